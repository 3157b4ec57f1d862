"""Studies on Dask clusters of this machine: workers that die and come late change nothing."""

import os
import signal
import threading
import time

import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.study import cluster
from swarm_forage_env.study.cluster import LOCAL, cluster_executor, slurm_cluster
from swarm_forage_env.study.study_run import DONE, StudyFolder, run_study
from swarm_forage_env.study.study_table import gather_study
from tests.support.tiny_study import tiny_study

distributed = pytest.importorskip("distributed")

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


@pytest.mark.slow
def test_jobs_of_slurm_have_one_core_each():
    pytest.importorskip("dask_jobqueue")
    with slurm_cluster(queue="short", scheduler_options={"host": "127.0.0.1", "dashboard_address": None}) as jobs:
        script = jobs.job_script()
    assert "#SBATCH -p short" in script
    assert "#SBATCH --cpus-per-task=1" in script
    assert "--nthreads 1" in script


def test_a_scheduler_that_does_not_answer_is_told(monkeypatch):
    monkeypatch.setattr(cluster, "CONNECT_WITHIN_S", 0.2)
    address = "tcp://127.0.0.1:9"
    with pytest.raises(ConfigError, match=f"address of a Dask scheduler, local or slurm, got '{address}'"):
        with_executor(address)
    with pytest.raises(ConfigError, match="no number of workers for a running scheduler"):
        with_executor(address, 3)
