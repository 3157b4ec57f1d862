"""From policies to an entry, and its numbers made again, in a tiny protocol."""

import itertools
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from metrics.benchmark import SAME, Training, load_protocol, read_entry, run_benchmark, verify_entry
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
    world = next(world for world in protocol.held_out if world.name == "room, 2 robots")
    record = run_one(plan_run(world, "crw", seed=1))
    assert entry.performance([world])[0, 0, 0] == pytest.approx(record["performance"].sum() / 0.2)  # of 200 s
    assert entry.performance(protocol.held_out).shape == (2, 5, 2)


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
        (["crw"], {"name": "dpo"}, ConfigError, "Expected another name than 'dpo'"),
        (["oracle"], {}, ConfigError, "oracle, which reads the world"),
    ):
        with pytest.raises(error, match=message):
            made(policies, protocol, **options)


def test_no_entry_is_made_of_failed_runs(protocol, tmp_path, monkeypatch):
    def act(self, obs, active):
        assert len(obs) != 2, "no pairs"
        return np.zeros((len(obs), 3), np.float32)

    monkeypatch.setattr(RandomPolicy, "act", act)
    told = r"all 12 runs to finish, 2 failed; the first, .*random in .*, 2 robots, seed 1: .*no pairs"
    with pytest.raises(ConfigError, match=told):
        made(["random"], protocol, out=tmp_path)
    assert len(list(tmp_path.glob("*.parquet"))) == 10, "the others are kept"


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
    replace(entry, runs={**entry.runs, world: ((1e4, 1e4),) * 2}).write(file)
    assert {row[1] for row in verified(file, n_worlds=99) if row[-1] != SAME} == {world}


def test_policies_must_be_those_of_the_entry(file, tmp_path):
    for policies in (["crw"], ["ppo_warehouse_small", "crw"]):
        with pytest.raises(ConfigError, match=r"Expected --policy with the policies of .* \(crw, ppo_.*\), got others"):
            verify_entry(file, policies)
    made_up_entry(load_protocol(), "mine", lambda k: 1.0).write(tmp_path / "mine.json")
    with pytest.raises(ValueError, match=r"mine_0.npz"):
        verify_entry(tmp_path / "mine.json")


PLAN = Path(pretrained.__file__).with_name("generalist.toml")


@pytest.fixture(scope="module")
def real():
    return load_protocol()


def test_it_has_three_worlds_or_more_of_ten_kinds(real):
    assert len(real.held_out) == 33
    kinds = [world.name.partition(",")[0] for world in real.held_out]
    assert len({*kinds}) == 10
    assert min(kinds.count(kind) for kind in kinds) >= 3


def test_held_out_worlds_differ_from_those_to_train_in(real):
    known = [world.scenario for world in real.training]
    assert len(known) == 3
    assert [world.name for world in real.held_out if world.scenario in known] == []


@pytest.mark.parametrize("policy", ["crw", "stochm", "stochx"])
def test_controllers_with_and_without_caches_fit_into_every_calm_world(real, policy):
    for world in real.held_out:
        if not world.wrappers:
            ForageEnv(plan_run(world, policy).scenario).reset(seed=real.seeds[0])


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
    assert not [world.name for world in real.held_out if world.scenario.arena in arenas]


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


def test_worlds_are_variants_sizes_and_what_disturbs():
    names = ["room, source below", "room, 2 robots", "room, 4 robots", "worn, slow", "worn, noisy wheels"]
    found = load_protocol(TINY)
    assert [world.name for world in found.worlds] == ["training: here", *names]
    assert found.groups == ("room", "room", "room", "worn", "worn")
    assert [world.n_robots for world in found.held_out] == [4, 2, 4, 4, 4]
    assert [bool(world.wrappers) for world in found.held_out] == [False, False, False, True, True]
    middles = np.array(found.held_out[0].scenario.objects.object_positions_m)
    np.testing.assert_allclose([middles.min(axis=0), middles.max(axis=0)], [[1.7, 1.7], [7.3, 2.9]])
    assert len(middles) == 29 * 7, "squares of 0.2 m in 5.8 m x 1.4 m"
