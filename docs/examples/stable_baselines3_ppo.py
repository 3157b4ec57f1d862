"""PPO of stable-baselines3 in plain code: one shared policy, every robot is a sub-environment.

This is `swarm-forage train` without its checkpoints and evaluations: the same recipe gives the same last weights.
"""

import torch

from swarm_forage_env.training.recipe import recipe
from swarm_forage_env.training.sb3 import ActiveRolloutBuffer, SwarmPPO, SwarmVecEnv
from swarm_forage_env.training.sb3.export import ACTIVATION_CLASSES, export_network, note_interface
from swarm_forage_env.training.sb3.training import training_seed

N_DECISIONS = 3_400_000  # of single robots

torch.set_num_threads(1)
plan = recipe("warehouse_small", steps=N_DECISIONS)  # plain numbers: print it, or put your own in their place
env = SwarmVecEnv(plan.scenario, n_arenas=plan.n_arenas, interface=plan.interface)
model = SwarmPPO(  # PPO that asks its network about robots at work only
    "MlpPolicy",
    env,
    **plan.options,  # n_steps, batch_size, learning_rate, ...
    policy_kwargs={"net_arch": list(plan.hidden), "activation_fn": ACTIVATION_CLASSES[plan.activation]},
    rollout_buffer_class=ActiveRolloutBuffer,  # leaves out robots that are dead or in repair
    rollout_buffer_kwargs=env.rollout_buffer_kwargs,
    seed=training_seed(plan.seed, 0),
    device="cpu",
)
note_interface(model, plan.interface)
end = 0
for stage in plan.stages:  # in a narrow warehouse, where ways are short, then in the real one
    env.set_options({"scenario": stage.scenario})
    if end:  # a new seed, and arenas that start anew
        seed = training_seed(plan.seed, model.num_timesteps)
        model = SwarmPPO.load("checkpoint.zip", env=env, device="cpu", seed=seed, **stage.options)
    end += stage.steps
    model.learn(end - model.num_timesteps, reset_num_timesteps=False)
    model.save("checkpoint.zip")
export_network(model, plan.interface, samples=plan.samples).save("policy.npz")
