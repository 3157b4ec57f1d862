"""Training by stable-baselines3 as a `TrainingPlan` says: stages, checkpoints, evaluations, resuming.

A folder holds everything of a training run: `plan.json`, `model.zip` (the latest checkpoint), `evaluations.csv`,
`tensorboard/`, and `policy.npz`, the network alone as it did best in evaluations, for algorithms whose network a file
can hold.
"""

import csv
import importlib.util
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import A2C, DQN, PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import safe_mean

from swarm_forage_env.config import ConfigError
from swarm_forage_env.learning.network import LearnedPolicy
from swarm_forage_env.learning.plan import Evaluation, Stage, TrainingPlan, TrainingStatus, read_plan
from swarm_forage_env.learning.sb3.buffers import ActiveRolloutBuffer, PresentReplayBuffer
from swarm_forage_env.learning.sb3.export import export_network
from swarm_forage_env.learning.sb3.vec_env import SwarmVecEnv
from swarm_forage_env.policy import Policy, load_policy
from swarm_forage_env.recording import software_versions
from swarm_forage_env.study.run import run_policy

ALGORITHM_CLASSES: dict[str, type[BaseAlgorithm]] = {"ppo": PPO, "a2c": A2C, "dqn": DQN, "sac": SAC}
ON_POLICY = ("ppo", "a2c")
EXPORTABLE = ("ppo", "a2c", "dqn")
MODEL_FILE = "model.zip"
PLAN_FILE = "plan.json"
POLICY_FILE = "policy.npz"
EVALUATIONS_FILE = "evaluations.csv"
_REPORT_EVERY_S = 1.0


@dataclass(frozen=True, kw_only=True, slots=True)
class TrainingResult:
    """What a training run leaves."""

    model: BaseAlgorithm
    evaluations: tuple[Evaluation, ...]
    """All of the folder, oldest first."""
    policy_file: Path | None
    """The best network so far; None for an algorithm whose network a file cannot hold."""


Report = Callable[[TrainingStatus | Evaluation], None]


