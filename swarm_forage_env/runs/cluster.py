"""Executors on many machines, by Dask; `run_all` uses them as it uses a pool of local processes.

Workers need the same versions of the packages, and no shared disk: tasks and records travel through the scheduler. A
worker may join or be killed at any time; what it was running is run elsewhere.
"""

import logging
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from functools import cache
from multiprocessing import resource_tracker
from typing import Any

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.wording import install_command
from swarm_forage_env.runs.workers import WorkerError, available_cores, deaf_children

LOCAL = "local"
CONNECT_WITHIN_S = 30.0
"""How long a scheduler may take to answer, at first and when the connection was lost."""


@contextmanager
def cluster_executor(where: str, workers: int | None = None) -> Iterator[Executor]:
    """Give an executor on a Dask cluster; a cluster that was started here ends with the context.

    Args:
        where: `LOCAL`: worker processes of this machine, reachable from it alone. Else the address of a running
            scheduler, such as "tcp://10.0.0.5:8786".
        workers: How many processes to start; default one per available core. A running scheduler has its own.

    Raises:
        ConfigError: no scheduler answers there, or it is given `workers`.
        ImportError: Dask is not installed.
        WorkerError: the scheduler ended while the executor was in use, or a run killed its workers.
    """
    try:
        import distributed
        from distributed.client import ClosedClientError
    except ImportError as error:
        raise ImportError(f"Studies on a cluster need Dask: {install_command('cluster')}.") from error
    if where != LOCAL and workers is not None:
        raise ConfigError(f"Expected no number of workers for a running scheduler, got {workers} for {where}.")
    with ExitStack() as stack:
        for logger in map(logging.getLogger, ("distributed.client", "distributed.nanny")):
            stack.callback(logger.setLevel, logger.level)
            logger.setLevel(logging.CRITICAL)  # the errors below say what they would
        target: Any = where
        if where == LOCAL:
            options: dict[str, Any] = {"threads_per_worker": 1, "host": "127.0.0.1", "dashboard_address": None}
            with _interrupts_later():
                cluster = distributed.LocalCluster(
                    n_workers=workers or available_cores(), loop=_event_loop(), **options
                )
                target = stack.enter_context(cluster)
        try:
            client = stack.enter_context(distributed.Client(target, loop=_event_loop(), timeout=CONNECT_WITHIN_S))
        except (OSError, RuntimeError, TypeError, ValueError) as error:  # Dask raises all of them of addresses
            raise ConfigError(f"Expected local or the address of a Dask scheduler, got {where!r}: {error}") from error
        try:
            yield client.get_executor(pure=False)
        except distributed.KilledWorker as error:
            raise WorkerError(f"A run killed its workers, most likely because memory ran out: {error}") from error
        except (ClosedClientError, WorkerError) as error:
            if client.status == "running":
                raise
            raise WorkerError(
                f"The scheduler of Dask ({where}) does not answer any more: it ended, or its machine cannot be reached."
            ) from error


@cache
def _event_loop() -> Any:
    """Return an event loop in a thread of its own.

    Dask's own counts as broken when its thread takes more than ten seconds to start, as on a busy machine.
    """
    from tornado.ioloop import IOLoop

    loop, started = IOLoop(make_current=False), threading.Event()
    loop.add_callback(started.set)
    threading.Thread(target=loop.start, daemon=True).start()
    started.wait()
    return loop


@contextmanager
def _interrupts_later() -> Iterator[None]:
    """Hold back Ctrl-C until the end of the block: Dask prints tracebacks where it ends workers that are starting."""
    if threading.current_thread() is not threading.main_thread():  # only the main thread has handlers
        yield
        return
    caught: list[int] = []
    usual = signal.signal(signal.SIGINT, lambda number, _: caught.append(number))
    resource_tracker.ensure_running()  # multiprocessing's; started later it would unblock the signal again
    try:
        with deaf_children():
            yield
    finally:
        signal.signal(signal.SIGINT, usual)
    if caught:
        raise KeyboardInterrupt
