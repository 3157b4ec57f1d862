"""Evolve the weights of a small network in the worlds of a training plan, by separable CMA-ES.

    pip install ".[evolve,plots]"  # in a checkout
    python scripts/evolve_network.py --plan docs/benchmark/plans/ippo.toml --seeds 5 --out results/evolved_network
    swarm-forage run crw,results/evolved_network/seed_0/policy.npz

Of a plan of `swarm-forage train` it takes the worlds, rewards, stages and evaluations, and how robots see and act. All
networks of a generation are in the same arenas at once: each robot runs one of them for `--n-steps` decisions, and the
next generation deals the robots anew, wherever they are. So 50 robots try 50 networks in the time of one run. A network
is worth what its robots earn, in each world in standard deviations from the mean of all networks. An evaluation runs
the network in the middle of its generation; the best one is kept. A training ends before it has more decisions than
the plan.
"""

import argparse
import importlib
import itertools
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.contract.types import FloatArray, IntArray, ObsArray
from swarm_forage_env.policies.interface import LearnerInterface
from swarm_forage_env.policies.network import Network, NetworkAbout
from swarm_forage_env.training.curves import beside_baseline, read_trainings
from swarm_forage_env.training.evaluations import Baselines, check_unused
from swarm_forage_env.training.evaluator import Evaluator
from swarm_forage_env.training.plan import Stage, TrainingPlan, read_plan
from swarm_forage_env.training.seeds import seed_folder
from swarm_forage_env.views.gymnasium import SwarmVectorEnv
from swarm_forage_env.views.sampler import ScenarioSampler

WIDTH = 0.5
"""Standard deviation of the weights of the first generation, around 0."""


