"""Who makes runs: this process, a pool of local processes, or an executor of the caller, such as Dask's.

Workers need no shared disk, because records are sent back. A run that fails, or kills its worker, ends no other one.
"""

import os
import signal
import threading
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, TypeAlias, TypeVar

from swarm_forage_env._internal.compiling import is_kept, tell_of_first_run
from swarm_forage_env._internal.fields import as_whole
from swarm_forage_env._internal.files import check_folder
from swarm_forage_env.policies import trust
from swarm_forage_env.policies.registry import file_of, is_policy_file
from swarm_forage_env.runs.record import RecordError, RunRecord
from swarm_forage_env.runs.run import run_one, warm_up
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import RunFailure, RunStore
from swarm_forage_env.world.kernels.tick import observe

Outcome: TypeAlias = RunRecord | RunFailure
Result = TypeVar("Result")
Tell: TypeAlias = Callable[[int, int], None]
"""Called with how much of a run is done, and of how much."""
Task: TypeAlias = tuple[RunSpec, ...]
"""Runs that an executor gets together."""

THREAD_SETTINGS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
    "POLARS_MAX_THREADS",
)
"""Environment variables set to 1 for workers: runs are parallel, the libraries inside a run are not."""
QUEUED_PER_WORKER = 2
"""Runs given to the pool per worker: enough that no worker waits, few enough that a crash loses little."""
BATCH_ROBOT_TICKS = 20_000_000
"""How much an executor of several machines gets as one task: ten seconds or more, much longer than sending it takes."""
QUEUED_ELSEWHERE = 4096
"""Tasks given to the executor of the caller at a time: enough for the workers that may join it, few enough to watch."""
WAKE_UP_EVERY_S = 0.5
"""The driver never sleeps longer, because with the signal handler of a library (polars) Ctrl-C may not end a sleep."""
KILLED = (
    "The worker process that made the run was killed, most likely because memory ran out; try fewer processes at a "
    "time (--jobs 1), or a smaller run."
)
"""What is said of a run whose worker died: the system gives no reason."""


class WorkerError(RuntimeError):
    """Worker processes could not be started at all, or an executor ended before its work was done."""


def run_each(
    specs: Iterable[RunSpec],
    *,
    store: RunStore | None = None,
    executor: Executor | None = None,
    jobs: int | None = None,
) -> Generator[Outcome]:
    """Run specifications and yield each outcome as it finishes, already stored.

    It also runs what is stored already. Closing the iterator, also by Ctrl-C, cancels the runs that have not finished.

    Args:
        specs: What to run. Neighbours that differ in the seed alone go to `executor` as one task.
        store: Where records and failures go.
        executor: Runs the work; default a pool of local processes.
        jobs: Processes of the default pool, default one per available core; 1 = in this process.

    Raises:
        OSError: the store cannot be written to; then nothing has been run.
        WorkerError: no worker process could be started, or `executor` ended before all runs were done.
    """
    todo = deque((spec,) for spec in specs)
    if store is not None and todo:
        check_folder(store.folder)
    if jobs is not None:
        jobs = as_whole("jobs", jobs, at_least=1, or_none=True)
    if executor is not None:
        outcomes = _run_elsewhere(executor, _batches(todo, BATCH_ROBOT_TICKS))
    elif jobs == 1 or len(todo) <= 1:
        outcomes = _run_here(todo)
    else:
        outcomes = _run_in_pool(todo, processes_of(len(todo), jobs))
    return _stored(outcomes, store)


def map_runs(
    do: Callable[[RunSpec, Tell | None], Result],
    specs: Sequence[RunSpec],
    *,
    jobs: int | None = 1,
    advance: Callable[[float], None] | None = None,
) -> Generator[Result]:
    """Yield what a function makes of each run, in their order; it is for what is more than a record.

    Args:
        do: Makes one run. It is told how to say how far it is, or None. Other processes must find it by its name.
        specs: The runs.
        jobs: Processes, None = one per available core; 1 = in this process.
        advance: Called with the robot-ticks that are done.

    Raises:
        ConfigError: `jobs` is no number of processes.
        WorkerError: worker processes could not be started, or one was killed.
        UntrustedModelError: see `policies.trust`.
        Exception: whatever the function raises.
    """
    if jobs is not None:
        jobs = as_whole("jobs", jobs, at_least=1, or_none=True)
    done = 0.0
    if (n_workers := processes_of(len(specs), jobs)) == 1:
        for spec in specs:
            yield do(spec, None if advance is None else partial(_advance, advance, done, spec.robot_ticks))
            done += spec.robot_ticks
        return
    for file in {file_of(spec.policy) for spec in specs if is_policy_file(spec.policy)}:
        trust.check(file)  # workers know nothing of what the user of a command allows
    with _process_pool(n_workers) as pool:
        _check_workers_start(pool)
        _warm_up_workers(pool, specs)
        for spec, future in [(spec, pool.submit(do, spec, None)) for spec in specs]:
            if _is_broken_by(future):
                raise WorkerError(KILLED)
            yield future.result()
            done += spec.robot_ticks
            if advance is not None:
                advance(done)


