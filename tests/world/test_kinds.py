"""Robots of several kinds: how fast they drive, and what they see of the world and of themselves."""

import copy
from typing import Any

import numpy as np
import pytest

from swarm_forage_env import ConfigError, ForageEnv, load_policy, parallel_env, plan_run, run_one, scenario
from swarm_forage_env.contract.codes import ObjectStatus
from swarm_forage_env.contract.own_functions import register_sensor
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.runs.run import build_env
from swarm_forage_env.scenarios.robots import RobotKind
from swarm_forage_env.views.arenas import ArenaBatch
from swarm_forage_env.views.plans import plan_arena
from swarm_forage_env.wrappers.registry import parse_wrapper
from tests.reference import kinds as twin
from tests.support.branches import pickled
from tests.support.stage import assert_conserved, put, stand

N_ROBOTS = 12
SMALL: dict[str, Any] = {
    "n_robots": N_ROBOTS,
    "n_objects": 60,
    "width_m": 8.0,
    "height_m": 6.0,
    "nest_centre_m": (1.0, 3.0),
    "nest_size_m": (0.8, 2.0),
    "start_margin_m": 0.6,
    "physics": "compiled",
}
THREE: tuple[RobotKind, ...] = (
    RobotKind(name="scout", share=0.25, window_cells=3, lacks=("light",)),
    RobotKind(name="hauler", share=0.5, speed=0.5, window_cells=1, lacks=("proximity",)),
    RobotKind(name="blind", speed=0.8, lacks=("los_object", "los_cache")),
)
"""Rows 0 to 2, 3 to 8 and 9 to 11."""
KINDS: dict[str, Any] = {"robot_kinds": THREE}
OTHERS = (RobotKind(name="other", share=0.1, speed=0.3), RobotKind(name="rest", lacks=("light",)))


def made(**fields: Any) -> ForageEnv:
    return ForageEnv(scenario("warehouse_small", **(SMALL | fields)))


def drawn(ticks: int, n_robots: int = N_ROBOTS) -> np.ndarray:
    actions = np.random.default_rng(0).uniform(-1.2, 1.2, (ticks, n_robots, 3)).astype(np.float32)
    return np.abs(actions) * np.float32([1.0, 1.0, 0.8])


def part(env: ForageEnv, name: str) -> np.ndarray:
    return env.last_obs[:, env.layout[name]]


@pytest.mark.parametrize("physics", ["chipmunk", "compiled"])
def test_they_are_those_of_the_twins(physics):
    env = made(physics=physics, caches="static", **KINDS)
    env.reset_batch(seed=1)
    rng, n_objects, n_caches = np.random.default_rng(1), np.zeros(N_ROBOTS), np.zeros(N_ROBOTS)
    for tick, actions in enumerate(drawn(40)):
        if tick % 10 == 5:  # some are away, some in repair; most of them come back
            present = rng.random(N_ROBOTS) < 0.8
            env.set_population(active=present & (rng.random(N_ROBOTS) < 0.8), present=present)
        if tick % 4 == 0:
            _go_to_see(env)
        free = env.active & (env.swarm.pending_kind == 0)
        env.step_batch(actions)
        np.testing.assert_allclose(env.last_obs, twin.observe(env), atol=2e-6)
        n_objects += np.count_nonzero(part(env, "los_object"), axis=1)
        n_caches += np.count_nonzero(part(env, "los_cache"), axis=1)
        for robot in np.flatnonzero(free).tolist():
            expected = twin.wheels(twin.kind_of(env, robot), actions[robot, :2].tolist())
            np.testing.assert_allclose(env.swarm.wheel_speed[robot], expected, atol=1e-7)
    assert_conserved(env)
    assert n_objects[[1, 2, *range(4, 9)]].all(), "those with a camera that stood on objects have seen them"
    assert not n_objects[9:].any()
    assert n_caches[:3].any(), "who sees one cell far sees the cache that begins there"
    assert not n_caches[3], "who sees its own cell does not"


def _go_to_see(env: ForageEnv) -> None:
    """Put robots on objects, and one of each window on a cell beside a cache."""
    cells = env.objects.cell[env.objects.status == ObjectStatus.FREE][::4]
    places = [(x, y) for x, y in cells[:N_ROBOTS].tolist()]
    slot = np.flatnonzero(env.caches.alive)[0]
    x, y = env.caches.cell[slot].tolist()
    beside = x - env.scenario.cache_half_side_cells - 1
    places[0], places[3] = (beside, y - 1), (beside, y + 1)
    for row in np.flatnonzero(env.swarm.present).tolist():
        stand(env, row, places[row])


@pytest.mark.parametrize("physics", ["chipmunk", "compiled"])
@pytest.mark.parametrize("policy", ["crw", "stochm"])
def test_kinds_that_lack_nothing_change_nothing(physics, policy):
    def columns(**fields: Any) -> dict[str, np.ndarray]:
        options = SMALL | {"physics": physics, "horizon_s": 80.0, "interval_s": 40.0} | fields
        world = scenario("warehouse_small", **options)
        return run_one(plan_run(world, policy, seed=1)).columns()

    plain = columns()
    for kinds in ((RobotKind(name="all"),), (RobotKind(name="one", share=0.3), RobotKind(name="other"))):
        kinded = columns(robot_kinds=kinds)
        for name, column in plain.items():
            np.testing.assert_array_equal(column, kinded[name])


