"""Configurations are complete and refuse wrong values at construction, each with a helpful message."""

import dataclasses
import json
import math
from typing import Any

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.scenarios.config import (
    SECTIONS,
    ArenaConfig,
    CacheConfig,
    ObjectConfig,
    ScenarioConfig,
    from_mapping,
    to_mapping,
)
from swarm_forage_env.scenarios.overrides import field_sections, with_overrides
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, SEARCH_AND_RESCUE_OBJECTS, scenario
from swarm_forage_env.scenarios.quirks import Quirks

PRESETS = [scenario(name) for name in SCENARIO_NAMES] + [
    scenario("search_and_rescue", side_m=side) for side in SEARCH_AND_RESCUE_OBJECTS
]

OTHER_VALUES: dict[str, Any] = {
    "name": "mine",
    "caches": "static",
    "performance": "first_picked",
    "dt_s": 0.1,
    "horizon_s": 2_000.0,
    "interval_s": 100.0,
    "physics": "compiled",
    "physics_substeps": (0.2,) * 5,
    "width_m": 50.0,
    "height_m": 52.0,
    "nest_centre_m": (20.0, 22.0),
    "nest_size_m": (4.0, 6.0),
    "further_nests": ((2.0, 2.0, 3.0, 3.0),),
    "obstacles": ((10.0, 10.0, 10.4, 12.0), (30.0, 8.0, 31.0, 9.0)),
    "n_robots": 3,
    "radius_m": 0.07,
    "wheel_base_m": 0.12,
    "max_speed_mps": 0.05,
    "max_wheel_difference_mps": 0.1,
    "start_margin_m": 3.0,
    "n_objects": 7,
    "placement": "dual_source",
    "object_positions_m": ((30.0, 30.0),),
    "walk_probability": 0.026,
    "pickup_ticks": 5,
    "drop_ticks": 3,
    "side_share": 0.1,
    "distance_share": 0.3,
    "static_size": 3,
    "respawn_scale": 0.1,
    "delivery": 2.0,
    "first_pickup": 0.5,
    "nest_progress": 0.01,
    "interference": -0.1,
    "tick": -0.001,
    "team": True,
    "neighbours_seen": 3,
    "neighbour_range_m": 1.5,
    "message_size": 2,
    "message_range_m": 4.0,
    **dict.fromkeys((item.name for item in dataclasses.fields(Quirks)), True),
}


OWN_PLACES: dict[str, Any] = {"placement": "positions", "n_objects": 1}
"""What goes with positions of one's own."""


def refusal(preset: str = "warehouse_medium", **overrides: Any) -> str:
    with pytest.raises(ConfigError) as caught:
        with_overrides(scenario(preset), **overrides)
    return str(caught.value)


def test_every_field_can_be_overridden_by_name():
    base = scenario("warehouse_medium")
    table = field_sections()
    assert set(OTHER_VALUES) == set(table)
    for name, value in OTHER_VALUES.items():
        beside = OWN_PLACES if name == "object_positions_m" else {}
        changed = with_overrides(base, **{name: value, **beside})
        holder = getattr(changed, table[name]) if table[name] else changed
        assert getattr(holder, name) == value
        back = getattr(base, table[name]) if table[name] else base
        before = {field: getattr(base.objects, field) for field in beside}
        assert with_overrides(changed, **{name: getattr(back, name), **before}) == base


def test_field_names_are_unique_across_sections():
    names = [item.name for section in (ScenarioConfig, *SECTIONS.values()) for item in dataclasses.fields(section)]
    assert len(names) == len(set(names))


@pytest.mark.parametrize("config", PRESETS, ids=lambda config: f"{config.name}-{config.arena.width_m:g}")
def test_mapping_round_trip(config):
    assert from_mapping(ScenarioConfig, to_mapping(config)) == config
    assert from_mapping(ScenarioConfig, json.loads(json.dumps(to_mapping(config)))) == config


def test_mapping_uses_defaults_for_what_is_left_out():
    mapping = {
        "name": "tiny",
        "arena": {"width_m": 16, "height_m": 16, "nest_centre_m": [8, 8], "nest_size_m": [3.2, 3.2]},
        "robots": {"n_robots": 2},
        "objects": {"n_objects": 5, "placement": "random"},
    }
    config = from_mapping(ScenarioConfig, mapping)
    assert config.cache == CacheConfig()
    assert config.horizon_s == 10_000.0
    assert config.physics == "compiled"


