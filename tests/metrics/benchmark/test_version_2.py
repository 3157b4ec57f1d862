"""Version 2 of the benchmark: its worlds, and tracks of equal budget."""

import itertools
import json
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from metrics.benchmark import BenchmarkError, Training, benchmark_question, board_of, load_protocol, read_entry
from swarm_forage_env import plan_run, scenario
from swarm_forage_env._internal.fields import as_tuples
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies import pretrained
from tests.support.entries import TINY, made_up_entry

IDENTITY_OF_VERSION_2 = "11cc1bb18dbafaa9"
"""A change of worlds, seeds, lengths or tracks is another version: entries of this one must stay comparable."""
PLAN = Path(pretrained.__file__).with_name("generalist.toml")
IN_10M = Training(worlds="given", track="10M", decisions=10_000_000)


@pytest.fixture(scope="module")
def protocol():
    return load_protocol(version=2)


def test_version_2_never_changes(protocol):
    assert (protocol.version, protocol.identity) == (2, IDENTITY_OF_VERSION_2)


def test_tracks_stand_below_the_worlds(protocol):
    assert "track 40M: 5 trainings of at most 40,000,000 decisions" in protocol.text()
    assert protocol.to_mapping()["tracks"] == {"10M": 10_000_000, "40M": 40_000_000}
    assert "track" not in load_protocol(version=1).text()


def test_it_has_three_worlds_or_more_of_eight_kinds(protocol):
    kinds = [world.group for world in protocol.scored]
    assert len({*kinds}) == 8
    assert min(kinds.count(kind) for kind in kinds) >= 3


def test_both_versions_have_the_same_training_worlds_and_no_other_world_in_common(protocol):
    mine, theirs = (
        {each.name: each.world for each in version.worlds if not each.is_held_out}
        for version in (protocol, load_protocol(version=1))
    )
    assert {name: world.scenario for name, world in mine.items()} == {n: w.scenario for n, w in theirs.items()}
    known = [each.world for each in load_protocol(version=1).worlds]
    assert not [
        each.name
        for each in protocol.scored
        if any(each.world.scenario == one.scenario and each.world.wrappers == one.wrappers for one in known)
    ]


def test_a_source_of_boxes_lies_on_all_their_cells(protocol):
    """The small warehouse turned by half: 16 x 56 cells, as many as the source of the preset has."""
    turned = next(each.world.scenario for each in protocol.worlds if each.name.endswith("mirrored, source in the west"))
    ((x_low, y_low, x_high, y_high),) = scenario("warehouse_small").source_cells
    nx, ny = turned.arena.n_cells
    wanted = {(nx - 1 - x, ny - 1 - y) for x in range(x_low, x_high) for y in range(y_low, y_high)}
    assert {box[:2] for box in turned.source_cells} == wanted
    assert turned.arena.nest_box_m == pytest.approx((27.2, 1.6, 30.4, 14.4))


@pytest.mark.parametrize("policy", ["crw", "stochm", "stochx"])
def test_controllers_with_and_without_caches_fit_into_every_calm_world(protocol, policy):
    for world in protocol.scored:
        if not world.is_disturbed:
            ForageEnv(plan_run(world.world, policy).scenario).reset(seed=protocol.seeds[0])


def test_an_entry_in_a_track_has_five_trainings_within_its_budget(protocol):
    IN_10M.check_track(protocol, 5)
    replace(IN_10M, track="40M", decisions=40_000_000).check_track(protocol, 5)
    Training(worlds="other", track="open", decisions=10**12).check_track(protocol, 1)


@pytest.mark.parametrize(
    ("fields", "n_policies", "message"),
    [
        ({"decisions": 10_000_001}, 5, "at most 10,000,000 decisions of a training for the track 10M, got 10,000,001"),
        ({"decisions": None}, 5, "got none; say how many with --decisions"),
        ({"worlds": "other"}, 5, "got 'other'; say --trained-in given, or choose --track open"),
        ({}, 4, "Expected 5 trainings for the track 10M, got 4"),
        ({"track": "20M"}, 5, r"Expected a track .*version 2 \(10M, 40M, open\), got '20M'"),
    ],
)
def test_a_training_that_does_not_fit_its_track_is_refused(protocol, fields, n_policies, message):
    with pytest.raises(BenchmarkError, match=message):
        replace(IN_10M, **fields).check_track(protocol, n_policies)


