"""QMIX with TorchRL: robots share a network that says what actions are worth, and a mixer makes one worth of them all.

    pip install . "torchrl==0.14.1" "torch==2.13.0"  # in a checkout
    python scripts/torchrl_qmix.py --plan docs/benchmark/plans/qmix.toml --out results/qmix
    swarm-forage run crw,results/qmix/policy.npz

It carries out a plan of `swarm-forage train`: its worlds, its stages, its evaluations, and options of its own. Our
vector environment collects; TorchRL's networks, memory and loss learn. The swarm is paid together, the sum of what its
robots earn, and the mixer learns whose actions were worth it. It has weights for each robot, so all worlds have the
same number of robots. It sees the swarm as the critic of `torchrl_mappo.py` does. Runs need no mixer: what is worth
most to a robot is worth most to the swarm. The network that does best in the evaluations is kept.
"""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium.spaces import flatdim
from rivals import begin, check_plan, told
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from torch import nn
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.data.postprocs import MultiStep
from torchrl.modules import QValueModule, SafeSequential
from torchrl.modules.models.multiagent import QMixer
from torchrl.objectives import HardUpdate, ValueEstimators
from torchrl.objectives.multiagent import QMixerLoss
from torchrl_mappo import LIBRARIES, perceptron, swarm_state

from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.contract.types import ObsArray
from swarm_forage_env.policies.interface import LearnerInterface
from swarm_forage_env.policies.network import Network, NetworkAbout
from swarm_forage_env.training.evaluator import Evaluator
from swarm_forage_env.training.plan import TrainingPlan
from swarm_forage_env.views.gymnasium import SwarmVectorEnv

OPTIONS = {"buffer_size": 20_000, "batch_size": 64, "learning_rate": 5e-4, "gamma": 0.99, "n_steps": 1,
           "train_freq": 32, "gradient_steps": 8, "learning_starts": 1_000, "target_update_interval": 200,
           "exploration_fraction": 0.3, "exploration_final_eps": 0.05, "mixing_units": 32,
           "max_grad_norm": 10.0}  # fmt: skip
"""Options that the script understands, and what they are where a plan leaves them out. Names are those of DQN in
stable-baselines3, but memory, batch and `learning_starts` count decisions of swarms, `train_freq` those of all rows and
`target_update_interval` steps of the gradient; `mixing_units` is the mixer's."""
SEEN = ("agents", "observation")


class SwarmMixer(nn.Module):
    """TorchRL's mixer, with what the swarm looks like as the state that its weights come from."""

    def __init__(self, n_columns: int, n_robots: int, n_units: int) -> None:
        super().__init__()
        self.mixer = QMixer((2 * n_columns,), n_units, n_robots, "cpu")

    def forward(self, values: torch.Tensor, seen: torch.Tensor) -> torch.Tensor:
        """Return the worth to the swarm (..., 1) of values (..., N, 1) of robots that see (..., N, d)."""
        return self.mixer(values, swarm_state(seen, torch.ones(seen.shape[:-1], dtype=torch.bool)))


