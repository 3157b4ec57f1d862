"""RecurrentPPO of sb3-contrib: robots that remember by an LSTM, without the site memory of the package.

    pip install ".[train]" "torch==2.13.0"  # in a checkout
    python scripts/recurrent_ppo.py --plan docs/benchmark/plans/recurrent_ppo.toml --out results/recurrent_ppo
    swarm-forage run crw,results/recurrent_ppo/policy.npz

It carries out a plan of `swarm-forage train`: its worlds, its stages, its options of PPO, its evaluations. The network
that does best in these is kept; it runs without torch. The algorithm has a buffer of its own, so it would also learn
from rows that stand for no robot. `UsedRows` leaves these out.
"""

from importlib.metadata import version
from pathlib import Path

import numpy as np
from rivals import begin, told
from sb3_contrib import RecurrentPPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnvWrapper

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.training.evaluator import Evaluator
from swarm_forage_env.training.plan import Stage, TrainingPlan
from swarm_forage_env.training.sb3 import SwarmVecEnv
from swarm_forage_env.training.sb3.algorithms import arguments_of
from swarm_forage_env.training.sb3.export import export_network
from swarm_forage_env.training.sb3.training import check_plan, training_seed

LIBRARIES = {name: version(name) for name in ("torch", "stable-baselines3", "sb3-contrib")}


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


class Watch(BaseCallback):
    """Has the network evaluated when that is due."""

    def __init__(self, evaluator: Evaluator) -> None:
        super().__init__()
        self._evaluator = evaluator

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        self.look(self.model)

    def look(self, model: BaseAlgorithm) -> None:
        """Evaluate the network as it is now, between two rollouts or at the end of a stage."""
        done, plan = model.num_timesteps, self._evaluator.plan
        if self._evaluator.is_due(done):
            network = export_network(model, plan.interface, samples=plan.samples, caches=plan.scenario.caches)
            print(told(self._evaluator.evaluate(network, done)), flush=True)


def carry_out(plan: TrainingPlan, folder: Path) -> None:
    """Collect, learn and evaluate, stage by stage."""
    if not plan.lstm:
        raise ConfigError("Expected a plan of ppo with lstm, the number of cells, got one without.")
    check_plan(plan)
    watch = Watch(Evaluator(plan, folder, {"by": "scripts/recurrent_ppo.py", "versions": LIBRARIES}))
    learnt: RecurrentPPO | None = None
    end = 0
    for stage in plan.stages:
        model, end = model_of(plan, stage, learnt), end + stage.steps
        model.learn(end - model.num_timesteps, reset_num_timesteps=False, callback=watch)
        watch.look(model)
        model.get_env().close()  # type: ignore[union-attr] - it has one
        learnt = model


def model_of(plan: TrainingPlan, stage: Stage, before: RecurrentPPO | None) -> RecurrentPPO:
    """Return the model of a stage, with the weights and the decisions of the stage before."""
    done = 0 if before is None else before.num_timesteps
    env = UsedRows(SwarmVecEnv(**plan.arenas_of(stage)), dict(stage.scenario))
    options = {**plan.options, **stage.options, "seed": training_seed(plan.seed, done)}
    made_of = arguments_of(plan, env.venv)
    model = RecurrentPPO(made_of["policy"], env, policy_kwargs=made_of["policy_kwargs"], device="cpu", **options)
    if before is not None:
        model.set_parameters(before.get_parameters())  # type: ignore[arg-type] - its types forget dictionaries in it
        model.num_timesteps = done
    return model


if __name__ == "__main__":
    begin(__doc__, "results/recurrent_ppo", carry_out)
