"""What the folder of a training tells of how it went, readable without the library that trained.

`plan.json` holds the plan, `evaluations.csv` a row per evaluation, with several worlds a row for each of them and one
for all.
"""

import csv
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.files import replacing
from swarm_forage_env.training.evaluation_worlds import ALL_WORLDS
from swarm_forage_env.training.plan import TrainingPlan, read_plan
from swarm_forage_env.training.status import Evaluation, WorldEvaluation

PLAN_FILE = "plan.json"
EVALUATIONS_FILE = "evaluations.csv"
MODEL_FILE = "model.zip"
_TOLD_ONCE = ("steps", "wall_time_s")
"""Columns that are the same in the rows of all worlds of an evaluation."""
_COLUMNS = tuple(item.name for item in fields(Evaluation) if item.name != "worlds")
_WORLD_COLUMNS = (*_TOLD_ONCE, *(item.name for item in fields(WorldEvaluation)))
_WORDS = ("world", "baseline_policy")
"""Columns that hold no numbers."""


@dataclass(frozen=True, kw_only=True, slots=True)
class TrainingCurve:
    """How a training went."""

    label: str
    """Name of its folder."""
    plan: TrainingPlan
    evaluations: tuple[Evaluation, ...]
    """At least one, oldest first."""


def read_training(folder: Path) -> TrainingCurve:
    """Return how the training of a folder went.

    Raises:
        ConfigError: there is no training in the folder, it has not been evaluated yet, or a file is damaged.
    """
    if not (folder / PLAN_FILE).exists():
        raise ConfigError(f"Expected the folder of a training, got {folder} without {PLAN_FILE}.")
    evaluations = read_evaluations(folder / EVALUATIONS_FILE)
    if not evaluations:
        raise ConfigError(f"Expected a training with evaluations, got {folder} without any in {EVALUATIONS_FILE}.")
    return TrainingCurve(
        label=folder.resolve().name, plan=read_plan(folder / PLAN_FILE), evaluations=tuple(evaluations)
    )


def kept_plan(folder: Path) -> TrainingPlan:
    """Return the plan of the training that a folder holds.

    Raises:
        ConfigError: it does not hold a training that can be resumed.
    """
    for name in (PLAN_FILE, MODEL_FILE):
        if not (folder / name).exists():
            raise ConfigError(
                f"Expected {folder} to hold a training to resume, {PLAN_FILE} and the checkpoint {MODEL_FILE}, found "
                f"no {name}; without resume a new one starts."
            )
    return read_plan(folder / PLAN_FILE)


def resumed_plan(folder: Path, described: TrainingPlan | None = None, steps: int | None = None) -> TrainingPlan:
    """Return the plan of the training in a folder, to resume it; `steps` can make it longer.

    Args:
        folder: Folder of the training.
        described: Plan that must agree with it but for the number of steps; None if there is none.
        steps: Decisions in all; None = those of the plan.

    Raises:
        ConfigError: no training in the folder, options that differ from its plan, or fewer steps.
    """
    kept = kept_plan(folder)
    plan = kept if steps is None else kept.longer(steps)
    if described is not None:
        begun, wanted = ([(stage.scenario, stage.options) for stage in each.stages] for each in (kept, described))
        # The options would divide the steps into other stages; a training keeps its own stages.
        wanted_plan = replace(described, stages=plan.stages) if begun == wanted else described
        differences = wanted_plan.differences(kept)
        if differences:
            raise ConfigError(
                f"Expected options that agree with {folder / PLAN_FILE}, got others: {'; '.join(differences)}. "
                "Without options but --out and --steps, --resume goes on by that plan."
            )
    return plan


def write_evaluations(path: Path, evaluations: Sequence[Evaluation]) -> None:
    """Write all evaluations of a training, whole or not at all.

    Where there are several worlds, an evaluation has a row for each and one for "all" of them, in which performance is
    the ratio that counts; see `evaluation_worlds`.
    """
    in_worlds = any(evaluation.worlds for evaluation in evaluations)
    with replacing(path) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, _WORLD_COLUMNS if in_worlds else _COLUMNS, restval="")
        table.writeheader()
        for evaluation in evaluations:
            plain = {name: getattr(evaluation, name) for name in _COLUMNS}
            if in_worlds:
                told = {name: plain[name] for name in _TOLD_ONCE}
                table.writerows({**told, **asdict(world)} for world in evaluation.worlds)
                plain |= {"world": ALL_WORLDS, "ratio": evaluation.performance}
            table.writerow(plain)


def read_evaluations(path: Path) -> list[Evaluation]:
    """Return the evaluations of a file, none if there is no file.

    Raises:
        ConfigError: the file holds something else.
    """
    if not path.exists():
        return []
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return _evaluations_of(csv.DictReader(file))
    except (ValueError, TypeError, KeyError, csv.Error) as error:
        raise ConfigError(f"Cannot read the evaluations in {path}: {error}; repair or remove the file.") from error


def _evaluations_of(rows: Iterable[dict[str, str]]) -> list[Evaluation]:
    found: list[Evaluation] = []
    worlds: list[WorldEvaluation] = []
    for row in rows:
        words = {name: row.pop(name) for name in _WORDS if name in row}
        if words.get("world", ALL_WORLDS) != ALL_WORLDS:
            told: dict[str, Any] = {name: float(text) for name, text in row.items() if name not in _TOLD_ONCE}
            worlds.append(WorldEvaluation(**{**told, **words}))
            continue
        if words:
            del row["ratio"]  # of all worlds: it is the performance
        numbers = {name: float(text) for name, text in row.items()}
        found.append(Evaluation(**{**numbers, "steps": int(numbers["steps"]), "worlds": tuple(worlds)}))  # type: ignore[arg-type] - worlds are the only tuple
        worlds = []
    return found
