#!/usr/bin/env python
"""PPO in one file, in the manner of CleanRL: plain torch on `gymnasium.make_vec`.

    pip install . "torch==2.13.0"  # in a checkout
    python scripts/cleanrl_ppo.py --out results/cleanrl_ppo
    swarm-forage run crw,results/cleanrl_ppo/policy.npz
    swarm-forage train curves results/cleanrl_ppo

It differs from the textbook in two places, because sub-environments are robots. Arenas start anew within the step that
ends them, so the value of the last observation is added where an episode was truncated. And steps of robots that are
not at work (`infos["active"]`) are in no minibatch. The network that does best in evaluations of 2,000 s is kept.
"""

import argparse
import logging
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.spaces import flatdim
from torch import nn

import swarm_forage_env  # registers the environments
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.network import Network, NetworkAbout
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.training.evaluation_plan import EvaluationPlan
from swarm_forage_env.training.evaluator import Evaluator
from swarm_forage_env.training.plan import Stage, TrainingPlan
from swarm_forage_env.wrappers.world import World

INTERFACE = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5)
NARROW = {"width_m": 12.0, "nest_centre_m": (1.2, 8.0), "nest_size_m": (1.2, 12.8)}
"""A first stage in which the way home is a third as long."""
EPISODE: dict[str, Any] = {"horizon_s": 600.0, "first_pickup": 1.0, "nest_progress": 0.05}
"""What an episode is like, besides its robots."""


class Agent(nn.Module):
    """Actor and critic, two small networks."""

    def __init__(self, n_columns: int, n_actions: int) -> None:
        super().__init__()
        self.actor, self.critic = self._network(n_columns, n_actions), self._network(n_columns, 1)

    @staticmethod
    def _network(n_inputs: int, n_outputs: int) -> nn.Sequential:
        return nn.Sequential(nn.Linear(n_inputs, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, n_outputs))

    def value(self, obs: torch.Tensor) -> torch.Tensor:
        """Return values (n,)."""
        return self.critic(obs).squeeze(-1)

    def choices(self, obs: torch.Tensor) -> torch.distributions.Categorical:
        """Return the distribution of actions."""
        return torch.distributions.Categorical(logits=self.actor(obs))

    def network(self) -> Network:
        """Return the actor as a network that runs without torch, and draws its actions as in training."""
        return Network.from_state_dict(self.actor.state_dict(), NetworkAbout(interface=INTERFACE, samples=True))


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n-arenas", type=int, default=8)
    parser.add_argument("--n-robots", type=int, default=50)
    parser.add_argument("--total-timesteps", type=int, default=6_000_000, help="at least; halves end with a rollout")
    parser.add_argument("--num-steps", type=int, default=128)
    parser.add_argument("--learning-rate", type=float, default=1e-3)
    parser.add_argument("--gamma", type=float, default=0.99)
    parser.add_argument("--gae-lambda", type=float, default=0.98)
    parser.add_argument("--update-epochs", type=int, default=4)
    parser.add_argument("--minibatch-size", type=int, default=3200)
    parser.add_argument("--clip-coef", type=float, default=0.2)
    parser.add_argument("--ent-coef", type=float, default=0.003)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--out", type=Path, default=Path("results/cleanrl_ppo"), help="folder of network and evaluations"
    )
    return parser.parse_args()


def update(
    agent: Agent, optimizer: torch.optim.Optimizer, batch: dict[str, torch.Tensor], args: argparse.Namespace
) -> None:
    """One PPO update over the steps of a rollout, (n,) each."""
    for _ in range(args.update_epochs):
        for chosen in torch.randperm(len(batch["obs"])).split(args.minibatch_size):
            part = {name: values[chosen] for name, values in batch.items()}
            choices = agent.choices(part["obs"])
            ratio = (choices.log_prob(part["actions"]) - part["log_probs"]).exp()
            advantages = (part["advantages"] - part["advantages"].mean()) / (part["advantages"].std() + 1e-8)
            clipped = ratio.clamp(1 - args.clip_coef, 1 + args.clip_coef)
            policy_loss = -torch.min(advantages * ratio, advantages * clipped).mean()
            value_loss = 0.5 * (agent.value(part["obs"]) - part["returns"]).square().mean()
            loss = policy_loss + value_loss - args.ent_coef * choices.entropy().mean()
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
            optimizer.step()


