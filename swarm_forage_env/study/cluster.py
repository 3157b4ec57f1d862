"""Executors on many machines, by Dask; `runner` uses them as it uses a pool of local processes.

Workers need the same versions of the packages, and no shared disk: tasks and records travel through the scheduler. A
worker may join or be killed at any time; what it was running is run elsewhere.
"""

import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from multiprocessing import resource_tracker
from typing import Any

from swarm_forage_env._internal.extras import install_command
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.study.runner import available_cores

LOCAL, SLURM = "local", "slurm"
CONNECT_WITHIN_S = 30.0


@contextmanager
def cluster_executor(where: str, workers: int | None = None) -> Iterator[Executor]:
    """Give an executor on a Dask cluster; a cluster that was started here ends with the context.

    Args:
        where: `LOCAL`: worker processes of this machine, reachable from it alone. `SLURM`: jobs as the file
            `~/.config/dask/jobqueue.yaml` of dask-jobqueue describes them. Else the address of a running scheduler,
            such as "tcp://10.0.0.5:8786".
        workers: How many processes or jobs to start; default one per available core. A running scheduler has its own.

    Raises:
        ConfigError: no scheduler answers there, or `workers` for a running one.
        ImportError: Dask is not installed.
    """
    try:
        import distributed
    except ImportError as error:
        raise ImportError(f"Studies on a cluster need Dask: {install_command('cluster')}.") from error
    if where not in (LOCAL, SLURM) and workers is not None:
        raise ConfigError(f"Expected no number of workers for a running scheduler, got {workers} for {where}.")
    with ExitStack() as stack:
        target: Any = where
        if where == LOCAL:
            with _interrupts_later():
                target = stack.enter_context(
                    distributed.LocalCluster(
                        n_workers=workers or available_cores(),
                        threads_per_worker=1,
                        host="127.0.0.1",
                        dashboard_address=None,  # type: ignore[arg-type] - None is documented: no dashboard
                    )
                )
        elif where == SLURM:
            target = stack.enter_context(slurm_cluster())
            target.scale(jobs=workers or available_cores())
        try:
            client = stack.enter_context(distributed.Client(target, timeout=CONNECT_WITHIN_S))
        except (OSError, ValueError) as error:
            raise ConfigError(
                f"Expected the address of a Dask scheduler, local or slurm, got {where!r}: {error}"
            ) from error
        yield client.get_executor(pure=False)


@contextmanager
def _interrupts_later() -> Iterator[None]:
    """Hold back Ctrl-C until the end of the block.

    A terminal sends it to the workers, too. Dask prints tracebacks where it ends a worker, or this process, while they
    start. So it is raised here when all have started, and workers, which inherit what is blocked, never see it.
    """
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "pthread_sigmask"):
        yield  # only the main thread has handlers; Windows cannot block
        return
    caught: list[int] = []
    usual = signal.signal(signal.SIGINT, lambda number, _: caught.append(number))
    resource_tracker.ensure_running()  # multiprocessing's; started later it would unblock it again
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        signal.signal(signal.SIGINT, usual)
    if caught:
        raise KeyboardInterrupt


def slurm_cluster(**settings: Any) -> Any:
    """Return a cluster of slurm jobs, without jobs yet.

    Args:
        settings: Of `dask_jobqueue.SLURMCluster`, over those of its configuration file. Default: one core and 4 GiB per
            job (our choice; a run of 819 robots takes a tenth of that).

    Raises:
        ImportError: dask-jobqueue is not installed.
    """
    try:
        from dask import config
        from dask_jobqueue.slurm import SLURMCluster
    except ImportError as error:
        raise ImportError(f"Slurm needs dask-jobqueue: {install_command('cluster')}.") from error
    usual = {"cores": 1, "processes": 1, "memory": "4GiB"}
    configured = config.get("jobqueue.slurm", {})
    kept = {name: value for name, value in usual.items() if configured.get(name) is None}
    return SLURMCluster(**{**kept, **settings})
