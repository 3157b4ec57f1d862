"""From policies to an entry, in a tiny protocol: the runs, and the measures that they allow."""

import math
import shutil

import numpy as np
import pytest

from metrics.benchmark import BenchmarkError, Training, benchmark_question, load_protocol, read_entry, run_benchmark
from metrics.scoring import ask
from metrics.scoring.scores import MEASURE_CRITERIA, ON_REQUEST
from swarm_forage_env import run_one
from swarm_forage_env.policies.model_files import file_digest
from swarm_forage_env.policies.pretrained import network_file
from swarm_forage_env.policies.registry import RandomPolicy
from swarm_forage_env.runs import workers
from swarm_forage_env.runs.record import RunRecord
from tests.support.entries import TINY

FROM_RATES_ALONE = {"availability"}
"""Measures that say the same of every policy, and are in no entry."""


@pytest.fixture(scope="module")
def protocol():
    return load_protocol(TINY)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("records")


@pytest.fixture(scope="module")
def entry(protocol, folder):
    policies = ("crw", "ppo_warehouse_small")
    training = Training(worlds="given", library="a library", core_hours=1.5)
    return run_benchmark(
        policies, name="both", protocol=protocol, training=training, out=folder, jobs=1, progress=False
    )


def test_an_entry_has_the_runs_of_all_policies(entry, protocol):
    planned = benchmark_question(["crw"], name="one", protocol=protocol).plan.specs
    spec = next(spec for spec in planned if spec.seed == 2 and spec.world.n_robots == 2)
    record = run_one(spec)
    row = entry.performance("room, 2 robots")[0]
    assert row[1] == pytest.approx(record.performance.sum() / 0.2)  # per 1,000 s, of 200 s
    assert entry.interference("room, 2 robots")[0, 1] == pytest.approx(record.interference_fraction.mean(), rel=1e-5)
    assert entry.performance("room, noisy wheels").shape == (2, 2)


def test_an_entry_has_every_measure(entry):
    assert {measure.label for measure in entry.measures} == MEASURE_CRITERIA.keys() - FROM_RATES_ALONE - {*ON_REQUEST}
    emergence = next(measure for measure in entry.measures if measure.label == "spatial_emergence")
    assert (emergence.group, emergence.at) == ("room", "N = 1 to 2")
    assert [len(row) for row in (*emergence.values, *emergence.relative)] == [2, 2, 2, 2]


def test_an_entry_tells_how_it_was_made(entry):
    crw, ppo = entry.policies
    assert (crw.name, crw.digest, crw.training_seed) == ("crw", "", None)
    assert (ppo.name, len(ppo.digest), ppo.training_seed) == ("ppo_warehouse_small", 16, 0)
    assert entry.training.core_hours == 1.5
    assert entry.core_hours >= 0.0
    assert not math.isnan(entry.core_hours)
    assert entry.versions["swarm-forage-env"]


def test_stored_runs_give_the_same_entry(entry, protocol, folder, tmp_path):
    again = run_benchmark(
        ["crw", "ppo_warehouse_small"],
        name="both",
        protocol=protocol,
        training=entry.training,
        training_seeds=(3, 4),
        out=folder,
        jobs=1,
        progress=False,
    )
    assert again.runs == entry.runs
    assert [policy.training_seed for policy in again.policies] == [3, 4]
    again.write(tmp_path / "entry.json")
    assert read_entry(tmp_path / "entry.json", protocol).runs == entry.runs


def test_training_seeds_are_one_per_policy(protocol):
    with pytest.raises(BenchmarkError, match="got 1 for 2 policies"):
        run_benchmark(["crw", "dpo"], name="two", protocol=protocol, training_seeds=(1,))


def test_an_unknown_policy_is_refused(protocol):
    with pytest.raises(ValueError, match="Unknown policy 'cwr'"):
        benchmark_question(["cwr"], name="one", protocol=protocol)


def test_a_question_has_every_policy_in_every_world(protocol):
    plan = benchmark_question(["crw", "dpo"], name="two", protocol=protocol).plan
    assert plan.seeds == protocol.seeds
    for policy in ("crw", "dpo"):
        conditions = plan.of_policy(policy)
        assert [condition.world.name for condition in conditions] == [world.name for world in protocol.worlds]
        assert [condition.world.wrappers for condition in conditions] == [w.world.wrappers for w in protocol.worlds]


def test_asked_again_the_stored_runs_answer(entry, protocol, folder, monkeypatch):
    monkeypatch.setattr(workers, "run_one", lambda spec: pytest.fail("a stored run was repeated"))
    question = benchmark_question(["crw", "ppo_warehouse_small"], name="both", protocol=protocol)
    assert ask(question, out=folder, jobs=1, progress=False).runs == entry.runs


def test_no_entry_is_made_of_failed_runs(tmp_path, monkeypatch):
    def act(self, obs, active):
        assert len(obs) != 2, "no pairs"
        return np.zeros((len(obs), 3), np.float32)

    monkeypatch.setattr(RandomPolicy, "act", act)
    quick = load_protocol(TINY, quick=True)
    n_runs = len(quick.worlds)
    told = rf"all {n_runs} runs to finish, 1 failed; the first, .*random in .*, 2 robots, seed 1: .*no pairs"
    with pytest.raises(BenchmarkError, match=told):
        run_benchmark(["random"], name="broken", protocol=quick, out=tmp_path, jobs=1, progress=False)
    # The others are kept.
    assert len(list(tmp_path.glob("*.parquet"))) == n_runs - 1


def test_an_entry_of_a_mixed_swarm_keeps_its_name_and_the_digest_of_its_file(tmp_path, monkeypatch):
    monkeypatch.setattr(RunRecord, "cpu_time_s", math.nan)  # as of records that do not tell it
    net = shutil.copy(network_file("ppo_warehouse_small"), tmp_path / "net.npz")
    quick = load_protocol(TINY, quick=True)
    made = run_benchmark([f"mixed:{net}=50%,crw=rest"], name="both", protocol=quick, jobs=1, progress=False)
    (told,) = made.policies
    assert (told.name, told.digest) == ("mixed:net=0.5,crw=rest", file_digest(net))
    assert made.core_hours is None