@torch.no_grad()
def rollout(envs, agent: Agent, obs: np.ndarray, active: np.ndarray, args: argparse.Namespace):
    """Collect num_steps steps of every robot; returns steps at work, last observation, active robots, mean reward."""
    shape = (args.num_steps, envs.num_envs)
    seen = torch.zeros((*shape, obs.shape[1]))
    actions, log_probs, values, rewards, dones = (torch.zeros(shape) for _ in range(5))
    at_work, earned = torch.zeros(shape, dtype=torch.bool), 0.0
    for step in range(args.num_steps):
        seen[step], at_work[step] = torch.from_numpy(obs), torch.from_numpy(active)
        choices = agent.choices(seen[step])
        action = choices.sample()
        actions[step], log_probs[step], values[step] = action, choices.log_prob(action), agent.value(seen[step])
        obs, reward, terminated, truncated, infos = envs.step(action.numpy())
        active = infos["active"]
        earned += reward.mean() / args.num_steps
        if truncated.any():  # ended by time, not by death: add the value of what would have followed
            last = torch.from_numpy(np.stack(infos["final_obs"][truncated]))
            reward[truncated] += args.gamma * agent.value(last).numpy()
        rewards[step], dones[step] = torch.from_numpy(reward), torch.from_numpy(terminated | truncated)
    advantages = torch.zeros(shape)
    next_value, last = agent.value(torch.from_numpy(obs)), torch.zeros(envs.num_envs)
    for step in reversed(range(args.num_steps)):
        target = rewards[step] + args.gamma * next_value * (1 - dones[step])
        # The value of a robot not at work follows from its next step: no network, and no lambda in the decay.
        values[step] = torch.where(at_work[step], values[step], target)
        decay = args.gamma * torch.where(at_work[step], args.gae_lambda, 1.0)
        last = target - values[step] + decay * (1 - dones[step]) * last
        advantages[step], next_value = last, values[step]
    batch = {
        "obs": seen,
        "actions": actions,
        "log_probs": log_probs,
        "advantages": advantages,
        "returns": advantages + values,
    }
    return {name: values[at_work] for name, values in batch.items()}, obs, active, earned


def plan_of(args: argparse.Namespace) -> TrainingPlan:
    """Return what is trained in: half in the narrow arena, half in the real one, where networks are judged."""
    per_rollout = max(1, args.num_steps * args.n_arenas * args.n_robots)
    half = per_rollout * -(-args.total_timesteps // (2 * per_rollout))
    return TrainingPlan(
        world=World(scenario("warehouse_small", n_robots=args.n_robots, **EPISODE)),
        interface=INTERFACE,
        samples=True,
        n_arenas=args.n_arenas,
        stages=(Stage(steps=half, scenario=NARROW), Stage(steps=half)),
        evaluation=EvaluationPlan(every_steps=max(1, half // 5), horizon_s=2000.0, baseline="dpo"),
        seed=args.seed,
    )


def main() -> None:
    """Train; print what a robot earns per decision, and what evaluations deliver."""
    args = parse()
    torch.manual_seed(args.seed)
    torch.set_num_threads(1)
    logging.basicConfig(level=logging.INFO)  # says when something is compiled for the first time
    options = {name: value for name, value in vars(args).items() if name != "out"}
    try:
        plan = plan_of(args)
        evaluator = Evaluator(plan, args.out, {"by": "scripts/cleanrl_ppo.py", "options": options})
    except swarm_forage_env.ConfigError as error:
        raise SystemExit(str(error)) from error
    arenas = {"n_arenas": args.n_arenas, "n_robots": args.n_robots, "interface": INTERFACE, **EPISODE}
    envs = gymnasium.make_vec("swarm_forage/warehouse_small-v0", **arenas)
    agent = Agent(flatdim(envs.single_observation_space), flatdim(envs.single_action_space))
    optimizer = torch.optim.Adam(agent.parameters(), lr=args.learning_rate, eps=1e-5)
    steps, until, spent_s = 0, 0, 0.0
    for stage in plan.stages:
        until += stage.steps
        obs, infos = envs.reset(seed=args.seed, options={"scenario": stage.scenario})
        active = infos["active"]
        while steps < until:
            started = time.perf_counter()
            batch, obs, active, reward = rollout(envs, agent, obs, active, args)
            update(agent, optimizer, batch, args)
            steps, spent_s = steps + args.num_steps * envs.num_envs, spent_s + time.perf_counter() - started
            print(f"{steps:>10,} decisions, {steps / spent_s:,.0f} per s, reward {reward:.4f}")
            if evaluator.is_due(steps):
                delivered = evaluator.evaluate(agent.network(), steps).performance
                print(f"{steps:>10,} decisions, {delivered:.2f} objects per 1,000 s in its evaluation")
    envs.close()


if __name__ == "__main__":
    main()
