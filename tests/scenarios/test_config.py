"""Configurations are complete, changed by the name of a field, told in words, and refuse worlds that cannot be."""

import dataclasses
import json
import math

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError, read
from swarm_forage_env.scenarios.config import SECTIONS, ArenaConfig, ScenarioConfig, to_mapping
from swarm_forage_env.scenarios.differences import difference_words, differences
from swarm_forage_env.scenarios.overrides import field_sections, with_overrides
from swarm_forage_env.scenarios.performance import performance_curve, performance_of
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario
from swarm_forage_env.scenarios.quirks import AUTHORS_PROGRAM

OTHERS = {
    "name": "mine", "caches": "static", "performance": "first_picked", "dt_s": 0.1, "interval_s": 100.0,
    "physics": "chipmunk", "physics_substeps": (0.2,) * 5, "width_m": 50.0, "nest_size_m": (4.0, 6.0),
    "further_nests": ((2.0, 2.0, 3.0, 3.0),), "n_robots": 3, "neighbours_seen": 3, "n_objects": 7,
    "placement": "dual_source", "side_share": 0.1, "team": True, "delivery": 2.0, "scattered_sites": True,
}  # fmt: skip


def test_every_field_can_be_set_by_its_name():
    base, table = scenario("warehouse_medium"), field_sections()
    names = [item.name for section in (ScenarioConfig, *SECTIONS.values()) for item in dataclasses.fields(section)]
    assert len(names) == len(set(names)), "unique across sections"
    assert table.keys() == set(names) - SECTIONS.keys()
    for name, value in OTHERS.items():
        changed = with_overrides(base, **{name: value})
        assert getattr(getattr(changed, table[name]) if table[name] else changed, name) == value
        back = getattr(getattr(base, table[name]) if table[name] else base, name)
        assert with_overrides(changed, **{name: back}) == base != changed


def test_sections_may_be_replaced_whole_and_quirks_by_the_name_of_rules():
    base = scenario("warehouse_small")
    robots = dataclasses.replace(base.robots, n_robots=7)
    assert with_overrides(base, robots=robots, radius_m=0.09).robots == dataclasses.replace(robots, radius_m=0.09)
    assert with_overrides(base, quirks="AUTHORS_PROGRAM").quirks == AUTHORS_PROGRAM
    with pytest.raises(ConfigError, match="Unknown rules 'AUTHORS'"):
        with_overrides(base, quirks="AUTHORS")