def _advance(advance: Callable[[float], None], before: float, robot_ticks: int, tick: int, end: int) -> None:
    advance(before + robot_ticks * tick / end)


def _stored(outcomes: Generator[Outcome], store: RunStore | None) -> Generator[Outcome]:
    """Yield outcomes after they are stored."""
    with closing(outcomes):
        for outcome in outcomes:
            if store is not None:
                if isinstance(outcome, RunRecord):
                    try:
                        store.write(outcome)
                    except RecordError as error:  # too large to be read again; the other runs go on
                        outcome = _failure(RunSpec.from_json(outcome.spec), error)
                if not isinstance(outcome, RunRecord):
                    store.write_failure(outcome)
            yield outcome


def available_cores() -> int:
    """Return the number of cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def processes_of(n_runs: int, jobs: int | None) -> int:
    """Return how many local processes make so many runs, if `jobs` are asked for; None = one per available core."""
    return min(jobs or available_cores(), max(1, n_runs))


def run_several(specs: Task) -> tuple[Outcome, ...]:
    """Run specifications one after the other; a run that fails does not end the others."""
    outcomes: list[Outcome] = []
    for spec in specs:
        try:
            outcomes.append(run_one(spec))
        except Exception as error:  # noqa: BLE001 - whatever a run raises is its failure
            outcomes.append(_failure(spec, error))
    return tuple(outcomes)


def _run_on(executor: Executor, todo: deque[Task], *, limit: int) -> Generator[Outcome]:
    """Run `todo` with at most `limit` tasks submitted at a time; if the executor breaks, stop and leave the rest.

    Runs that were submitted when it broke are failures. If a task of several runs fails as a whole, they are tried
    again one by one, so that only those fail that kill their worker. Tasks that the executor cancels, because it ends,
    are in `todo` again at the end.
    """
    running: dict[Future[Any], Task] = {}
    cancelled: list[Task] = []
    broken = False
    try:
        while running or (todo and not broken):
            while todo and not broken and len(running) < limit:
                try:
                    running[_submitted(executor, todo[0])] = todo[0]
                    todo.popleft()
                except BrokenExecutor:
                    broken = True
            finished, _ = wait(running, timeout=WAKE_UP_EVERY_S, return_when=FIRST_COMPLETED)
            for future in finished:
                task = running.pop(future)
                if future.cancelled():
                    cancelled.append(task)
                    continue
                error = future.exception()
                broken = broken or isinstance(error, BrokenExecutor)
                if error is None:
                    yield from future.result() if len(task) > 1 else (future.result(),)
                elif len(task) > 1 and not broken:
                    todo.extend((spec,) for spec in task)
                else:
                    yield from (_failure(spec, error) for spec in task)
    finally:
        for future in running:
            future.cancel()
    todo.extend(cancelled)


def _submitted(executor: Executor, task: Task) -> Future[Any]:
    return executor.submit(run_one, task[0]) if len(task) == 1 else executor.submit(run_several, task)


def _run_here(todo: deque[Task]) -> Generator[Outcome]:
    """Run `todo` in this process."""
    yield from _run_on(_InProcess(), todo, limit=1)


def _batches(tasks: deque[Task], robot_ticks: int) -> deque[Task]:
    """Join neighbours that differ in the seed alone, until a task has so many robot-ticks."""
    joined: deque[Task] = deque()
    size = 0
    for task in tasks:
        last = joined[-1] if joined else ()
        if last and size < robot_ticks and replace(task[0], seed=last[0].seed) == last[0]:
            joined[-1] = (*last, *task)
            size += task[0].robot_ticks
        else:
            joined.append(task)
            size = task[0].robot_ticks
    return joined


def _run_elsewhere(executor: Executor, todo: deque[Task]) -> Generator[Outcome]:
    """Run `todo` on the executor of the caller, which is not replaced if it breaks."""
    yield from _run_on(executor, todo, limit=min(QUEUED_ELSEWHERE, max(1, len(todo))))
    if todo:
        n_left = sum(len(task) for task in todo)
        left = "1 run is" if n_left == 1 else f"{n_left} runs are"
        raise WorkerError(f"The executor broke, or cancelled runs: {left} not done. Run them again on a new one.")


def _failure(spec: RunSpec, error: BaseException) -> RunFailure:
    reason = str(error).splitlines()
    kind = MemoryError if isinstance(error, MemoryError) else type(error)  # numpy has a kind of its own
    told = f"{kind.__name__}: {reason[0] if reason else 'no message'}"
    if isinstance(error, BrokenExecutor):
        told = f"{type(error).__name__}: {KILLED}"
    return RunFailure(
        spec=spec,
        error=told,
        traceback="".join(traceback.format_exception(error)).rstrip(),
    )


class _InProcess(Executor):
    """Runs submitted calls at once, in this process. Ctrl-C passes through; other errors go into the future."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Make the call and return a finished future."""
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:  # noqa: BLE001 - an executor hands on whatever the call raises
            future.set_exception(error)
        return future


