"""Studies on Dask clusters of this machine: workers that die and come late change nothing."""

import json
import logging
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import nullcontext
from pathlib import Path

import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs import cluster
from swarm_forage_env.runs.cluster import LOCAL, cluster_executor
from swarm_forage_env.runs.store import DONE
from swarm_forage_env.runs.workers import WorkerError
from swarm_forage_env.studies.study_folder import StudyFolder, run_study
from swarm_forage_env.studies.study_table import gather_study
from tests.support.tiny_study import tiny_study

distributed = pytest.importorskip("distributed")

ROOT = Path(__file__).resolve().parents[2]
STUDY = tiny_study(seeds=tuple(range(6)), horizon_s=40.0, interval_s=20.0)


def with_executor(*words):
    with cluster_executor(*words):
        pytest.fail("there should be no executor")


def packed(folder):
    gather_study(folder).write(folder.folder / "tiny.parquet")
    return (folder.folder / "tiny.parquet").read_bytes()


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """The packed file as one local process makes it."""
    folder = StudyFolder(tmp_path_factory.mktemp("local"))
    run_study(STUDY, folder, jobs=1)
    return packed(folder)


@pytest.fixture
def loopback():
    """A cluster without workers that only this machine can reach."""
    with distributed.LocalCluster(n_workers=0, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as made:
        yield made


def once_some_runs_are_stored(folder, do):
    """Start a thread that does something in the middle of a study."""

    def wait_and_do():
        while len(folder.store.run_ids()) < 2:
            time.sleep(0.01)
        do()

    thread = threading.Thread(target=wait_and_do)
    thread.start()
    return thread


@pytest.mark.slow
def test_a_worker_killed_in_the_middle_changes_nothing(tmp_path, loopback, expected):
    loopback.scale(1)
    folder = StudyFolder(tmp_path)
    with distributed.Client(loopback) as client, cluster_executor(loopback.scheduler_address) as executor:
        client.wait_for_workers(1, timeout=60)
        (pid,) = client.run(os.getpid).values()
        thread = once_some_runs_are_stored(folder, lambda: os.kill(pid, signal.SIGKILL))
        state = run_study(STUDY, folder, executor=executor)
        thread.join()
        assert pid not in client.run(os.getpid).values()
    assert state.count(DONE) == STUDY.n_runs
    assert packed(folder) == expected


@pytest.mark.slow
def test_workers_may_join_late(tmp_path, loopback, expected):
    folder = StudyFolder(tmp_path)
    with distributed.Client(loopback) as client, cluster_executor(loopback.scheduler_address) as executor:
        first = threading.Timer(1.0, loopback.scale, (1,))
        first.start()
        second = once_some_runs_are_stored(folder, lambda: loopback.scale(2))
        state = run_study(STUDY, folder, executor=executor)
        second.join()
        client.wait_for_workers(2, timeout=60)
    assert state.count(DONE) == STUDY.n_runs
    assert packed(folder) == expected


@pytest.mark.slow
def test_a_cluster_of_this_machine_is_one_word(tmp_path, expected):
    with cluster_executor(LOCAL, 1) as executor:
        run_study(STUDY, StudyFolder(tmp_path), executor=executor)
    assert packed(StudyFolder(tmp_path)) == expected


@pytest.fixture
def scheduler_and_worker(tmp_path):
    """A scheduler and a worker as processes of their own; gives the first, and its address."""
    file = tmp_path / "scheduler.json"
    dask = (
        [sys.executable, "-m", "distributed.cli.dask_scheduler"],
        [sys.executable, "-m", "distributed.cli.dask_worker"],
    )
    own = ["--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(file)]
    usual = {"cwd": tmp_path, "env": {**os.environ, "PYTHONPATH": str(ROOT)}, "stderr": subprocess.DEVNULL}
    processes = [
        subprocess.Popen([*dask[0], *own, "--port", "0"], **usual),
        subprocess.Popen([*dask[1], *own, "--nthreads", "1", "--no-nanny"], **usual),
    ]
    try:
        while not file.exists():
            assert processes[0].poll() is None, "the scheduler starts"
            time.sleep(0.1)
        time.sleep(0.1)  # until the file is written
        yield processes[0], json.loads(file.read_text())["address"]
    finally:
        for process in processes:
            process.kill()
            process.wait()


@pytest.mark.slow
def test_a_scheduler_that_dies_ends_the_study_and_no_run_is_a_failure(
    monkeypatch, tmp_path, scheduler_and_worker, expected, caplog
):
    monkeypatch.setattr(cluster, "CONNECT_WITHIN_S", 5.0)
    scheduler, address = scheduler_and_worker
    folder = StudyFolder(tmp_path / "study")

    def run_on_it():
        with cluster_executor(address) as executor:
            once_some_runs_are_stored(folder, scheduler.kill)
            run_study(STUDY, folder, executor=executor)

    with pytest.raises(WorkerError, match=rf"scheduler of Dask \({address}\) does not answer any more"):
        run_on_it()
    assert 2 <= len(folder.store.run_ids()) < STUDY.n_runs
    assert not list(folder.folder.rglob("failures/*"))
    assert all(record.levelname == "INFO" for record in caplog.records), "one line says it, and that is ours"
    run_study(STUDY, folder, jobs=1)
    assert packed(folder) == expected


def test_nannies_do_not_warn_at_a_normal_end(monkeypatch, caplog):
    """On a slow machine one kills its worker, which has nothing left to do, and says so."""

    class Cluster(nullcontext):
        def __init__(self, **_):
            super().__init__()

        def __exit__(self, *_):
            nanny.warning("Worker process still alive after 4.0 seconds, killing")

    class Client(nullcontext):
        status = "running"

        def __init__(self, *_, **__):
            super().__init__(self)

        def get_executor(self, **_):
            nanny.warning("Restarting worker")

    nanny = logging.getLogger("distributed.nanny")
    monkeypatch.setattr(distributed, "LocalCluster", Cluster)
    monkeypatch.setattr(distributed, "Client", Client)
    with cluster_executor(LOCAL, 1):
        pass
    assert [record.getMessage() for record in caplog.records] == ["Restarting worker"]
    nanny.warning("as before")
    assert len(caplog.records) == 2


def test_a_scheduler_that_does_not_answer_is_told(monkeypatch):
    monkeypatch.setattr(cluster, "CONNECT_WITHIN_S", 0.2)
    address = "tcp://127.0.0.1:9"
    with pytest.raises(ConfigError, match=f"Expected local or the address of a Dask scheduler, got '{address}'"):
        with_executor(address)
    with pytest.raises(ConfigError, match=r"got 'tls://127.0.0.1:9': .* needs certificates.*distributed.comm.tls"):
        with_executor("tls://127.0.0.1:9")
    with pytest.raises(ConfigError, match=r"got 'ucx://127.0.0.1:9'"):
        with_executor("ucx://127.0.0.1:9")
    with pytest.raises(ConfigError, match="no number of workers for a running scheduler"):
        with_executor(address, 3)
