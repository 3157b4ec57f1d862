"""Runs on Dask: workers of this machine, and a scheduler that is not there."""

import os
from importlib.util import find_spec

import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs import cluster
from swarm_forage_env.runs.cluster import LOCAL, cluster_executor
from swarm_forage_env.runs.runner import run_all
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.workers import WorkerError
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.world import World

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(find_spec("distributed") is None, reason="needs the cluster extra"),
]

WORLD = World(scenario("warehouse_small", n_robots=2, n_objects=20, horizon_s=4.0, interval_s=2.0))
SPECS = [RunSpec(world=WORLD, policy="random", seed=seed) for seed in range(3)]


def test_a_cluster_of_this_machine_is_one_word(tmp_path):
    """It makes the same runs, and a run that always kills its worker ends the call."""
    expected = run_all(SPECS, jobs=1, progress=False)
    with cluster_executor(LOCAL, 1) as executor:
        found = run_all(SPECS, out=tmp_path, executor=executor, progress=False)
    assert found.n_done == 3
    assert all(record.equals(expected.records[run_id]) for run_id, record in found.records.items())
    with pytest.raises(WorkerError, match="A run killed its workers"), cluster_executor(LOCAL, 1) as executor:
        executor.submit(os._exit, 9).result()


def no_executor(where, *workers):
    with cluster_executor(where, *workers):
        pytest.fail("there should be no executor")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # Dask leaves coroutines behind
def test_a_scheduler_that_does_not_answer_is_told(monkeypatch):
    """Dask would wait ten seconds for a thread of its own to start, which is too short on a busy machine."""
    monkeypatch.setattr("distributed.utils._CollectErrorThread", None)
    monkeypatch.setattr(cluster, "CONNECT_WITHIN_S", 0.2)
    for address in ("tcp://127.0.0.1:9", "tls://127.0.0.1:9", "ucx://127.0.0.1:9"):
        with pytest.raises(ConfigError, match=f"Expected local or the address of a Dask scheduler, got '{address}'"):
            no_executor(address)
    with pytest.raises(ConfigError, match="no number of workers for a running scheduler"):
        no_executor("tcp://127.0.0.1:9", 3)
