"""Training one plan with several seeds: one after the other, or several at once in processes of their own.

    train_seeds(recipe("warehouse_small"), range(5), Path("results/training/five"))

Every training has its own process, unless only one runs at a time: so one that fails, or is killed, ends no other one.
"""

import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from swarm_forage_env._internal.faults import in_words
from swarm_forage_env._internal.fields import ConfigError, Several, checked, whole
from swarm_forage_env._internal.files import alone_in, check_folder
from swarm_forage_env.policies import trust
from swarm_forage_env.runs.run import warm_up
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.runs.workers import (
    WAKE_UP_EVERY_S,
    deaf_children,
    live_with_driver,
    processes_of,
    single_threaded_children,
)
from swarm_forage_env.training.evaluations import MODEL_FILE, PLAN_FILE, Evaluation, TrainingStatus
from swarm_forage_env.training.plan import TrainingPlan, read_plan
from swarm_forage_env.training.sb3.training import check_place, check_plan, train
from swarm_forage_env.training.seeds import SeedTrainings, TrainingFailure, is_finished, read_seeds, seed_folder

KEEP_S = 20.0
"""How long an interrupted training may take to keep a checkpoint, before it is killed; our choice."""

News: TypeAlias = TrainingStatus | Evaluation | TrainingFailure
SeedReport: TypeAlias = Callable[[int, News], None]
_JobReport: TypeAlias = Callable[[News], None]


class _Job(NamedTuple):
    """A training that is to be made, or resumed."""

    plan: TrainingPlan
    folder: Path
    resume: bool


def train_seeds(
    plan: TrainingPlan,
    seeds: Sequence[int],
    folder: Path,
    *,
    jobs: int | None = None,
    resume: bool = False,
    report: SeedReport | None = None,
) -> SeedTrainings:
    """Train one plan with several seeds, each as `train` does.

    Ctrl-C keeps checkpoints before it goes on its way. A training that fails ends no other one.

    Args:
        plan: What to do; its own seed does not count.
        seeds: Seeds of the trainings.
        folder: Where `plan.json` and the folders of the trainings go, `seed_0` and so on.
        jobs: Trainings at a time, each in a process of its own; default one per usable core; 1 = in this process, one
            after the other. A script must start processes under `if __name__ == "__main__":`.
        resume: Leave finished trainings as they are, go on with others from their checkpoints, and begin the rest.
        report: Told the seed with the status of its training about once a second, every evaluation, and failures.

    Raises:
        ConfigError: jobs below 1; no seeds, or equal ones; what `train` refuses before it begins, for any of the seeds;
            or another call that trains in the folder.
    """
    if jobs is not None:
        jobs = whole("jobs (or None)", jobs, at_least=1)
    checked("seeds", tuple(seeds), Several)
    if len(set(seeds)) < len(seeds):
        raise ConfigError(f"Expected different seeds, got {', '.join(map(str, seeds))}.")
    check_plan(plan)
    check_folder(folder)
    failures: dict[int, str] = {}

    def told(seed: int, news: News) -> None:
        if isinstance(news, TrainingFailure):
            failures[seed] = news.reason
        if report is not None:
            report(seed, news)

    with alone_in(folder, ConfigError):
        _check_shared(folder, plan)
        todo = _todo(plan, seeds, folder, resume)
        plan.write(folder / PLAN_FILE)
        n_processes = processes_of(len(todo), jobs)
        if n_processes == 1:
            for job in todo:
                _train(job, partial(told, job.plan.seed))
        else:
            one_interval = replace(plan.scenario, horizon_s=plan.scenario.interval_s)
            warm_up(plan_run(one_interval, "random"))  # compiles the world before several processes do so at once
            _train_apart(todo, n_processes, told)
        return read_seeds(plan, folder, seeds, failures)


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


def _todo(plan: TrainingPlan, seeds: Sequence[int], folder: Path, resume: bool) -> list[_Job]:
    """Return the trainings that are not finished; raises ConfigError if one of them cannot begin."""
    todo: list[_Job] = []
    for seed in seeds:
        job = _Job(replace(plan, seed=seed), seed_folder(folder, seed), resume)
        if resume and not (job.folder / MODEL_FILE).exists():  # it had nothing to keep yet
            job = job._replace(resume=False)
        check_place(job.folder, job.plan, resume=job.resume)
        if job.resume and is_finished(job.plan, job.folder):
            continue
        if job.resume:
            trust.check(job.folder / MODEL_FILE)
        todo.append(job)
    return todo


def _train(job: _Job, report: _JobReport) -> None:
    """Train, and report a failure instead of raising it."""
    try:
        train(job.plan, job.folder, resume=job.resume, report=report)
    except Exception as error:  # noqa: BLE001 - whatever a training raises is its failure
        report(TrainingFailure(" ".join(str(error).split()) if isinstance(error, ConfigError) else in_words(error)))


def _train_apart(todo: Sequence[_Job], n_processes: int, report: SeedReport) -> None:
    """Train several at a time, each in a process of its own, which tells at last that it has ended: None."""
    waiting = deque(todo)
    running: dict[Any, tuple[int, BaseProcess]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < n_processes:
                job = waiting.popleft()
                connection, process = _started(job)
                running[connection] = job.plan.seed, process
            for connection in wait([*running], WAKE_UP_EVERY_S):
                seed, process = running[connection]
                news, has_ended = _heard(connection, process)
                if news is not None:
                    report(seed, news)
                if has_ended:
                    del running[connection]
                    process.join()
    except BaseException:
        _stop([process for _, process in running.values()])
        raise


def _heard(connection: Any, process: BaseProcess) -> tuple[News | None, bool]:
    """Return what a process tells, and whether it tells nothing more."""
    try:
        news = connection.recv()
    except (EOFError, OSError):
        process.join()
        return TrainingFailure(_how_it_ended(process.exitcode or 0)), True
    return news, news is None


def _how_it_ended(code: int) -> str:
    """Say how a process ended that did not say it itself, and what to do."""
    if code == -getattr(signal, "SIGKILL", 9):  # Windows has none
        return (
            "its process was killed, most likely because memory ran out; try fewer trainings at a time (--jobs 1), "
            "then --resume (with --trust-models)"
        )
    how = f"exit code {code}" if code >= 0 else f"signal {-code}"
    return f"its process ended with {how} before the training was over; --resume (with --trust-models) goes on with it"


def _started(job: _Job) -> tuple[Any, BaseProcess]:
    """Start the process of a training; returns what it tells through."""
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_train_here, args=(job, theirs), name=job.folder.name)
    with single_threaded_children(), deaf_children():
        process.start()
    theirs.close()
    return ours, process


def _train_here(job: _Job, driver: Connection) -> None:
    """Train in a process of its own. SIGTERM interrupts the training, which keeps a checkpoint."""
    signal.signal(signal.SIGTERM, _interrupt)
    live_with_driver()
    try:
        _train(job, driver.send)
        driver.send(None)
    except KeyboardInterrupt:
        sys.exit(128 + signal.SIGTERM)


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