@pytest.mark.parametrize("name", SCENARIO_NAMES)
def test_a_scenario_is_read_back_from_json(name):
    config = scenario(name, obstacles=((5.0, 2.0, 5.4, 2.6),))
    assert read(ScenarioConfig, json.loads(json.dumps(to_mapping(config)))) == config
    assert hash(config) == hash(scenario(name, obstacles=[[5, 2, 5.4, 2.6]]))


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"n_robot": 4}, "Unknown scenario field 'n_robot'. Did you mean 'n_robots'?"),
        ({"n_robots": 0}, "robots.n_robots to be a whole number >= 1, got 0"),
        ({"quirks": True}, "scenario.quirks to be a Quirks, got True"),
        ({"placement": "single_sorce"}, "Did you mean 'single_source'?"),
        ({"performance": "colected"}, "Did you mean 'collected'?"),
        ({"name": "../elsewhere"}, "scenario.name to be at most 60 characters"),
        ({"width_m": 1e9}, "at most 1,073,741,824 cells"),
        ({"height_m": 48.1}, "arena.height_m to be a multiple of 0.2 m"),
        ({"width_m": 1.8}, "at least 2 m, got 1.8"),
        ({"nest_centre_m": (46.0, 24.0)}, "inside the 48.0 x 48.0 m arena, got centre (46.0, 24.0)"),
        ({"nest_centre_m": (24.0, 2.0)}, "got centre (24.0, 2.0)"),
        ({"nest_size_m": (0.05, 9.6)}, "a nest of at least one cell"),
        ({"start_margin_m": 0.48}, "robots.start_margin_m >= 0.485"),
        ({"start_margin_m": 24.0}, "an arena larger than twice robots.start_margin_m = 24.0"),
        ({"n_objects": 25_921}, "at most 25920 objects for placement 'random'"),
        ({"side_share": 0.0001}, "cache.side_share to give caches of at least one cell"),
        ({"caches": "dynamic", "side_share": 0.5, "height_m": 30.0, "nest_centre_m": (24.0, 15.0)}, "dynamic caches"),
        ({"dt_s": 1.0}, "at most their radius of 0.085036758 m per tick"),
        ({"max_speed_mps": 5.0, "dt_s": 0.5}, "got 0.2 m/s for dt_s = 0.5 s"),
        ({"horizon_s": 100.1}, "horizon_s to be a whole number of ticks of 0.2 s"),
        ({"interval_s": 0.1}, "interval_s to be a whole number of ticks"),
        ({"physics_substeps": (1 / 3,) * 3}, "at least 4 equal shares"),
        ({"physics_substeps": (0.2,) * 4}, "that sum to 1"),
        ({"physics_substeps": (0.5, 0.2, 0.15, 0.15)}, "equal shares"),
        ({"physics_substeps": (1 / 101,) * 101}, "at most 100"),
    ],
)  # fmt: skip
def test_worlds_that_cannot_be_are_refused(overrides, words):
    with pytest.raises(ConfigError) as caught:
        with_overrides(scenario("warehouse_medium"), **overrides)
    assert words in str(caught.value)


def test_the_largest_numbers_that_fit_are_taken():
    assert scenario("warehouse_small", n_objects=896).objects.n_objects == 896
    with pytest.raises(ConfigError, match="at most 896 objects"):
        scenario("warehouse_small", n_objects=897)
    most = int(0.4 * (16.0 - 5.6) ** 2 / (math.pi * 0.085036758**2))
    assert scenario("search_and_rescue", side_m=16, n_robots=most).robots.n_robots == most
    with pytest.raises(ConfigError, match=rf"at most {most} robots in a start area of 10\.4 x 10\.4 m"):
        scenario("search_and_rescue", side_m=16, n_robots=most + 1)
    assert scenario("search_and_rescue", n_objects=4_000).objects.n_objects == 4_000, "left to the draw"


def test_a_nest_is_snapped_to_whole_cells():
    arena = ArenaConfig(width_m=16, height_m=16, nest_centre_m=(8.03, 8.0), nest_size_m=(3.25, 3.2))
    assert arena.nest_cells == (32, 32, 48, 48)
    assert arena.nest_box_m == (6.4, 6.4, 9.6, 9.6)
    assert ArenaConfig(width_m=2, height_m=2, nest_centre_m=(1, 1), nest_size_m=(0.4, 0.4)).n_cells == (10, 10)


# What a scenario has that its preset has not


WALL = ((10.0, 4.0, 11.0, 12.0),)


@pytest.mark.parametrize("name", SCENARIO_NAMES)
def test_a_preset_of_any_size_differs_in_nothing(name):
    for sizes in ({}, {"n_robots": 5}):
        config = scenario(name, **sizes)
        assert (differences(config), difference_words(config)) == ({}, ())


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"n_objects": 1}, ("1 object",)),
        ({"obstacles": WALL}, ("obstacles 10,4,11,12",)),
        ({"nest_centre_m": (16.0, 8.0)}, ("nest 3.2 x 12.8 m at 16,8",)),
        ({"width_m": 40.0}, ("40 x 16 m", "nest 3.2 x 12.8 m at 3.2,8")),
        ({"density": 0.05, "n_robots": 200}, ("89.6 x 44.8 m", "1,568 objects")),
        ({"caches": "static"}, ("static caches",)),
        ({"physics": "chipmunk"}, ("physics chipmunk",)),
        ({"max_speed_mps": 0.05}, ("max speed 0.05 m/s",)),
        ({"quirks": "AUTHORS_PROGRAM"}, ("rules AUTHORS_PROGRAM",)),
        ({"scattered_sites": True}, ("quirks scattered_sites",)),
        ({"horizon_s": 400.0, "interval_s": 100.0, "performance": "n_active"}, ()),
    ],
)
def test_differences_are_told_in_words(fields, words):
    assert difference_words(scenario("warehouse_small", **fields)) == words


