"""Kinds of robots as data: who is of which kind, what is refused, and every way to write them down."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm_forage_env import ConfigError, plan_run, scenario
from swarm_forage_env.cli.scenario_options import parse_setting
from swarm_forage_env.contract.layout import WINDOW_CELLS, observation_layout
from swarm_forage_env.scenarios.config import ScenarioConfig, from_mapping, to_mapping
from swarm_forage_env.scenarios.robots import (
    SENSORS,
    WINDOWS_CELLS,
    RobotKind,
    kind_from_words,
    kind_rows,
    kind_sizes,
    words_of_kind,
)
from swarm_forage_env.studies.study import Axis, list_word
from swarm_forage_env.views.sampler import SampledWorld, ScenarioSampler

SCOUT = RobotKind(name="scout", share=0.2, window_cells=3)
HAULER = RobotKind(name="hauler", speed=0.5, lacks=("light", "los_cache"))
WORDS = "scout:share=0.2,window_cells=3+hauler:speed=0.5,lacks=light/los_cache"


def of_shares(*shares: float | None) -> tuple[RobotKind, ...]:
    return tuple(RobotKind(name=f"kind_{place}", share=share) for place, share in enumerate(shares))


@pytest.mark.parametrize(
    ("shares", "n_robots", "sizes"),
    [
        ((0.5, 0.3, 0.2), 10, (5, 3, 2)),
        ((0.5, 0.3, 0.2), 6, (3, 2, 1)),
        ((0.5, 0.5), 3, (2, 1)),  # equal remainders: the earlier kind
        ((0.2, None), 50, (10, 40)),
        ((None, 0.2), 2, (2, 0)),
        ((0.0, None), 5, (0, 5)),
        ((1.0, None), 5, (5, 0)),
        ((1 / 3, 1 / 3, 1 / 3), 10, (4, 3, 3)),
        ((0.1, 0.2, 0.7), 10, (1, 2, 7)),  # sums of tenths are not exact
        ((None,), 4, (4,)),
        ((), 4, ()),
    ],
)
def test_shares_are_robots_by_largest_remainder(shares, n_robots, sizes):
    assert kind_sizes(of_shares(*shares), n_robots) == sizes


@given(weights=st.lists(st.integers(1, 1000), min_size=1, max_size=16), n_robots=st.integers(1, 20_000))
def test_every_robot_has_a_kind_and_no_kind_is_off_by_one(weights, n_robots):
    shares = [weight / sum(weights) for weight in weights]
    sizes = kind_sizes(of_shares(*shares), n_robots)
    assert sum(sizes) == n_robots
    assert all(abs(size - share * n_robots) < 1.0 + 1e-6 for size, share in zip(sizes, shares, strict=True))


def test_the_first_rows_are_of_the_first_kind():
    assert kind_rows((SCOUT, HAULER), 50) == (slice(0, 10), slice(10, 50))
    robots = scenario("warehouse_small", robot_kinds=(SCOUT, HAULER)).robots
    assert [robots.kind_of(row) for row in (0, 9, 10, 49)] == ["scout", "scout", "hauler", "hauler"]
    assert scenario("warehouse_small").robots.kind_of(0) is None


@pytest.mark.parametrize(
    ("kinds", "words"),
    [
        ([SCOUT], "a tuple of kinds"),
        ("scout", "a tuple of kinds"),
        (("scout",), "a RobotKind or a table"),
        (({"share": 0.2},), "Missing name"),
        (({"name": "a", "spead": 0.2},), r"'spead'\. Did you mean 'speed'"),
        (({"name": "two words"},), "letters, digits and _"),
        (({"name": 3},), "letters, digits and _"),
        (({"name": "none"},), "not to be 'none', which stands for a swarm without kinds"),
        (({"name": "a", "speed": 1.5},), r"at most 1, got 1\.5: it is a share of max_speed_mps"),
        (({"name": "a", "speed": 0},), "the speed of robot kind a"),
        (({"name": "a", "share": -0.1}, {"name": "b"}), "the share of robot kind a"),
        (({"name": "a", "window_cells": 2},), "window_cells of robot kind a to be one of 1, 3, 5"),
        (({"name": "a", "window_cells": True},), "window_cells of robot kind a to be a whole number"),
        (({"name": "a", "window_cells": 3.0},), r"window_cells of robot kind a to be a whole number, got 3\.0"),
        (({"name": "a", "window_cells": np.int64(3)},), r"a whole number, got .*int\("),
        (({"name": "a", "lacks": "light"},), "lacks as a tuple of names"),
        (({"name": "a", "lacks": ["light", "light"]},), "each name once"),
        (({"name": "a", "lacks": ["lihgt"]},), "what robot kind a lacks .* Did you mean 'light'"),
        (({"name": "a", "lacks": ["ground"]},), "what robot kind a lacks"),
        (({"name": "a"}, {"name": "b"}), "one robot kind at most without a share"),
        (({"name": "a", "share": 0.2}, {"name": "a"}), "each name once"),
        (({"name": "a", "share": 0.7}, {"name": "b", "share": 0.7}), "add up to 1, got a: 0.7, b: 0.7"),
        (({"name": "a", "share": 0.2}, {"name": "b", "share": 0.7}), "leave one share out"),
        (tuple({"name": f"k{place}", "share": 1 / 17} for place in range(17)), "at most 16 robot kinds, got 17"),
    ],
)
def test_what_no_kinds_are(kinds, words):
    with pytest.raises(ConfigError, match=words):
        scenario("warehouse_small", robot_kinds=kinds)


def test_kinds_may_lack_own_sensors_of_the_scenario_only():
    kinds = (RobotKind(name="a", lacks=("compass",)),)
    assert scenario("warehouse_small", own_sensors=("compass",), robot_kinds=kinds).robots.robot_kinds == kinds
    with pytest.raises(ConfigError, match="what robot kind a lacks"):
        scenario("warehouse_small", robot_kinds=kinds)


def test_every_sensor_that_may_be_lacking_is_a_slice():
    optional = ("neighbours", "messages")
    assert set(SENSORS) - set(observation_layout(1.0, 1.0, 1).names) == set(optional)
    assert WINDOWS_CELLS[-1] == WINDOW_CELLS


def test_kinds_are_read_back_from_every_form():
    config = scenario("warehouse_small", robot_kinds=(SCOUT, HAULER))
    assert from_mapping(ScenarioConfig, json.loads(json.dumps(to_mapping(config)))) == config
    tables = (
        {"name": "scout", "share": 0.2, "window_cells": 3},
        {"name": "hauler", "speed": 0.5, "lacks": HAULER.lacks},
    )
    assert scenario("warehouse_small", robot_kinds=tables) == config
    assert parse_setting(f"robot_kinds={WORDS}") == ("robot_kinds", (SCOUT, HAULER))
    assert "+".join(map(words_of_kind, (SCOUT, HAULER))) == list_word(tables) == WORDS
    assert kind_from_words("scout") == RobotKind(name="scout")
    assert words_of_kind(RobotKind(name="scout")) == words_of_kind({"name": "scout", "lacks": []}) == "scout"
    Axis(name="robot_kinds", values=("none", WORDS))


@pytest.mark.parametrize(
    ("word", "words"),
    [
        ("scout:speed=fast", "speed of robot kind scout to be a number, got 'fast'"),
        ("scout:spead=1", "Did you mean 'speed'. Known: share, speed, window_cells, lacks"),
        ("scout:speed", "NAME:key=value"),
        ("scout:lacks=light,proximity", "several sensors as lacks=light/proximity"),
        ("scout:lacks=", r"lacks of robot kind scout to be sensors, such as light or light/proximity .*, got ''"),
        ("scout:lacks=light/", "lacks of robot kind scout to be sensors"),
        ("scout:share=0.2,share=0.4", "each key of robot kind scout once, got share twice"),
        ("scout:window_cells=3.0", r"window_cells of robot kind scout to be a whole number, got '3\.0'"),
        ("none:speed=0.5", "not to be 'none'"),
        ("scout:speed=2", "at most 1, got 2"),
    ],
)
def test_words_that_are_no_kinds(word, words):
    with pytest.raises(ConfigError, match=words):
        parse_setting(f"robot_kinds={word}")


def test_identities_are_those_of_before_where_there_are_none():
    plain, empty, kinded = (
        plan_run(scenario("warehouse_small", **fields), "crw", seed=1).run_id
        for fields in ({}, {"robot_kinds": ()}, {"robot_kinds": (SCOUT, HAULER)})
    )
    assert plain == empty != kinded


def test_kinds_can_be_drawn():
    kinds = [{"name": "slow", "share": {"uniform": [0.1, 0.9]}, "speed": {"uniform": [0.3, 1.0]}}, HAULER]
    world = SampledWorld(scenario={"preset": "warehouse_small", "robot_kinds": kinds})
    worlds = ScenarioSampler(worlds=(world,))
    again = ScenarioSampler.from_mapping(json.loads(json.dumps(worlds.to_mapping())))
    found = [worlds.world_of(seed).scenario.robots.robot_kinds for seed in range(20)]
    assert found == [again.world_of(seed).scenario.robots.robot_kinds for seed in range(20)]
    assert {hauler for _, hauler in found} == {HAULER}
    shares, speeds = zip(*((slow.share, slow.speed) for slow, _ in found), strict=True)
    assert len(set(shares)) == len(set(speeds)) == 20
    assert 0.1 <= min(shares) < max(shares) <= 0.9
    too_fast = [{"name": "slow", "speed": {"uniform": [0.5, 2.0]}}]
    with pytest.raises(ConfigError, match=r"robot_kinds\.0\.speed = 2"):
        ScenarioSampler(worlds=(SampledWorld(scenario={"preset": "warehouse_small", "robot_kinds": too_fast}),))
    with pytest.raises(ConfigError, match="either all or none two or more robot_kinds"):
        ScenarioSampler(worlds=(world, SampledWorld(scenario="warehouse_small")))


@pytest.mark.parametrize("window", [{"uniform": [1, 5]}, {"log_uniform": [1, 3]}, {"uniform": [3, 3]}])
def test_windows_are_drawn_from_a_choice(window):
    kinds = [{"name": "near", "share": 0.5, "window_cells": window}, HAULER]
    with pytest.raises(ConfigError, match=r"window_cells of robot kind near .*choice of 1, 3, 5, got"):
        SampledWorld(scenario={"preset": "warehouse_small", "robot_kinds": kinds})
    shared = {"robot_kinds": kinds}
    with pytest.raises(ConfigError, match=r"choice = \[1, 3, 5\]"):
        ScenarioSampler(worlds=(SampledWorld(scenario="warehouse_small"),), scenario=shared)
    chosen = [{**kinds[0], "window_cells": {"choice": [1, 3, 5]}}, HAULER]
    worlds = ScenarioSampler(worlds=(SampledWorld(scenario={"preset": "warehouse_small", "robot_kinds": chosen}),))
    assert {worlds.world_of(seed).scenario.robots.robot_kinds[0].window_cells for seed in range(20)} == {1, 3, 5}