def train(
    plan: TrainingPlan,
    folder: Path,
    *,
    n_processes: int = 0,
    resume: bool = False,
    report: Report | None = None,
) -> TrainingResult:
    """Train, or go on training from the last checkpoint.

    The same plan gives the same weights on the same machine with the same versions. Resumed training is sound, but
    not the same as one that was never interrupted: arenas start anew, and so does the replay memory of dqn and sac.

    Args:
        plan: What to do.
        folder: Where results go; created.
        n_processes: Processes that the arenas are spread over; 0 = all in this process.
        resume: Go on where the checkpoint in `folder` stopped; without a checkpoint, start.
        report: Told the status about once a second, and every evaluation.

    Raises:
        ConfigError: the folder holds a training run and nobody said resume, or that of another plan.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _claim(folder, plan, resume=resume)
    torch.set_num_threads(1)  # networks this small gain nothing from more, and arenas want the cores
    env = SwarmVecEnv(
        plan.scenario,
        n_arenas=plan.n_arenas,
        n_processes=n_processes,
        interface=plan.interface,
        wrappers=plan.wrappers,
    )
    try:
        watch = _Watch(plan, folder, report or _keep_quiet)
        model, done = _opened(plan, folder, env)
        begins = 0
        for stage in plan.stages:
            ends = begins + stage.steps
            if done < ends:
                model = _prepared(plan, stage, folder, env, done)
                model.learn(ends - done, callback=watch, reset_num_timesteps=False, tb_log_name=plan.algorithm)
                done = model.num_timesteps
            begins = ends
        assert model is not None, "a plan has a stage"
    finally:
        env.close()
    policy_file = folder / POLICY_FILE if plan.algorithm in EXPORTABLE else None
    return TrainingResult(model=model, evaluations=tuple(watch.evaluations), policy_file=policy_file)


def _claim(folder: Path, plan: TrainingPlan, *, resume: bool) -> None:
    """Write the plan, unless the folder belongs to another training run."""
    path = folder / PLAN_FILE
    if path.exists():
        if not resume:
            raise ConfigError(
                f"Expected an unused folder, got {folder} with a training run; resume it or go elsewhere."
            )
        if read_plan(path) != plan:
            raise ConfigError(f"Expected the plan in {path} to resume its training, got another plan.")
    plan.write(path)


def _opened(plan: TrainingPlan, folder: Path, env: SwarmVecEnv) -> tuple[BaseAlgorithm | None, int]:
    """Return the checkpoint of the folder and how far it got."""
    if not (folder / MODEL_FILE).exists():
        return None, 0
    model = ALGORITHM_CLASSES[plan.algorithm].load(folder / MODEL_FILE, env=env, device="cpu")
    return model, model.num_timesteps


def _prepared(plan: TrainingPlan, stage: Stage, folder: Path, env: SwarmVecEnv, done: int) -> BaseAlgorithm:
    """Return the model for a stage: a new one, or the checkpoint with the options of the stage."""
    env.set_options({"scenario": stage.scenario})
    algorithm = ALGORITHM_CLASSES[plan.algorithm]
    options: dict[str, Any] = {**plan.options, **stage.options}
    # Runs of a later stage, or of a resumed one, are none that were seen before.
    options["seed"] = plan.seed + done
    options["tensorboard_log"] = str(folder / "tensorboard") if importlib.util.find_spec("tensorboard") else None
    if (folder / MODEL_FILE).exists():
        return algorithm.load(folder / MODEL_FILE, env=env, device="cpu", **options)
    buffer: dict[str, Any] = {"replay_buffer_class": PresentReplayBuffer}
    if plan.algorithm in ON_POLICY:
        buffer = {
            "rollout_buffer_class": ActiveRolloutBuffer,
            "rollout_buffer_kwargs": {"active_column": env.active_column},
        }
    return algorithm("MlpPolicy", env, device="cpu", policy_kwargs={"net_arch": list(plan.hidden)}, **buffer, **options)


class _Watch(BaseCallback):
    """Checkpoints, evaluates and reports; knows the whole training, over all its stages."""

    def __init__(self, plan: TrainingPlan, folder: Path, report: Report) -> None:
        super().__init__()
        self._plan = plan
        self._folder = folder
        self._report = report
        self._started = time.perf_counter()
        self._last_report = 0.0
        self._next_evaluation = 0
        self._baseline: float | None = None
        self.evaluations = _read_evaluations(folder / EVALUATIONS_FILE)

    def _on_training_start(self) -> None:
        if self._next_evaluation == 0:
            self._next_evaluation = self.num_timesteps + self._plan.evaluation.every_steps

    def _on_step(self) -> bool:
        for info in self.locals["infos"]:
            if "run" in info:
                counted = info["run"][self._plan.scenario.performance]
                self.logger.record_mean("rollout/performance_per_1000_s", 1000.0 * counted / info["run"]["seconds"])
        return True

    def _on_rollout_end(self) -> None:
        elapsed = time.perf_counter() - self._started
        if self.num_timesteps >= self._next_evaluation:
            self._evaluate()
        if elapsed - self._last_report >= _REPORT_EVERY_S:
            self._last_report = elapsed
            episodes = self.model.ep_info_buffer or ()
            mean = float(safe_mean([episode["r"] for episode in episodes]))
            self._report(TrainingStatus(steps=self.num_timesteps, wall_time_s=elapsed, episode_return=mean))

    def _on_training_end(self) -> None:
        if not self.evaluations or self.evaluations[-1].steps != self.num_timesteps:
            self._evaluate()
        self.logger.dump(self.num_timesteps)

    def _evaluate(self) -> None:
        """Keep a checkpoint, run the policy, and note how it did."""
        self._next_evaluation = self.num_timesteps + self._plan.evaluation.every_steps
        self.model.save(self._folder / MODEL_FILE)
        if self._baseline is None:
            self._baseline, _ = self._judged(lambda: load_policy(self._plan.evaluation.baseline))
        performance, interference = self._judged(lambda: LearnedPolicy(self._plan.interface, _acting(self.model)))
        evaluation = Evaluation(
            steps=self.num_timesteps,
            wall_time_s=round(time.perf_counter() - self._started, 1),
            performance=performance,
            baseline=self._baseline,
            interference_fraction=interference,
        )
        for name in ("performance", "baseline", "interference_fraction"):
            self.logger.record(f"evaluation/{name}", getattr(evaluation, name))
        self.evaluations.append(evaluation)
        self._write(evaluation)
        if self._plan.algorithm in EXPORTABLE and performance >= max(past.performance for past in self.evaluations):
            self._export(evaluation)
        self._report(evaluation)

    def _export(self, evaluation: Evaluation) -> None:
        plan = self._plan
        card = {
            "plan": plan.to_mapping(),
            "evaluation": asdict(evaluation),
            "versions": {**software_versions(), "torch": str(torch.__version__)},
        }
        network = export_network(self.model, plan.interface, caches=plan.scenario.caches, card=card)
        network.save(self._folder / POLICY_FILE)

    def _judged(self, make_policy: Callable[[], Policy]) -> tuple[float, float]:
        """Return performance per 1,000 s and interference, means over the runs of the evaluation."""
        plan = self._plan
        specs = plan.evaluation.specs(plan.scenario, plan.wrappers, "policy")
        records = [run_policy(make_policy(), spec) for spec in specs]
        performance = np.mean([record.rate_per_1000_s("performance") for record in records])
        return float(performance), float(np.mean([record.interference_fraction.mean() for record in records]))

    def _write(self, evaluation: Evaluation) -> None:
        path = self._folder / EVALUATIONS_FILE
        is_new = not path.exists()
        with path.open("a", newline="", encoding="utf-8") as file:
            table = csv.DictWriter(file, [item.name for item in fields(Evaluation)])
            if is_new:
                table.writeheader()
            table.writerow(asdict(evaluation))


def _read_evaluations(path: Path) -> list[Evaluation]:
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        rows = [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]
    return [Evaluation(**{**row, "steps": int(row["steps"])}) for row in rows]  # type: ignore[arg-type]


def _acting(model: BaseAlgorithm) -> Callable[[np.ndarray, np.random.Generator], np.ndarray]:
    def choose(rows: np.ndarray, rng: np.random.Generator) -> np.ndarray:  # noqa: ARG001 - nothing is drawn
        return model.predict(rows, deterministic=True)[0]

    return choose


def _keep_quiet(news: TrainingStatus | Evaluation) -> None:
    """Report to nobody."""
