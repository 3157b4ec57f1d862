"""Runs without Python between ticks, in pieces: the same as tick by tick, bit for bit; and where Python is asked."""

import copy
import pickle
from typing import Any

import numpy as np
import pytest

from baselines.crw import CRWPolicy
from baselines.stochm import STOCHMPolicy
from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env._internal.prefetching import LARGE
from swarm_forage_env.contract.codes import Counter, Task
from swarm_forage_env.contract.policy import ActionError, Policy, SwarmSpec
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.network import NetworkPolicy
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import LiveRun, build_env, build_stack
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.base import SwarmWrapper, WrapperConfig
from swarm_forage_env.wrappers.noise import SensorNoiseConfig
from swarm_forage_env.wrappers.recorder import RunRecorder
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.throttle import Throttle, ThrottleConfig
from swarm_forage_env.wrappers.waveform import Waveform
from tests.support.drivers import LAST_TICK, UntilNaN, tick_by_tick
from tests.support.foraging import quick_world
from tests.support.networks import network_of

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
        "actuator_noise:sigma=step,amplitude=0.3,start_s=20",
        "actuator_noise:sigma=0",
    ),
)
"""Of each wrapper that tells what it does ahead, some."""
ALL = [parse_wrapper(pool[0]) for pool in POOLS]
FAR = {"nest_centre_m": (3.2, 8.0), "nest_size_m": (3.2, 12.8)}
"""Room for a static cache in the small warehouse."""
OBSTACLES = {"obstacles": ((8.0, 4.0, 8.4, 12.0),)}
MESSAGES = {"message_size": 2, "neighbours_seen": 2, "neighbour_range_m": 2.0}
SLOW_HANDS = {"pickup_ticks": 3, "drop_ticks": 2, "walk_probability": 0.02}
STILL = {"walk_probability": 0.0}
"""Where objects lie still, robots look at the floor again only near what has changed."""


def random_stack(chance: np.random.Generator) -> list[WrapperConfig]:
    """One of each pool, by chance none."""
    return [parse_wrapper(str(chance.choice(pool))) for pool in POOLS if chance.random() < 0.6]


def live(policy: Any, world: ScenarioConfig, wrappers: Any = (), *, by_ticks: bool = False) -> LiveRun:
    stack = build_stack(world, wrappers, reads=getattr(policy, "reads", None))
    return LiveRun(stack, tick_by_tick(policy) if by_ticks else policy, seed=4)


def both(policy: str, wrappers: Any = (), **fields: Any) -> list[LiveRun]:
    """A run in pieces, and the same tick by tick."""
    caches = getattr(load_policy(policy), "caches", "none")
    fields = {"n_robots": 9, "horizon_s": 100.0, "interval_s": 25.0, **FAR, **fields}
    world = quick_world("warehouse_small", caches=caches, **fields)
    return [live(load_policy(policy), world, wrappers, by_ticks=by_ticks) for by_ticks in (False, True)]


def outcome(run: LiveRun) -> dict[str, np.ndarray]:
    """Everything that a run shows and records."""
    recorder, swarm = run._stack, run.forage_env.swarm
    policy = copy.copy(run._policy)
    vars(policy).pop("act", None)
    shown = {"obs": recorder.last_obs.copy(), "actions": policy.compiled().actions.copy()}
    shown |= {name: np.array(getattr(swarm, name)) for name in swarm._fields}
    shown |= {"tick": np.array(run.forage_env.tick)}
    return shown | (recorder.columns() if recorder.complete else {})


def assert_same(one: LiveRun, other: LiveRun) -> None:
    ours, theirs = outcome(one), outcome(other)
    assert ours.keys() == theirs.keys()
    for name, values in ours.items():
        np.testing.assert_array_equal(values, theirs[name], err_msg=name)


def network(world: ScenarioConfig, decision_ticks: int) -> NetworkPolicy:
    """A network with weights by chance."""
    interface = InterfaceConfig(
        observation="compact",
        actions="discrete" if decision_ticks % 2 else "continuous",
        automatic_gripper=decision_ticks != 3,
        decision_ticks=decision_ticks,
        site_memory=decision_ticks > 3,
    )
    return NetworkPolicy(network_of(interface, 7, seed=decision_ticks, swarm=SwarmSpec.of(world), caches=world.caches))


