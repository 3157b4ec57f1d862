"""MAPPO with TorchRL: robots share an actor that sees what one robot sees, and a critic that sees the whole swarm.

    pip install . "torchrl==0.14.1" "torch==2.13.0"  # in a checkout
    python scripts/torchrl_mappo.py --plan docs/benchmark/plans/ippo.toml --out results/mappo
    swarm-forage run crw,results/mappo/policy.npz

It carries out a plan of `swarm-forage train`: its worlds, its stages, its options of PPO. Our vector environment
collects, TorchRL's modules and losses learn. The critic gets a robot's own row, and the mean and the largest of each
column over all robots at work in its arena: as many numbers for eight robots as for five hundred. Runs need no critic.
The network that does best in the plan's evaluations is kept.
"""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import tensordict
import torch
import torchrl
from gymnasium.spaces import flatdim
from rivals import begin, check_plan, told
from tensordict import TensorDict
from tensordict.nn import InteractionType, TensorDictModule
from torch import nn
from torchrl.modules import MLP, ProbabilisticActor, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value.functional import generalized_advantage_estimate

from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.policies.interface import LearnerInterface
from swarm_forage_env.policies.network import Network, NetworkAbout
from swarm_forage_env.training.evaluator import Evaluator
from swarm_forage_env.training.plan import TrainingPlan
from swarm_forage_env.views.gymnasium import SwarmVectorEnv

OPTIONS = {"n_steps": 128, "batch_size": 4096, "n_epochs": 4, "learning_rate": 1e-3, "gamma": 0.99, "gae_lambda": 0.97,
           "ent_coef": 0.01, "clip_range": 0.2, "vf_coef": 0.5, "max_grad_norm": 0.5}  # fmt: skip
"""Options that the script understands, and what they are where a plan leaves them out."""
LIBRARIES = {"torch": str(torch.__version__), "torchrl": torchrl.__version__, "tensordict": tensordict.__version__}


def perceptron(n_inputs: int, n_outputs: int, hidden: tuple[int, ...], last_gain: float) -> MLP:
    """Return a perceptron with orthogonal first weights; the last layer's are as large as `last_gain` says."""
    body = MLP(in_features=n_inputs, out_features=n_outputs, num_cells=list(hidden), activation_class=nn.Tanh)
    layers = [layer for layer in body if isinstance(layer, nn.Linear)]
    for layer in layers:
        nn.init.orthogonal_(layer.weight, last_gain if layer is layers[-1] else 2**0.5)
        nn.init.zeros_(layer.bias)
    return body


class Learner:
    """Actor, critic and the loss of both."""

    def __init__(self, n_columns: int, n_actions: int, hidden: tuple[int, ...]) -> None:
        self.body = perceptron(n_columns, n_actions, hidden, last_gain=0.01)  # begins with all actions alike
        self.actor = ProbabilisticActor(
            TensorDictModule(self.body, ["observation"], ["logits"]),
            in_keys=["logits"],
            distribution_class=torch.distributions.Categorical,
            default_interaction_type=InteractionType.RANDOM,  # outside of TorchRL's collectors the default is the mode
            return_log_prob=True,
        )
        central = perceptron(3 * n_columns, 1, hidden, last_gain=1.0)
        self.critic = ValueOperator(central, in_keys=["observation", "swarm"])
        self.loss = ClipPPOLoss(  # the options have weights of their own
            self.actor,
            self.critic,
            critic_coeff=1.0,
            entropy_coeff=1.0,
            normalize_advantage=True,
            loss_critic_type="l2",
        )
        self.optimizer = torch.optim.Adam(self.loss.parameters(), eps=1e-5)

    def value(self, obs: torch.Tensor, swarm: torch.Tensor) -> torch.Tensor:
        """Return values (R, 1)."""
        return self.critic(TensorDict({"observation": obs, "swarm": swarm}, [len(obs)]))["state_value"]

    def update(self, batch: TensorDict, options: dict) -> None:
        """Learn from the steps of a rollout, (n,)."""
        for group in self.optimizer.param_groups:
            group["lr"] = options["learning_rate"]
        for _ in range(options["n_epochs"]):
            for chosen in torch.randperm(len(batch)).split(options["batch_size"]):
                parts = self.loss(batch[chosen])
                loss = parts["loss_objective"] + options["vf_coef"] * parts["loss_critic"]
                loss = loss + options["ent_coef"] * parts["loss_entropy"]
                self.optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(self.loss.parameters(), options["max_grad_norm"])
                self.optimizer.step()


