"""Sensors and rewards of users: names, errors, and where they arrive."""

import copy
import json
from contextlib import nullcontext
from importlib.metadata import EntryPoint
from runpy import run_path
from typing import Any

import gymnasium
import numpy as np
import pytest

from swarm_forage_env import (
    ConfigError,
    ForageEnv,
    SwarmSpec,
    load_policy,
    parallel_env,
    plan_run,
    register_reward,
    register_sensor,
    run_one,
    scenario,
    with_overrides,
)
from swarm_forage_env.contract import own_functions as own
from swarm_forage_env.contract.own_functions import OwnFunctionError
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface, interface_from_mapping
from swarm_forage_env.training.plan import TrainingPlan
from swarm_forage_env.views.gymnasium import SwarmVectorEnv
from swarm_forage_env.wrappers.base import wrap_in_order
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import World
from tests.support.branches import pickled


def nest_distance(world):
    return np.linalg.norm(world.swarm.position - world.config.arena.nest_centre_m, axis=1) / 50.0


def heading_and_cargo(world):
    return np.column_stack([np.sin(world.swarm.heading), world.swarm.carried_object >= 0])


@pytest.fixture(autouse=True)
def _registered(monkeypatch):
    monkeypatch.setattr(own, "_SENSORS", {})
    monkeypatch.setattr(own, "_REWARDS", {})
    register_sensor("nest_distance", nest_distance, meaning="distance to the nest / 50 m")
    register_sensor("both", heading_and_cargo, n_columns=2)
    register_reward("row", lambda world: np.arange(len(world.swarm.active)) / 8.0)


def made(**fields: Any) -> ForageEnv:
    return ForageEnv(scenario("warehouse_small", n_robots=6, **fields))


ACTIONS = np.tile(np.array([1.0, 0.5, 0.0], np.float32), (6, 1))


@pytest.mark.parametrize("physics", ["chipmunk", "compiled"])
def test_own_columns_come_last_and_change_no_other(physics):
    plain, env = made(physics=physics), made(physics=physics, own_sensors=("both", "nest_distance"))
    assert env.layout.names == (*plain.layout.names, "both", "nest_distance")
    assert env.layout.part("nest_distance").meaning == "distance to the nest / 50 m"
    before = plain.reset_batch(seed=1).copy(), env.reset_batch(seed=1).copy()
    after = plain.step_batch(ACTIONS)[0], env.step_batch(ACTIONS)[0]
    for bare, rich in (before, after):
        np.testing.assert_array_equal(rich[:, : plain.layout.size], bare)
    world = env.arena
    np.testing.assert_array_equal(after[1][:, env.layout["both"]], np.float32(heading_and_cargo(world)))
    np.testing.assert_array_equal(after[1][:, -1], np.float32(nest_distance(world)))
    assert (before[1][:, -1] != after[1][:, -1]).all(), "they are read in every tick"


def test_a_robot_that_is_away_senses_nothing():
    env = made(own_sensors=("nest_distance",))
    env.reset(seed=1)
    present = np.arange(6) != 2
    env.set_population(active=present, present=present)
    column = env.step_batch(ACTIONS)[0][:, -1]
    assert ((column > 0.0) == present).all()


def test_an_own_reward_is_added_for_robots_at_work():
    env = made(own_reward="row", tick=-1.0)
    env.reset(seed=1)
    at_work = np.arange(6) != 5
    env.set_population(active=at_work, present=np.ones(6, bool))
    np.testing.assert_array_equal(env.step_batch(ACTIONS)[1], [-1.0, -0.875, -0.75, -0.625, -0.5, 0.0])
    team = made(own_reward="row", team=True)
    team.reset(seed=1)
    np.testing.assert_array_equal(team.step_batch(ACTIONS)[1], np.full(6, np.float32(15.0 / 8.0 / 6.0)))


