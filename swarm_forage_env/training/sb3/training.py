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
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import stable_baselines3
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.logger import HParam
from stable_baselines3.common.utils import safe_mean

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.files import alone_in, check_folder, replacing
from swarm_forage_env._internal.wording import suggestion
from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.policies import trust
from swarm_forage_env.policies.extras import ExtraFunction
from swarm_forage_env.policies.learned import LearnedPolicy
from swarm_forage_env.policies.model_files import model_choice
from swarm_forage_env.policies.network import Network, NetworkPolicy
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import Started
from swarm_forage_env.runs.versions import software_versions
from swarm_forage_env.training.evaluation_plan import BEST
from swarm_forage_env.training.evaluations import (
    EVALUATIONS_FILE,
    MODEL_FILE,
    PLAN_FILE,
    POLICY_FILE,
    Evaluation,
    TrainingStatus,
    as_kept,
    baselines_of,
    check_unused,
    chosen,
    evaluated,
    kept_plan,
    known_baselines,
    lacks_evaluation,
    read_evaluations,
    write_evaluations,
)
from swarm_forage_env.training.plan import EXPORTABLE, LEARNING, Stage, TrainingPlan
from swarm_forage_env.training.sb3.algorithms import ALGORITHM_CLASSES, arguments_of
from swarm_forage_env.training.sb3.buffers import EmptyRolloutError
from swarm_forage_env.training.sb3.export import export_network, note_interface
from swarm_forage_env.views.plans import plan_arena
from swarm_forage_env.views.stable_baselines3 import SwarmVecEnv

_REPORT_EVERY_S = 1.0
_TOLD = ("algorithm", "seed", "n_arenas", "hidden", "activation", "interface", "options", "stages",
         "samples", "temperature", "in_runs", "scenario.reward", "scenario.name", "scenario.robots.n_robots",
         "sampler")  # fmt: skip
