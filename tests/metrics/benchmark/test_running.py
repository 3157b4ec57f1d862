"""From policies to an entry, and its numbers made again, in a tiny protocol."""

import contextlib
import itertools
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from metrics.benchmark import SAME, BenchmarkError, Training, load_protocol, read_entry, run_benchmark, verify_entry
from metrics.benchmark.entry import WorldRuns
from swarm_forage_env import plan_run, run_one, scenario
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies import pretrained
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


def test_policies_must_be_those_of_the_entry(file, tmp_path):
    for policies in (["crw"], ["ppo_warehouse_small", "crw"]):
        with pytest.raises(BenchmarkError, match=r"Expected the policies of .* \(crw, ppo_.*\), got others"):
            verify_entry(file, policies)
    made_up_entry(load_protocol(), "mine", lambda k: 1.0).write(tmp_path / "mine.json")
    with pytest.raises(BenchmarkError, match=r"Expected --policy FILE,... for each of mine_0.npz"):
        verify_entry(tmp_path / "mine.json")


PLAN = Path(pretrained.__file__).with_name("generalist.toml")


@pytest.fixture(scope="module")
def real():
    return load_protocol()


def test_it_has_three_worlds_or_more_of_eight_kinds(real):
    assert len(real.scored) == 27
    kinds = [world.group for world in real.scored]
    assert len({*kinds}) == 8
    assert min(kinds.count(kind) for kind in kinds) >= 3


def test_held_out_worlds_differ_from_those_to_train_in(real):
    given = [world for world in real.worlds if not world.group]
    assert len(given) == 3
    assert not any(world.counts for world in given)
    known = [world.world.scenario for world in given]
    assert [world.name for world in real.scored if world.world.scenario in known] == []


@pytest.mark.parametrize("policy", ["crw", "stochm", "stochx"])
def test_controllers_with_and_without_caches_fit_into_every_calm_world(real, policy):
    for world in real.scored:
        if not world.is_disturbed:
            ForageEnv(plan_run(world.world, policy).scenario).reset(seed=real.seeds[0])


@pytest.mark.parametrize(
    ("fields", "n_policies", "message"),
    [
        ({}, 5, None),
        ({"track": "40M", "decisions": 40_000_000}, 5, None),
        ({"worlds": "other", "track": "open", "decisions": 10**12}, 1, None),
        ({"decisions": 10_000_001}, 5, "at most 10,000,000 decisions .* for the track 10M, got 10,000,001"),
        ({"decisions": None}, 5, r"\(--decisions\) for the track 10M, got none"),
        ({"worlds": "other"}, 5, "trained-in given.* got 'other'; or choose --track open"),
        ({}, 4, "Expected 5 trainings, a file each, for the track 10M, got 4"),
        ({"track": "20M"}, 5, "--track to be one of 10M, 40M, open, got '20M'"),
    ],
)
def test_a_training_fits_its_track_or_is_refused(real, fields, n_policies, message):
    training = replace(Training(worlds="given", track="10M", decisions=10_000_000), **fields)
    with contextlib.nullcontext() if message is None else pytest.raises(BenchmarkError, match=message):
        training.check_track(real, n_policies)


def test_no_world_has_an_arena_in_which_the_shipped_generalist_was_trained_or_evaluated(real):
    plan = tomllib.loads(PLAN.read_text())
    parts = (plan["sampler"], *(stage["sampler"] for stage in plan["stages"] if "sampler" in stage), plan["evaluation"])
    drawn = [world["scenario"] for part in parts for world in part["worlds"]]
    arenas = {
        scenario(fields["preset"], **variant | {"n_robots": n_robots}).arena
        for fields in drawn
        for variant in variants(fields)
        for n_robots in bounds(fields["n_robots"])
    }
    assert len(arenas) > 20
    assert not [world.name for world in real.scored if world.world.scenario.arena in arenas]


def bounds(value):
    return value["uniform"] if isinstance(value, dict) else [value]


def variants(fields):
    """Fields of a sampled world as a scenario takes them, once for each choice; those within bounds are left out."""
    choices = {
        name: value["choice"] if isinstance(value, dict) else [value]
        for name, value in fields.items()
        if name != "preset" and not (isinstance(value, dict) and "uniform" in value)
    }
    for picked in itertools.product(*choices.values()):
        yield dict(zip(choices, picked, strict=True))


def test_a_swarm_of_one_does_not_count():
    assert {world.name: world.counts for world in load_protocol(TINY).worlds} == {
        "training: here": False,
        "room, source below": True,
        "room, 1 robot": False,
        "room, 2 robots": True,
        "room, 4 robots": True,
        "room, slow": True,
        "room, noisy wheels": True,
    }


def test_quick_is_shorter_and_another_identity():
    full, quick = load_protocol(TINY), load_protocol(TINY, quick=True)
    assert [world.name for world in quick.worlds] == [world.name for world in full.worlds]
    assert quick.seeds == (1,)
    assert quick.worlds[0].world.scenario.horizon_s == 100.0
    assert quick.identity != full.identity
