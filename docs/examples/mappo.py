"""MAPPO in one file: PPO whose critic sees the state of the arena; plain torch on a vector environment.

    python docs/examples/mappo.py docs/benchmark/plans/ippo.toml 3 results/seed_3 interface.frame_decisions=200

trains by a plan and seed 3: in its worlds and stages, with its interface and options; a value of it may be another
one. Networks are always two layers of 64 with tanh. The folder gets evaluations and the best network. The critic values
a robot by the state of its arena and by what the robot sees. Arenas start anew within the step that ends them: where
one was truncated, the value of its last state is added. Steps of robots not at work are left out.
"""

import sys

import numpy as np
import torch
from torch import nn
from torch.distributions import Categorical

from swarm_forage_env.cli.worlds import parse_setting
from swarm_forage_env.contract.policy import state_size
from swarm_forage_env.policies.network import Network, NetworkAbout
from swarm_forage_env.training.evaluation import Evaluator
from swarm_forage_env.training.plan import read_plan
from swarm_forage_env.views.gymnasium import SwarmVectorEnv

WIDTH = 64
"""Of all hidden layers."""
OWN = state_size(1, 0)


class Critic(nn.Module):
    """Value of each robot by what it sees (rows, d), by the state (arenas, S) of its arena and its own part of that.

    A state begins with OWN numbers for each of its N robots; `place` (rows,) is N times the arena plus the robot. Its
    thousands of numbers are divided by the root of their number: else one step of Adam changes values too much.
    """

    def __init__(self, n_columns, n_state, n_robots):
        super().__init__()
        self.n_robots = n_robots
        self.of_robot, self.of_state = nn.Linear(n_columns + OWN, WIDTH), nn.Linear(n_state, WIDTH)
        self.onwards = nn.Sequential(nn.Tanh(), nn.Linear(WIDTH, WIDTH), nn.Tanh(), nn.Linear(WIDTH, 1))

    def forward(self, seen, states, place):
        own = states[:, : self.n_robots * OWN].reshape(-1, OWN)[place]
        of_arenas = self.of_state(states / states.shape[1] ** 0.5)[place // self.n_robots]
        return self.onwards(self.of_robot(torch.hstack([seen, own])) + of_arenas)[:, 0]


def advantages_of(rewards, values, following, dones, at_work, gamma, gae_lambda):
    """Return advantages and values (steps, rows); `following` (rows,) are the values after the last step.

    The value of a robot not at work follows from its next step: no network, and no lambda in the decay.
    """
    advantages, values, last = torch.zeros_like(values), values.clone(), torch.zeros_like(following)
    for step in reversed(range(len(rewards))):
        target = rewards[step] + gamma * following * (1 - dones[step])
        following = values[step] = torch.where(at_work[step], values[step], target)
        decay = gamma * torch.where(at_work[step], gae_lambda, 1.0)
        last = advantages[step] = target - following + decay * (1 - dones[step]) * last
    return advantages, values


def learn(
    envs,
    scenario,
    done,
    end,
    *,
    learning_rate=3e-4,
    n_steps=2048,
    batch_size=64,
    n_epochs=10,
    gamma=0.99,
    gae_lambda=0.95,
    clip_range=0.2,
    ent_coef=0.0,
):
    """Train until a stage ends; returns how many decisions are done. Defaults are those of stable-baselines3."""
    obs, infos = envs.reset(seed=int(torch.randint(2**31, ())), options={"scenario": scenario})
    n_rows, place = envs.num_envs, torch.arange(envs.num_envs)
    optimizer.param_groups[0]["lr"] = learning_rate
    while done < end:
        seen, states = torch.zeros(n_steps, *obs.shape), torch.zeros(n_steps, *envs.state().shape)
        places = place + n_rows * torch.arange(n_steps)[:, None]  # (steps, rows), in the states of all steps
        at_work = torch.zeros(n_steps, n_rows, dtype=torch.bool)
        actions, log_probs, values, rewards, dones = torch.zeros(5, n_steps, n_rows)
        with torch.no_grad():
            for step in range(n_steps):
                seen[step], states[step], at_work[step] = map(torch.from_numpy, (obs, envs.state(), infos["active"]))
                choices = Categorical(logits=actor(seen[step]))
                actions[step] = choices.sample()
                log_probs[step], values[step] = choices.log_prob(actions[step]), critic(seen[step], states[step], place)
                obs, reward, terminated, truncated, infos = envs.step(actions[step].numpy().astype(int))
                if truncated.any():  # ended by time, not by death: add the value of what would have followed
                    last = [infos["final_obs"][truncated], infos["final_info"]["state"][truncated]]
                    last = [torch.from_numpy(np.stack(part)) for part in last]
                    robots = place[torch.from_numpy(truncated)] % envs.n_robots
                    reward[truncated] += gamma * critic(*last, place[: len(robots)] * envs.n_robots + robots).numpy()
                rewards[step], dones[step] = torch.from_numpy(reward), torch.from_numpy(terminated | truncated)
            following = critic(*map(torch.from_numpy, (obs, envs.state())), place)
            advantages, values = advantages_of(rewards, values, following, dones, at_work, gamma, gae_lambda)
        rollout = [part[at_work] for part in (seen, places, actions, log_probs, advantages, advantages + values)]
        for _ in range(n_epochs):
            for chosen in torch.randperm(len(rollout[0])).split(batch_size):
                rows, places_of_rows, taken, before, advantage, returns = (part[chosen] for part in rollout)
                choices = Categorical(logits=actor(rows))
                ratio = (choices.log_prob(taken) - before).exp()
                advantage = (advantage - advantage.mean()) / (advantage.std(correction=0) + 1e-8)
                clipped = ratio.clamp(1 - clip_range, 1 + clip_range)
                gain = torch.min(advantage * ratio, advantage * clipped).mean()
                error = 0.5 * (critic(rows, states.flatten(0, 1), places_of_rows) - returns).square().mean()
                optimizer.zero_grad()
                (error - gain - ent_coef * choices.entropy().mean()).backward()
                nn.utils.clip_grad_norm_(optimizer.param_groups[0]["params"], 0.5)
                optimizer.step()
        done += n_steps * n_rows
        print(f"{done:,}: {rewards.mean():.4f} reward per decision", flush=True)
        if evaluator.is_due(done):
            about = NetworkAbout(interface=plan.interface, activation="tanh", samples=plan.samples)
            evaluator.evaluate(Network.from_state_dict(actor.state_dict(), about), done)
    return done


if __name__ == "__main__":
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    plan_file, seed, folder, *settings = sys.argv[1:]
    plan = read_plan(plan_file).with_settings(dict(map(parse_setting, [*settings, f"seed={seed}"])))
    if plan.algorithm != "ppo" or plan.starts > 1:
        sys.exit(f"Expected a plan of ppo with one start, got {plan.algorithm} with {plan.starts}.")
    evaluator = Evaluator(plan, folder, {"by": "MAPPO in plain torch"})
    torch.set_num_threads(1)
    torch.manual_seed(plan.seed)
    stages = [(stage, end, SwarmVectorEnv(**plan.arenas_of(stage))) for stage, end in plan.parts()]
    envs = stages[0][2]
    envs.reset(seed=plan.seed)
    n_columns, n_actions = envs.interface.widths
    layers = (nn.Linear(n_columns, WIDTH), nn.Tanh(), nn.Linear(WIDTH, WIDTH), nn.Tanh(), nn.Linear(WIDTH, n_actions))
    actor, critic = nn.Sequential(*layers), Critic(n_columns, envs.state().shape[1], envs.n_robots)
    for layer in [*actor.modules(), *critic.modules()]:
        if isinstance(layer, nn.Linear):  # with the weights that torch begins with, robots learn half as much
            nn.init.orthogonal_(layer.weight, 2**0.5)
            nn.init.zeros_(layer.bias)
    nn.init.orthogonal_(actor[-1].weight, 0.01)
    nn.init.orthogonal_(critic.onwards[-1].weight, 1.0)
    optimizer = torch.optim.Adam([*actor.parameters(), *critic.parameters()], eps=1e-5)
    done = 0
    for stage, end, envs in stages:
        done = learn(envs, dict(stage.scenario), done, end, **{**plan.options, **stage.options})
