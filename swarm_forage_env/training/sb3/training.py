"""Training by stable-baselines3 as a `TrainingPlan` says: stages, checkpoints, evaluations, resuming.

A folder holds everything of a training run: `plan.json`, `model.zip` (the latest checkpoint), `evaluations.csv`,
`tensorboard/`, and `policy.npz`, the network alone as it did best in evaluations, for algorithms whose network a file
can hold.
"""

import importlib.util
import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from io import BytesIO
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import stable_baselines3
import torch
from stable_baselines3 import A2C, DQN, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.utils import safe_mean

from swarm_forage_env._internal.fields import ConfigError, known_keys
from swarm_forage_env._internal.files import alone_in, check_folder, replacing
from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.contract.types import ObsArray
from swarm_forage_env.policies import trust
from swarm_forage_env.policies.extras import ExtraFunction
from swarm_forage_env.policies.learned import LearnedPolicy
from swarm_forage_env.policies.network import Network
from swarm_forage_env.training.evaluation import (
    EXPORTABLE,
    MODEL_FILE,
    PLAN_FILE,
    POLICY_FILE,
    Evaluation,
    Evaluator,
    check_unused,
    reached_by,
)
from swarm_forage_env.training.plan import SAMPLING, Stage, TrainingPlan, read_plan
from swarm_forage_env.training.sb3.buffers import ActiveRolloutBuffer, PresentReplayBuffer
from swarm_forage_env.training.sb3.export import ACTIVATION_CLASSES, export_network, note_interface
from swarm_forage_env.training.sb3.ppo import SwarmPPO
from swarm_forage_env.views.plans import plan_arena
from swarm_forage_env.views.stable_baselines3 import SwarmVecEnv

ALGORITHM_CLASSES: dict[str, type[BaseAlgorithm]] = {"ppo": SwarmPPO, "a2c": A2C, "dqn": DQN, "sac": SAC}
"""The class that carries out a plan, by the plan's word."""
START_FILE = "start.zip"
"""Checkpoint of the best start so far, of a training with several."""
_PART = "swarm_forage_part"
"""Attribute of a model: which of the plan's parts it is in."""
_REPORT_EVERY_S = 1.0
_MOST_WEIGHT = 1e6
"""Where torch fails over the outputs of a network, weights this large tell that the training diverged; our choice."""
_OURS = {"policy", "env", "seed", "device", "policy_kwargs", "tensorboard_log", "_init_setup_model"} | {
    f"{kind}_buffer_{what}" for kind in ("rollout", "replay") for what in ("class", "kwargs")
}
"""Arguments of the algorithms' classes that training gives them."""


@dataclass(frozen=True, kw_only=True, slots=True)
class TrainingStatus:
    """Where a training run stands."""

    steps: int
    """Decisions of single robots so far."""
    episode_return: float
    """Mean return of the latest episodes, nan before the first."""


@dataclass(frozen=True, kw_only=True, slots=True)
class TrainingResult:
    """What a training run leaves."""

    model: BaseAlgorithm
    evaluations: tuple[Evaluation, ...]
    """All of the folder, oldest first."""
    policy_file: Path | None
    """The best network so far; None for an algorithm whose network a file cannot hold."""
    steps: int
    """Decisions of single robots that this call added; 0 when the training was finished before."""


Report = Callable[[TrainingStatus | Evaluation], None]