def test_version_1_has_no_tracks():
    with pytest.raises(BenchmarkError, match="Expected no track for version 1, got '10M'; leave out --track"):
        benchmark_question(["crw"], name="one", protocol=load_protocol(), training=IN_10M)
    with pytest.raises(BenchmarkError, match="Expected no decisions for version 1, got 5; leave out --track"):
        Training(decisions=5).check_track(load_protocol(), 1)


def test_an_entry_names_its_version_and_its_track(protocol):
    question = benchmark_question(["crw"], name="one", protocol=protocol)
    assert question.training.track == "open"
    assert question.command == "swarm-forage benchmark --policy crw --name one --version 2"
    with pytest.raises(BenchmarkError, match="Expected 5 trainings"):
        benchmark_question(["crw"], name="one", protocol=protocol, training=IN_10M)


def entry_file(folder, name, protocol, **fields):
    made_up_entry(protocol, name, lambda k: 10.0, measures=(), **fields).write(folder / f"{name}.json")
    return folder / f"{name}.json"


def test_an_entry_is_read_as_one_of_the_version_that_it_names_and_refused_for_another(protocol, tmp_path):
    first = entry_file(tmp_path, "first", load_protocol(version=1))
    second = entry_file(tmp_path, "second", protocol, n_policies=5, training=IN_10M)
    assert (read_entry(first).version, read_entry(second).training) == (1, IN_10M)
    told = json.loads(first.read_text())["training"]
    assert not {"track", "decisions"} & told.keys()  # files of version 1 stay as they are
    with pytest.raises(BenchmarkError, match="Expected an entry of version 2 of the benchmark, got one of version 1"):
        read_entry(first, protocol)
    with pytest.raises(BenchmarkError, match="Expected an entry of version 1 of the benchmark, got one of version 2"):
        read_entry(second, load_protocol(version=1))


def test_an_entry_whose_training_does_not_fit_its_track_is_no_entry(protocol, tmp_path):
    with pytest.raises(BenchmarkError, match="Expected 5 trainings for the track 10M, got 2"):
        read_entry(entry_file(tmp_path, "two", protocol, n_policies=2, training=IN_10M))


def test_one_network_in_five_files_is_no_five_trainings(protocol, tmp_path):
    entry = made_up_entry(protocol, "copies", lambda k: 10.0, measures=(), n_policies=5, training=IN_10M)
    for digests in ("abcde", "abcda"):
        policies = tuple(replace(one, digest=mark) for one, mark in zip(entry.policies, digests, strict=True))
        replace(entry, policies=policies).write(tmp_path / f"{digests}.json")
    assert read_entry(tmp_path / "abcde.json").name == "copies"
    with pytest.raises(BenchmarkError, match=r"Expected different trainings in .*abcda\.json, got one file twice"):
        read_entry(tmp_path / "abcda.json")


def test_entries_of_two_versions_are_on_no_board(protocol):
    entries = [
        made_up_entry(of, name, lambda k: 10.0, measures=())
        for of, name in ((load_protocol(version=1), "first"), (protocol, "second"))
    ]
    with pytest.raises(BenchmarkError, match=r"one version .*, got 'second' of version 2 beside 'first' of version 1;"):
        board_of(entries)


def test_versions_that_there_are_not_are_refused(tmp_path):
    with pytest.raises(BenchmarkError, match="Expected version 1, 2 or 3 of the benchmark, got 4"):
        load_protocol(version=4)
    file = entry_file(tmp_path, "fourth", replace(load_protocol(TINY), version=4))
    with pytest.raises(BenchmarkError, match=r"version 1, 2 or 3 of the benchmark, got 4 in .*fourth\.json"):
        read_entry(file)


@pytest.mark.parametrize("version", [2, 3])
def test_no_world_has_an_arena_in_which_the_shipped_generalist_was_trained_or_evaluated(version):
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
    assert not [world.name for world in load_protocol(version=version).scored if world.world.scenario.arena in arenas]


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
        yield dict(zip(choices, map(as_tuples, picked), strict=True))
