"""PPO of AgileRL on our vector environment: pip install agilerl==2.58.0 peft==0.21.0 torch==2.13.0.

The loop leaves out steps of robots that are not at work, which AgileRL's own would keep.
"""

import numpy as np
import torch
from agilerl.algorithms import PPO

from swarm_forage_env.policies.network import Network, NetworkAbout
from swarm_forage_env.training.evaluation import Evaluator
from swarm_forage_env.training.plan import TrainingPlan
from swarm_forage_env.views.gymnasium import SwarmVectorEnv

N_DECISIONS = 400_000  # of single robots

plan = TrainingPlan.from_mapping(
    {
        "scenario": {"preset": "classroom", "horizon_s": 400.0, "first_pickup": 1.0, "nest_progress": 0.05},
        "wrappers": {"population": {"death_per_tick": 0.0002}},  # a death every 1,000 s on average
        "interface": {"observation": "compact", "actions": "discrete", "automatic_gripper": True, "decision_ticks": 5},
        "samples": True,  # runs draw actions by their probabilities, as training does
        "n_arenas": 8,
        "stages": [{"steps": N_DECISIONS}],
        "evaluation": {"every_steps": N_DECISIONS // 10, "n_runs": 8},
    }
)
LAYERS = {"hidden_size": [64], "activation": "Tanh", "layer_norm": False}  # a perceptron, as network files want it

envs = SwarmVectorEnv(**plan.arenas_of(plan.stages[0]))
agent = PPO(
    envs.single_observation_space,
    envs.single_action_space,
    num_envs=envs.num_envs,
    learn_step=128 * envs.num_envs,
    batch_size=2048,
    lr=1e-3,
    net_config={"encoder_config": {**LAYERS}, "head_config": {**LAYERS}},
)
evaluator = Evaluator(plan, "results/agilerl", {"by": "docs/examples/agilerl_ppo.py"})

decisions = 0
observations, infos = envs.reset(seed=1)
done = np.zeros(envs.num_envs)
while decisions < N_DECISIONS:
    at_work = []
    agent.rollout_buffer.reset()
    for _ in range(agent.rollout_buffer.capacity):
        masks = envs.action_masks()
        at_work.append(infos["active"])
        actions, log_probs, _, values = agent.get_action(observations, action_mask=masks)
        following, rewards, terminations, truncations, infos = envs.step(actions)
        if truncations.any():  # what would have followed the time limit
            rewards[truncations] += agent.gamma * agent.get_action(np.stack(infos["final_obs"][truncations]))[3]
        agent.rollout_buffer.add(observations, actions, rewards, done, values, log_probs, action_mask=masks)
        observations, done = following, terminations | truncations
    agent.rollout_buffer.compute_returns_and_advantages(agent.get_action(observations)[3], done)
    rollout = agent.rollout_buffer.get_tensor_batch()
    agent.learn(rollout[torch.from_numpy(np.concatenate(at_work))])  # not at work: nothing to learn from
    decisions += len(rollout)
    if evaluator.is_due(decisions):
        about = NetworkAbout(interface=plan.interface, activation="tanh", samples=plan.samples)
        network = Network.from_state_dict(agent.actor.state_dict(), about)
        print(decisions, evaluator.evaluate(network, decisions).reached)
