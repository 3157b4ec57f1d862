"""Runs of compiled policies in worlds with compiled bodies: without Python between ticks, and the same bit for bit."""

import numpy as np
import pytest

from baselines.crw import CRWPolicy
from baselines.stochm import STOCHMPolicy
from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env._internal.prefetching import LARGE
from swarm_forage_env.contract.codes import Counter, Task
from swarm_forage_env.contract.policy import ActionError, Policy
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import LiveRun, build_env, build_stack
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.recorder import RunRecorder
from swarm_forage_env.wrappers.throttle import ThrottleConfig
from swarm_forage_env.wrappers.waveform import Waveform
from tests.support.drivers import LAST_TICK, UntilNaN, tick_by_tick
from tests.support.foraging import quick_world
from tests.support.stage import assert_same_world, snapshot


def recorded(world: ScenarioConfig, policy: Policy, *stops: int) -> RunRecorder:
    recorder = build_stack(world, reads=policy.reads)
    run = LiveRun(recorder, policy, seed=4)
    for tick in stops:
        run.advance(to_tick=tick)
        assert run.forage_env.tick == tick
        assert not run.over
    run.advance()
    assert run.over
    return recorder


WORLDS = [
    ("crw", "warehouse_small", {"n_robots": 1}),
    ("cpfa", "search_and_rescue", {}),
    ("stochm", "warehouse_small", {"nest_centre_m": (3.2, 8.0), "nest_size_m": (3.2, 12.8)}),
    # Where objects lie still, robots look at the floor again only near what has changed.
    ("dpo", "search_and_rescue", {"walk_probability": 0.0}),
    ("stochm", "warehouse_dual", {"walk_probability": 0.0, "nest_size_m": (3.2, 12.8)}),
    ("stochx", "warehouse_medium", {"walk_probability": 0.0, "n_robots": 150}),
    ("generalist", "search_and_rescue", {}),
    ("ppo_warehouse_small", "warehouse_small", {"n_robots": 7}),
]


@pytest.mark.parametrize(("policy", "name", "fields"), WORLDS)
def test_a_run_without_python_is_the_run_with_it(policy, name, fields):
    caches = load_policy(policy).caches
    world = quick_world(name, physics="compiled", caches=caches, interval_s=60.0, **fields)
    one = recorded(world, load_policy(policy), 7, 299, 301)
    other = recorded(world, tick_by_tick(load_policy(policy)))
    expected = other.columns() | other.contributed()
    assert (one.columns() | one.contributed()).keys() == expected.keys()
    for column, values in (one.columns() | one.contributed()).items():
        np.testing.assert_array_equal(values, expected[column], err_msg=column)
    for state in ("position", "heading", "carried_object"):
        np.testing.assert_array_equal(getattr(one.unwrapped.swarm, state), getattr(other.unwrapped.swarm, state))
    np.testing.assert_array_equal(one.unwrapped.arena.obs, other.unwrapped.arena.obs)
    if not fields:
        assert one.columns()["first_picked"].sum() > 0


def test_in_a_large_swarm_memory_is_asked_ahead_and_nothing_else_changes():
    world = scenario("warehouse_medium", n_robots=LARGE + 100, density=0.1, horizon_s=12.0, interval_s=12.0)
    one, other = recorded(world, CRWPolicy(), 7, 30), recorded(world, tick_by_tick(CRWPolicy()))
    assert one.columns()["first_picked"].sum() > 0
    assert_same_world(snapshot(one.unwrapped), snapshot(other.unwrapped))
    np.testing.assert_array_equal(one.unwrapped.arena.obs, other.unwrapped.arena.obs)


@pytest.mark.parametrize("ticks", [3])
def test_what_somebody_writes_into_the_observation_between_two_pieces_is_gone_after_the_next_tick(ticks):
    world = scenario("warehouse_small", n_robots=40, interval_s=1000.0, horizon_s=1000.0)
    seen = []
    for policy in (CRWPolicy(), tick_by_tick(CRWPolicy())):
        run = LiveRun(build_stack(world, reads=policy.reads), policy, seed=4)
        n_delivered = 0
        for first in range(1000, 4900, 10):
            run.advance(to_tick=first)
            run.forage_env.last_obs[:, 24:48] = 0.5  # light, and now and then proximity
            run.forage_env.last_obs[:, : 24 * (first % 500 == 0)] = 0.5
            before = run.forage_env.events.counters[Counter.COLLECTED]
            run.advance(to_tick=first + ticks)
            n_delivered += run.forage_env.events.counters[Counter.COLLECTED] - before
            assert (run.forage_env.last_obs[:, :48] == 0.5).sum() == 0
        assert n_delivered > 0
        seen.append(run.forage_env.last_obs)
    np.testing.assert_array_equal(*seen)


