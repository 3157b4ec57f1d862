#!/usr/bin/env python
"""Train PPO of stable-baselines3 on a swarm: one shared policy, every robot is a sub-environment.

pip install ".[train]" "torch==2.13.0"  # in a checkout
python scripts/train_ppo.py --out ppo_example.npz
swarm-forage run crw,ppo_example.npz

This is `swarm-forage train` without its checkpoints and evaluations: the same recipe gives the same last weights.
"""

import argparse
from pathlib import Path

import torch

from swarm_forage_env.training.defaults import DEFAULT_STEPS
from swarm_forage_env.training.recipe import recipe
from swarm_forage_env.training.sb3 import ActiveRolloutBuffer, SwarmPPO, SwarmVecEnv
from swarm_forage_env.training.sb3.export import ACTIVATION_CLASSES, export_network, note_interface
from swarm_forage_env.training.sb3.training import training_seed


def main() -> None:
    """Train in a narrow warehouse, where ways are short, then in the real one; save the network."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=DEFAULT_STEPS, help="decisions of single robots")
    parser.add_argument("--out", type=Path, default=Path("ppo_example.npz"))
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    plan = recipe("warehouse_small", steps=arguments.steps)  # plain numbers: print it, or put your own in their place
    env = SwarmVecEnv(plan.scenario, n_arenas=plan.n_arenas, interface=plan.interface)
    checkpoint = arguments.out.with_suffix(".zip")
    model = SwarmPPO(  # PPO that asks its network about robots at work only
        "MlpPolicy",
        env,
        **plan.options,  # n_steps, batch_size, learning_rate, ...
        policy_kwargs={"net_arch": list(plan.hidden), "activation_fn": ACTIVATION_CLASSES[plan.activation]},
        rollout_buffer_class=ActiveRolloutBuffer,  # leaves out robots that are dead or in repair
        rollout_buffer_kwargs=env.rollout_buffer_kwargs,
        seed=training_seed(plan.seed, 0),
        verbose=1,
        device="cpu",
    )
    note_interface(model, plan.interface)
    end = 0
    for stage in plan.stages:
        env.set_options({"scenario": stage.scenario})
        if end:  # a new seed, and arenas that start anew
            seed = training_seed(plan.seed, model.num_timesteps)
            model = SwarmPPO.load(checkpoint, env=env, device="cpu", seed=seed, **stage.options)
        end += stage.steps
        model.learn(end - model.num_timesteps, reset_num_timesteps=False)
        model.save(checkpoint)
    export_network(model, plan.interface, samples=plan.samples).save(arguments.out)


if __name__ == "__main__":
    main()
