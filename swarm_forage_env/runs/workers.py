"""Who makes runs: this process, a pool of local processes, or an executor of the caller, such as Dask's.

Workers need no shared disk, because results are sent back.
"""

import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager, nullcontext, suppress
from itertools import islice
from multiprocessing import get_context, parent_process
from queue import Empty, SimpleQueue
from typing import TypeVar

from swarm_forage_env._internal.compiling import is_kept, tell_of_first_run
from swarm_forage_env._internal.fields import whole
from swarm_forage_env.policies import trust
from swarm_forage_env.policies.registry import file_of, is_policy_file
from swarm_forage_env.runs.run import warm_up
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.world.kernels.tick import observe

Result = TypeVar("Result")

THREAD_SETTINGS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
    "POLARS_MAX_THREADS",
)
"""Environment variables set to 1 for workers: runs are parallel, the libraries inside a run are not."""
AT_A_TIME = 4096
"""Runs given to an executor at a time: enough for the workers that may join it, few enough to watch."""
WAKE_UP_EVERY_S = 0.5
"""The driver never sleeps longer, because with the signal handler of a library (polars) Ctrl-C may not end a sleep."""


class WorkerError(RuntimeError):
    """A worker process was killed or could not be started, or an executor ended before its work was done."""

    def __init__(
        self,
        message: str = "A worker process was killed, most likely because memory ran out: the same call makes what is "
        "missing, with fewer processes at a time (--jobs 1) or smaller runs. A script with wrappers of its "
        "own must start runs under `if __name__ == '__main__':`.",
    ) -> None:
        super().__init__(message)


def available_cores() -> int:
    """Return the number of cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def processes_of(n_runs: int, jobs: int | None) -> int:
    """Return how many local processes make so many runs, if `jobs` are asked for; None = one per available core.

    Raises:
        ConfigError: `jobs` is no number of processes.
    """
    if jobs is not None:
        whole("jobs", jobs, at_least=1)
    return min(jobs or available_cores(), max(1, n_runs))


def each_run(
    do: Callable[[RunSpec], Result],
    specs: Sequence[RunSpec],
    *,
    jobs: int | None = None,
    executor: Executor | None = None,
) -> Generator[tuple[RunSpec, Result]]:
    """Yield runs with what a function makes of each, as they finish. Closing the iterator ends the others.

    Args:
        do: Makes one run; other processes must find it by its name.
        specs: The runs, begun in this order.
        jobs: Processes, None = one per available core; 1 = in this process.
        executor: Makes the runs instead. It is not shut down.

    Raises:
        ConfigError: `jobs` is no number of processes.
        WorkerError: see there.
        UntrustedModelError: see `policies.trust`.
        Exception: whatever the function raises.
    """
    n_workers = processes_of(len(specs), jobs)
    for file in {file_of(spec.policy) for spec in specs if is_policy_file(spec.policy)}:
        trust.check(file)  # workers know nothing of what the user of a command allows
    if executor is None and n_workers == 1:
        for spec in specs:
            yield spec, do(spec)
        return
    with _process_pool(n_workers) if executor is None else nullcontext(executor) as workers:
        if executor is None:
            if not is_kept(observe):
                tell_of_first_run()
            for _ in _done(workers, prepare, list({_kernels_of(spec): spec for spec in specs}.values()), 1):
                pass
        yield from _done(workers, do, specs, AT_A_TIME)


def _done(
    workers: Executor, do: Callable[[RunSpec], Result], specs: Sequence[RunSpec], at_a_time: int
) -> Generator[tuple[RunSpec, Result]]:
    # `concurrent.futures.wait` locks every future; a Ctrl-C in it leaves locks for which the end of the pool waits.
    waiting, running, done = iter(specs), dict[Future[Result], RunSpec](), SimpleQueue[Future[Result]]()
    wrappers = {type(config) for spec in specs for config in spec.wrappers}
    try:
        while True:
            with deaf_children(), scriptless_children(wrappers):
                for spec in islice(waiting, at_a_time - len(running)):
                    future = workers.submit(do, spec)
                    running[future] = spec
                    future.add_done_callback(done.put)
            if not running:
                return
            with suppress(Empty):
                future = done.get(timeout=WAKE_UP_EVERY_S)
                if future.cancelled():
                    raise WorkerError
                yield running.pop(future), future.result()
    except BrokenExecutor as error:
        raise WorkerError from error
    finally:
        if not isinstance(workers, ProcessPoolExecutor):  # a pool ends whole, and complains of what others cancelled
            for future in running:
                future.cancel()


def _kernels_of(spec: RunSpec) -> tuple[str, ...]:
    """Runs for which this is equal use the same kernels."""
    world = spec.scenario
    return (spec.policy, world.caches, world.physics, *(config.name for config in spec.wrappers))


def prepare(spec: RunSpec) -> None:
    """Compile what a run needs, or read it from disk, once in a process, so that the run takes as long as any other.

    What its first ticks raise, the run itself raises, too.
    """
    kernels = _kernels_of(spec)
    if kernels not in _prepared:
        _prepared.add(kernels)
        with suppress(Exception):
            warm_up(spec)


_prepared: set[tuple[str, ...]] = set()


@contextmanager
def _process_pool(n_workers: int) -> Iterator[Executor]:
    """Local processes of one thread each; they end at once when the driver stops or dies."""
    with single_threaded_children():
        pool = ProcessPoolExecutor(n_workers, mp_context=get_context("spawn"), initializer=live_with_driver)
        try:
            yield pool
        except BaseException:
            processes = [*(pool._processes or {}).values()]
            pool.shutdown(wait=False, cancel_futures=True)
            for process in processes:
                process.terminate()
            raise
        pool.shutdown()


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
def scriptless_children(used: Iterable[type] = ()) -> Iterator[None]:
    """Processes started inside this context do not read the user's script again, which then needs no guard.

    They have to where a class that they use stands in it.
    """
    script = vars(sys.modules["__main__"])
    has_used = any(one.__module__ == "__main__" for one in used)
    hidden = {name: script[name] for name in ("__file__", "__spec__") if name in script and not has_used}
    script.update(dict.fromkeys(hidden))
    try:
        yield
    finally:
        script.update(hidden)


def live_with_driver() -> None:
    """Prepare a process that a driver has started: it ignores Ctrl-C, and exits when the driver is gone.

    That functions are compiled the driver tells, once for all.
    """
    logging.getLogger("swarm_forage_env").setLevel(logging.ERROR)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    driver = parent_process()
    if driver is not None:
        threading.Thread(target=lambda: (driver.join(), os._exit(1)), daemon=True).start()


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