TASKS = ("generalist", "harvester", "collector", "starter", "finisher", "transferer", "cache_collector")


def curve(name, **columns):
    given = {key: np.asarray(values) for key, values in columns.items()}
    return performance_curve(name, {"interval": np.arange(len(next(iter(given.values())))), **given})


def balance(**shares):
    return curve("task_balance", **{f"task_share_{task}": [share] for task, share in shares.items()})[0]


def test_columns_are_taken_as_they_are_or_turned_round():
    """A tenth of the time lost is worth 10, half of it 2; no loss at all is 0, because distances need finite curves."""
    found = curve("cache_drops", cache_drops=np.array([3, 0, 5]))
    assert (found.tolist(), found.dtype) == ([3.0, 0.0, 5.0], np.float64)
    assert curve("1/interference_fraction", interference_fraction=[0.1, 0.5, 0.0]) == pytest.approx([10.0, 2.0, 0.0])
    assert curve("deaths", n_active=[1.0]).tolist() == [0.0]
    assert curve("task_share_none", n_active=[1.0]).tolist() == [1.0]
    assert curve("believed_interference_fraction", interference_fraction=[0.3]).tolist() == [0.3]


def test_load_is_objects_per_cache():
    """Six objects in two caches are 3 per cache; before the first cache stands there is no load."""
    loads = {"n_objects_cached": [6.0, 0.0, 5.0], "n_caches": [2.0, 0.0, 0.5]}
    assert curve("cache_load", **loads).tolist() == [3.0, 0.0, 10.0]
    np.testing.assert_allclose(curve("1/cache_load", **loads), [1 / 3, 0.0, 0.1])


def test_balance_of_tasks_is_the_entropy_of_their_shares_among_robots_with_a_task():
    assert balance(**dict.fromkeys(TASKS, 1 / 7)) == pytest.approx(1.0)
    # 1/4 ln 4 + 3/4 ln 4/3 = 0.5623, over ln 7 = 1.9459
    assert balance(harvester=0.25, collector=0.75) == pytest.approx(0.28899, abs=1e-5)
    assert balance(generalist=1.0) == balance(none=1.0) == 0.0
    assert balance(none=0.5, harvester=0.25, collector=0.25) == pytest.approx(math.log(2) / math.log(7))


def test_balance_takes_its_logarithms_from_the_c_library():
    """The last bits of numpy's depend on the processor, and a record holds this curve."""
    shares = np.random.default_rng(0).integers(1, 500, (len(TASKS), 400))
    found = curve("task_balance", **{f"task_share_{task}": row for task, row in zip(TASKS, shares, strict=True)})
    for balance_then, column in zip(found.tolist(), shares.T.tolist(), strict=True):
        total = 0.0
        for share in column:
            total += share / sum(column) * math.log(share / sum(column))
        assert balance_then == -total / math.log(7)


def test_names_units_and_what_adds_up():
    told = [performance_of(name) for name in ("collected", "1/n_active", "cache_load", "1/cache_load", "task_balance")]
    assert [one.unit for one in told] == ["objects", "1/robots", "objects per cache", "1/(objects per cache)", "1"]
    assert [one.title for one in told[:2]] == ["deliveries", "1/robots at work"]
    assert [one.adds_up for one in told] == [True, False, False, False, False]
    with pytest.raises(ConfigError, match="Did you mean '1/collected'"):
        performance_of("1/deliveries")