RUNS = [
    ("crw", "warehouse_small", {"n_robots": 1}),
    ("cpfa", "search_and_rescue", {}),
    ("stochm", "warehouse_small", FAR),
    ("dpo", "search_and_rescue", STILL),
    ("stochm", "warehouse_dual", {**STILL, "nest_size_m": (3.2, 12.8)}),
    ("stochx", "warehouse_medium", {**STILL, "n_robots": 150}),
    ("generalist", "search_and_rescue", {}),
    ("ppo_warehouse_small", "warehouse_small", {"n_robots": 7}),
    ("crw", "warehouse_dual", OBSTACLES),
    ("dpo", "warehouse_dual", MESSAGES),
    ("cpfa", "warehouse_dual", SLOW_HANDS),
    ("stochx", "warehouse_dual", {**OBSTACLES, **SLOW_HANDS}),
    (2, "warehouse_dual", OBSTACLES),
    (3, "warehouse_dual", MESSAGES),
    (5, "warehouse_dual", SLOW_HANDS),
    *((policy, "warehouse_small", {"n_robots": 9, **FAR}) for policy in ("crw", "dpo", "cpfa", "stochm", "generalist")),
]
"""Policy or the decision of a network in ticks, preset, fields."""


@pytest.mark.parametrize(("policy", "name", "fields"), RUNS)
def test_a_run_in_pieces_is_the_run_tick_by_tick(policy, name, fields):
    """From the ninth row on under wrappers by chance."""
    number = RUNS.index((policy, name, fields))
    chance = np.random.default_rng(number)
    caches = "none" if isinstance(policy, int) else load_policy(policy).caches
    options = {"n_robots": 12, **fields} if name == "warehouse_dual" else fields
    world = quick_world(name, physics="compiled", caches=caches, **{"horizon_s": 80.0, "interval_s": 20.0, **options})
    wrappers = random_stack(chance) if number >= 8 else []
    pieces, slow = (
        live(network(world, policy) if isinstance(policy, int) else load_policy(policy), world, wrappers, by_ticks=each)
        for each in (False, True)
    )
    assert pieces.compiled_policy is not None
    for tick in sorted(chance.integers(1, 400, 4).tolist()):
        for run in (pieces, slow):
            run.advance(to_tick=tick)
        assert_same(pieces, slow)
        if number >= 15 and chance.random() < 0.5:  # now and then some ticks with Python in between
            vars(pieces._policy).pop("act", None)
            tick_by_tick(pieces._policy)
    for run in (pieces, slow):
        run.advance()
        assert run.over
    assert_same(pieces, slow)
    np.testing.assert_array_equal(pieces.forage_env.arena.obs, slow.forage_env.arena.obs)


def test_in_a_large_swarm_memory_is_asked_ahead_and_nothing_else_changes():
    world = scenario("warehouse_medium", n_robots=LARGE + 100, density=0.1, horizon_s=12.0, interval_s=12.0)
    runs = [live(CRWPolicy(), world, by_ticks=by_ticks) for by_ticks in (False, True)]
    for run in runs:
        run.advance(to_tick=7)
        run.advance()
    assert_same(*runs)


def test_what_somebody_writes_into_the_observation_between_two_pieces_is_gone_after_the_next_tick():
    world = scenario("warehouse_small", n_robots=40, interval_s=1000.0, horizon_s=1000.0)
    seen = []
    for by_ticks in (False, True):
        run, n_delivered = live(CRWPolicy(), world, by_ticks=by_ticks), 0
        for first in range(1000, 4900, 10):
            run.advance(to_tick=first)
            run.forage_env.last_obs[:, 24:48] = 0.5  # light, and now and then proximity
            run.forage_env.last_obs[:, : 24 * (first % 500 == 0)] = 0.5
            before = run.forage_env.events.counters[Counter.COLLECTED]
            run.advance(to_tick=first + 3)
            n_delivered += run.forage_env.events.counters[Counter.COLLECTED] - before
            assert (run.forage_env.last_obs[:, :48] == 0.5).sum() == 0
        assert n_delivered > 0
        seen.append(run.forage_env.last_obs)
    np.testing.assert_array_equal(*seen)


@pytest.mark.parametrize("deaths", ["terminate", "absorbing"])
def test_the_run_ends_with_the_last_robot(deaths):
    wrappers = [parse_wrapper(f"population:death_per_tick=0.1,deaths={deaths}"), parse_wrapper("sensor_noise:sigma=1")]
    runs = both("dpo", wrappers, n_robots=3)
    for run in runs:
        run.advance()
        assert run.over
        assert run.forage_env.tick < 500
    assert_same(*runs)