class Learner:
    """The network of values, its mixer, the loss of both, and the memory."""

    def __init__(self, n_columns: int, n_actions: int, n_robots: int, hidden: tuple[int, ...], options: dict) -> None:
        self.body = perceptron(n_columns, n_actions, hidden, last_gain=0.01)  # begins with all actions alike
        names = [("agents", name) for name in ("action", "action_value", "chosen_action_value")]
        values = SafeSequential(
            TensorDictModule(self.body, [SEEN], names[1:2]),
            QValueModule("categorical", action_value_key=names[1], out_keys=names),
        )
        mixer = SwarmMixer(n_columns, n_robots, options["mixing_units"])
        mixed = TensorDictModule(mixer, [names[2], SEEN], ["chosen_action_value"])
        self.loss = QMixerLoss(values, mixed, action_space="categorical")
        self.targets = HardUpdate(self.loss, value_network_update_interval=options["target_update_interval"])
        self.optimizer = torch.optim.Adam(self.loss.parameters(), eps=1e-5)
        self.memory = TensorDictReplayBuffer(storage=LazyTensorStorage(options["buffer_size"]))

    def choose(self, obs: ObsArray, explores: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return actions (R,): those that are worth most, or any where a robot `explores` (R,)."""
        values = self.body(torch.from_numpy(obs))
        return np.where(explores, rng.integers(values.shape[1], size=len(obs)), values.argmax(1).numpy())

    def update(self, options: dict) -> None:
        """Learn from decisions of the swarm that are drawn from memory."""
        self.loss.make_value_estimator(ValueEstimators.TD0, gamma=options["gamma"])
        for group in self.optimizer.param_groups:
            group["lr"] = options["learning_rate"]
        for _ in range(options["gradient_steps"]):
            loss = self.loss(self.memory.sample(options["batch_size"]))["loss"]
            self.optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(self.loss.parameters(), options["max_grad_norm"])
            self.optimizer.step()
            self.targets.step()


@torch.no_grad()
def rollout(
    envs: SwarmVectorEnv, learner: Learner, obs: ObsArray, options: dict, share: float, rng: np.random.Generator
) -> tuple[TensorDict, ObsArray]:
    """Collect `train_freq` decisions of every robot, of which `share` explore.

    Returns:
        Decisions of swarms, (A, T), each with what `n_steps` of them earned and led to; and what robots see at the end.
    """
    shape = envs.n_arenas, envs.n_robots
    steps: list[TensorDict] = []
    for _ in range(options["train_freq"]):
        actions = learner.choose(obs, rng.random(len(obs)) < share, rng)
        before, (obs, reward, _, truncated, infos) = obs, envs.step(actions)
        if not infos["active"].all():
            raise SystemExit("Expected worlds with fixed numbers of robots, got robots that come or go.")
        after = obs
        if truncated.any():  # ended by time: what would have followed is worth something
            after = obs.copy()
            after[truncated] = np.stack(infos["final_obs"][truncated])
        done = torch.from_numpy(truncated).view(shape)[:, :1]
        following = {
            "agents": {"observation": torch.from_numpy(after).view(*shape, -1)},
            "reward": torch.from_numpy(reward).view(shape).sum(1, keepdim=True),
            "done": done,
            "terminated": torch.zeros_like(done),
        }
        robots = {"observation": torch.from_numpy(before).view(*shape, -1), "action": torch.from_numpy(actions)}
        robots["action"] = robots["action"].view(shape)
        steps.append(TensorDict({"agents": robots, "next": following}, [envs.n_arenas]))
    batch: Any = MultiStep(options["gamma"], options["n_steps"])(TensorDict.stack(steps, 1))
    kept = (("next", name) for name in ("agents", "reward", "done", "terminated"))
    return batch.select("agents", "steps_to_next_obs", *kept), obs


class Training:
    """A training by a plan."""

    def __init__(self, plan: TrainingPlan, folder: Path) -> None:
        """Begin with values of zero, about, and an empty memory."""
        check_plan(plan, "dqn", OPTIONS)
        self._options = [{**OPTIONS, **plan.options, **stage.options} for stage in plan.stages]
        robot = LearnerInterface(plan.interface, SwarmSpec.of(plan.scenario))
        sizes = flatdim(robot.observation_space), flatdim(robot.action_space), plan.scenario.robots.n_robots
        self.plan, self.done = plan, 0
        self.learner = Learner(*sizes, plan.hidden, self._options[0])
        self._rng = np.random.default_rng(plan.seed)
        self._evaluator = Evaluator(plan, folder, {"by": "scripts/torchrl_qmix.py", "versions": LIBRARIES})

    def carry_out(self) -> None:
        """Collect, learn and evaluate, stage by stage."""
        end = 0
        for stage, options in zip(self.plan.stages, self._options, strict=True):
            envs = SwarmVectorEnv(**self.plan.arenas_of(stage))
            end += stage.steps
            first_seed = int(np.random.default_rng((self.plan.seed, self.done)).integers(2**31))
            obs, _ = envs.reset(seed=first_seed, options={"scenario": dict(stage.scenario)})
            while self.done < end:
                batch, obs = rollout(envs, self.learner, obs, options, self._exploring(options), self._rng)
                self.learner.memory.extend(batch.reshape(-1))
                if len(self.learner.memory) >= options["learning_starts"]:
                    self.learner.update(options)
                self.done += options["train_freq"] * envs.num_envs
                if self._evaluator.is_due(self.done):
                    print(told(self._evaluator.evaluate(self._network(), self.done)), flush=True)
            envs.close()

    def _exploring(self, options: dict) -> float:
        """Return the share of robots that explore: less and less, then as many as the options leave."""
        n_decisions = options["exploration_fraction"] * self.plan.total_steps
        return max(options["exploration_final_eps"], 1.0 - self.done / n_decisions)

    def _network(self) -> Network:
        about = NetworkAbout(interface=self.plan.interface, samples=self.plan.samples, caches=self.plan.scenario.caches)
        return Network.from_state_dict(self.learner.body.state_dict(), about)


if __name__ == "__main__":
    begin(__doc__, "results/qmix", lambda plan, folder: Training(plan, folder).carry_out())