def test_copies_go_on_alike():
    env = made(own_sensors=("both",), own_reward="row", physics="compiled")
    env.reset(seed=1)
    twin = copy.deepcopy(env)
    for one, other in zip(env.step_batch(ACTIONS)[:2], twin.step_batch(ACTIONS)[:2], strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("observation", ["full", "compact"])
def test_learners_see_them_through_every_view(observation):
    fields: dict[str, Any] = {"n_robots": 6, "own_sensors": ("both",), "interface": {"observation": observation}}
    dicts = parallel_env("warehouse_small", **fields)
    rows = gymnasium.make_vec("swarm_forage/warehouse_small-v0", **fields)
    per_agent = np.stack(list(dicts.reset(seed=3)[0].values()))
    np.testing.assert_array_equal(per_agent, rows.reset(seed=3)[0])
    assert per_agent.shape[1] == {"full": 113, "compact": 25}[observation]
    assert (np.abs(per_agent[:, -2]) > 0.0).all(), "sines of headings"


def test_a_policy_that_was_trained_without_them_runs_where_they_are():
    spec = SwarmSpec.of(scenario("warehouse_small", n_robots=6, own_sensors=("both",)))
    obs = made(own_sensors=("both",)).reset_batch(seed=1)
    plain = made().reset_batch(seed=1)
    for observation in ("full", "compact"):
        config = InterfaceConfig(observation=observation)
        seen = LearnerInterface(config, spec).observe(obs)
        bare = LearnerInterface(config, SwarmSpec.of(scenario("warehouse_small", n_robots=6))).observe(plain)
        np.testing.assert_array_equal(seen, bare)
    policy = load_policy("ppo_warehouse_small")
    policy.reset(spec, np.random.default_rng(1))
    assert policy.act(obs, np.ones(6, bool)).shape == (6, 3)


def test_a_policy_that_sees_them_says_what_it_needs():
    config = InterfaceConfig(own_sensors=("both",))
    with pytest.raises(ConfigError, match=r"own_sensors=\('both',\)"):
        LearnerInterface(config, SwarmSpec.of(scenario("warehouse_small")))


@pytest.mark.compiled
@pytest.mark.parametrize("physics", ["chipmunk", "compiled"])
def test_runs_of_scripted_policies_stay_what_they_are(physics):
    small = scenario("warehouse_small", n_robots=6, horizon_s=200.0, physics=physics)
    own_fields: dict[str, Any] = {"own_sensors": ("both",), "own_reward": "row"}
    plain = run_one(plan_run(small, "crw", seed=1)).columns()
    rich = run_one(plan_run(with_overrides(small, **own_fields), "crw", seed=1)).columns()
    for name, column in plain.items():
        np.testing.assert_array_equal(column, rich[name])


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"own_sensors": ("booth",)}, r"Unknown own sensor 'booth'\. Did you mean 'both'\?.*register_sensor"),
        ({"own_sensors": "both"}, "a tuple of names"),
        ({"own_sensors": ("both", "both")}, "each name once"),
        ({"own_reward": 3}, "reward.own_reward"),
    ],
)
def test_what_a_scenario_cannot_name(fields, message):
    with pytest.raises(ConfigError, match=message):
        made(**fields)


def test_an_unknown_reward_is_told_at_the_reset():
    env = made(own_reward="rwo")
    with pytest.raises(ConfigError, match=r"Unknown own reward 'rwo'.*row.*register_reward"):
        env.reset(seed=1)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (lambda world: np.zeros((6, 2)), r"shape .*\(6, 1\).* got \(6, 2\)"),
        (lambda world: np.full(6, 1.5), r"in \[-1, 1\], got 1.5"),
        (lambda world: np.full(6, np.nan), r"got nan"),
        (lambda world: np.full(6, 1j), "real numbers, got an array of complex128"),
        (lambda world: world.swarm.colour, "sensor 'odd' failed with AttributeError"),
    ],
)
def test_readings_that_no_observation_can_hold(values, message):
    register_sensor("odd", values)
    env = made(own_sensors=("odd",))
    with pytest.raises(OwnFunctionError, match=message):
        env.reset(seed=1)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (lambda world: np.zeros(5), r"\(6,\), got \(5,\)"),
        (lambda world: np.full(6, np.inf), r"numbers in \[-1e\+30, 1e\+30\], got inf"),
        (lambda world: np.full(6, np.nan), "got nan"),
        (lambda world: np.full(6, -1e300), r"got -1e\+300"),
    ],
)
def test_rewards_that_no_learner_can_take(values, message):
    register_reward("odd", values)
    env = made(own_reward="odd")
    env.reset(seed=1)
    with pytest.raises(OwnFunctionError, match=message):
        env.step_batch(ACTIONS)


