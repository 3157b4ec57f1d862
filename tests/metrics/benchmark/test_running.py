"""From policies to an entry, and its numbers made again, in a tiny protocol."""

from dataclasses import replace

import numpy as np
import pytest

from metrics.benchmark import SAME, BenchmarkError, Training, load_protocol, read_entry, run_benchmark, verify_entry
from metrics.benchmark.entry import WorldRuns
from swarm_forage_env import plan_run, run_one
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.registry import RandomPolicy
from swarm_forage_env.runs import runner
from tests.support.entries import TINY, made_up_entry

POLICIES = ("crw", "ppo_warehouse_small")


@pytest.fixture(scope="module")
def protocol():
    return load_protocol(TINY)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("records")


def made(policies, protocol, **options):
    return run_benchmark(policies, protocol=protocol, jobs=1, progress=False, **{"name": "both", **options})


@pytest.fixture(scope="module")
def entry(protocol, folder):
    return made(POLICIES, protocol, training=Training(worlds="given", command="a command"), out=folder)


def test_an_entry_has_the_runs_of_all_policies(entry, protocol):
    world = next(each.world for each in protocol.worlds if each.name == "room, 2 robots")
    record = run_one(plan_run(world, "crw", seed=2))
    row = entry.performance("room, 2 robots")[0]
    assert row[1] == pytest.approx(record["performance"].sum() / 0.2)  # per 1,000 s, of 200 s
    assert entry.interference("room, 2 robots")[0, 1] == pytest.approx(record["interference_fraction"].mean(), rel=1e-5)
    assert entry.performance("room, noisy wheels").shape == (2, 2)


def test_an_entry_tells_how_it_was_made(entry):
    crw, ppo = entry.policies
    assert (crw.name, crw.digest) == ("crw", "")
    assert (ppo.name, len(ppo.digest)) == ("ppo_warehouse_small", 16)
    assert (entry.training.command, entry.training.track) == ("a command", "open")
    assert entry.versions["swarm-forage-env"]


def test_stored_runs_answer_and_an_entry_is_read_back(entry, protocol, folder, tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "run_one", lambda spec: pytest.fail("a stored run was repeated"))
    again = made(POLICIES, protocol, out=folder, training=entry.training)
    again.write(tmp_path / "entry.json")
    assert read_entry(tmp_path / "entry.json", protocol).runs == again.runs == entry.runs


def test_what_cannot_be_entered_is_refused_before_any_run(protocol, monkeypatch):
    monkeypatch.setattr(runner, "run_one", lambda spec: pytest.fail("something was run"))
    for policies, options, error, message in (
        (["cwr"], {}, ValueError, "Unknown policy 'cwr'"),
        (["crw"], {"name": "\x1b[31m"}, ConfigError, "Expected the name of an entry to be a non-empty text"),
        (["crw"], {"name": "dpo"}, BenchmarkError, "Expected another name than 'dpo'"),
        (["crw"], {"training": Training(worlds="given", track="short", decisions=9)}, BenchmarkError, "2 trainings"),
    ):
        with pytest.raises(error, match=message):
            made(policies, protocol, **options)


def test_no_entry_is_made_of_failed_runs(tmp_path, monkeypatch):
    def act(self, obs, active):
        assert len(obs) != 2, "no pairs"
        return np.zeros((len(obs), 3), np.float32)

    monkeypatch.setattr(RandomPolicy, "act", act)
    quick = load_protocol(TINY, quick=True)
    n_runs = len(quick.worlds)
    told = rf"all {n_runs} runs to finish, 1 failed; the first, .*random in .*, 2 robots, seed 1: .*no pairs"
    with pytest.raises(BenchmarkError, match=told):
        made(["random"], quick, out=tmp_path)
    assert len(list(tmp_path.glob("*.parquet"))) == n_runs - 1, "the others are kept"


@pytest.fixture
def file(entry, tmp_path, monkeypatch):
    """The entry as a file, beside its protocol."""
    (tmp_path / "benchmark.toml").write_text(TINY.read_text())
    monkeypatch.setattr("metrics.benchmark.protocol.FOLDER", tmp_path)
    entry.write(tmp_path / "two.json")
    return tmp_path / "two.json"


def verified(file, **options):
    return verify_entry(file, POLICIES, jobs=1, progress=False, **options).frame.rows()


def test_an_entry_comes_again_and_one_altered_number_is_found(entry, file):
    found = verified(file, n_worlds=99)
    assert len(found) == 2 * len(entry.runs)
    assert ({row[-1] for row in found}, {row[0] for row in found}) == ({SAME}, {*POLICIES})
    world = "room, 2 robots"
    runs = {**entry.runs, world: WorldRuns(performance=((1e4, 1e4),) * 2, interference=((0.1, 0.1),) * 2)}
    replace(entry, runs=runs).write(file)
    assert {row[1] for row in verified(file, n_worlds=99) if row[-1] != SAME} == {world}


def test_a_seed_draws_the_worlds(file):
    first, again, other = ([row[:2] for row in verified(file, n_worlds=2, seed=seed)] for seed in (1, 1, 2))
    assert first == again != other
    assert len(first) == 2


def test_policies_must_be_those_of_the_entry(file, tmp_path):
    for policies in (["crw"], ["ppo_warehouse_small", "crw"]):
        with pytest.raises(BenchmarkError, match=r"Expected the policies of .* \(crw, ppo_.*\), got others"):
            verify_entry(file, policies)
    made_up_entry(load_protocol(), "mine", lambda k: 1.0).write(tmp_path / "mine.json")
    with pytest.raises(BenchmarkError, match=r"Expected --policy FILE,... for each of mine_0.npz"):
        verify_entry(tmp_path / "mine.json")
