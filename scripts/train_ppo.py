#!/usr/bin/env python
"""Train PPO of stable-baselines3 on a swarm: one shared policy, every robot is a sub-environment.

pip install ".[train]" "torch==2.13.0"  # in a checkout
python scripts/train_ppo.py --steps 3000000 --out ppo_example.npz
swarm-forage run --policy crw,ppo_example.npz
"""

import argparse
from pathlib import Path

import torch
from stable_baselines3 import PPO

from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.training.sb3 import ActiveRolloutBuffer, SwarmVecEnv
from swarm_forage_env.training.sb3.export import export_network


def main() -> None:
    """Train in a narrow warehouse, where ways are short, then in the real one; save the network."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=3_000_000, help="decisions of single robots")
    parser.add_argument("--out", type=Path, default=Path("ppo_example.npz"))
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    env = SwarmVecEnv(
        "warehouse_small",
        n_arenas=8,
        interface=InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5),
        horizon_s=600.0,
        first_pickup=1.0,
        nest_progress=0.05,
    )
    model = PPO(
        "MlpPolicy",
        env,
        n_steps=128,
        batch_size=3200,
        n_epochs=4,
        gae_lambda=0.98,
        learning_rate=1e-3,
        rollout_buffer_class=ActiveRolloutBuffer,  # leaves out robots that are dead or in repair
        rollout_buffer_kwargs=env.rollout_buffer_kwargs,
        seed=0,
        verbose=1,
        device="cpu",
    )
    for changes in ({"width_m": 12.0, "nest_centre_m": (1.2, 8.0), "nest_size_m": (1.2, 12.8)}, {}):
        env.set_options({"scenario": changes})
        model.set_env(env)  # makes the next call of learn reset the arenas
        model.learn(arguments.steps // 2, reset_num_timesteps=False)
    export_network(model, env.interface.config).save(arguments.out)


if __name__ == "__main__":
    main()
