"""World: its name, its wrappers in order, and what it refuses."""

from dataclasses import replace

import pytest

from swarm_forage_env._internal.fields import ConfigError, FileName, checked
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.views.pettingzoo import parallel_env
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import SIZE, UNDISTURBED, World, read_world, world_of
from tests.support.wrapper_configs import InnerConfig, OuterConfig

SMALL = scenario("warehouse_small")


@pytest.mark.parametrize(
    ("world", "name"),
    [
        (World(SMALL), "warehouse_small, 50 robots"),
        (
            World(SMALL, (InnerConfig(sigma=0.1), OuterConfig())),
            "warehouse_small, 50 robots, test outer: groups proximity, test inner: sigma 0.1",
        ),
        (
            World(scenario("warehouse_small", n_objects=3, physics="chipmunk")),
            "warehouse_small, 50 robots, physics chipmunk, 3 objects",
        ),
        (World(SMALL, (InnerConfig(),), criterion="noise", value=0.025), "warehouse_small, 50 robots, noise 0.025"),
        (
            World(SMALL, (InnerConfig(sigma=0.1),), criterion=SIZE, value=50),
            "warehouse_small, 50 robots, test inner: sigma 0.1",
        ),
        (World(SMALL, criterion=SIZE, value=50, name="the usual"), "the usual"),
    ],
)
def test_a_name_tells_the_swarm_and_what_is_varied_or_disturbs_it(world, name):
    assert world.name == name


WORLDS = [
    World(SMALL, name="home"),
    *(
        World(scenario("warehouse_small", **fields))
        for fields in (
            {},
            {"n_robots": 20},
            {"horizon_s": 400.0},
            {"n_robots": 20, "horizon_s": 400.0},
            {"n_objects": 3},
            {"n_objects": 3, "obstacles": ((10.0, 4.0, 11.0, 12.0),)},
            {"scattered_sites": True},
        )
    ),
    World(SMALL, (InnerConfig(sigma=0.1),)),
    World(SMALL, (InnerConfig(sigma=0.2),)),
    World(replace(SMALL, name="ruins")),
    World(replace(scenario("warehouse_small", n_objects=3), name="ruins")),
]


def test_no_two_worlds_share_a_file_name():
    names = [world.file_name for world in WORLDS]
    assert len(set(names)) == len(names)
    assert names[:5] == [
        "home",
        "warehouse_small",
        "warehouse_small_20_robots",
        "warehouse_small_400_s",
        "warehouse_small_20_robots_400_s",
    ]
    for world in WORLDS:
        checked("file_name", world.file_name, FileName)


def test_wrappers_are_kept_in_stack_order_and_at_most_once():
    shuffled = World(SMALL, (InnerConfig(), OuterConfig()))
    assert shuffled.wrappers == (OuterConfig(), InnerConfig())
    assert shuffled == World(SMALL, (OuterConfig(), InnerConfig()))
    with pytest.raises(ConfigError, match="each wrapper at most once, got test_inner, test_inner"):
        World(SMALL, (InnerConfig(), InnerConfig(sigma=0.2)))


@pytest.mark.parametrize(
    ("given", "fields", "message"),
    [
        ("warehouse_small", {}, "Expected scenario to be a ScenarioConfig, got 'warehouse_small'"),
        (SMALL, {"criterion": ""}, "Expected criterion to be a non-empty text"),
        (SMALL, {"value": "much"}, "Expected criterion_value to be a finite number, got 'much'"),
    ],
)
def test_what_is_no_world_is_refused(given, fields, message):
    with pytest.raises(ConfigError, match=message):
        World(given, **fields)


def test_a_world_is_given_as_itself_a_scenario_or_a_preset():
    world = World(SMALL)
    assert world_of(world) is world
    assert world_of(SMALL) == world_of("warehouse_small") == world
    assert (world.criterion, world.value, world.n_robots) == (UNDISTURBED, 0.0, 50)
    with pytest.raises(ConfigError, match="Did you mean 'warehouse_small'"):
        world_of("warehouse_smal")
    with pytest.raises(ConfigError, match="ScenarioConfig"):
        world_of(7)


def test_a_world_may_stand_in_a_file(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('scenario = "warehouse_small"\n[set]\nn_robots = 7\n[wrappers.sensor_noise]\nsigma = 0.1\n')
    world = World(scenario("warehouse_small", n_robots=7), (parse_wrapper("sensor_noise:sigma=0.1"),))
    assert read_world(file) == world_of(file) == world_of(str(file)) == world
    env = parallel_env(file, n_objects=50, wrappers=["throttle:waveform=constant,amplitude=0.2"])
    assert (env.unwrapped.scenario.objects.n_objects, len(env.possible_agents)) == (50, 7)
    assert [type(wrapper).__name__ for wrapper in env.stack] == ["SensorNoise", "Throttle"]
    assert [one.made_from.sigma for one in parallel_env(world, wrappers=[]).stack] == [0.1]
    (changed,) = parallel_env(str(file), wrappers=["sensor_noise:sigma=0.2"]).stack
    assert changed.made_from.sigma == 0.2
    file.write_text("[set]\nn_robts = 7\n")
    with pytest.raises(ConfigError, match=r"Cannot use .*mine\.toml: .*n_robts.*n_robots"):
        read_world(file)
    with pytest.raises(ConfigError, match="file of a world, which ends with"):
        world_of(tmp_path)
