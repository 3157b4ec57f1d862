"""Evolution in one file: each robot tries a network of its own, and the swarm keeps what pays; no torch, no gradients.

    python docs/examples/evolve_network.py docs/benchmark/plans/ippo.toml 3 results/seed_3 interface.frame_decisions=200

evolves one network by a plan and seed 3: in its worlds, stages and interface, with ten times its decisions; a value of
it may be another one. The folder gets evaluations and the best network. In a generation, the two robots of each pair
change the network by the same noise, one to either side. The network then moves towards the noise of robots that earned
more than the others of their arena. This is the evolution strategy of Salimans et al. (2017), with robots as the
population.
"""

import sys
from dataclasses import replace

import numpy as np

from swarm_forage_env.cli.worlds import parse_setting
from swarm_forage_env.policies.network import Network, NetworkAbout
from swarm_forage_env.training.evaluation import Evaluator
from swarm_forage_env.training.plan import read_plan
from swarm_forage_env.views.gymnasium import SwarmVectorEnv

TIMES = 10
"""Decisions, as a multiple of those of the plan: evolution takes a tenth of the time of PPO for each."""
HIDDEN = 8
GENERATION = 500
"""Decisions, enough for a way to the source and back."""
NOISE = 0.3
"""Standard deviation in each weight."""
RATE = 0.2
"""Of Adam, at the beginning; it falls to zero."""


def layers_of(genes, n_columns, n_actions):
    """Cut genes (..., G) into weights and biases of two layers."""
    sizes = [(n_columns, HIDDEN), (HIDDEN,), (HIDDEN, n_actions), (n_actions,)]
    parts = np.split(genes, np.cumsum([np.prod(size) for size in sizes])[:-1], axis=-1)
    return [part.reshape(*genes.shape[:-1], *size) for part, size in zip(parts, sizes, strict=True)]


def network_of(genes, n_columns, n_actions):
    weight_1, bias_1, weight_2, bias_2 = (part.astype(np.float32) for part in layers_of(genes, n_columns, n_actions))
    about = NetworkAbout(interface=plan.interface, activation="tanh", samples=plan.samples)
    return Network((weight_1, weight_2), (bias_1, bias_2), about)


def earnings(envs, obs, infos, genes, rng):
    """Run a generation of robots with genes (rows, G); what follows it, what each robot earned, and for how long."""
    weight_1, bias_1, weight_2, bias_2 = layers_of(genes, *envs.interface.widths)
    earned, at_work = np.zeros((2, len(genes)))
    for _ in range(GENERATION):
        hidden = np.tanh(np.einsum("ri,rih->rh", obs, weight_1) + bias_1)
        logits = np.einsum("rh,rha->ra", hidden, weight_2) + bias_2
        at_work += infos["active"]
        obs, reward, _, _, infos = envs.step((logits + rng.gumbel(size=logits.shape)).argmax(axis=1))
        earned += reward
    return obs, infos, earned, at_work


def advantages(earned, is_there):
    """How much more robots earned than the others of their arena (arenas, robots), in standard deviations."""
    count = is_there.sum(axis=1, keepdims=True)
    above = np.where(is_there, earned - earned.sum(axis=1, keepdims=True) / count, 0.0)
    return above / (np.sqrt((above**2).sum(axis=1, keepdims=True) / count) + 1e-8)


def evolve(envs, genes, scenario, done, end, rates, rng):
    """Return the genes after a stage, which ends at so many decisions, and how many are done; the rate falls."""
    obs, infos = envs.reset(seed=int(rng.integers(2**31)), options={"scenario": scenario})
    n_rows, shape = envs.num_envs, (-1, envs.n_robots)
    if envs.n_robots % 2:
        sys.exit(f"Expected worlds whose largest swarm has an even number of robots, got {envs.n_robots}.")
    slope, square = np.zeros((2, len(genes)))
    n_generations = -((done - end) // (n_rows * GENERATION))
    for number, rate in enumerate(np.linspace(*rates, n_generations), 1):
        noise = rng.normal(size=(n_rows // 2, len(genes))).astype(np.float32)
        noise = np.stack([noise, -noise], axis=1).reshape(n_rows, -1)
        tried = (genes + NOISE * noise).astype(np.float32)
        obs, infos, earned, at_work = earnings(envs, obs, infos, tried, rng)
        better = advantages(earned.reshape(shape), at_work.reshape(shape) > 0).ravel() @ noise
        slope, square = 0.9 * slope + 0.1 * better, 0.99 * square + 0.01 * better**2
        genes = genes + rate * slope / (1 - 0.9**number) / (np.sqrt(square / (1 - 0.99**number)) + 1e-8)
        done += n_rows * GENERATION
        print(f"{done:,}: {earned.sum() / at_work.sum():.4f} reward per decision", flush=True)
        if evaluator.is_due(done):
            evaluator.evaluate(network_of(genes, *envs.interface.widths), done)
    return genes, done


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    plan_file, seed, folder, *settings = sys.argv[1:]
    plan = read_plan(plan_file).with_settings(dict(map(parse_setting, [*settings, f"seed={seed}"])))
    plan = replace(
        plan,
        stages=tuple(replace(stage, steps=TIMES * stage.steps) for stage in plan.stages),
        evaluation=replace(plan.evaluation, every_steps=TIMES * plan.evaluation.every_steps),
    )
    evaluator = Evaluator(plan, folder, {"by": "evolution in plain numpy"})
    rng = np.random.default_rng(plan.seed)
    stages = [(stage, end, SwarmVectorEnv(**plan.arenas_of(stage))) for stage, end in plan.parts()]
    n_columns, n_actions = stages[0][2].interface.widths
    first = rng.normal(size=(n_columns, HIDDEN)) / np.sqrt(n_columns)
    genes, done = np.concatenate([first.ravel(), np.zeros(HIDDEN + HIDDEN * n_actions + n_actions)]), 0
    for stage, end, envs in stages:
        rates = RATE * (1.0 - np.array([end - stage.steps, end]) / plan.total_steps)
        genes, done = evolve(envs, genes, dict(stage.scenario), done, end, rates, rng)
