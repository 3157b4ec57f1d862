"""MAPPO in one file: PPO whose critic sees the state of the arena; plain torch on `gymnasium.make_vec`.

The critic values a robot by the state of its arena and by what the robot sees. Arenas start anew within the step that
ends them: where one was truncated, the value of its last state is added. Steps of robots not at work are left out.
"""

import gymnasium
import numpy as np
import torch
from torch import nn
from torch.distributions import Categorical

import swarm_forage_env  # noqa: F401 - registers the environments
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.network import Network, NetworkAbout

N_DECISIONS = 1_000_000  # of single robots
N_STEPS, EPOCHS, MINIBATCH, GAMMA, LAMBDA, CLIP, ENTROPY = 128, 4, 2048, 0.99, 0.98, 0.2, 0.003
INTERFACE = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5)
FIELDS = {"horizon_s": 400.0, "first_pickup": 1.0, "nest_progress": 0.05}

torch.set_num_threads(1)
envs = gymnasium.make_vec("swarm_forage/classroom-v0", n_arenas=8, interface=INTERFACE, **FIELDS)
n_columns, n_rows = envs.single_observation_space.shape[0], envs.num_envs


def perceptron(n_inputs, n_outputs):
    return nn.Sequential(nn.Linear(n_inputs, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, n_outputs))


def views(obs, states=None):
    """What the critic sees of each robot, (rows, v): the state of its arena, by default now, and its observation."""
    states = envs.state().repeat(envs.n_robots, axis=0) if states is None else np.stack(states)
    return torch.from_numpy(np.hstack([states, np.stack(obs)]))


obs, infos = envs.reset(seed=0)
actor, critic = perceptron(n_columns, envs.single_action_space.n), perceptron(views(obs).shape[1], 1)
weights = [*actor.parameters(), *critic.parameters()]
optimizer = torch.optim.Adam(weights, lr=1e-3, eps=1e-5)
for _ in range(0, N_DECISIONS, N_STEPS * n_rows):
    viewed = torch.zeros(N_STEPS, *views(obs).shape)
    seen = viewed[..., -n_columns:]  # what robots see stands last
    actions, log_probs, values, rewards, dones, advantages = torch.zeros(6, N_STEPS, n_rows)
    at_work = torch.zeros(N_STEPS, n_rows, dtype=torch.bool)
    with torch.no_grad():
        for step in range(N_STEPS):
            viewed[step], at_work[step] = views(obs), torch.from_numpy(infos["active"])
            choices = Categorical(logits=actor(seen[step]))
            actions[step] = choices.sample()
            log_probs[step], values[step] = choices.log_prob(actions[step]), critic(viewed[step])[:, 0]
            obs, reward, terminated, truncated, infos = envs.step(actions[step].numpy().astype(int))
            if truncated.any():  # ended by time, not by death: add the value of what would have followed
                last_states = infos["final_info"]["state"][truncated]
                reward[truncated] += GAMMA * critic(views(infos["final_obs"][truncated], last_states))[:, 0].numpy()
            rewards[step], dones[step] = torch.from_numpy(reward), torch.from_numpy(terminated | truncated)
        following, last = critic(views(obs))[:, 0], torch.zeros(n_rows)
        for step in reversed(range(N_STEPS)):
            target = rewards[step] + GAMMA * following * (1 - dones[step])
            # The value of a robot not at work follows from its next step: no network, and no lambda in the decay.
            following = values[step] = torch.where(at_work[step], values[step], target)
            decay = GAMMA * torch.where(at_work[step], LAMBDA, 1.0)
            last = advantages[step] = target - following + decay * (1 - dones[step]) * last
    rollout = [values[at_work] for values in (seen, viewed, actions, log_probs, advantages, advantages + values)]
    for _ in range(EPOCHS):
        for chosen in torch.randperm(len(rollout[0])).split(MINIBATCH):
            rows, of_critic, taken, before, advantage, returns = (part[chosen] for part in rollout)
            choices = Categorical(logits=actor(rows))
            ratio = (choices.log_prob(taken) - before).exp()
            advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
            gain = torch.min(advantage * ratio, advantage * ratio.clamp(1 - CLIP, 1 + CLIP)).mean()
            error = 0.5 * (critic(of_critic)[:, 0] - returns).square().mean()
            optimizer.zero_grad()
            (error - gain - ENTROPY * choices.entropy().mean()).backward()
            nn.utils.clip_grad_norm_(weights, 0.5)
            optimizer.step()
    print(f"reward per decision: {rewards.mean():.4f}")
about = NetworkAbout(interface=INTERFACE, activation="tanh", samples=True)
Network.from_state_dict(actor.state_dict(), about).save("policy.npz")