def test_mapping_refuses_unknown_keys_with_the_nearest():
    mapping = to_mapping(scenario("warehouse_small"))
    mapping["arena"]["widht_m"] = 3.0
    with pytest.raises(ConfigError, match=r"Unknown key 'arena\.widht_m'\. Did you mean 'width_m'\?"):
        from_mapping(ScenarioConfig, mapping)
    with pytest.raises(ConfigError, match=r"Unknown key 'horizon'\. Did you mean 'horizon_s'\?"):
        from_mapping(ScenarioConfig, {"horizon": 3.0})


@pytest.mark.parametrize(
    ("overrides", "parts"),
    [
        ({"n_robots": 0}, ("robots.n_robots to be a whole number >= 1", "got 0")),
        ({"n_robots": -4}, ("robots.n_robots to be a whole number >= 1", "got -4")),
        ({"n_robots": 2.0}, ("robots.n_robots to be a whole number", "got 2.0")),
        ({"n_robots": True}, ("robots.n_robots to be a whole number", "got True.")),
        ({"n_robots": np.int64(5)}, ("robots.n_robots to be a whole number", "convert it with int()")),
        ({"width_m": 1e9}, ("at most 1,073,741,824 cells", "4 GiB", "1000000000.0 x ")),
        ({"dt_s": 1.0}, ("at most their radius of 0.085036758 m per tick", "0.1 m/s for dt_s = 1.0 s")),
        ({"max_speed_mps": 5.0, "dt_s": 0.5}, ("at most their radius", "got 0.2 m/s")),
        ({"radius_m": -0.1}, ("robots.radius_m to be a finite number > 0", "got -0.1")),
        ({"wheel_base_m": math.nan}, ("robots.wheel_base_m to be a finite number", "got nan")),
        ({"max_speed_mps": math.inf}, ("robots.max_speed_mps to be a finite number", "got inf")),
        ({"start_margin_m": 0.3}, ("robots.start_margin_m >= 0.485", "got 0.3")),
        ({"start_margin_m": 24.0}, ("arena larger than twice robots.start_margin_m = 24.0", "lower the margin")),
        ({"n_objects": 0}, ("objects.n_objects to be a whole number >= 1", "got 0")),
        ({"n_objects": 25_921}, ("at most 25920 objects", "'random'", "got 25921", "fewer objects")),
        ({"placement": "anywhere"}, ("single_source, dual_source, quad_source, random, power_law", "'anywhere'")),
        ({"placement": "single_sorce"}, ("Did you mean 'single_source'?",)),
        ({"walk_probability": 1.5}, ("objects.walk_probability to be a number in [0, 1]", "got 1.5")),
        ({"walk_probability": -0.1}, ("objects.walk_probability to be a number in [0, 1]", "got -0.1")),
        ({"walk_probability": math.nan}, ("objects.walk_probability to be a number in [0, 1]", "got nan")),
        ({"pickup_ticks": 0}, ("objects.pickup_ticks to be a whole number from 1 to 1,000,000", "got 0")),
        ({"drop_ticks": 2.5}, ("objects.drop_ticks to be a whole number", "got 2.5")),
        ({"width_m": -48.0}, ("arena.width_m to be a finite number > 0", "got -48.0")),
        ({"width_m": 0.0}, ("arena.width_m to be a finite number > 0", "got 0.0")),
        ({"height_m": math.nan}, ("arena.height_m to be a finite number", "got nan")),
        ({"height_m": "48"}, ("arena.height_m to be a finite number", "got '48'")),
        ({"height_m": 48.1}, ("arena.height_m to be a multiple of 0.2 m", "got 48.1")),
        ({"width_m": 1.8}, ("arena.width_m to be a multiple of 0.2 m and at least 2 m", "got 1.8")),
        ({"nest_centre_m": (46.0, 24.0)}, ("nest inside the 48.0 x 48.0 m arena", "(46.0, 24.0)", "(9.6, 9.6)")),
        ({"nest_centre_m": (24.0,)}, ("arena.nest_centre_m to be (x, y)", "got (24.0,)")),
        ({"nest_size_m": [9.6, 9.6]}, ("arena.nest_size_m to be (x, y)", "got [9.6, 9.6]")),
        ({"nest_size_m": (-1.0, 9.6)}, ("arena.nest_size_m[0] to be a finite number > 0", "got -1.0")),
        ({"nest_size_m": (0.05, 9.6)}, ("arena.nest_size_m of at least one cell", "got (0.05, 9.6)")),
        ({"side_share": 0.6}, ("cache.side_share to be a number in (0, 0.5]", "got 0.6")),
        ({"side_share": 0.0001}, ("cache.side_share to give caches of at least one cell", "got 0.0001")),
        ({"distance_share": 0.0}, ("cache.distance_share to be a finite number > 0", "got 0.0")),
        ({"static_size": 1}, ("cache.static_size to be a whole number >= 2", "got 1")),
        ({"respawn_scale": -1.0}, ("cache.respawn_scale to be a finite number >= 0", "got -1.0")),
        ({"delivery": math.inf}, ("reward.delivery to be a finite number", "got inf")),
        ({"team": "yes"}, ("reward.team to be True or False", "got 'yes'")),
        ({"integer_estimates": 1}, ("quirks.integer_estimates to be True or False", "got 1")),
        ({"caches": "dinamic"}, ("none, static, dynamic", "got 'dinamic'", "Did you mean 'dynamic'?")),
        ({"performance": "colected"}, ("performance to be a recorded column", "Did you mean 'collected'?")),
        ({"physics": "compild"}, ("physics to be one of compiled, chipmunk", "Did you mean 'compiled'?")),
        ({"name": "../elsewhere"}, ("scenario.name to be at most 60 characters", "got '../elsewhere'")),
        ({"name": ""}, ("scenario.name to be a non-empty text", "got ''")),
        ({"dt_s": 0.0}, ("scenario.dt_s to be a finite number > 0", "got 0.0")),
        ({"horizon_s": 100.1}, ("horizon_s to be a whole number of ticks of 0.2 s", "got 100.1")),
        ({"interval_s": 0.3}, ("interval_s to be a whole number of ticks of 0.2 s", "got 0.3")),
        ({"physics_substeps": (0.5, 0.4)}, ("scenario.physics_substeps", "sum to 1", "got (0.5, 0.4)")),
        ({"physics_substeps": 5}, ("scenario.physics_substeps", "sum to 1", "got 5")),
        ({"physics_substeps": (1.5, -0.5)}, ("scenario.physics_substeps to be positive shares", "got (1.5, -0.5)")),
        ({"physics_substeps": (1.0,)}, ("scenario.physics_substeps to be at least 4 equal shares", "got (1.0,)")),
        ({"physics_substeps": (1 / 101,) * 101}, ("equal shares of a tick", "and at most 100, got 101.")),
        ({"physics_substeps": (0.5, 0.25, 0.25)}, ("at least 4 equal shares", "got (0.5, 0.25, 0.25)")),
        ({"physics_substeps": (0.5, 0.2, 0.15, 0.15)}, ("at least 4 equal shares", "got (0.5, 0.2, 0.15, 0.15)")),
        ({"quirks": True}, ("quirks to be a Quirks", "got True")),
        ({"n_robot": 4}, ("Unknown scenario field 'n_robot'", "Did you mean 'n_robots'?")),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, dict) else "",
)
def test_refusals_say_what_was_expected_and_what_came(overrides, parts):
    message = refusal(**overrides)
    for part in parts:
        assert part in message


