"""Executors on many machines, by Dask; `runner` uses them as it uses a pool of local processes.

Workers need the same versions of the packages, and no shared disk: tasks and records travel through the scheduler. A
worker may join or be killed at any time; what it was running is run elsewhere.
"""

import logging
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from multiprocessing import resource_tracker
from typing import Any

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.wording import install_command
from swarm_forage_env.runs.workers import WorkerError, available_cores

LOCAL, SLURM, SLURM_JOBS = "local", "slurm", "slurm-jobs"
ROLES = ("the scheduler", "the process that writes", "at least one worker")
"""What the tasks of an allocation do, in their order."""
CONNECT_WITHIN_S = 30.0
"""How long a scheduler may take to answer, at first and when the connection was lost."""
TLS_NEEDS = ". An address with tls:// needs certificates: distributed.comm.tls in ~/.config/dask/distributed.yaml."


@contextmanager
def cluster_executor(where: str, workers: int | None = None) -> Iterator[Executor]:
    """Give an executor on a Dask cluster; a cluster that was started here ends with the context.

    Args:
        where: `LOCAL`: worker processes of this machine, reachable from it alone. `SLURM`: the tasks of this
            allocation, in each of which srun started this command. `SLURM_JOBS`: jobs of their own as the file
            `~/.config/dask/jobqueue.yaml` of dask-jobqueue describes them. Else the address of a running scheduler,
            such as "tcp://10.0.0.5:8786".
        workers: How many processes or jobs to start; default one per available core. A running scheduler and an
            allocation have their own.

    Raises:
        ConfigError: no scheduler answers there, no allocation of three tasks or more, or `workers` where they are
            given.
        ImportError: Dask is not installed.
        SystemExit: in all tasks of an allocation but one, when the study is over: they are its scheduler and workers.
        WorkerError: the scheduler ended while the executor was in use.
    """
    try:
        import distributed
        from distributed.client import ClosedClientError
    except ImportError as error:
        raise ImportError(f"Studies on a cluster need Dask: {install_command('cluster')}.") from error
    if where not in (LOCAL, SLURM_JOBS) and workers is not None:
        what = "tasks of an allocation, whose number says how many" if where == SLURM else "a running scheduler"
        raise ConfigError(f"Expected no number of workers for {what}, got {workers} for {where}.")
    with ExitStack() as stack:
        loggers = {name: logging.getLogger(f"distributed.{name}") for name in ("client", "nanny")}
        for logger in loggers.values():
            stack.callback(logger.setLevel, logger.level)
        loggers["client"].setLevel(logging.CRITICAL)  # the errors below say what it would
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
            target = stack.enter_context(_allocation())
        elif where == SLURM_JOBS:
            target = stack.enter_context(slurm_cluster())
            target.scale(jobs=workers or available_cores())
        try:
            client = stack.enter_context(distributed.Client(target, timeout=CONNECT_WITHIN_S))
        except (OSError, RuntimeError, TypeError, ValueError) as error:  # Dask raises all of them of addresses
            hint = TLS_NEEDS if where.startswith("tls:") else ""
            raise ConfigError(
                f"Expected the address of a Dask scheduler, local, slurm or slurm-jobs, got {where!r}: {error}{hint}"
            ) from error
        try:
            yield client.get_executor(pure=False)
        except (ClosedClientError, WorkerError) as error:
            if client.status == "running":
                raise
            raise WorkerError(
                f"The scheduler of Dask ({where}) does not answer any more: it ended, or its machine cannot be reached."
            ) from error
        loggers["nanny"].setLevel(logging.ERROR)  # it warns of workers that are slow to leave


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


def _allocation() -> Any:
    """Make one Dask cluster of the tasks of this allocation; returns in the second task, when the scheduler is there.

    The first task becomes the scheduler and all others workers. They leave with SystemExit when the study is over. They
    find each other by a file in the working folder, which all nodes must see. The network is that of dask-jobqueue's
    setting `jobqueue.slurm.interface`, "ib0" for example; default the usual one.
    """
    told = {
        name: os.environ.get(name, "") for name in ("SLURM_JOB_ID", "SLURM_STEP_ID", "SLURM_PROCID", "SLURM_NTASKS")
    }
    if not all(told.values()) or int(told["SLURM_NTASKS"]) < len(ROLES):
        got = f"{told['SLURM_NTASKS']} tasks" if all(told.values()) else "a process that srun did not start"
        raise ConfigError(
            f"Expected three tasks or more of a Slurm allocation, {', '.join(ROLES)}: srun --ntasks 17 swarm-forage "
            f"study run ... --cluster slurm; got {got}."
        )
    usual = signal.getsignal(signal.SIGINT)
    try:
        from dask import config
        from dask_jobqueue.slurm import SLURMRunner
    except ImportError as error:
        raise ImportError(f"Slurm needs dask-jobqueue: {install_command('cluster')}.") from error
    network = {"interface": config.get("jobqueue.slurm.interface", None)}
    runner = SLURMRunner(
        scheduler_file="dask-scheduler-{job_id}.json",
        scheduler_options={"dashboard_address": None, **network},
        worker_options={"nthreads": 1, **network},
    )
    # The library ends its processes by Ctrl-C and answers it in all of them; here it means what it always does.
    signal.signal(signal.SIGINT, usual)
    return runner


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
