"""Training one plan with several seeds, several at once.

    train_seeds(recipe("warehouse_small"), range(5), Path("results/training/five"))

Every training has a process of its own, so one that fails, or is killed, ends no other one.
"""

import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, TypeAlias

from swarm_forage_env._internal.faults import in_words
from swarm_forage_env._internal.fields import ConfigError, Count, checked
from swarm_forage_env._internal.files import alone_in, check_folder
from swarm_forage_env.policies import trust
from swarm_forage_env.runs.workers import (
    WAKE_UP_EVERY_S,
    deaf_children,
    live_with_driver,
    processes_of,
    scriptless_children,
    single_threaded_children,
)
from swarm_forage_env.training.curves import Trainings, beside_baseline, read_training
from swarm_forage_env.training.evaluation import EVALUATIONS_FILE, MODEL_FILE, PLAN_FILE, Evaluation
from swarm_forage_env.training.plan import TrainingPlan, read_plan
from swarm_forage_env.training.sb3.training import TrainingStatus, check_place, check_plan, train

KEEP_S = 20.0
"""How long an interrupted training may take to keep a checkpoint, before it is killed; our choice."""

SeedReport: TypeAlias = Callable[[int, TrainingStatus | Evaluation | str], None]
"""Told a seed, and the status of its training, an evaluation, or why it failed."""
_Job: TypeAlias = tuple[TrainingPlan, Path, bool]
"""A training, its folder, and whether it goes on from its checkpoint."""


def seed_folder(folder: Path, seed: int) -> Path:
    """Return the folder of the training with a seed."""
    return folder / f"seed_{seed}"


def train_seeds(
    plan: TrainingPlan,
    seeds: Sequence[int],
    folder: Path,
    *,
    jobs: int | None = None,
    resume: bool = False,
    report: SeedReport | None = None,
) -> Trainings:
    """Train one plan with several seeds, each as `train` does.

    Ctrl-C keeps checkpoints before it goes on its way. A training that fails ends no other one.

    Args:
        plan: What to do; its own seed does not count.
        seeds: Seeds of the trainings.
        folder: Where `plan.json` and the folders of the trainings go, `seed_0` and so on.
        jobs: Trainings at a time; default one per usable core. A script must start them under
            `if __name__ == "__main__":`.
        resume: Leave finished trainings as they are, go on with others from their checkpoints, and begin the rest.
        report: Told the seed with the status of its training about once a second, every evaluation, and failures.

    Raises:
        ConfigError: jobs below 1; no seeds, or equal ones; what `train` refuses before it begins, for any of the seeds;
            or another call that trains in the folder.
    """
    seeds = checked("seeds", tuple(seeds), tuple[Count, ...])
    if not seeds or len(set(seeds)) < len(seeds):
        raise ConfigError(f"Expected one or more different seeds, got {', '.join(map(str, seeds)) or 'none'}.")
    n_processes = processes_of(len(seeds), jobs)
    check_plan(plan)
    check_folder(folder)
    failures: dict[str, str] = {}

    def told(seed: int, news: TrainingStatus | Evaluation | str) -> None:
        if isinstance(news, str):
            failures[seed_folder(folder, seed).name] = news
        if report is not None:
            report(seed, news)

    with alone_in(folder, ConfigError):
        _check_shared(folder, plan)
        todo = [job for seed in seeds if (job := _job(replace(plan, seed=seed), folder, resume)) is not None]
        plan.write(folder / PLAN_FILE)
        _train_all(todo, n_processes, told)
        places = [seed_folder(folder, seed) for seed in seeds]
        begun = [read_training(place) for place in places if (place / EVALUATIONS_FILE).exists()]
        return beside_baseline(begun, failures)


def is_finished(folder: Path) -> bool:
    """Return whether a folder holds a whole training."""
    return (folder / EVALUATIONS_FILE).exists() and read_training(folder).is_finished


