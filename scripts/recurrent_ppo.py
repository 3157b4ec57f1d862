"""RecurrentPPO of sb3-contrib: robots that remember by a network of their own, without the site memory of the package.

    pip install ".[train]" "torch==2.13.0" "sb3-contrib==2.9.2"  # in a checkout
    python scripts/recurrent_ppo.py --plan docs/benchmark/plans/recurrent_ppo.toml --out recurrent_ppo.zip
    swarm-forage --trust-models run crw,recurrent_ppo.zip

It carries out a plan of `swarm-forage train`: its worlds, its stages, its options of PPO. The algorithm has a buffer of
its own, so it would also learn from rows that stand for no robot. `UsedRows` leaves these out.
"""

import argparse
import dataclasses
import time
from pathlib import Path

import numpy as np
import torch
from sb3_contrib import RecurrentPPO
from stable_baselines3.common.vec_env import VecEnvWrapper

from swarm_forage_env.training.plan import read_plan
from swarm_forage_env.training.sb3 import SwarmVecEnv
from swarm_forage_env.training.sb3.export import note_interface
from swarm_forage_env.training.sb3.training import training_seed

MEMORY = {"lstm_hidden_size": 64, "shared_lstm": True, "enable_critic_lstm": False}
"""One memory for actor and critic: half the time of two."""


class UsedRows(VecEnvWrapper):
    """The rows of a `SwarmVecEnv` that stand for robots; the largest world of a sampler says how many rows all have."""

    venv: SwarmVecEnv

    def __init__(self, venv: SwarmVecEnv, changes: dict) -> None:
        super().__init__(venv)
        venv.set_options({"scenario": changes})
        venv.reset()
        venv.set_options({"scenario": changes})
        self._used = np.flatnonzero(venv.active)
        self.num_envs = len(self._used)

    def reset(self) -> np.ndarray:
        """Start a run in every arena; returns observations (num_envs, d)."""
        return np.asarray(self.venv.reset())[self._used]

    def step_async(self, actions: np.ndarray) -> None:
        """Keep actions (num_envs,)."""
        every = np.zeros((self.venv.num_envs, *actions.shape[1:]), actions.dtype)
        every[self._used] = actions
        self.venv.step_async(every)

    def step_wait(self):
        """Step every arena; refuses worlds in which robots come and go, because they would teach while away."""
        obs, rewards, dones, infos = self.venv.step_wait()
        if not np.array_equal(np.flatnonzero(self.venv.active), self._used):
            raise SystemExit("Expected worlds with fixed numbers of robots, got robots that come or go.")
        return np.asarray(obs)[self._used], rewards[self._used], dones[self._used], [infos[row] for row in self._used]


def main() -> None:
    """Carry the plan out stage by stage, and save the model with a note of its interface."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plan", type=Path, required=True, help="plan of a training by PPO, as TOML")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=Path("recurrent_ppo.zip"), help="where the trained model goes")
    args = parser.parse_args()
    torch.set_num_threads(1)
    plan = dataclasses.replace(read_plan(args.plan), seed=args.seed)
    if plan.algorithm != "ppo":
        parser.error(f"Expected a plan of ppo in {args.plan}, got one of {plan.algorithm}.")
    started, done, end = time.perf_counter(), 0, 0
    for stage in plan.stages:
        end += stage.steps
        env = UsedRows(SwarmVecEnv(**plan.arenas_of(stage)), dict(stage.scenario))
        options = {**plan.options, **stage.options, "seed": training_seed(plan.seed, done)}
        if done:  # the same weights in other arenas
            model = RecurrentPPO.load(args.out, env=env, device="cpu", **options)
        else:
            network = {"net_arch": list(plan.hidden), **MEMORY}
            model = RecurrentPPO("MlpLstmPolicy", env, policy_kwargs=network, device="cpu", verbose=1, **options)
            note_interface(model, plan.interface, caches=plan.scenario.caches)
        model.learn(end - done, reset_num_timesteps=False)
        done = model.num_timesteps
        model.save(args.out)
        env.close()
        print(f"{done:,} decisions in {time.perf_counter() - started:,.0f} s, {args.out}")


if __name__ == "__main__":
    main()
