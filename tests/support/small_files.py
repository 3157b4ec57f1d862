"""One small file of each format, made once in a process and removed at its end."""

import atexit
import shutil
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

from metrics.benchmark import load_protocol
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.runs.store import RunFailure, failure_file, store
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.studies.results import pack_study, run_study
from swarm_forage_env.studies.study_file import Axis
from swarm_forage_env.training.datasets import record_dataset
from swarm_forage_env.training.evaluation import (
    EVALUATIONS_FILE,
    MODEL_FILE,
    PLAN_FILE,
    Evaluation,
    WorldEvaluation,
    write_evaluations,
)
from swarm_forage_env.training.plan import TrainingPlan
from swarm_forage_env.training.recipe import recipe
from tests.support.entries import TINY, made_up_entry
from tests.support.networks import network_of
from tests.support.tiny_study import tiny_study

SPEC = plan_run(scenario("warehouse_small", n_robots=2, n_objects=10, horizon_s=4.0, interval_s=2.0), "dpo", seed=1)
INTERFACE = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True)


def _failure(file: Path) -> None:
    folder = file.parent / "of_failures"
    store(folder, RunFailure(spec=SPEC, error="ValueError: too warm", traceback="ValueError: too warm"))
    shutil.move(failure_file(folder, SPEC.run_id), file)


def _packed(file: Path) -> None:
    folder = file.parent / "of_study"
    run_study(tiny_study(Axis(name="n_robots", values=(2,))), folder, jobs=1)
    pack_study(folder, file)


def evaluated(steps: int, reached: float, interference: float = 0.25, *, world: str = "small") -> Evaluation:
    """An evaluation of a training in one world, whose baseline reaches 5."""
    told = WorldEvaluation(
        world=world,
        baseline_policy="random",
        performance=reached,
        baseline=5.0,
        ratio=reached / 5.0,
        interference_fraction=interference,
    )
    return Evaluation(steps=steps, wall_time_s=1.0, cpu_time_s=60.0, reached=reached, worlds=(told,))


def trained(folder: Path, plan: TrainingPlan, *evaluations: Evaluation) -> None:
    """Write a folder as a training leaves it, with an empty model."""
    folder.mkdir(parents=True, exist_ok=True)
    plan.write(folder / PLAN_FILE)
    (folder / MODEL_FILE).touch()
    write_evaluations(folder / EVALUATIONS_FILE, evaluations)


MAKERS: dict[str, Callable[[Path], object]] = {
    "record.parquet": lambda file: run_one(SPEC).write(file),
    "packed.parquet": _packed,
    "failure.json": _failure,
    "dataset": lambda folder: record_dataset(SPEC, (1,), folder),
    "entry.json": lambda file: made_up_entry(load_protocol(TINY), "mine", lambda k: 10.0 * k).write(file),
    "network.npz": lambda file: network_of(INTERFACE).save(file),
    "plan.json": lambda file: recipe().write(file),
    "evaluations.csv": lambda file: write_evaluations(file, [evaluated(384, 1.5)]),
}
"""Name of a file, or of the folder of a data set -> what writes it. The entry is one of `entries.TINY`."""


@cache
def small_file(name: str) -> Path:
    """Return the file of that name; whoever changes it works on a copy."""
    file = _folder() / name
    MAKERS[name](file)
    return file


@cache
def _folder() -> Path:
    folder = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder
