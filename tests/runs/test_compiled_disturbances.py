"""Compiled policies under wrappers: without Python between most ticks, and the same bit for bit."""

import copy
import pickle
from typing import Any

import numpy as np
import pytest

from baselines.crw import CRWPolicy
from swarm_forage_env.contract.policy import ActionError
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import LiveRun, build_env, build_stack
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.base import SwarmWrapper, WrapperConfig
from swarm_forage_env.wrappers.noise import SensorNoise, SensorNoiseConfig
from swarm_forage_env.wrappers.population import PopulationDynamics
from swarm_forage_env.wrappers.recorder import RunRecorder
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.throttle import Throttle, ThrottleConfig
from swarm_forage_env.wrappers.waveform import Waveform
from tests.support.drivers import LAST_TICK, UntilNaN, tick_by_tick
from tests.support.foraging import quick_world

POOLS = (
    (
        "sensor_noise:sigma=0.02",
        "sensor_noise:sigma=0",
        "sensor_noise:sigma=0.05,groups=proximity+heading",
        "sensor_noise:sigma=sine,amplitude=0.03,period_s=7,groups=light+ground+position",
    ),
    (
        "population:malfunction_per_tick=0.1,repair_per_tick=0.1,death_per_tick=0.005",
        "population:death_per_tick=0.2,birth_per_tick=0.5,initial_robots=4,deaths=absorbing",
        "population:birth_per_tick=0.2,initial_robots=3,max_robots=5",
        "population:death_per_tick=0",
    ),
    (
        "throttle:waveform=square,amplitude=0.3,offset=0.2,period_s=9",
        "throttle:waveform=constant,amplitude=0.4,carriers=true",
        "throttle:waveform=sine,amplitude=0.3,period_s=11",
    ),
    (
        "actuator_noise:sigma=0.2",
        "actuator_noise:sigma=0.1",
        "actuator_noise:sigma=step,amplitude=0.3,start_s=20",
        "actuator_noise:sigma=0",
    ),
)
"""Of each wrapper that tells what it does ahead, some; a stack has one of each, or none."""
POLICIES = ("crw", "dpo", "cpfa", "stochm", "stochx", "generalist")
TICKS = 500


def random_stack(chance: np.random.Generator) -> list[WrapperConfig]:
    """One of each pool, by chance none, but at least one wrapper."""
    while True:
        words = [pool[chance.integers(len(pool))] for pool in POOLS if chance.random() < 0.6]
        if words:
            return [parse_wrapper(word) for word in words]


def started(policy: str, wrappers, seed: int = 4, *, by_ticks: bool = False, n_robots: int = 9) -> LiveRun:
    chosen: Any = load_policy(policy)
    far: dict[str, Any] = {"nest_centre_m": (3.2, 8.0), "nest_size_m": (3.2, 12.8)}  # room for a static cache
    lasting = {"horizon_s": TICKS / 5, "interval_s": TICKS / 20}
    world = quick_world(
        "warehouse_small", caches=getattr(chosen, "caches", "none"), n_robots=n_robots, **far, **lasting
    )
    stack = build_stack(world, wrappers, reads=getattr(chosen, "reads", None))
    return LiveRun(stack, tick_by_tick(chosen) if by_ticks else chosen, seed)


def outcome(run: LiveRun) -> dict[str, np.ndarray]:
    """Everything that a run shows and records."""
    recorder, swarm = run._stack, run.forage_env.swarm
    assert isinstance(recorder, RunRecorder)
    policy = copy.copy(run._policy)
    vars(policy).pop("act", None)
    shown = {"obs": recorder.last_obs.copy(), "actions": policy.compiled().actions.copy()}
    shown |= {name: np.array(getattr(swarm, name)) for name in swarm._fields}
    shown |= {"tick": np.array(run.forage_env.tick)}
    return shown | (recorder.columns() | recorder.contributed() if recorder.complete else {})


def assert_same(one: LiveRun, other: LiveRun) -> None:
    ours, theirs = outcome(one), outcome(other)
    assert ours.keys() == theirs.keys()
    for name, values in ours.items():
        np.testing.assert_array_equal(values, theirs[name], err_msg=name)


@pytest.mark.parametrize("seed", range(6))
def test_a_run_of_any_stack_is_the_run_tick_by_tick(seed):
    chance = np.random.default_rng(seed)
    policy, wrappers = POLICIES[seed % len(POLICIES)], random_stack(chance)
    pieces, slow = started(policy, wrappers), started(policy, wrappers, by_ticks=True)
    assert pieces.compiled_policy is not None
    for tick in sorted(chance.integers(1, TICKS, 5).tolist()):
        pieces.advance(to_tick=tick)
        slow.advance(to_tick=tick)
        assert_same(pieces, slow)
        vars(pieces._policy).pop("act", None)
        if chance.random() < 0.3:  # now and then some ticks with Python in between
            tick_by_tick(pieces._policy)
    pieces.advance()
    slow.advance()
    assert pieces.over
    assert slow.over
    assert_same(pieces, slow)


@pytest.mark.parametrize("deaths", ["terminate", "absorbing"])
def test_the_run_ends_with_the_last_robot(deaths):
    wrappers = [parse_wrapper(f"population:death_per_tick=0.1,deaths={deaths}"), parse_wrapper("sensor_noise:sigma=1")]
    fast, slow = (started("dpo", wrappers, by_ticks=by_ticks, n_robots=3) for by_ticks in (False, True))
    fast.advance()
    slow.advance()
    assert fast.over
    assert fast.forage_env.tick < TICKS
    assert_same(fast, slow)


def test_robots_killed_between_two_ticks_end_the_run_in_the_next():
    wrappers = [parse_wrapper("population:death_per_tick=0")]
    runs = [started("crw", wrappers, by_ticks=by_ticks, n_robots=2) for by_ticks in (False, True)]
    for run in runs:
        run.advance(to_tick=100)
        population = run._stack.stack[1]
        assert isinstance(population, PopulationDynamics)
        assert population.kill(0)
        run.advance(to_tick=150)
        assert population.kill(1)
        run.advance()
        assert run.over
        assert run.forage_env.tick == 151
    assert_same(*runs)


ALL = ("sensor_noise:sigma=0.02", POOLS[1][0], POOLS[2][0], "actuator_noise:sigma=0.2")


def test_a_run_goes_on_from_a_snapshot_and_from_a_copy():
    run = started("dpo", [parse_wrapper(word) for word in ALL])
    run.advance(to_tick=222)
    recorder, policy = run._stack, run._policy
    assert isinstance(recorder, RunRecorder)
    stored = pickle.dumps((recorder.snapshot(), policy))
    twin, twin_policy = copy.deepcopy((recorder, policy))
    run.advance()
    expected = outcome(run)
    snapshot, policy = pickle.loads(stored)  # noqa: S301 - our own bytes
    other = started("dpo", [parse_wrapper(word) for word in ALL], seed=9)._stack
    assert isinstance(other, RunRecorder)
    other.restore_batch(snapshot)
    for stack, driver in ((other, policy), (twin, twin_policy)):
        stack.run(driver.compiled(), TICKS)
        assert stack.complete
        for name, values in (stack.columns() | stack.contributed()).items():
            np.testing.assert_array_equal(values, expected[name], err_msg=name)
        np.testing.assert_array_equal(stack.last_obs, expected["obs"])


def test_another_level_counts_from_the_next_tick_on():
    runs = [started("dpo", [parse_wrapper(word) for word in ALL], by_ticks=by_ticks) for by_ticks in (False, True)]
    for run in runs:
        run.advance(to_tick=101)
        _, noise, _, throttle, _ = run._stack.stack
        assert isinstance(noise, SensorNoise)
        assert isinstance(throttle, Throttle)
        noise.reconfigure(SensorNoiseConfig(sigma=0.3, groups=("proximity", "position")))
        throttle.reconfigure(ThrottleConfig(waveform=Waveform(kind="constant", amplitude=0.9)))
        run.advance()
    assert_same(*runs)


# Where Python is asked


class Mute(SwarmWrapper):
    """Says nothing about what its hook does."""

    stack_position = 3

    def observe(self, obs):
        obs[:, 0] = 0.0
        return obs


class Idle(SwarmWrapper):
    """Does nothing in a tick."""

    stack_position = 3


class Stronger(Throttle):
    def gain(self, actions, wheel_gain):
        return super().gain(actions, wheel_gain)


def is_compiled(stack: SwarmWrapper, *, tick: int = 0) -> bool:
    run = LiveRun(stack, CRWPolicy(), seed=0)
    run.advance(to_tick=tick)
    return run.compiled_policy is not None


def test_wrappers_that_do_not_speak_for_their_hooks_are_asked_in_every_tick():
    world = scenario("warehouse_small", n_robots=2)
    throttled = ThrottleConfig(waveform=Waveform(kind="constant", amplitude=0.1))
    assert is_compiled(RunRecorder(Throttle(build_env(world), throttled)), tick=3)
    assert is_compiled(RunRecorder(Idle(build_env(world))), tick=3)
    assert not is_compiled(RunRecorder(Mute(build_env(world))))
    assert not is_compiled(RunRecorder(Stronger(build_env(world), throttled)))
    assert not is_compiled(build_stack(world, [parse_wrapper("handling_cost:waveform=constant,amplitude=5")]))
    patched = Throttle(build_env(world), throttled)
    patched.gain = lambda actions, wheel_gain: wheel_gain
    assert not is_compiled(RunRecorder(patched))


class Gain(SwarmWrapper):
    """Slows the left wheels in every other tick, by a gain that a user may well make; the others have no hooks."""

    stack_position = 3
    given: Any = None

    def gain(self, actions, wheel_gain):
        return self.given if self.unwrapped.tick % 2 == 0 else wheel_gain

    def ahead(self, n_ticks):
        return -(self.unwrapped.tick % 2 == 0) * 3 + 1, {}  # below 0 is as good as 0


N_ROBOTS = 6
HALF = np.array([[0.5, 1.0]])


@pytest.mark.parametrize(
    "given",
    [
        np.broadcast_to(HALF, (N_ROBOTS, 2)),
        np.asfortranarray(np.repeat(HALF, N_ROBOTS, axis=0)),
        np.repeat(HALF, N_ROBOTS, axis=0).astype(np.float32),
    ],
)
def test_gains_of_every_type_and_order_are_taken(given):
    speeds = []
    for by_ticks in (False, True):
        stack = Gain(build_env(scenario("warehouse_small", n_robots=N_ROBOTS)))
        stack.given = given
        run = LiveRun(RunRecorder(stack), tick_by_tick(CRWPolicy()) if by_ticks else CRWPolicy(), seed=1)
        assert by_ticks or run.compiled_policy is not None
        run.advance(to_tick=3)
        speeds.append(run.forage_env.swarm.wheel_speed.copy())
    np.testing.assert_array_equal(*speeds)


def test_a_gain_of_another_shape_is_refused():
    stack = Gain(build_env(scenario("warehouse_small", n_robots=N_ROBOTS)))
    stack.given = np.ones(N_ROBOTS)
    run = LiveRun(RunRecorder(stack), CRWPolicy(), seed=1)
    with pytest.raises(ActionError, match=r"wheel_gain with shape \(n_robots, 2\) = \(6, 2\), got \(6,\)"):
        run.advance(to_tick=3)
    stack.reset_batch(1)
    stack.given = np.ones((N_ROBOTS, 1))
    with pytest.raises(ActionError, match=r"got \(6, 1\)"):
        stack.step_batch(np.zeros((N_ROBOTS, 3), np.float32))


class Teller(SwarmWrapper):
    """Hands compiled code an array that is too short."""

    stack_position = 3

    def ahead(self, n_ticks):
        return 5, {"draws": np.zeros(3, np.uint32)}


def test_wrappers_from_elsewhere_hand_compiled_code_no_arrays():
    run = LiveRun(RunRecorder(Teller(build_env(scenario("warehouse_small", n_robots=6)))), CRWPolicy(), seed=1)
    with pytest.raises(ValueError, match=r"Expected `ahead` of Teller to return \{\} .* got draws"):
        run.advance(to_tick=5)


class Second(Throttle):
    stack_position = 4


def test_two_wrappers_that_do_the_same_thing_both_do_it():
    runs = []
    for by_ticks in (False, True):
        inner, outer = (ThrottleConfig(waveform=Waveform(kind="constant", amplitude=share)) for share in (0.2, 0.5))
        stack = Throttle(Second(build_env(scenario("warehouse_small", n_robots=2)), inner), outer)
        runs.append(LiveRun(RunRecorder(stack), tick_by_tick(CRWPolicy()) if by_ticks else CRWPolicy(), seed=1))
        runs[-1].advance(to_tick=20)
    assert_same(*runs)


# Faults


@pytest.mark.parametrize(
    "population", ["population:death_per_tick=0", "population:malfunction_per_tick=5,repair_per_tick=5"]
)
def test_a_fault_ends_a_run_where_it_ends_with_python(population):
    """Also in a tick in which robots break down: none does, because what robots want to do is looked at before."""
    ended = []
    for by_ticks in (False, True):
        world = scenario("warehouse_small", n_robots=4, n_objects=20)
        policy: Any = tick_by_tick(UntilNaN()) if by_ticks else UntilNaN()
        wrappers = [parse_wrapper(word) for word in (population, "throttle:waveform=constant,amplitude=0.5")]
        run = LiveRun(build_stack(world, wrappers, reads=policy.reads), policy, seed=4)
        with pytest.raises(ActionError, match=r"nan.* for robot_2"):
            run.advance()
        assert policy.n_ticks == LAST_TICK
        assert run.forage_env.tick == LAST_TICK - 1
        if not by_ticks:  # wrappers have done more ahead than came to be
            with pytest.raises(RuntimeError, match="half done"):
                run.advance()
        ended.append((run.forage_env.swarm.position.copy(), run.forage_env.active.copy()))
    for one, other in zip(*ended, strict=True):
        np.testing.assert_array_equal(one, other)