def train(
    plan: TrainingPlan,
    folder: Path,
    *,
    resume: bool = False,
    report: Report | None = None,
    callbacks: Sequence[BaseCallback] = (),
    extra_reward: ExtraFunction | None = None,
    extra_observation: ExtraFunction | None = None,
) -> TrainingResult:
    """Train, or go on training from the last checkpoint.

    The same plan gives the same weights on the same machine with the same versions. Resumed training is sound, but
    not the same as one that was never interrupted: arenas start anew, and so does the replay memory of dqn and sac.
    Ctrl-C keeps a checkpoint before it goes on its way; a crash leaves the one of the latest evaluation. One that was
    killed within an evaluation begins with it when it goes on. Two trainings in one folder would overwrite each other,
    so the second is refused.

    Args:
        plan: What to do. A training goes on by its own plan, or by one with a longer last stage or further stages.
        folder: Where results go; created.
        resume: Go on where the checkpoint in `folder` stopped.
        report: Told the status about once a second, and every evaluation.
        callbacks: Further callbacks of the library; one that returns False ends the training, as the library has it.
        extra_reward: Function of the world that adds to rewards; see `parallel_env`.
        extra_observation: Function of the world that gives further columns, in evaluations, too. The kept network says
            how many; a policy made of it needs the function again.

    Raises:
        ConfigError: the algorithm knows no such option; the folder holds a training run and `resume` is False, or none
            that this plan goes on with and it is True; another call that trains in the folder; a stage whose scenario
            cannot be built; or a training that diverged.
    """
    extras = {"extra_reward": extra_reward, "extra_observation": extra_observation}
    if extra_observation is not None:
        arena = plan_arena(plan.scenario, interface=plan.interface, extra_observation=extra_observation)
        plan = replace(plan, interface=arena.interface)
    check_plan(plan)
    check_folder(folder)
    with alone_in(folder, ConfigError):
        check_place(folder, plan, resume=resume)
        if resume:
            trust.check(folder / MODEL_FILE)
        torch.set_num_threads(1)  # networks this small gain nothing from more, and arenas want the cores
        watch = _Watch(plan, folder, report or (lambda _: None), extra_observation)
        return _train(plan, folder, watch, CallbackList([watch, *callbacks]), extras)


def _train(
    plan: TrainingPlan, folder: Path, watch: "_Watch", callbacks: BaseCallback, extras: Mapping[str, Any]
) -> TrainingResult:
    """Train in a folder that is checked, and that nobody else writes to."""
    model = _opened(plan, folder / MODEL_FILE) if (folder / MODEL_FILE).exists() else None
    begun = done = 0 if model is None else model.num_timesteps
    for part in count():
        parts = plan.parts(watch.evaluator.evaluations)
        if part == len(parts):
            break
        (stage, end), latest = parts[part], getattr(model, _PART, 0)
        if done >= end and not (part == latest and watch.evaluator.is_due(done)):
            continue
        env = SwarmVecEnv(**plan.arenas_of(stage), **extras)
        try:
            starts = len(parts) - len(plan.stages) + 1
            checkpoint = None if model is None else _checkpoint(plan, folder, latest, part, starts, watch.evaluator)
            model = _prepared(plan, stage, folder, env, done, checkpoint)
            setattr(model, _PART, part)
            number = max(1, part + 2 - starts)
            _learn(model, max(0, end - done), callbacks, watch, f"stage {number}")
        finally:
            env.close()
        done = model.num_timesteps
        if done < end:  # a callback ended it
            break
    assert model is not None, "a plan has a stage"
    return TrainingResult(
        model=model,
        evaluations=tuple(watch.evaluator.evaluations),
        policy_file=folder / POLICY_FILE if plan.algorithm in EXPORTABLE else None,
        steps=done - begun,
    )


def _checkpoint(
    plan: TrainingPlan, folder: Path, latest: int, part: int, starts: int, evaluator: Evaluator
) -> Path | None:
    """Return what a part begins with, after the latest checkpoint of the same or an earlier part; None = a new model.

    The best start so far is kept beside the checkpoint.
    """
    if starts == 1 or latest == part or latest >= starts:
        return folder / MODEL_FILE
    first = plan.stages[0].steps
    reached = [reached_by(evaluator.evaluations, n * first) for n in range(1, latest + 2)]
    if reached[-1] == max(reached):
        with replacing(folder / START_FILE) as draft:
            draft.write_bytes((folder / MODEL_FILE).read_bytes())
    return folder / START_FILE if part == starts else None