def test_robots_killed_and_levels_changed_between_two_ticks_count_from_the_next_on():
    runs = both("dpo", [parse_wrapper("population:death_per_tick=0"), *ALL[::2]], n_robots=2)
    for run in runs:
        run.advance(to_tick=100)
        _, noise, population, throttle = run._stack.stack
        assert population.kill(0)
        noise.reconfigure(SensorNoiseConfig(sigma=0.3, groups=("proximity", "position")))
        throttle.reconfigure(ThrottleConfig(waveform=Waveform(kind="constant", amplitude=0.9)))
        run.advance(to_tick=150)
    assert_same(*runs)
    for run in runs:
        assert run._stack.stack[2].kill(1)
        run.advance()
        assert run.over
        assert run.forage_env.tick == 151
    assert_same(*runs)


@pytest.mark.parametrize(("name", "wrappers"), [("dpo", ALL), ("stochx", ()), ("generalist", ())])
def test_a_run_goes_on_from_a_snapshot_and_from_a_copy(name, wrappers):
    run, _ = both(name, wrappers)
    run.advance(to_tick=103)  # between two decisions of the network
    first = run._policy.compiled()
    run.advance(to_tick=222)
    assert run._policy.compiled() is first
    recorder, policy = run._stack, run._policy
    stored, whole = pickle.dumps((recorder.snapshot(), policy)), pickle.loads(pickle.dumps(run))  # noqa: S301 - our own
    twin, twin_policy = copy.deepcopy((recorder, policy))
    run.advance()
    expected = outcome(run)
    snapshot, policy = pickle.loads(stored)  # noqa: S301 - our own bytes
    whole.advance()
    assert_same(whole, run)
    other = both(name, wrappers)[0]._stack
    other.restore_batch(snapshot)
    for stack, driver in ((other, policy), (twin, twin_policy)):
        stack.run(driver.compiled(), 500)
        assert stack.complete
        for column, values in stack.columns().items():
            np.testing.assert_array_equal(values, expected[column], err_msg=column)
        np.testing.assert_array_equal(stack.last_obs, expected["obs"])


# Where Python is asked

THROTTLED = ThrottleConfig(waveform=Waveform(kind="constant", amplitude=0.1))


class Proxy:
    """Hands everything on but what it does itself, as wrappers of policies often do."""

    def __init__(self, policy):
        self.policy = policy

    def __getattr__(self, name):
        return getattr(self.policy, name)

    def act(self, obs, active):
        return 0.5 * self.policy.act(obs, active)


class Slow(CRWPolicy):
    def act(self, obs, active):
        return 0.5 * super().act(obs, active)


class TellsAnew(CRWPolicy):
    """Tells tasks by a new array each time it is asked, which no kernel keeps up to date."""

    @property
    def task(self):
        return np.where(self.activity > 1, Task.GENERALIST, Task.NONE).astype(np.int8)


class Watcher(RunRecorder):
    def after_step(self, tasks, terminated, truncated):
        super().after_step(tasks, terminated, truncated)


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


def is_compiled(stack: SwarmWrapper | ScenarioConfig, policy: Policy | None = None) -> bool:
    stack = build_stack(stack) if isinstance(stack, ScenarioConfig) else stack
    run = LiveRun(stack, policy or CRWPolicy(), seed=0)
    run.advance(to_tick=3)
    return run.compiled_policy is not None


def test_python_is_asked_wherever_it_has_a_say():
    world = scenario("warehouse_small", n_robots=2)
    assert is_compiled(world)
    for policy in (Slow(), Proxy(CRWPolicy()), TellsAnew(), tick_by_tick(CRWPolicy())):
        assert not is_compiled(world, policy)
    assert not is_compiled(scenario("warehouse_small", n_robots=2, physics="chipmunk"))
    assert not is_compiled(Watcher(build_env(world)))
    patched = build_stack(world)
    patched.after_step = lambda *arguments: None
    assert not is_compiled(patched)
    assert is_compiled(RunRecorder(Throttle(build_env(world), THROTTLED)))
    assert is_compiled(RunRecorder(Idle(build_env(world))))
    assert not is_compiled(RunRecorder(Mute(build_env(world))))
    assert not is_compiled(RunRecorder(Stronger(build_env(world), THROTTLED)))
    assert not is_compiled(build_stack(world, [parse_wrapper("handling_cost:waveform=constant,amplitude=5")]))
    for name, method in (("gain", lambda actions, wheel_gain: wheel_gain), ("step_batch", None)):
        below = Throttle(build_env(world), THROTTLED)
        setattr(below, name, method or below.step_batch)
        assert not is_compiled(RunRecorder(below))


# What others' wrappers say