def fails_in_tick_3(world):
    if world.tick == 3:
        raise OSError("the network is down")
    return np.zeros(len(world.swarm.active))


OWN: list[dict[str, Any]] = [{"own_sensors": ("odd",)}, {"own_reward": "odd"}]


@pytest.fixture
def _fails():
    register_sensor("odd", fails_in_tick_3)
    register_reward("odd", fails_in_tick_3)


@pytest.mark.usefixtures("_fails")
@pytest.mark.parametrize("fields", OWN)
def test_a_tick_that_fails_half_done_is_not_gone_on_with(fields):
    """The world has moved on, but what wraps it has not counted the tick: all that came later would be shifted."""
    env = ForageEnv(scenario("warehouse_small", n_robots=6, physics="compiled", **fields))
    stack = wrap_in_order(env, [parse_wrapper("sensor_noise:sigma=0.1")])
    stack.reset_batch(seed=1)
    for _ in range(2):
        stack.step_batch(ACTIONS)
    before = stack.snapshot()
    expected_failure = pytest.raises(OwnFunctionError, match="'odd' failed with OSError: the network is down")
    with expected_failure:
        stack.step_batch(ACTIONS)
    assert env.tick == 3, "one may look at what there is"
    for refused in (lambda: stack.step_batch(ACTIONS), lambda: env.step_batch(ACTIONS), stack.snapshot):
        with pytest.raises(RuntimeError, match=r"half done.*\. Reset"):
            refused()
    stack.restore_batch(before)
    register_sensor("odd", lambda world: np.zeros(6))
    with expected_failure if "own_reward" in fields else nullcontext():
        stack.step_batch(ACTIONS)
    stack.reset_batch(seed=1)
    stack.step_batch(ACTIONS)


@pytest.mark.usefixtures("_fails")
@pytest.mark.parametrize("fields", OWN)
@pytest.mark.parametrize("n_arenas", [1, 2])
def test_arenas_of_which_one_fails_wait_for_a_reset(fields, n_arenas):
    arenas = SwarmVectorEnv("warehouse_small", n_arenas=n_arenas, n_robots=6, physics="compiled", **fields)
    actions = np.zeros((6 * n_arenas, 3), np.float32)
    for _ in range(2):
        arenas.reset(seed=3)
        for _ in range(2):
            arenas.step(actions)
        with pytest.raises(OwnFunctionError):
            arenas.step(actions)
        with pytest.raises(RuntimeError, match=r"half done.*\. Reset"):
            arenas.step(actions)


def test_a_reset_that_fails_leaves_no_run_of_before():
    register_sensor("odd", lambda world: np.zeros(6))
    env = made(own_sensors=("odd",))
    env.reset(seed=1)
    register_sensor("odd", lambda world: 1 / 0)
    with pytest.raises(OwnFunctionError):
        env.reset(seed=1)
    with pytest.raises(RuntimeError, match="half done"):
        env.step_batch(ACTIONS)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: register_sensor("light", nest_distance),
        lambda: register_sensor("two words", nest_distance),
        lambda: register_sensor("wide", nest_distance, n_columns=0),
        lambda: register_sensor("none", None),  # pyright: ignore[reportArgumentType] - users give anything
        lambda: register_reward("", nest_distance),
        lambda: register_reward("none", None),  # pyright: ignore[reportArgumentType] - likewise
    ],
)
def test_what_cannot_be_registered(wrong):
    with pytest.raises(ConfigError):
        wrong()


class Offered:
    """An entry point of an installed package."""

    def __init__(self, name, value):
        self.name, self._value = name, value

    def load(self):
        return self._value


def test_installed_packages_offer_them(monkeypatch):
    sensor = own.OwnSensor(name="offered", function=nest_distance)
    points = {own.SENSOR_ENTRY_POINTS: sensor, own.REWARD_ENTRY_POINTS: nest_distance}
    monkeypatch.setattr(own, "_installed", lambda group: (Offered("offered", points[group]),))
    assert own.own_sensor("offered") is sensor
    assert own.own_reward("offered") is nest_distance
    monkeypatch.setattr(own, "_installed", lambda group: (Offered("offered", nest_distance),))
    with pytest.raises(ConfigError, match="to be an OwnSensor"):
        own.own_sensor("offered")