def test_as_many_objects_as_the_source_has_cells():
    assert scenario("warehouse_small", n_objects=896).objects.n_objects == 896
    assert "at most 896 objects" in refusal("warehouse_small", n_objects=897)


def test_robot_discs_cover_at_most_two_fifths_of_the_start_area():
    disc = math.pi * 0.085036758**2
    most = int(0.4 * (16.0 - 5.6) ** 2 / disc)
    assert scenario("search_and_rescue", side_m=16, n_robots=most).robots.n_robots == most
    with pytest.raises(ConfigError) as caught:
        scenario("search_and_rescue", side_m=16, n_robots=most + 1)
    message = str(caught.value)
    assert f"at most {most} robots in a start area of 10.4 x 10.4 m" in message
    assert f"got {most + 1}" in message
    assert "larger arena or fewer robots" in message


def test_configurations_are_frozen_and_hashable():
    config = scenario("warehouse_small")
    assert hash(config) == hash(scenario("warehouse_small"))
    with pytest.raises(dataclasses.FrozenInstanceError):
        config.caches = "static"  # type: ignore[misc] - that is the mistake


def test_nest_is_snapped_to_whole_cells():
    arena = ArenaConfig(width_m=16.0, height_m=16.0, nest_centre_m=(8.03, 8.0), nest_size_m=(3.25, 3.2))
    assert arena.nest_cells == (32, 32, 48, 48)
    assert arena.nest_box_m == (6.4, 6.4, 9.6, 9.6)


def test_power_law_counts_are_left_to_the_draw():
    assert ObjectConfig(n_objects=4_000, placement="power_law").n_objects == 4_000
    assert scenario("search_and_rescue", n_objects=4_000).objects.n_objects == 4_000