def check_plan(plan: TrainingPlan) -> None:
    """Refuse options that no training can have with a ConfigError; a checkpoint would take them without a word."""
    arguments = inspect.signature(ALGORITHM_CLASSES[plan.algorithm]).parameters
    done, starts, learns = 0, 0, False
    waits = arguments["learning_starts"].default if "learning_starts" in arguments else 0
    for stage in plan.stages:
        options = {**plan.options, **stage.options}
        known_keys(options, sorted(set(arguments) - _OURS), f"option of {plan.algorithm}")
        done, starts = done + stage.steps, options.get("learning_starts", waits)
        learns = learns or done > starts
    if not learns:
        raise ConfigError(
            f"Expected more steps than the {starts:,} after which {plan.algorithm} begins to learn (learning_starts), "
            f"got {done:,}; give more, or a smaller learning_starts (--set options.learning_starts=NUMBER)."
        )


def check_place(folder: Path, plan: TrainingPlan, *, resume: bool) -> None:
    """Refuse a folder with a training that is not this one, or without one that can be resumed, with a ConfigError."""
    if not resume:
        check_unused(folder, "resume it (--resume), or choose another folder (--out)")
        return
    for name in (PLAN_FILE, MODEL_FILE):
        if not (folder / name).exists():
            raise ConfigError(
                f"Expected {folder} to hold a training to resume, with {PLAN_FILE} and the checkpoint {MODEL_FILE}, "
                f"found no {name}; without resume a new one starts."
            )
    differences = plan.differences(read_plan(folder / PLAN_FILE))
    if differences:
        raise ConfigError(
            f"Expected the plan in {folder / PLAN_FILE} to resume its training, got another plan: "
            f"{'; '.join(differences)}."
        )


def _opened(plan: TrainingPlan, path: Path, **options: Any) -> BaseAlgorithm:
    """Return a checkpoint, with other options."""
    try:
        return ALGORITHM_CLASSES[plan.algorithm].load(path, device="cpu", **options)
    except Exception as error:  # torch and the library raise many kinds
        reason = " ".join(str(error).split())
        raise ConfigError(f"Cannot open the checkpoint {path}: {reason}; train anew in another folder.") from error


def _prepared(
    plan: TrainingPlan, stage: Stage, folder: Path, env: SwarmVecEnv, done: int, checkpoint: Path | None
) -> BaseAlgorithm:
    """Return the model for a stage: a new one, or a checkpoint with the options of the stage."""
    env.set_options({"scenario": stage.scenario})
    options: dict[str, Any] = {**plan.options, **stage.options, "seed": training_seed(plan.seed, done)}
    options["tensorboard_log"] = str(folder / "tensorboard") if importlib.util.find_spec("tensorboard") else None
    if checkpoint is not None:
        model = _opened(plan, checkpoint, env=env, **options)
    else:
        try:
            model = ALGORITHM_CLASSES[plan.algorithm](env=env, device="cpu", **_arguments(plan, env), **options)
        except (AssertionError, TypeError, ValueError) as error:  # how the library refuses values
            raise ConfigError(f"Cannot prepare {plan.algorithm} with its options: {error}") from error
    model.num_timesteps = done  # those of other starts, too
    note_interface(model, plan.interface, caches=plan.scenario.caches, samples=plan.samples)
    return model


def _arguments(plan: TrainingPlan, env: SwarmVecEnv) -> dict[str, Any]:
    """Return what a new model is made with besides its options: policy, network and buffer."""
    network = {"net_arch": list(plan.hidden), "activation_fn": ACTIVATION_CLASSES[plan.activation]}
    buffer: dict[str, Any] = {"replay_buffer_class": PresentReplayBuffer}
    if plan.algorithm in SAMPLING:
        buffer = {"rollout_buffer_class": ActiveRolloutBuffer, "rollout_buffer_kwargs": env.rollout_buffer_kwargs}
    return {"policy": "MlpPolicy", "policy_kwargs": network, **buffer}


def training_seed(seed: int, done: int) -> int:
    """Return the seed for what comes after `done` decisions of a training with `seed`.

    It is drawn, so that a later stage or a resumed training does not repeat earlier runs, nor those of the evaluations,
    whose seeds are counted up from a number of their own.
    """
    return int(np.random.default_rng((seed, done)).integers(2**31))