def test_half_the_speed_drives_the_same_path_in_twice_the_time():
    fast, slow = made(n_robots=1), made(n_robots=1, robot_kinds=(RobotKind(name="slow", speed=0.5),))
    for actions in ((1.0, 1.0, 0.0), (0.2, 0.5, 0.0), (-0.5, 0.5, 0.0)):
        for env in (fast, slow):
            env.reset_batch(seed=3)
            put(env, 0, 4.0, 3.0)
        for _ in range(5):
            fast.step_batch(np.float32([actions]))
        for _ in range(10):
            slow.step_batch(np.float32([actions]))
        np.testing.assert_allclose(slow.swarm.wheel_speed, 0.5 * fast.swarm.wheel_speed)
        np.testing.assert_allclose(slow.swarm.position, fast.swarm.position, atol=1e-9)
        np.testing.assert_allclose(slow.swarm.heading, fast.swarm.heading, atol=1e-9)


def test_gains_multiply_and_make_no_motor_faster_than_its_kind():
    env = made(**KINDS)
    for gain in (0.5, 3.0):
        env.reset_batch(seed=1)
        actions = drawn(1)[0]
        env.step_batch(actions, wheel_gain=np.full((N_ROBOTS, 2), gain))
        expected = [twin.wheels(twin.kind_of(env, row), actions[row, :2].tolist(), gain) for row in range(N_ROBOTS)]
        np.testing.assert_allclose(env.swarm.wheel_speed, expected, atol=1e-7)


def test_a_throttle_multiplies():
    world = scenario("warehouse_small", **SMALL, **KINDS)
    stack = build_env(world, [parse_wrapper("throttle:waveform=constant,amplitude=0.4")])
    stack.reset_batch(seed=1)
    stack.step_batch(np.tile(np.float32([1.0, 1.0, 0.0]), (N_ROBOTS, 1)))
    expected = [0.1 * 0.6 * twin.kind_of(stack.unwrapped, row).speed for row in range(N_ROBOTS)]
    np.testing.assert_allclose(stack.unwrapped.swarm.wheel_speed[:, 0], expected)


def test_the_dead_come_back_as_what_they_were():
    env = made(**KINDS)
    env.reset_batch(seed=1)
    before = part(env, "kind").copy()
    assert len({tuple(row) for row in before.tolist()}) == 3
    nobody, everybody = np.zeros(N_ROBOTS, bool), np.ones(N_ROBOTS, bool)
    env.set_population(active=nobody, present=nobody)
    env.step_batch(drawn(1)[0])
    assert not part(env, "kind").any()
    env.set_population(active=everybody, present=everybody)
    env.step_batch(drawn(1)[0])
    np.testing.assert_array_equal(part(env, "kind"), before)


def test_a_sensor_that_is_lacking_has_no_noise():
    register_sensor("of_kinds", lambda world: np.ones(len(world.swarm.active)), meaning="one")
    kinds = (
        RobotKind(name="bare", share=0.5, lacks=("proximity", "light", "neighbours", "messages", "of_kinds")),
        RobotKind(name="all"),
    )
    world = {"neighbours_seen": 2, "neighbour_range_m": 9.0, "message_size": 1, "message_range_m": 9.0}
    config = scenario("warehouse_small", **SMALL, **world, own_sensors=("of_kinds",), robot_kinds=kinds)
    words = ("sensor_noise:groups=proximity+light+neighbours,sigma=0.5", "message_noise:sigma=0.5")
    stack = build_env(config, [parse_wrapper(word) for word in words])
    env = stack.unwrapped
    stack.reset_batch(seed=1)
    for _ in range(5):
        obs, *_ = stack.step_batch(np.ones((N_ROBOTS, 4), np.float32))
        for name in kinds[0].lacks:
            assert not obs[:6, env.layout[name]].any(), name
            assert obs[6:, env.layout[name]].any(axis=1).all(), name


def test_who_feels_nothing_believes_in_no_obstacle():
    kinds = (RobotKind(name="numb", lacks=("proximity",)),)
    config = scenario("warehouse_small", **SMALL, robot_kinds=kinds)
    for world, least in ((config, 0.0), (scenario("warehouse_small", **SMALL), 0.5)):
        stack = build_env(world, [parse_wrapper("sensor_noise:groups=proximity,sigma=0.5")])
        stack.reset_batch(seed=1)
        stack.step_batch(np.zeros((N_ROBOTS, 3), np.float32))
        assert (stack.interval_columns()["believed_interference_fraction"] > least) == (least > 0.0)