N_ROBOTS = 6
HALF = np.array([[0.5, 1.0]])


class Gain(SwarmWrapper):
    """Slows the left wheels in every other tick, by a gain that a user may well make; the others have no hooks."""

    stack_position = 3
    given: Any = None

    def gain(self, actions, wheel_gain):
        return self.given if self.unwrapped.tick % 2 == 0 else wheel_gain

    def ahead(self, n_ticks):
        return -(self.unwrapped.tick % 2 == 0) * 3 + 1, {}  # below 0 is as good as 0


class Teller(SwarmWrapper):
    """Hands compiled code an array that is too short."""

    stack_position = 3

    def ahead(self, n_ticks):
        return 5, {"draws": np.zeros(3, np.uint32)}


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


def test_what_others_hand_over_is_checked():
    stack = Gain(build_env(scenario("warehouse_small", n_robots=N_ROBOTS)))
    stack.given = np.ones(N_ROBOTS)
    run = LiveRun(RunRecorder(stack), CRWPolicy(), seed=1)
    with pytest.raises(ActionError, match=r"wheel_gain with shape \(n_robots, 2\) = \(6, 2\), got \(6,\)"):
        run.advance(to_tick=3)
    stack.reset_batch(1)
    stack.given = np.ones((N_ROBOTS, 1))
    with pytest.raises(ActionError, match=r"got \(6, 1\)"):
        stack.step_batch(np.zeros((N_ROBOTS, 3), np.float32))
    run = LiveRun(RunRecorder(Teller(build_env(scenario("warehouse_small", n_robots=N_ROBOTS)))), CRWPolicy(), seed=1)
    with pytest.raises(ValueError, match=r"Expected `ahead` of Teller to return \{\} .* got draws"):
        run.advance(to_tick=5)


# Faults

NO_TASK = max(Task) + 1


@kernel
def drive_until_no_task(_obs, active, _draws, state, now):
    allocation, actions = state[-2], state[-1]
    for i in range(active.size):
        actions[i, 0], actions[i, 1], actions[i, 2] = 0.5, 0.4, -1.0
    if now == LAST_TICK:
        allocation.task[1] = NO_TASK


class UntilNoTask(STOCHMPolicy):
    _kernel = staticmethod(drive_until_no_task)


NOT_A_NUMBER = r"got \[0.5, nan, -1.0\] and \[.*\] for robot_2"
BREAKING = ("population:malfunction_per_tick=5,repair_per_tick=5", "throttle:waveform=constant,amplitude=0.5")


@pytest.mark.parametrize(
    ("policy_class", "wrappers", "error", "message", "ticks"),
    [
        (UntilNaN, (), ActionError, NOT_A_NUMBER, LAST_TICK - 1),
        (UntilNaN, BREAKING, ActionError, NOT_A_NUMBER, LAST_TICK - 1),
        (UntilNoTask, (), ValueError, rf"tasks with shape .* = \(4,\) .* codes \[.*{NO_TASK}\]", LAST_TICK),
    ],
)
@pytest.mark.parametrize("start", [0, LAST_TICK - 1])
def test_a_fault_ends_a_run_where_it_ends_with_python(policy_class, wrappers, error, message, ticks, start):
    """Also in a tick in which robots break down: none does, because what robots want to do is looked at before."""
    world = scenario("warehouse_small", n_robots=4, n_objects=20, caches=policy_class.caches)
    ended = []
    for by_ticks in (False, True):
        policy = policy_class()
        run = live(policy, world, [parse_wrapper(word) for word in wrappers], by_ticks=by_ticks)
        run.advance(to_tick=start)
        with pytest.raises(error, match=message):
            run.advance()
        assert policy.n_ticks == LAST_TICK
        assert run.forage_env.tick == ticks
        ended.append((run.forage_env.swarm.position.copy(), run.forage_env.active.copy()))
        if wrappers and not by_ticks and start == 0:  # wrappers have done more ahead than came to be
            with pytest.raises(RuntimeError, match="half done"):
                run.advance()
    for one, other in zip(*ended, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("name", ["obs", "active"])
def test_a_policy_cannot_write_into_what_it_sees(name):
    class Writes:
        def reset(self, spec, rng):
            self.actions = np.zeros((spec.n_robots, 3), np.float32)

        def act(self, obs, active):
            {"obs": obs, "active": active}[name][:] = 1
            return self.actions

    with pytest.raises(ValueError, match="read-only"):
        LiveRun(build_stack(scenario("classroom"), ()), Writes(), 1).advance(to_tick=1)