def layers_of(points: np.ndarray, sizes: Sequence[int]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return weights (K, in, out) and biases (K, out) of each layer of K networks, from their numbers (K, n).

    `sizes` are those of the layers, inputs first.
    """
    layers, at = [], 0
    for before, after in itertools.pairwise(sizes):
        middle, end = at + before * after, at + (before + 1) * after
        layers.append((points[:, at:middle].reshape(-1, before, after), points[:, middle:end]))
        at = end
    return layers


def n_numbers(sizes: Sequence[int]) -> int:
    """Return how many weights and biases a network has."""
    return sum((before + 1) * after for before, after in itertools.pairwise(sizes))


def outputs(rows: ObsArray, layers: Sequence[tuple[np.ndarray, np.ndarray]]) -> ObsArray:
    """Return values of the last layer (R, m) for observations (R, d), each row by the network of its own."""
    for k, (weight, bias) in enumerate(layers):
        rows = np.einsum("ri,rij->rj", np.tanh(rows) if k else rows, weight) + bias
    return rows


class World:
    """The arenas of one kind of world, so that no row is to spare. Robots go on where the last generation left them."""

    def __init__(self, env: SwarmVectorEnv, obs: ObsArray) -> None:
        """Take the arenas and what their robots see first."""
        self.env, self._obs = env, obs

    def earned(self, points: np.ndarray, sizes: Sequence[int], n_steps: int, rng: np.random.Generator) -> FloatArray:
        """Return what a robot of each of K networks (K, n) earns in `n_steps` decisions, (K,); NaN without a robot."""
        n_robots, n_networks = len(self._obs), len(points)
        which: IntArray = rng.permutation(rng.permutation(n_networks)[np.arange(n_robots) % n_networks])
        layers = layers_of(points[which].astype(np.float32), sizes)
        total = np.zeros(n_robots)
        for _ in range(n_steps):
            values = outputs(self._obs, layers)
            drawn = np.argmax(values + rng.gumbel(size=values.shape), axis=1)  # by the probabilities of the softmax
            self._obs, rewards, _, _, _ = self.env.step(drawn)
            total += rewards
        robots = np.bincount(which, minlength=n_networks)
        of_each = np.bincount(which, total, minlength=n_networks)
        return np.where(robots > 0, of_each / np.maximum(robots, 1), np.nan)


def worlds_of(plan: TrainingPlan, stage: Stage, seed: int) -> list[World]:
    """Return the worlds of a stage, with as many of the plan's arenas as their weights say, at least one each."""
    arenas = plan.arenas_of(stage)
    sampler = arenas["sampler"]
    weights = [world.get("weight", 1.0) for world in sampler.table["worlds"]]
    worlds = []
    for k, (world, weight) in enumerate(zip(sampler.table["worlds"], weights, strict=True)):
        alone = ScenarioSampler({**sampler.table, "worlds": [world]})
        kind = {"sampler": alone, "n_arenas": max(1, round(plan.n_arenas * weight / sum(weights)))}
        env = SwarmVectorEnv(**{**arenas, **kind})
        obs, infos = env.reset(seed=seed + 1000 * k, options={"scenario": dict(stage.scenario)})
        if not infos["active"].all():
            raise SystemExit("Expected worlds with fixed numbers of robots, got spare rows: take another plan.")
        worlds.append(World(env, obs))
    return worlds


def worth(earned: FloatArray) -> FloatArray:
    """Return what networks are worth, (K,), by what they earned, (worlds, K), NaN where a network had no robot."""
    spread = np.nanstd(earned, axis=1, keepdims=True)
    apart = (earned - np.nanmean(earned, axis=1, keepdims=True)) / np.where(spread > 0.0, spread, 1.0)
    return np.nan_to_num(apart).mean(axis=0)


class Training:
    """A training by a plan: its search, and its evaluations."""

    def __init__(self, plan: TrainingPlan, words: argparse.Namespace, baselines: Baselines | None) -> None:
        """Begin with networks around zero."""
        import cma

        robot = LearnerInterface(plan.interface, SwarmSpec.of(plan.scenario))
        self.sizes = (robot.layout.size, *plan.hidden, int(robot.action_space.n))  # type: ignore[attr-defined] - discrete
        options = {"popsize": words.population, "seed": plan.seed + 1, "CMA_diagonal": True, "verbose": -9}
        self.strategy = cma.CMAEvolutionStrategy(np.zeros(n_numbers(self.sizes)), WIDTH, options)
        self.plan, self.done = plan, 0
        self._words = words
        folder = seed_folder(words.out, plan.seed)
        self.evaluator = Evaluator(plan, folder, made_by(words), baselines=baselines)
        self._rng = np.random.default_rng(plan.seed)

    def carry_out(self) -> None:
        """Evolve stage by stage, and evaluate meanwhile."""
        end = 0
        for stage in self.plan.stages:
            end += stage.steps
            worlds = worlds_of(self.plan, stage, int(np.random.default_rng((self.plan.seed, end)).integers(2**31)))
            n_decisions = sum(world.env.num_envs for world in worlds) * self._words.n_steps
            while self.done + n_decisions <= end:
                self._generation(worlds)
                self.done += n_decisions
                if self.evaluator.is_due(self.done):
                    self._evaluate()
            for world in worlds:
                world.env.close()
        if not self.evaluator.evaluations or self.evaluator.evaluations[-1].steps < self.done:
            self._evaluate()

    def _generation(self, worlds: Sequence[World]) -> None:
        points = self.strategy.ask()
        asked = np.array(points)
        earned = np.array([world.earned(asked, self.sizes, self._words.n_steps, self._rng) for world in worlds])
        self.strategy.tell(points, (-worth(earned)).tolist())

    def _evaluate(self) -> None:
        """Run the network in the middle of the generation."""
        layers = layers_of(np.array([self.strategy.result.xfavorite], np.float32), self.sizes)
        about = NetworkAbout(
            interface=self.plan.interface, activation="tanh", samples=True, caches=self.plan.scenario.caches
        )
        network = Network(tuple(weight[0] for weight, _ in layers), tuple(bias[0] for _, bias in layers), about)
        evaluation = self.evaluator.evaluate(network, self.done)
        reached = f"{evaluation.performance:.2f} of the baselines, interference {evaluation.interference_fraction:.3f}"
        print(f"seed {self.plan.seed}: {self.done:,} decisions, {reached}", file=sys.stderr, flush=True)


def made_by(words: argparse.Namespace) -> dict[str, Any]:
    """Return what a card says beside plan and evaluation."""
    import cma

    said = {"population": words.population, "n_steps": words.n_steps}
    return {"by": "scripts/evolve_network.py", "evolution": said, "versions": {"cma": cma.__version__}}


def evolving_plan(words: argparse.Namespace) -> TrainingPlan:
    """Return the plan with a network of ours; raises ConfigError for one that evolution cannot carry out."""
    plan = read_plan(words.plan)
    if plan.interface.actions != "discrete" or not all(stage.sampler or plan.sampler for stage in plan.stages):
        raise ConfigError(
            f"Expected a plan with samplers and discrete actions in {words.plan}, such as "
            f"docs/benchmark/plans/ippo.toml, got {plan.interface.actions} actions or a stage without a sampler."
        )
    stages = tuple(replace(stage, options={}) for stage in plan.stages)  # they are those of gradients
    return replace(plan, hidden=(words.hidden,), activation="tanh", options={}, stages=stages, samples=True)


def main() -> None:
    """Carry out a training per seed, and draw how they went."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plan", type=Path, required=True, help="plan of a training, as TOML")
    parser.add_argument("--out", type=Path, required=True, help="folder of the trainings")
    parser.add_argument("--seed", type=int, default=0, help="of the first training (default: 0)")
    parser.add_argument("--seeds", type=int, default=1, help="trainings (default: 1)")
    parser.add_argument("--hidden", type=int, default=8, help="units of the hidden layer (default: 8)")
    parser.add_argument("--population", type=int, default=48, help="networks at once (default: 48)")
    parser.add_argument("--n-steps", type=int, default=128, help="decisions of a robot (default: 128)")
    words = parser.parse_args()
    try:
        for module in ("cma", "matplotlib"):  # one is needed at the end
            importlib.import_module(module)
    except ImportError as error:
        parser.error(f'{error}; pip install ".[evolve,plots]"')
    seeds = range(words.seed, words.seed + words.seeds)
    folders, baselines = [seed_folder(words.out, seed) for seed in seeds], None
    try:
        plan = evolving_plan(words)
        for folder in folders:  # before the first training
            check_unused(folder, "choose another folder (--out), or other seeds (--seed)")
        for seed in seeds:
            training = Training(replace(plan, seed=seed), words, baselines)
            training.carry_out()
            baselines = training.evaluator.baselines
    except (ConfigError, OSError) as error:
        parser.error(str(error))
    trainings = read_trainings(folders)
    curves = beside_baseline(*trainings, averaged=[one.label for one in trainings])
    curves.draw(words.out / "curves.png")


if __name__ == "__main__":
    main()
