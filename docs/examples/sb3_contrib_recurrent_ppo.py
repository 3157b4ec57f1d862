"""RecurrentPPO of sb3-contrib, whose robots learn what to remember: pip install sb3-contrib.

The model runs from its zip file, with a memory per robot. It also learns from robots that are in repair or dead.
"""

import torch
from sb3_contrib import RecurrentPPO

from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.training.sb3 import SwarmVecEnv
from swarm_forage_env.training.sb3.export import note_interface

N_DECISIONS = 1_000_000  # of single robots
FIELDS = {"horizon_s": 400.0, "first_pickup": 1.0, "nest_progress": 0.05}

torch.set_num_threads(1)
interface = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5)
env = SwarmVecEnv("classroom", n_arenas=8, interface=interface, **FIELDS)
model = RecurrentPPO(
    "MlpLstmPolicy",
    env,
    n_steps=128,
    batch_size=2048,
    learning_rate=1e-3,
    ent_coef=0.003,
    policy_kwargs={"lstm_hidden_size": 64, "net_arch": [64]},
    seed=0,
    device="cpu",
)
note_interface(model, env.interface.config)
model.learn(N_DECISIONS)
model.save("policy.zip")