def test_a_module_that_fails_is_told_with_its_name(monkeypatch):
    broken = EntryPoint(name="mine", value="no_such_package_of_mine:MINE", group=own.SENSOR_ENTRY_POINTS)
    monkeypatch.setattr(own, "_installed", lambda _: (broken,))
    told = "Cannot load own {} 'mine' from no_such_package_of_mine:MINE: ModuleNotFoundError: No module named"
    for kind, find in (("sensor", own.own_sensor), ("reward", own.own_reward)):
        with pytest.raises(OwnFunctionError, match=told.format(kind)):
            find("mine")


def test_a_policy_that_reads_a_sensor_says_what_the_scenario_lacks():
    assert ForageEnv(scenario("warehouse_small", n_robots=2, own_sensors=("both",)), reads=("both",)).arena.reads == (
        "both",
    )
    with pytest.raises(ConfigError, match=r"the own sensor 'both', which the policy reads, .*--set own_sensors=both"):
        ForageEnv(scenario("warehouse_small", n_robots=2), reads=("both",))


def test_a_function_that_fails_is_told_with_its_line(tmp_path):
    (tmp_path / "mine.py").write_text("def late(world):\n    raise ValueError('too late')\n")
    register_sensor("late", run_path(str(tmp_path / "mine.py"))["late"])
    with pytest.raises(
        OwnFunctionError, match=rf"sensor 'late' failed with ValueError: too late \({tmp_path}/mine.py, line 2\)"
    ):
        made(own_sensors=("late",)).reset(seed=1)


def test_a_name_of_the_compact_view_is_taken_there():
    register_sensor("obstacle", nest_distance)
    with pytest.raises(ConfigError, match="got 'obstacle' twice"):
        parallel_env("warehouse_small", own_sensors=("obstacle",), interface={"observation": "compact"})


def test_a_sensor_that_changes_its_columns_is_told_at_the_reset():
    env = made(own_sensors=("both",))
    register_sensor("both", nest_distance)
    with pytest.raises(ConfigError, match=r"'both' with 2 columns.* got 1; make the environment anew"):
        env.reset(seed=1)


def test_a_reset_cannot_change_what_the_spaces_promise():
    env = parallel_env("warehouse_small", n_robots=6, interface={"observation": "full"})
    with pytest.raises(ConfigError, match=r"own_sensors to stay \(\)"):
        env.reset(options={"scenario": {"own_sensors": ("both",)}})


@pytest.mark.parametrize("physics", ["chipmunk", "compiled"])
def test_arenas_together_and_noise_show_the_same_columns(physics):
    fields: dict[str, Any] = {"n_robots": 6, "own_sensors": ("both",), "physics": physics}
    alone, together = (SwarmVectorEnv("warehouse_small", n_arenas=n, **fields) for n in (1, 2))
    one, both = alone.reset(seed=3)[0], together.reset(seed=3)[0]
    np.testing.assert_array_equal(both[:6, -2:], one[:, -2:])
    noisy = parallel_env("warehouse_small", wrappers=["sensor_noise:sigma=0.1"], interface={}, **fields)
    np.testing.assert_array_equal(np.stack(list(noisy.reset(seed=3)[0].values()))[:, -2:], one[:, -2:])


def test_a_snapshot_takes_functions_that_cannot_be_stored():
    register_sensor("odd", lambda world: np.zeros(6))
    register_reward("odd", lambda world: np.ones(6))
    env = made(own_sensors=("odd",), own_reward="odd", physics="compiled")
    env.reset(seed=1)
    env.step_batch(ACTIONS)
    snapshot = pickled(env.snapshot())
    env.step_batch(ACTIONS)
    env.restore(snapshot)
    assert env.tick == 1
    assert env.step_batch(ACTIONS)[1].tolist() == [1.0] * 6


@pytest.mark.parametrize("own_sensors", ["both+nest_distance", ["both", "nest_distance"]])
def test_an_interface_says_its_sensors_in_a_word_or_in_json(own_sensors):
    assert interface_from_mapping({"own_sensors": own_sensors}).own_sensors == ("both", "nest_distance")


def test_a_plan_of_a_training_says_them():
    plan = TrainingPlan(world=World(scenario("warehouse_small", own_sensors=("both",))))
    assert plan.interface.own_sensors == ("both",)
    assert TrainingPlan.from_mapping(json.loads(json.dumps(plan.to_mapping()))) == plan