def swarm_state(rows: torch.Tensor, at_work: torch.Tensor) -> torch.Tensor:
    """Return what a swarm looks like as a whole: per column the mean and the largest over its robots at work.

    Args:
        rows: (..., N, d), what its robots see.
        at_work: (..., N) bool.

    Returns:
        (..., 2 d), zeros where nobody is at work.
    """
    at_work = at_work[..., None]
    n_at_work = at_work.sum(-2)
    mean = (rows * at_work).sum(-2) / n_at_work.clamp(min=1)
    largest = torch.where(at_work, rows, -1.0).amax(-2) * (n_at_work > 0)
    return torch.cat([mean, largest], -1)


def swarm_rows(obs: torch.Tensor, active: torch.Tensor, n_arenas: int) -> torch.Tensor:
    """Return what the critic sees of the swarm, `swarm_state`, in every row of its arena.

    Args:
        obs: (R, d), arena by arena.
        active: (R,) bool, robots at work.
        n_arenas: Arenas, R / n_arenas rows each.

    Returns:
        (R, 2 d), the same for all rows of an arena.
    """
    rows = obs.view(n_arenas, -1, obs.shape[1])
    return swarm_state(rows, active.view(n_arenas, -1)).repeat_interleave(rows.shape[1], 0)


@torch.no_grad()
def rollout(envs: SwarmVectorEnv, learner: Learner, obs: np.ndarray, active: np.ndarray, options: dict):
    """Collect n_steps decisions of every robot; returns those of robots at work, last observation, active robots."""
    steps: list[TensorDict] = []
    for _ in range(options["n_steps"]):
        seen, at_work = torch.from_numpy(obs), torch.from_numpy(active)
        step = TensorDict({"observation": seen, "swarm": swarm_rows(seen, at_work, envs.n_arenas)}, [len(seen)])
        step = learner.critic(learner.actor(step))
        obs, reward, terminated, truncated, infos = envs.step(step["action"].numpy())
        step["at_work"], step["reward"] = at_work, torch.from_numpy(reward)[:, None]
        step["terminated"] = torch.from_numpy(terminated)[:, None]
        step["done"] = torch.from_numpy(terminated | truncated)[:, None]
        step["next_value"] = torch.zeros(len(seen), 1)
        if steps:
            steps[-1]["next_value"] += step["state_value"] * ~steps[-1]["done"]
        if truncated.any():  # ended by time, not by death: the value of what would have followed, in the same swarm
            last = obs.copy()
            last[truncated] = np.stack(infos["final_obs"][truncated])
            seen = torch.from_numpy(last)
            value = learner.value(seen, swarm_rows(seen, at_work, envs.n_arenas))
            step["next_value"] += value * torch.from_numpy(truncated)[:, None]
        steps.append(step)
        active = infos["active"]
    seen, at_work = torch.from_numpy(obs), torch.from_numpy(active)
    after = learner.value(seen, swarm_rows(seen, at_work, envs.n_arenas))
    steps[-1]["next_value"] += after * ~steps[-1]["done"]
    batch: Any = TensorDict.stack(steps)
    batch["advantage"], batch["value_target"] = generalized_advantage_estimate(
        options["gamma"],
        options["gae_lambda"],
        batch["state_value"],
        batch["next_value"],
        batch["reward"],
        batch["done"],
        batch["terminated"],
        time_dim=0,
    )
    taught = batch[batch["at_work"]].select(
        "observation", "swarm", "action", "action_log_prob", "advantage", "value_target"
    )
    return taught, obs, active


def carry_out(plan: TrainingPlan, folder: Path) -> None:
    """Collect, learn and evaluate, stage by stage; the best network is kept, and draws its actions."""
    plan = dataclasses.replace(plan, samples=True)
    check_plan(plan, "ppo", OPTIONS)
    options_of_stages = [{**OPTIONS, **plan.options, **stage.options} for stage in plan.stages]
    robot = LearnerInterface(plan.interface, SwarmSpec.of(plan.scenario))
    learner = Learner(flatdim(robot.observation_space), flatdim(robot.action_space), plan.hidden)
    evaluator = Evaluator(plan, folder, {"by": "scripts/torchrl_mappo.py", "versions": LIBRARIES})
    about = NetworkAbout(interface=plan.interface, samples=True, caches=plan.scenario.caches)
    done, end = 0, 0
    for stage, options in zip(plan.stages, options_of_stages, strict=True):
        envs = SwarmVectorEnv(**plan.arenas_of(stage))
        end += stage.steps
        first_seed = int(np.random.default_rng((plan.seed, done)).integers(2**31))  # another one in each stage
        obs, infos = envs.reset(seed=first_seed, options={"scenario": dict(stage.scenario)})
        active = infos["active"]
        while done < end:
            batch, obs, active = rollout(envs, learner, obs, active, options)
            learner.update(batch, options)
            done += options["n_steps"] * envs.num_envs
            if evaluator.is_due(done):
                network = Network.from_state_dict(learner.body.state_dict(), about)
                print(told(evaluator.evaluate(network, done)), flush=True)
        envs.close()


if __name__ == "__main__":
    begin(__doc__, "results/mappo", carry_out)