def _run_in_pool(todo: deque[Task], n_workers: int) -> Generator[Outcome]:
    """Run `todo` in local processes. If one is killed, the runs that are under way fail, and no other is begun."""
    with _process_pool(n_workers) as pool:
        _check_workers_start(pool)
        _warm_up_workers(pool, [spec for task in todo for spec in task])
        yield from _run_on(pool, todo, limit=QUEUED_PER_WORKER * n_workers)
    if todo:
        raise WorkerError(KILLED)


def _check_workers_start(pool: Executor) -> None:
    if _is_broken_by(pool.submit(os.getpid)):
        raise WorkerError(
            "Worker processes could not be started. A script that starts runs must do so under "
            "`if __name__ == '__main__':`; jobs=1 runs everything in this process."
        )


def _warm_up_workers(pool: Executor, specs: Iterable[RunSpec]) -> None:
    """Have one run of each kind compile and cache its kernels before many processes need them.

    What a run raises is ignored here: it raises it again later, and it is recorded then.

    Raises:
        WorkerError: a worker was killed.
    """
    kinds = tuple({_kernel_kind(spec): spec for spec in specs}.values())
    if not is_kept(observe):
        tell_of_first_run()  # workers have nobody to tell
    for spec in kinds:
        if _is_broken_by(pool.submit(warm_up, spec)):
            raise WorkerError(KILLED)


def _is_broken_by(future: Future[Any]) -> bool:
    """Wait for a task, and say whether the worker that did it died."""
    while not future.done():
        wait((future,), timeout=WAKE_UP_EVERY_S)
    return isinstance(future.exception(), BrokenExecutor)


def _kernel_kind(spec: RunSpec) -> tuple[Any, ...]:
    """Runs of one kind use the same kernels."""
    world = spec.scenario
    return spec.policy, world.caches, world.physics, tuple(config.name for config in spec.wrappers)


class _Pool(ProcessPoolExecutor):
    """A process pool whose workers never see Ctrl-C, not even while they start; only the driver handles it."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Submit, which may start a worker."""
        with deaf_children():
            return super().submit(fn, *args, **kwargs)


@contextmanager
def deaf_children() -> Iterator[None]:
    """Processes started inside this context never see Ctrl-C: they inherit that SIGINT is blocked."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows: they have to ignore it themselves
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _process_pool(n_workers: int) -> Iterator[ProcessPoolExecutor]:
    """A pool of spawned, single-threaded processes that exit at once when the driver stops or dies."""
    context = get_context("spawn")
    lifeline, held_by_driver = context.Pipe(duplex=False)
    with single_threaded_children():
        pool = _Pool(n_workers, mp_context=context, initializer=live_with_driver, initargs=(lifeline,))
        try:
            yield pool
        except BaseException:
            held_by_driver.close()  # workers see the end of the lifeline and exit in the middle of their runs
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        pool.shutdown()
        held_by_driver.close()
        lifeline.close()


def live_with_driver(lifeline: Connection) -> None:
    """Prepare a process that a driver has started: it ignores Ctrl-C, and exits when the driver is gone.

    Args:
        lifeline: Its other end is the driver's, who sends nothing.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_leave_at_end_of, args=(lifeline,), daemon=True).start()


def _leave_at_end_of(lifeline: Connection) -> None:
    try:
        lifeline.recv()
    except (EOFError, OSError):
        os._exit(1)


@contextmanager
def single_threaded_children() -> Iterator[None]:
    """Processes started inside this context use one thread each; libraries read the settings at import."""
    before = {name: os.environ.get(name) for name in THREAD_SETTINGS}
    os.environ.update(dict.fromkeys(THREAD_SETTINGS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