def test_interference_is_measured_whether_it_is_felt_or_not():
    kinds = (RobotKind(name="numb", lacks=("proximity",)),)
    plain, numb = made(), made(robot_kinds=kinds)
    for env in (plain, numb):
        env.reset_batch(seed=1)
        for actions in drawn(30):
            env.step_batch(actions)
    np.testing.assert_array_equal(numb.events.counters, plain.events.counters)
    assert float(plain.events.interference_sum[0]) > 0.0
    assert not part(numb, "proximity").any()


def test_snapshots_and_copies_go_on_alike():
    env, actions = made(**KINDS), drawn(12)
    env.reset_batch(seed=1)
    for action in actions[:6]:
        env.step_batch(action)
    snapshot, other, third = env.snapshot(), copy.deepcopy(env), pickled(env)
    seen = [env.step_batch(action)[0].copy() for action in actions[6:]]
    env.restore_batch(snapshot)
    for branch in (env, other, third):
        np.testing.assert_array_equal(seen, [branch.step_batch(action)[0].copy() for action in actions[6:]])


class OneByOne(ArenaBatch):
    """Arenas that are never taken together."""

    def _chosen_ways(self) -> tuple[None, None]:
        return None, None


@pytest.mark.compiled
def test_arenas_together_are_what_they_are_alone():
    plan = plan_arena(scenario("warehouse_small", **SMALL | KINDS), interface={}, max_cycles=12)
    batches = ArenaBatch(plan, 2), OneByOne(plan, 2)
    np.testing.assert_array_equal(*[batch.reset([3, 4], [None, None])[0] for batch in batches])
    assert batches[0]._chosen_ways()[0] is not None
    for actions in drawn(20).reshape(10, 2 * N_ROBOTS, 3):
        together, alone = (batch.step(actions) for batch in batches)
        np.testing.assert_array_equal(together.obs, alone.obs)
        np.testing.assert_array_equal(together.rewards, alone.rewards)


def test_records_tell_kinds_apart():
    world = scenario("warehouse_small", **SMALL | KINDS, horizon_s=400.0, interval_s=200.0)
    record = run_one(plan_run(world, "dpo", seed=2))
    columns = record.columns()
    per_kind = np.array([columns[f"part_{number}_collected"] for number in (1, 2, 3)])
    assert per_kind.sum(axis=0).tolist() == record.collected.tolist()
    assert per_kind[0].sum() > 0, "those who see find something"
    assert columns["part_2_n_present"].tolist() == [6.0, 6.0]
    again = run_one(plan_run(world, "dpo", seed=2)).columns()
    for name, column in columns.items():
        np.testing.assert_array_equal(column, again[name])


@pytest.mark.parametrize(("observation", "size"), [("full", 111), ("compact", 23)])
def test_learners_see_their_kind(observation, size):
    interface = {"observation": observation}
    env = parallel_env("warehouse_small", **SMALL, **KINDS, interface=interface)
    seen = env.reset(seed=1)[0]
    assert seen["robot_0"].shape == (size + 8,)
    np.testing.assert_allclose(seen["robot_3"][-8:], [0.5, 0.2, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    unseen = parallel_env("warehouse_small", **SMALL, **KINDS, interface=interface | {"sees_kind": False})
    np.testing.assert_array_equal(unseen.reset(seed=1)[0]["robot_3"], seen["robot_3"][:-8])


def test_policies_without_kinds_run_where_there_are_some():
    env = made(**KINDS)
    policy = load_policy("ppo_warehouse_small")
    policy.reset(env.swarm_spec, np.random.default_rng(1))
    env.step_batch(policy.act(env.reset_batch(seed=1), env.active))


def test_a_policy_that_sees_kinds_says_what_it_needs():
    shown = InterfaceConfig(observation="compact").for_scenario(scenario("warehouse_small", **KINDS))
    assert shown.sees_kind is True
    plain = scenario("warehouse_small", robot_kinds=(RobotKind(name="all", speed=0.5),))
    assert InterfaceConfig().for_scenario(plain).sees_kind is None
    with pytest.raises(ConfigError, match=r"several kinds, which the policy sees, .* two or more robot_kinds"):
        LearnerInterface(shown, SwarmSpec.of(plain))
    with pytest.raises(ConfigError, match=r"several kinds, because .* 'kind', .* two or more robot_kinds"):
        ForageEnv(plain, reads=shown.reads)
    LearnerInterface(shown, SwarmSpec.of(scenario("warehouse_small", robot_kinds=OTHERS)))


def test_a_reset_keeps_the_columns():
    env = parallel_env("warehouse_small", **SMALL, **KINDS, interface={})
    env.reset(options={"scenario": {"robot_kinds": OTHERS}})
    assert env.forage_env.scenario.robots.robot_kinds == OTHERS
    with pytest.raises(ConfigError, match="two or more robot_kinds, as the columns that spaces promise, got 0"):
        env.reset(options={"scenario": {"robot_kinds": ()}})
    plain = parallel_env("warehouse_small", **SMALL, interface={})
    with pytest.raises(ConfigError, match="fewer than two robot_kinds, as the columns that spaces promise, got 3"):
        plain.reset(options={"scenario": KINDS})