def is_compiled(world: ScenarioConfig, policy: Policy) -> bool:
    return LiveRun(build_stack(world, reads=policy.reads), policy, seed=0).compiled_policy is not None


class Proxy:
    """Hands everything on but what it does itself, as wrappers of policies often do."""

    def __init__(self, policy):
        self.policy = policy

    def __getattr__(self, name):
        return getattr(self.policy, name)

    def act(self, obs, active):
        return 0.5 * self.policy.act(obs, active)


class Watcher(RunRecorder):
    def after_step(self, tasks, terminated, truncated):
        super().after_step(tasks, terminated, truncated)


class Slow(CRWPolicy):
    def act(self, obs, active):
        return 0.5 * super().act(obs, active)


def test_python_is_asked_wherever_it_has_a_say():
    world = scenario("warehouse_small", n_robots=2)
    assert is_compiled(world, CRWPolicy())
    assert not is_compiled(world, Slow())
    assert not is_compiled(world, Proxy(CRWPolicy()))
    assert LiveRun(Watcher(build_env(world)), CRWPolicy(), seed=0).compiled_policy is None
    patched = build_stack(world)
    patched.after_step = lambda *arguments: None
    assert LiveRun(patched, CRWPolicy(), seed=0).compiled_policy is None
    inner = build_stack(world, [ThrottleConfig(waveform=Waveform(kind="constant", amplitude=0.1))])
    assert LiveRun(inner, CRWPolicy(), seed=0).compiled_policy is not None
    inner.stack[1].step_batch = inner.stack[1].step_batch
    assert LiveRun(inner, CRWPolicy(), seed=0).compiled_policy is None
    assert not is_compiled(world, tick_by_tick(CRWPolicy()))
    assert not is_compiled(scenario("warehouse_small", n_robots=2, physics="chipmunk"), CRWPolicy())


def test_every_tick_is_shown_in_a_window(monkeypatch):
    shown = []
    monkeypatch.setattr("swarm_forage_env.env._new_window", lambda: None)
    monkeypatch.setattr(ForageEnv, "render", lambda env: shown.append(env.tick))
    env = ForageEnv(scenario("warehouse_small", n_robots=2), render_mode="human")
    env._window = object()  # type: ignore[assignment] - only that there is one counts
    run = LiveRun(RunRecorder(env), CRWPolicy(), seed=0)
    run.advance(to_tick=3)
    assert shown == [0, 1, 2, 3]


class TellsAnew(CRWPolicy):
    """Tells tasks by a new array each time it is asked."""

    @property
    def task(self):
        return np.where(self.activity > 1, Task.GENERALIST, Task.NONE).astype(np.int8)


def test_tasks_that_no_kernel_keeps_up_to_date_are_asked_for_in_every_tick():
    assert not is_compiled(scenario("warehouse_small", n_robots=2), TellsAnew())


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


@pytest.mark.parametrize(
    ("policy_class", "error", "message", "ticks"),
    [
        (UntilNaN, ActionError, r"got \[0.5, nan, -1.0\] and \[1.0, 1.0\] for robot_2", LAST_TICK - 1),
        (UntilNoTask, ValueError, rf"tasks with shape .* = \(4,\) .* codes \[.*{NO_TASK}\]", LAST_TICK),
    ],
)
@pytest.mark.parametrize("start", [0, LAST_TICK - 1])
def test_a_fault_ends_a_run_where_it_ends_with_python(policy_class, error, message, ticks, start):
    world = scenario("warehouse_small", n_robots=4, n_objects=20, caches=policy_class.caches, physics="compiled")
    ended = []
    for policy in (policy_class(), tick_by_tick(policy_class())):
        run = LiveRun(build_stack(world, reads=policy.reads), policy, seed=4)
        run.advance(to_tick=start)
        with pytest.raises(error, match=message):
            run.advance()
        assert policy.n_ticks == LAST_TICK
        ended.append(snapshot(run.forage_env))
    assert ended[0]["tick"] == ticks
    assert_same_world(*ended)


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
