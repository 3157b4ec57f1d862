"""Version 3 of the benchmark: worlds in which coordination pays, each also without what robots coordinate by."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from metrics import PAPER_POLICIES
from metrics.benchmark import (
    BenchmarkError,
    details_page,
    load_protocol,
    page_block,
    read_entry,
    reference_of,
    standing_of,
)
from metrics.benchmark.pairs import SAME, gain, pairs_sheet
from metrics.benchmark.standing import scripted_entries
from metrics.statistics import aggregate
from swarm_forage_env import plan_run
from swarm_forage_env.contract.policy import layout_for
from swarm_forage_env.env import ForageEnv
from tests.support.entries import TINY, made_up_entry

IDENTITY_OF_VERSION_3 = "48411ee7f3279c63"
"""A change of worlds, seeds, lengths or tracks is another version: entries of this one must stay comparable."""
LACKS = {"messages": "nobody hears", "neighbours": "nobody seen", "kinds": "all alike"}


@pytest.fixture(scope="module")
def protocol():
    return load_protocol(version=3)


def test_version_3_never_changes(protocol):
    assert (protocol.version, protocol.identity) == (3, IDENTITY_OF_VERSION_3)


def test_robots_can_coordinate_in_every_world_by_the_same_interface(protocol):
    layouts = {
        tuple((part.name, len(range(part.start, part.stop))) for part in layout_for(each.world.scenario))
        for each in protocol.worlds
    }
    assert len(layouts) == 1


def test_no_world_is_one_of_another_version(protocol):
    known = [each.world for version in (1, 2) for each in load_protocol(version=version).worlds]
    assert not [each.name for each in protocol.worlds if any(each.world.scenario == one.scenario for one in known)]


@pytest.mark.parametrize("policy", ["crw", "stochm", "stochx", "cpfa"])
def test_controllers_with_and_without_caches_fit_into_every_world(protocol, policy):
    for world in protocol.worlds:
        ForageEnv(plan_run(world.world, policy).scenario).reset(seed=protocol.seeds[0])


def test_every_variant_has_one_without_that_differs_in_what_robots_can_do_only(protocol):
    assert len(protocol.pairs) == 8
    for whole, lacking in protocol.pairs:
        assert whole.counts
        assert not lacking.counts
        assert lacking.role == "no, to compare with"
        assert lacking.name == f"{whole.name}, {LACKS[whole.group]}"
        with_, without = whole.world.scenario, lacking.world.scenario
        assert replace(without, robots=replace(without.robots, robot_kinds=with_.robots.robot_kinds)) == with_
        kinds = zip(with_.robots.robot_kinds, without.robots.robot_kinds, strict=True)
        for can, cannot in kinds:
            assert cannot == replace(can, speed=cannot.speed, lacks=cannot.lacks)
            assert can.lacks == ()
            assert cannot.lacks == (() if whole.group == "kinds" else (whole.group,))


def test_robots_that_are_all_alike_have_the_mean_speed(protocol):
    for whole, lacking in protocol.pairs:
        speeds = [
            np.average([kind.speed for kind in each.world.scenario.robots.robot_kinds], weights=(0.25, 0.75))
            for each in (whole, lacking)
        ]
        assert speeds[0] == pytest.approx(speeds[1])


def test_fields_of_all_worlds_give_way_to_those_of_a_group_and_these_to_those_of_a_variant(tmp_path):
    file = tmp_path / "protocol.toml"
    common = "[set]\nn_robots = 5\nn_objects = 40\n\n"
    variants = '\n[group.variants]\n"few" = { n_objects = 30 }\n\n[group.without]\n"slow" = { max_speed_mps = 0.05 }\n'
    text = TINY.read_text().replace("[quick]", f"{common}[quick]").replace("n_robots = 4, n_objects = 60, ", "")
    file.write_text(text.replace("sizes = [1, 2, 4]", "sizes = [1, 2, 5]") + variants)
    worlds = {each.name: each.world.scenario for each in load_protocol(file).worlds}
    assert (worlds["training: here"].robots.n_robots, worlds["training: here"].objects.n_objects) == (3, 60)
    assert (worlds["room, few"].robots.n_robots, worlds["room, few"].objects.n_objects) == (5, 30)
    assert worlds["room, noisy wheels"].objects.n_objects == 40
    assert worlds["room, few, slow"].robots.max_speed_mps == 0.05
    assert worlds["room, few, slow"].objects.n_objects == 30


def pair_entry(protocol, with_, without, **fields):
    """An entry whose runs are these numbers in the first world that can be compared, 1 elsewhere."""
    whole, lacking = protocol.pairs[0]
    entry = made_up_entry(protocol, "it", lambda k: 1.0, measures=(), **fields)
    told = {whole.name: with_, lacking.name: without}
    runs = {name: {**rows, "performance": told.get(name, with_)} for name, rows in entry.runs.items()}
    return replace(entry, runs=runs)


def test_a_gain_is_that_of_runs_with_the_same_seed(protocol):
    entry = pair_entry(protocol, [[12.0, 23.0, 34.0]], [[10.0, 20.0, 30.0]])
    found, expected = gain(entry, *protocol.pairs[0]), aggregate(np.array([2.0, 3.0, 4.0]) / 20.0)
    assert (found.mean, found.lower, found.upper) == pytest.approx((expected.mean, expected.lower, expected.upper))
    assert pairs_sheet([entry], protocol).rows[0][2] == "+15 % (+3 % to +27 %): 23 against 20"


def test_the_interval_of_several_trainings_is_that_over_trainings(protocol):
    rows = [[12.0, 22.0, 32.0], [14.0, 24.0, 34.0]]
    entry = pair_entry(protocol, rows, [[10.0, 20.0, 30.0]] * 2, n_policies=2)
    found, expected = gain(entry, *protocol.pairs[0]), aggregate([2.0 / 20.0, 4.0 / 20.0])
    assert (found.mean, found.lower, found.upper) == pytest.approx((expected.mean, expected.lower, expected.upper))


def test_a_gain_over_nothing_is_no_number(protocol):
    entry = pair_entry(protocol, [[1.0] * 3], [[0.0] * 3])
    assert math.isnan(gain(entry, *protocol.pairs[0]).mean)
    assert pairs_sheet([entry], protocol).rows[0][2] == "1 against nothing"


def test_runs_that_do_not_differ_are_called_the_same(protocol):
    entry = pair_entry(protocol, [[1.0] * 3], [[1.0] * 3])
    assert {row[2] for row in pairs_sheet([entry], protocol).rows} == {SAME}


def test_the_page_shows_gains_where_there_are_pairs_and_measures_where_there_are_some(protocol):
    for version, fields, is_there in ((protocol, {"measures": ()}, True), (load_protocol(TINY), {}, False)):
        entries = [made_up_entry(version, name, lambda k: 10.0, **fields) for name in PAPER_POLICIES]
        reference = reference_of(entries, version)
        standings = [standing_of(entry, reference, version) for entry in entries]
        block, details = page_block(standings, version), details_page(standings, reference, version, "page.md")
        assert ("### What coordination brings" in block) is is_there
        assert ("### Measure by measure" in block) is not is_there
        assert ("## All measures" in details) is not is_there


def test_who_reads_no_messages_runs_the_same_where_nobody_hears(protocol):
    for entry in scripted_entries(protocol):
        for whole, lacking in protocol.pairs:
            if whole.group != "kinds":
                assert entry.runs[whole.name] == entry.runs[lacking.name]


def test_a_key_that_a_group_does_not_know_is_refused(tmp_path):
    file = tmp_path / "protocol.toml"
    file.write_text(TINY.read_text() + '\n[group.with]\n"x" = {}\n')
    with pytest.raises(BenchmarkError, match=r"group\.with"):
        load_protocol(file)


def test_messages_pay_in_the_stored_runs_of_cpfa(protocol):
    of_cpfa = read_entry(Path(__file__).parents[3] / "docs/benchmark/v3/cpfa.json")
    found = [gain(of_cpfa, *pair) for pair in protocol.pairs if pair[0].name == "messages, one heap"]
    assert [each.lower > 0.0 for each in found] == [True]