"""Settings of a plan that TensorBoard shows beside the evaluations, by name or by what their names begin with."""
_NO_LINE = ("stdout", "log", "json", "csv")
"""Outputs of the library that hold numbers only."""
_MOST_WEIGHT = 1e6
"""Where torch fails over the outputs of a network, weights this large tell that the training diverged; our choice."""
_OURS = frozenset(
    {"policy", "env", "seed", "device", "policy_kwargs", "tensorboard_log", "_init_setup_model"}
    | {f"{kind}_buffer_{what}" for kind in ("rollout", "replay") for what in ("class", "kwargs")}
)
"""Arguments of the algorithms' classes that training gives them."""
_ELSEWHERE = {
    "seed": "seed",
    "policy_kwargs": "hidden",
    "net_arch": "hidden",
    "hidden": "hidden",
    "activation_fn": "activation",
    "activation": "activation",
}
"""What people look for among the options -> the field of a plan that says it."""


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
        ConfigError: the algorithm knows no such option, the folder holds a training run and
            `resume` is False, `resume` is True and the folder holds no training run, or one by another plan, or broken
            files; another call that trains in the folder; a stage whose scenario cannot be built; or a training that
            diverged.
    """
    extras = {"extra_reward": extra_reward, "extra_observation": extra_observation}
    if extra_observation is not None:
        arena = plan_arena(plan.scenario, interface=plan.interface, extra_observation=extra_observation)
        plan = replace(plan, interface=arena.interface)
    check_plan(plan)
    check_folder(folder)
    with alone_in(folder, ConfigError):
        check_place(folder, plan, resume=resume)
        return _train(plan, folder, resume, report or _keep_quiet, callbacks, extras)


def _train(
    plan: TrainingPlan,
    folder: Path,
    resume: bool,
    report: Report,
    callbacks: Sequence[BaseCallback],
    extras: Mapping[str, Any],
) -> TrainingResult:
    """Train in a folder that is checked, and that nobody else writes to."""
    torch.set_num_threads(1)  # networks this small gain nothing from more, and arenas want the cores
    watch = _Watch(plan, folder, report, extras["extra_observation"])
    together = _Together(watch, callbacks)
    env = _arenas(plan, plan.stages[0], extras)
    sampler = plan.stages[0].sampler
    try:
        model = _checkpoint(plan, folder, env) if resume else None
        begun = 0 if model is None else model.num_timesteps
        ends = 0
        for number, stage in enumerate(plan.stages, 1):
            ends += stage.steps
            done = 0 if model is None else model.num_timesteps
            if done < ends:
                if stage.sampler != sampler:
                    env.close()
                    env, sampler = _arenas(plan, stage, extras), stage.sampler
                model = _prepared(plan, stage, folder, env, done)
                _learn(model, ends - done, together, f"stage {number}{_changes(stage)}")
            if together.ended:
                break
        assert model is not None, "a plan has a stage"
        if watch.lacks_evaluation(model.num_timesteps) and not together.ended:
            model = _prepared(plan, plan.stages[-1], folder, env, model.num_timesteps)  # nothing is stepped any more
            _learn(model, 0, _Together(watch), "its last evaluation")
    finally:
        env.close()
    policy_file = folder / POLICY_FILE if plan.algorithm in EXPORTABLE else None
    return TrainingResult(
        model=model,
        evaluations=tuple(watch.evaluations),
        policy_file=policy_file,
        steps=model.num_timesteps - begun,
    )


def _arenas(plan: TrainingPlan, stage: Stage, extras: Mapping[str, Any]) -> SwarmVecEnv:
    return SwarmVecEnv(**plan.arenas_of(stage), **extras)


def check_plan(plan: TrainingPlan) -> None:
    """Refuse options and baselines that no training can have.

    Raises:
        ConfigError: see above.
    """
    _check_options(plan)
    _check_learns(plan)
    _check_baseline(plan)


def _check_options(plan: TrainingPlan) -> None:
    """Refuse options that the algorithm does not know, which a checkpoint would take without a word."""
    known = set(inspect.signature(ALGORITHM_CLASSES[plan.algorithm]).parameters) - _OURS
    for options in (plan.options, *(stage.options for stage in plan.stages)):
        for name in options:
            if name in known:
                continue
            if name in _ELSEWHERE:
                raise ConfigError(
                    f"Expected options of {plan.algorithm} without {name!r}: the plan says it in {_ELSEWHERE[name]!r}."
                )
            if name in _OURS:
                raise ConfigError(f"Expected options of {plan.algorithm} without {name!r}, which training sets itself.")
            raise ConfigError(f"Unknown option {name!r} of {plan.algorithm}.{suggestion(name, sorted(known))}")


def _check_learns(plan: TrainingPlan) -> None:
    """Refuse a training from replay that ends before it begins to learn."""
    default = inspect.signature(ALGORITHM_CLASSES[plan.algorithm]).parameters.get("learning_starts")
    if default is None:
        return
    done = starts = 0
    for stage in plan.stages:
        done += stage.steps
        starts = {**plan.options, **stage.options}.get("learning_starts", default.default)
        if done > starts:
            return
    raise ConfigError(
        f"Expected more steps than the {starts:,} after which {plan.algorithm} begins to learn (learning_starts), "
        f"got {done:,}; give more, or a smaller learning_starts (--set options.learning_starts=NUMBER)."
    )


def check_place(folder: Path, plan: TrainingPlan, *, resume: bool) -> None:
    """Refuse a folder with a training run that is not this one, or without one where it is to be resumed.

    Raises:
        ConfigError: see above.
    """
    if resume:
        differences = plan.differences(kept_plan(folder))
        if differences:
            raise ConfigError(
                f"Expected the plan in {folder / PLAN_FILE} to resume its training, got another plan: "
                f"{'; '.join(differences)}."
            )
    else:
        check_unused(folder, "resume it (--resume), or choose another folder (--out)")


def _check_baseline(plan: TrainingPlan) -> None:
    """Refuse a controller to compare with that cannot be opened; the first evaluation would be late for that."""
    worlds = plan.evaluation.worlds
    named = [(f"the baseline of {world.name}", world.baseline) for world in worlds if world.baseline != BEST]
    for where, baseline in named if worlds else [("evaluation.baseline", plan.evaluation.baseline)]:
        try:
            load_policy(baseline)
        except (ValueError, OSError) as error:
            raise ConfigError(f"Expected {where} to be a controller: {error}") from error


def _checkpoint(plan: TrainingPlan, folder: Path, env: SwarmVecEnv) -> BaseAlgorithm:
    path = folder / MODEL_FILE
    trust.check(path)
    try:
        return ALGORITHM_CLASSES[plan.algorithm].load(path, env=env, device="cpu")
    except Exception as error:  # torch and the library raise many kinds
        reason = " ".join(str(error).split())
        raise ConfigError(f"Cannot open the checkpoint {path}: {reason}; train anew in another folder.") from error


def _prepared(plan: TrainingPlan, stage: Stage, folder: Path, env: SwarmVecEnv, done: int) -> BaseAlgorithm:
    """Return the model for a stage: a new one, or the checkpoint with the options of the stage."""
    env.set_options({"scenario": stage.scenario})
    algorithm = ALGORITHM_CLASSES[plan.algorithm]
    options: dict[str, Any] = {**plan.options, **stage.options}
    options["seed"] = training_seed(plan.seed, done)
    options["tensorboard_log"] = str(folder / "tensorboard") if importlib.util.find_spec("tensorboard") else None
    try:
        if (folder / MODEL_FILE).exists():
            model = algorithm.load(folder / MODEL_FILE, env=env, device="cpu", **options)
        else:
            model = algorithm(env=env, device="cpu", **arguments_of(plan, env), **options)
    except (AssertionError, TypeError, ValueError) as error:  # how the library refuses values
        raise ConfigError(f"Cannot prepare {plan.algorithm} with its options: {error}") from error
    note_interface(model, plan.interface, caches=plan.scenario.caches, samples=plan.samples)
    return model


def training_seed(seed: int, done: int) -> int:
    """Return the seed for what comes after `done` decisions of a training with `seed`.

    It is drawn, so that a later stage or a resumed training does not repeat earlier runs, nor those of the evaluations,
    whose seeds are counted up from a number of their own.
    """
    return int(np.random.default_rng((seed, done)).integers(2**31))


def _changes(stage: Stage) -> str:
    fields = ", ".join(f"{name} = {value}" for name, value in stage.scenario.items())
    return f", with {fields}" if fields else ""


def _learn(model: BaseAlgorithm, steps: int, callbacks: "_Together", where: str) -> None:
    try:
        model.learn(steps, callback=callbacks, reset_num_timesteps=False, tb_log_name=callbacks.watch.plan.algorithm)
    except KeyboardInterrupt:
        if not _has_diverged(model):
            callbacks.watch.keep(model)
        raise
    except (ConfigError, EmptyRolloutError) as error:  # what only a reset or a run finds to be impossible
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
        self, plan: TrainingPlan, folder: Path, report: Report, extra_observation: ExtraFunction | None
    ) -> None:
        super().__init__()
        self._extra_observation = extra_observation
        self.plan = plan
        self._folder = folder
        self._report = report
        self._started = Started.now()
        self._last_report = -math.inf
        self._next_evaluation = 0
        self.evaluations = read_evaluations(folder / EVALUATIONS_FILE)
        self._baselines = known_baselines(plan, self.evaluations[-1]) if self.evaluations else {}
        self._counted = {
            config.name: config.performance
            for sampler in (plan.sampler, *(stage.sampler for stage in plan.stages))
            for config in (() if sampler is None else sampler.ends)
        }
        last = self.evaluations[-1] if self.evaluations else None
        self._spent_s, self._spent_cpu_s = (0.0, 0.0) if last is None else (last.wall_time_s, last.cpu_time_s)

    def _spent(self) -> tuple[float, float]:
        """Time and processor time of the training so far, s."""
        wall_time_s, cpu_time_s = self._started.spent_s()
        return self._spent_s + wall_time_s, self._spent_cpu_s + cpu_time_s

    def keep(self, model: BaseAlgorithm) -> None:
        """Write a checkpoint, beside the plan that it is one of.

        Raises:
            ValueError: the training diverged; the checkpoint before stays.
        """
        if _has_diverged(model):
            raise ValueError("Expected weights that are finite numbers.")
        self._write_plan()
        with replacing(self._folder / MODEL_FILE) as draft:
            content = BytesIO()  # torch tells a full disk as an error of its own
            model.save(content)
            draft.write_bytes(content.getvalue())

    def lacks_evaluation(self, steps: int) -> bool:
        """Return whether an evaluation was due by so many decisions, and was not finished."""
        return lacks_evaluation(self.plan, self.evaluations, steps)

    def _write_plan(self) -> None:
        self._folder.mkdir(parents=True, exist_ok=True)
        self.plan.write(self._folder / PLAN_FILE)

    def _on_training_start(self) -> None:
        self._write_plan()  # not before arenas and model are known to be possible
        if self._next_evaluation > 0:
            return
        self._next_evaluation = self.num_timesteps + self.plan.evaluation.every_steps
        self._tell_settings()
        if self.lacks_evaluation(self.num_timesteps):
            self._evaluate()

    def _tell_settings(self) -> None:
        """Let TensorBoard show the settings beside the evaluations."""
        told = {name: value for name, value in self.plan.settings().items() if name.startswith(_TOLD)}
        plain = {name: value if isinstance(value, int | float | str) else str(value) for name, value in told.items()}
        measures: dict[str, float] = {"evaluation/performance": 0.0, "evaluation/interference_fraction": 0.0}
        self.logger.record("settings", HParam(plain, measures), exclude=_NO_LINE)

    def _on_step(self) -> bool:
        for row in np.flatnonzero(self.locals["dones"]):
            run = self.locals["infos"][row].get("run")
            if run is not None:
                name = run["scenario"]
                counted = run[self._counted.get(name, self.plan.scenario.performance)]
                of_world = f"/{name}" if self._counted else ""
                self.logger.record_mean(f"rollout/performance_per_1000_s{of_world}", 1000.0 * counted / run["seconds"])
        return True

    def _on_rollout_start(self) -> None:
        # Not at the end of a rollout, which has not taught anything yet.
        if self.num_timesteps >= self._next_evaluation:
            self._evaluate()

    def _on_rollout_end(self) -> None:
        elapsed, _ = self._spent()
        if elapsed - self._last_report >= _REPORT_EVERY_S:
            self._last_report = elapsed
            episodes = self.model.ep_info_buffer or ()
            mean = float(safe_mean([episode["r"] for episode in episodes]))
            self._report(TrainingStatus(steps=self.num_timesteps, wall_time_s=elapsed, episode_return=mean))

    def _on_training_end(self) -> None:
        if not self.evaluations or self.evaluations[-1].steps < self.num_timesteps:
            self._evaluate()
        self.logger.dump(self.num_timesteps)

    def _evaluate(self) -> None:
        """Keep a checkpoint, run the policy, and note how it did."""
        self._next_evaluation = self.num_timesteps + self.plan.evaluation.every_steps
        self.keep(self.model)
        evaluation = self._judged()
        for name in ("performance", "baseline", "interference_fraction"):
            self.logger.record(f"evaluation/{name}", getattr(evaluation, name))
        for world in evaluation.worlds:
            self.logger.record(f"evaluation/ratio/{world.world}", world.ratio)
        self.evaluations.append(evaluation)
        # The network before the table: a table must not boast of a network that is not there.
        if self.plan.algorithm in EXPORTABLE and chosen(self.evaluations) is evaluation:
            self._export(evaluation)
        write_evaluations(self._folder / EVALUATIONS_FILE, self.evaluations)
        self._report(evaluation)

    def _export(self, evaluation: Evaluation) -> None:
        plan = self.plan
        card = {
            "plan": plan.to_mapping(),
            "evaluation": evaluation.to_mapping(),
            "versions": {
                **software_versions(),
                "stable-baselines3": stable_baselines3.__version__,
                "torch": str(torch.__version__),
            },
        }
        network = self._network(card)
        network.save(self._folder / POLICY_FILE)

    def _network(self, card: dict[str, Any] | None = None) -> Network:
        plan = self.plan
        caches = plan.scenario.caches
        learnt = export_network(self.model, plan.interface, samples=plan.samples, caches=caches, card=card)
        return as_kept(learnt, plan)

    def _judged(self) -> Evaluation:
        """Run the policy in the worlds of the evaluation, beside the baselines."""
        plan = self.plan
        if not self._baselines:  # their runs are made once, by a resumed training, too
            self._baselines = baselines_of(plan)
        policy = replace(LEARNING, factory=self._policy)
        return evaluated(plan, policy, self._baselines, steps=self.num_timesteps, spent_s=self._spent)

    def _policy(self) -> Policy:
        """The policy as it is now, as its file will have it where it draws.

        One that draws its actions does so by the chance of its run, not of the training.
        """
        interface, extra = self.plan.run_interface, self._extra_observation
        if not self.plan.samples:
            return LearnedPolicy(interface, remember=model_choice(self.model, draws=False), extra_observation=extra)
        network = self._network()
        if extra is None:
            return NetworkPolicy(network)
        return LearnedPolicy(interface, network.choose, extra_observation=extra)


class _Together(CallbackList):
    """Our callback and those of the user, and whether one of them ended the training.

    Attributes:
        ended: A callback returned False; the library then leaves `learn` and tells nobody why.
    """

    def __init__(self, watch: _Watch, others: Sequence[BaseCallback] = ()) -> None:
        super().__init__([watch, *others])
        self.watch = watch
        self.ended = False

    def _on_step(self) -> bool:
        goes_on = super()._on_step()
        self.ended = self.ended or not goes_on
        return goes_on


def _keep_quiet(news: TrainingStatus | Evaluation) -> None:
    """Report to nobody."""