def _learn(model: BaseAlgorithm, steps: int, callbacks: BaseCallback, watch: "_Watch", where: str) -> None:
    try:
        model.learn(steps, callback=callbacks, reset_num_timesteps=False, tb_log_name=watch.plan.algorithm)
    except KeyboardInterrupt:
        if not _has_diverged(model):
            watch.keep(model)
        raise
    except ConfigError as error:  # what only a reset or a run finds to be impossible
        raise ConfigError(f"Cannot train in {where}: {error}") from error
    except ValueError as error:
        if not _has_diverged(model):
            raise
        raise ConfigError(
            f"The training diverged in {where}, after {model.num_timesteps:,} decisions: weights became nan or huge; "
            "lower the learning_rate, or look for a reward or another option out of proportion."
        ) from error


def _has_diverged(model: BaseAlgorithm) -> bool:
    return not all(bool((weights.abs() < _MOST_WEIGHT).all()) for weights in model.policy.parameters())  # nan is not <


class _Watch(BaseCallback):
    """Checkpoints, evaluates and reports, over all stages of a training."""

    def __init__(
        self,
        plan: TrainingPlan,
        folder: Path,
        report: Report,
        extra_observation: ExtraFunction | None,
    ) -> None:
        super().__init__()
        self.plan, self._folder, self._report, self._extra = plan, folder, report, extra_observation
        made_by = {"versions": {"stable-baselines3": stable_baselines3.__version__, "torch": str(torch.__version__)}}
        self.evaluator = Evaluator(plan, folder, made_by, resume=True)  # the folder was looked at
        self._last_report = -math.inf

    def keep(self, model: BaseAlgorithm) -> None:
        """Write a checkpoint, beside the plan that it is one of.

        Raises:
            ValueError: the training diverged; the checkpoint before stays.
        """
        if _has_diverged(model):
            raise ValueError("Expected weights that are finite numbers.")
        self.plan.write(self._folder / PLAN_FILE)
        with replacing(self._folder / MODEL_FILE) as draft:
            content = BytesIO()  # torch tells a full disk as an error of its own
            model.save(content)
            draft.write_bytes(content.getvalue())

    def _on_training_start(self) -> None:
        self.plan.write(self._folder / PLAN_FILE)  # not before arenas and model are known to be possible
        self._report(TrainingStatus(steps=self.num_timesteps, episode_return=math.nan))

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        # Not at the end of a rollout, which has not taught anything yet.
        if self.evaluator.is_due(self.num_timesteps):
            self._evaluate()

    def _on_rollout_end(self) -> None:
        elapsed, _ = self.evaluator.spent_s()
        if elapsed - self._last_report >= _REPORT_EVERY_S:
            self._last_report = elapsed
            episodes = self.model.ep_info_buffer or ()
            mean = float(safe_mean([episode["r"] for episode in episodes]))
            self._report(TrainingStatus(steps=self.num_timesteps, episode_return=mean))

    def _on_training_end(self) -> None:
        evaluations = self.evaluator.evaluations
        if not evaluations or evaluations[-1].steps < self.num_timesteps:
            self._evaluate()
        self.logger.dump(self.num_timesteps)

    def _evaluate(self) -> None:
        """Keep a checkpoint, run the policy, and note how it did."""
        self.keep(self.model)
        plan, network, policy = self.plan, None, None
        if plan.algorithm in EXPORTABLE:
            caches = plan.scenario.caches
            network = export_network(self.model, plan.interface, samples=plan.samples, caches=caches)
            policy = None if self._extra is None else partial(self._seeing_more, plan.as_kept(network))
        else:
            policy = partial(LearnedPolicy, plan.run_interface, self._best_actions)
        evaluation = self.evaluator.evaluate(network, self.num_timesteps, policy=policy)
        self.logger.record("evaluation/reached", evaluation.reached)
        self.logger.record("evaluation/interference_fraction", evaluation.interference_fraction)
        for world in evaluation.worlds:
            self.logger.record(f"evaluation/ratio/{world.world}", world.ratio)
        self._report(evaluation)

    def _best_actions(self, rows: ObsArray, _: np.random.Generator) -> np.ndarray:
        return self.model.predict(rows, deterministic=True)[0]

    def _seeing_more(self, network: Network) -> Policy:
        """The network with the function of the user that it needs."""
        return LearnedPolicy(network.about.interface, network.choose, extra_observation=self._extra)