def _check_shared(folder: Path, plan: TrainingPlan) -> None:
    """Refuse a folder of one training, or of trainings by another plan."""
    if (folder / MODEL_FILE).exists():
        raise ConfigError(
            f"Expected a folder for several trainings, got {folder}, which is that of one; choose another (--out)."
        )
    if (folder / PLAN_FILE).exists():
        before = read_plan(folder / PLAN_FILE)
        differences = replace(plan, seed=before.seed).differences(before)
        if differences:
            raise ConfigError(
                f"Expected the plan in {folder / PLAN_FILE} for further trainings there, got another plan: "
                f"{'; '.join(differences)}. Choose another folder (--out)."
            )


def _job(plan: TrainingPlan, folder: Path, resume: bool) -> _Job | None:
    """Return what is to be done for a seed, None where all is; raises ConfigError if it cannot begin."""
    place = seed_folder(folder, plan.seed)
    resume = resume and (place / MODEL_FILE).exists()  # else it had nothing to keep yet
    check_place(place, plan, resume=resume)
    if resume:
        if is_finished(place) and read_plan(place / PLAN_FILE) == plan:
            return None
        trust.check(place / MODEL_FILE)
    return plan, place, resume


def _train_all(todo: Sequence[_Job], n_processes: int, report: SeedReport) -> None:
    """Train so many at a time, each in a process that closes its connection at the end."""
    waiting, running = deque(todo), dict[Any, tuple[int, BaseProcess]]()
    try:
        while waiting or running:
            while waiting and len(running) < n_processes:
                connection, process = _started(waiting[0])
                running[connection] = waiting.popleft()[0].seed, process
            for connection in wait([*running], WAKE_UP_EVERY_S):
                seed, process = running[connection]
                try:
                    report(seed, connection.recv())  # type: ignore[union-attr] - it is one of ours
                except (EOFError, OSError):
                    process.join()
                    del running[connection]
                    if process.exitcode:
                        report(seed, _how_it_ended(process.exitcode))
    except BaseException:
        _stop([process for _, process in running.values()])
        raise


def _how_it_ended(code: int) -> str:
    """Say how a process ended that failed without a word, and what to do."""
    how = f"its process ended with {f'exit code {code}' if code >= 0 else f'signal {-code}'}"
    if code == -getattr(signal, "SIGKILL", 9):  # Windows has none
        how = "its process was killed, most likely because memory ran out; try fewer at a time (--jobs 1)"
    return f"{how}; --resume (with --trust-models) goes on with it"


def _started(job: _Job) -> tuple[Connection, BaseProcess]:
    """Start the process of a training; returns what it tells through."""
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_train_here, args=(job, theirs), name=job[1].name)
    with single_threaded_children(), deaf_children(), scriptless_children(map(type, job[0].world.wrappers)):
        process.start()
    theirs.close()
    return ours, process


def _train_here(job: _Job, driver: Connection) -> None:
    """Train in a process of its own. SIGTERM interrupts the training, which keeps a checkpoint."""
    signal.signal(signal.SIGTERM, _interrupt)
    live_with_driver()
    plan, folder, resume = job
    try:
        train(plan, folder, resume=resume, report=driver.send)
    except KeyboardInterrupt:
        sys.exit(128 + signal.SIGTERM)
    except Exception as error:  # noqa: BLE001 - whatever a training raises is its failure
        driver.send(" ".join(str(error).split()) if isinstance(error, ConfigError) else in_words(error))


def _interrupt(*_: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # once is enough: a checkpoint is kept now
    raise KeyboardInterrupt


def _stop(processes: Sequence[BaseProcess]) -> None:
    """Let trainings keep checkpoints, and end those that do not."""
    for process in processes:
        process.terminate()
    until = time.monotonic() + KEEP_S
    for process in processes:
        process.join(max(0.0, until - time.monotonic()))
        process.kill()
        process.join()
