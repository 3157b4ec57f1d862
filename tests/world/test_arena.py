"""The arena as a whole: order of a tick, who is in the world, from actions to wheels, rewards, what `state` shows."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.spatial.distance import pdist

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.codes import Counter, Event, Grip, ObjectStatus
from swarm_forage_env.contract.policy import ActionError
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.config import RewardConfig
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario
from swarm_forage_env.world.placement import draw_start_poses
from tests.reference.motion import (
    MAX_DIFFERENCE_MPS,
    MAX_SPEED_MPS,
    limited_speeds,
    limited_wheels,
)
from tests.support.stage import (
    NEST_CELL,
    OPEN_CELL,
    act,
    assert_conserved,
    assert_same_world,
    build_cache,
    cell_centre,
    lay,
    load,
    put,
    snapshot,
    stand,
    tidy_world,
)

STRAIGHT = np.array([[0.5, 0.5, Grip.GRASP]] * 4, np.float32)


# Order of a tick


def test_interactions_see_where_the_robot_is_after_it_moved():
    env = tidy_world()
    lay(env, 0, OPEN_CELL)
    put(env, 0, 12.19, 8.1)  # on the object's cell, which it leaves in this tick
    env.step_batch(STRAIGHT)
    assert env.events.code[0] == Event.NOTHING_HERE


def test_objects_walk_in_every_tick():
    env = ForageEnv(scenario("warehouse_small", n_robots=1, walk_probability=1.0))
    env.reset_batch(0)
    before = env.objects.cell.copy()
    env.step_batch(np.zeros((1, 3), np.float32))
    moved = np.any(env.objects.cell != before, axis=1)
    assert env.events.counters[Counter.OBJECTS_MOVED] == np.count_nonzero(moved) > 190
    assert_conserved(env)


# Who is in the world


def population(env, *, away=(), gone=()):
    present = np.ones(len(env.active), np.bool_)
    present[list(gone)] = False
    active = present.copy()
    active[list(away)] = False
    return {"active": active, "present": present}


def test_only_permanent_death_terminates():
    env = tidy_world()
    away = population(env, away=(0,), gone=(1,))
    env.set_population(**away, terminated=np.array([False, True, False, False]))
    terminated = env.step_batch(STRAIGHT)[2]
    assert terminated.tolist() == [False, True, False, False]
    env.set_population(**away)
    assert env.step_batch(STRAIGHT)[2].tolist() == [False, True, False, False], "death lasts"
    env.reset_batch(0)
    assert not env.step_batch(STRAIGHT)[2].any()


# Global state


def test_state_shows_robots_and_objects():
    env = tidy_world(n_robots=3, n_objects=5, caches="static")
    build_cache(env, [3, 4], (70, 40))
    put(env, 0, 16.0, 4.0, math.pi / 2)
    load(env, 0, 1)
    env.set_population(**population(env, away=(1,), gone=(2,)))
    state = env.state()
    assert state.shape == env.state_space.shape == (6 * 3 + 3 * 5,)
    robots, objects = state[:18].reshape(3, 6), state[18:].reshape(5, 3)
    assert robots[0] == pytest.approx([0.0, -0.5, 0.0, 1.0, 1.0, 1.0], abs=1e-6)
    assert robots[1, 4:].tolist() == [0.0, 0.0]
    assert robots[2].tolist() == [0.0] * 6
    assert objects[1] == pytest.approx([0.0, -0.5, ObjectStatus.CARRIED / 3])
    x, y = cell_centre((70, 40))
    assert objects[3] == pytest.approx([2 * x / 32 - 1, 2 * y / 16 - 1, ObjectStatus.CACHED / 3])
    x, y = cell_centre(tuple(env.objects.cell[0].tolist()))
    assert objects[0] == pytest.approx([2 * x / 32 - 1, 2 * y / 16 - 1, 0.0])


# From actions to wheel speeds: limits, gains, held wheels, refused commands


command = st.floats(-2.0, 2.0, width=32)


@pytest.fixture(scope="module")
def lone_robot():
    return tidy_world(n_robots=1)


def drive(env, left, right, *, gain=None, grip=Grip.RELEASE):
    """Wheel speeds of robot 0 after one step with a command."""
    actions = np.zeros((len(env.active), 3), np.float32)
    actions[:, 2] = grip
    actions[0, :2] = left, right
    env.step_batch(actions, wheel_gain=None if gain is None else np.array([gain] * len(env.active)))
    return env.swarm.wheel_speed[0].tolist()


@given(left=command, right=command)
def test_speed_and_difference_are_clipped_separately(lone_robot, left, right):
    put(lone_robot, 0, 16.0, 8.0)
    wheels = drive(lone_robot, left, right)
    assert wheels == pytest.approx(limited_wheels(left, right), abs=1e-9)
    assert abs(wheels[0] + wheels[1]) / 2 <= MAX_SPEED_MPS + 1e-12
    assert abs(wheels[1] - wheels[0]) <= MAX_DIFFERENCE_MPS + 1e-12


@pytest.mark.parametrize(
    ("command", "wheels"),
    [
        ((1.0, 1.0), (0.10, 0.10)),  # a learner's full speed
        ((-1.0, -1.0), (-0.10, -0.10)),
        ((-1.0, 1.0), (-0.10, 0.10)),  # turning on the spot
        ((0.0, 1.0), (0.0, 0.20)),  # both limits just met: the outer wheel keeps its full speed
        ((0.5, 0.5), (0.10, 0.10)),
        ((0.25, 0.5), (0.05, 0.10)),  # inside of both limits
        ((5.0, 5.0), (0.10, 0.10)),  # beyond [-1, 1]
    ],
)
def test_limits_of_learners(lone_robot, command, wheels):
    assert drive(lone_robot, *command) == pytest.approx(wheels, abs=1e-9)


@pytest.mark.parametrize("gain", [(0.5, 0.25), (0.0, 0.0), (1.2, 3.0), (30.0, -30.0), (1.0, 1.5), (1e300, 1e300)])
@pytest.mark.parametrize("command", [(-1.0, 1.0), (0.4, 0.5)])
def test_a_gain_multiplies_after_the_limit_and_makes_no_robot_faster_than_its_motors(lone_robot, command, gain):
    put(lone_robot, 0, 16.0, 8.0)
    left, right = drive(lone_robot, *command, gain=gain)
    wanted = [wheel * factor for wheel, factor in zip(limited_wheels(*command), gain, strict=True)]
    assert (left, right) == pytest.approx(limited_speeds(*wanted), abs=1e-8)
    assert abs(left + right) / 2 <= MAX_SPEED_MPS * (1 + 1e-9)
    assert abs(right - left) <= MAX_DIFFERENCE_MPS * (1 + 1e-9)


@pytest.mark.parametrize(("column", "value"), [(0, np.inf), (1, np.nan), (2, -np.inf)])
def test_a_command_that_is_not_finite_is_refused_and_nothing_moves(column, value):
    env = tidy_world(n_robots=3)
    stand(env, 0, (60, 40))
    lay(env, 0, (60, 40))
    actions = np.full((3, 3), 0.5, np.float32)
    env.step_batch(actions)
    before = snapshot(env)
    actions[1] = 0.25
    actions[2, column] = value
    with pytest.raises(ActionError, match="robot_2"):
        env.step_batch(actions)
    assert_same_world(before, snapshot(env))
    actions[2] = 0.25
    env.step_batch(actions)
    assert env.tick == 2


def test_wheels_are_held_while_interacting():
    env = tidy_world(n_robots=1)
    stand(env, 0, (60, 40))
    lay(env, 0, (60, 40))
    assert drive(env, 0.1, 0.1, grip=Grip.GRASP) == pytest.approx((0.02, 0.02)), "the request itself is free to move"
    assert env.swarm.pending_kind[0] != 0
    where = env.swarm.position[0].copy()
    assert drive(env, 1.0, 0.5, grip=Grip.GRASP) == [0.0, 0.0]
    np.testing.assert_array_equal(env.swarm.position[0], where)
    assert env.swarm.carried_object[0] == 0
    assert drive(env, 1.0, 1.0, grip=Grip.GRASP) == pytest.approx((0.10, 0.10))


# Rewards


NOTHING = RewardConfig(delivery=0.0, first_pickup=0.0)


def rewards_of(env: ForageEnv, grips: dict[int, float], wheels: tuple[float, float] = (0.0, 0.0)) -> list[float]:
    actions = np.zeros((len(env.active), 3), np.float32)
    actions[:, :2] = wheels
    actions[:, 2] = np.where(env.swarm.carried_object >= 0, Grip.GRASP, Grip.RELEASE)
    for robot, grip in grips.items():
        actions[robot, 2] = grip
    return env.step_batch(actions)[1].tolist()


def delivering_world(**options) -> ForageEnv:
    """Robot 0 delivers and robot 1 picks up for the first time in the next step."""
    env = tidy_world(**options)
    stand(env, 0, NEST_CELL)
    load(env, 0, 0)
    stand(env, 1, OPEN_CELL)
    lay(env, 1, OPEN_CELL)
    act(env, {0: Grip.DELIVER, 1: Grip.GRASP})
    return env


def test_weights_multiply_and_add():
    env = delivering_world(reward=RewardConfig(delivery=3.0, first_pickup=-2.0, tick=0.5))
    assert rewards_of(env, {0: Grip.DELIVER, 1: Grip.GRASP}) == pytest.approx([3.5, -1.5, 0.5, 0.5])
    rewards_of(env, {1: Grip.RELEASE})
    rewards_of(env, {1: Grip.GRASP})
    assert rewards_of(env, {1: Grip.GRASP}) == pytest.approx([0.5] * 4)  # only the first pick-up is paid
    assert env.swarm.carried_object[1] == 1


def test_team_reward_is_the_mean_over_active_robots():
    env = delivering_world(reward=RewardConfig(team=True))
    env.set_population(active=np.array([True, True, True, False]), present=np.ones(4, np.bool_))
    assert rewards_of(env, {0: Grip.DELIVER, 1: Grip.GRASP}) == pytest.approx([1.1 / 3] * 3 + [0.0])


def test_nest_progress_pays_carrying_robots_by_the_metre():
    env = tidy_world(reward=replace(NOTHING, nest_progress=10.0))
    put(env, 0, 16.0, 8.0, np.pi)  # towards the nest centre at (3.2, 8)
    load(env, 0, 0)
    put(env, 1, 16.0, 5.0, np.pi)
    assert rewards_of(env, {}, wheels=(0.5, 0.5)) == pytest.approx([10 * 0.02, 0.0, 0.0, 0.0])
    assert rewards_of(env, {}, wheels=(-0.5, -0.5)) == pytest.approx([-10 * 0.02, 0.0, 0.0, 0.0])


def test_nest_progress_is_towards_the_nearest_of_several_nests():
    env = tidy_world(reward=replace(NOTHING, nest_progress=10.0), further_nests=((28.0, 7.0, 30.0, 9.0),))
    put(env, 0, 20.0, 8.0, np.pi)  # 16.8 m from (3.2, 8), 9 m from (29, 8)
    put(env, 1, 16.0, 8.0, np.pi)  # 12.8 and 13 m
    load(env, 0, 0)
    load(env, 1, 1)
    assert rewards_of(env, {}, wheels=(0.5, 0.5)) == pytest.approx([-10 * 0.02, 10 * 0.02, 0.0, 0.0])


def test_interference_can_be_penalised():
    env = tidy_world(reward=replace(NOTHING, interference=-0.25))
    put(env, 0, 16.0, 8.0)
    put(env, 1, 16.25, 8.0, np.pi)
    assert rewards_of(env, {}) == [-0.25, -0.25, 0.0, 0.0]


# Start poses: uniform, apart, away from the border; or an error that says why not


DIAMETER_M = 2 * 0.085036758


def draw_poses(config, seed=0):
    return draw_start_poses(config, stream_rng(seed, Stream.START_POSE))


@pytest.mark.parametrize("name", SCENARIO_NAMES)
def test_robots_start_apart_and_away_from_the_border(name):
    config = scenario(name)
    for seed in range(5):
        position, heading = draw_poses(config, seed)
        assert position.shape == (config.robots.n_robots, 2)
        assert pdist(position).min() > DIAMETER_M
        margin = config.robots.start_margin_m
        assert np.all(position >= margin)
        assert np.all(position <= (config.arena.width_m - margin, config.arena.height_m - margin))
        assert np.all((heading > -np.pi) & (heading <= np.pi))


def test_positions_and_headings_are_uniform():
    config = scenario("warehouse_small", n_robots=20)
    poses = [draw_poses(config, seed) for seed in range(100)]
    position, heading = np.concatenate([pose[0] for pose in poses]), np.concatenate([pose[1] for pose in poses])
    for values, low, high in (
        (position[:, 0], 2.8, 29.2),
        (position[:, 1], 2.8, 13.2),
        (heading, -np.pi, np.pi),
    ):
        assert stats.kstest(values, "uniform", (low, high - low)).pvalue > 1e-3


def test_of_two_overlapping_robots_the_higher_row_is_drawn_again():
    config = scenario("warehouse_small", n_robots=200, start_margin_m=6.0)
    rng = stream_rng(3, Stream.START_POSE)
    first = rng.uniform((6.0, 6.0), (26.0, 10.0), (200, 2))
    overlapping = np.argwhere(np.triu(np.linalg.norm(first[:, None] - first, axis=2) < DIAMETER_M, 1))
    assert len(overlapping) > 5
    position, _ = draw_poses(config, 3)
    moved = np.flatnonzero(np.any(position != first, axis=1))
    assert set(overlapping[:, 1]) <= set(moved.tolist())
    never_higher = set(range(200)) - set(moved.tolist())
    assert min(overlapping[:, 0].tolist()) in never_higher


def test_impossible_density_says_what_to_do(monkeypatch):
    monkeypatch.setattr("swarm_forage_env.world.placement._TRIALS", 3)
    config = scenario("warehouse_small", n_robots=1500, start_margin_m=4.0)
    with pytest.raises(ConfigError, match="1500 robots in 3 trials; use fewer robots"):
        draw_poses(config)
