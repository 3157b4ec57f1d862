"""What the folder of a training tells of how it went, readable without the library that trained.

`plan.json` holds the plan, `evaluations.csv` a row per evaluation.
"""

import csv
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.files import replacing
from swarm_forage_env.training.plan import TrainingPlan, read_plan
from swarm_forage_env.training.status import Evaluation

PLAN_FILE = "plan.json"
EVALUATIONS_FILE = "evaluations.csv"


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


def write_evaluations(path: Path, evaluations: Sequence[Evaluation]) -> None:
    """Write all evaluations of a training, whole or not at all."""
    with replacing(path) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, [item.name for item in fields(Evaluation)])
        table.writeheader()
        table.writerows(asdict(evaluation) for evaluation in evaluations)


def read_evaluations(path: Path) -> list[Evaluation]:
    """Return the evaluations of a file, none if there is no file.

    Raises:
        ConfigError: the file holds something else.
    """
    if not path.exists():
        return []
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]
        return [Evaluation(**{**row, "steps": int(row["steps"])}) for row in rows]
    except (ValueError, TypeError, KeyError, csv.Error) as error:
        raise ConfigError(f"Cannot read the evaluations in {path}: {error}; repair or remove the file.") from error
