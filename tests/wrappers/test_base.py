"""The stack of wrappers: order, hooks, gains, snapshots, and the record of a run."""

import itertools

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import Task
from swarm_forage_env.contract.policy import ActionError
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.columns import INTERVAL_COLUMNS
from swarm_forage_env.views.gymnasium import JointForageEnv, SwarmVectorEnv
from swarm_forage_env.views.pettingzoo import parallel_env
from swarm_forage_env.wrappers.base import STACK_ORDER, SwarmWrapper
from swarm_forage_env.wrappers.recorder import COUNTED, RunRecorder
from tests.support.fake_arena import FakeArena, small_scenario


def wrapper_at(position: int) -> type[SwarmWrapper]:
    return type(STACK_ORDER[position], (SwarmWrapper,), {"stack_position": position})


class Logging(SwarmWrapper):
    """Notes every hook and scales gains and observations."""

    log: list

    def __init__(self, env, name, factor):
        super().__init__(env)
        self.name, self.factor = name, factor

    def on_reset(self, seed):
        self.log.append((self.name, "on_reset", seed))

    def before_step(self):
        self.log.append((self.name, "before_step"))

    def gain(self, actions, wheel_gain):
        self.log.append((self.name, "gain"))
        own = np.full((4, 2), self.factor)
        return own if wheel_gain is None else wheel_gain * own

    def observe(self, obs):
        self.log.append((self.name, "observe"))
        return obs + np.float32(self.factor)

    def after_step(self, tasks, terminated, truncated):
        self.log.append((self.name, "after_step", tasks, truncated))


@pytest.fixture
def stack():
    Logging.log = []
    world = FakeArena()
    inner = type("Inner", (Logging,), {"stack_position": 4})(world, "inner", 0.5)
    return type("Outer", (Logging,), {"stack_position": 3})(inner, "outer", 0.25)


def test_hooks_run_inwards_before_the_step_and_outwards_after_it(stack):
    stack.reset_batch(7)
    assert Logging.log == [
        ("inner", "on_reset", 7),
        ("inner", "observe"),
        ("outer", "on_reset", 7),
        ("outer", "observe"),
    ]
    Logging.log.clear()
    stack.step_batch(np.zeros((4, 3), np.float32))
    assert [entry[:2] for entry in Logging.log] == [
        ("outer", "before_step"),
        ("outer", "gain"),
        ("inner", "before_step"),
        ("inner", "gain"),
        ("inner", "observe"),
        ("inner", "after_step"),
        ("outer", "observe"),
        ("outer", "after_step"),
    ]


@pytest.mark.parametrize(
    ("action", "gain", "reason"),
    [
        ((0.0, np.nan, 0.0), None, "Expected finite actions"),
        ((0.0, 0.0, 0.0), np.full((4, 2), np.nan), "Expected finite actions"),
        ((0.0, 0.0, 0.0), np.ones(4), r"wheel_gain with shape \(n_robots, 2\) = \(4, 2\), got \(4,\)"),
    ],
)
def test_what_the_arena_would_refuse_is_refused_before_any_hook(stack, action, gain, reason):
    """Else who catches the error and goes on has another run: noise was drawn, and robots have died."""
    stack.reset_batch(7)
    Logging.log.clear()
    actions = np.zeros((4, 3), np.float32)
    with pytest.raises(ActionError, match=r"\(n_robots, 3\) = \(4, 3\)"):
        stack.step_batch(actions[1:])
    actions[2] = action
    with pytest.raises(ActionError, match=reason):
        stack.step_batch(actions, wheel_gain=gain)
    assert Logging.log == []
    assert stack.unwrapped.calls == []


def test_gains_multiply_and_tasks_pass_through(stack):
    stack.reset_batch(0)
    tasks = np.array([1, 2, 3, 0], np.int8)
    obs, reward, terminated, truncated = stack.step_batch(
        np.zeros((4, 3), np.float32), wheel_gain=np.full((4, 2), 2.0), tasks=tasks
    )
    call = stack.unwrapped.calls[-1]
    np.testing.assert_allclose(call["wheel_gain"], 2.0 * 0.5 * 0.25)
    assert call["tasks"] is tasks
    np.testing.assert_allclose(obs, 0.01 + 0.5 + 0.25)
    assert reward.shape == terminated.shape == (4,)
    assert truncated is False
    assert Logging.log[-1][2] is tasks


def test_only_the_documented_order_can_be_stacked():
    for outer, inner in itertools.product(range(5), repeat=2):
        base = wrapper_at(inner)(FakeArena())
        if outer < inner:
            assert wrapper_at(outer)(base).unwrapped is base.unwrapped
        else:
            with pytest.raises(ValueError, match=", ".join(STACK_ORDER)):
                wrapper_at(outer)(base)


# Born safe


class StepsItself(SwarmWrapper):
    """Overrides what is called on the outermost wrapper only."""

    stack_position = 4

    def step_batch(self, *arguments, **options):
        return super().step_batch(*arguments, **options)


def test_a_wrapper_that_steps_itself_is_refused_where_it_would_be_skipped():
    with pytest.raises(TypeError, match="StepsItself inside of Contributor to override hooks only"):
        Contributor(StepsItself(ForageEnv(small_scenario())))


@pytest.mark.parametrize(("hook", "fault"), [("gain", KeyboardInterrupt), ("after_step", OSError)])
def test_whatever_fails_within_a_tick_is_not_gone_on_with(hook, fault):
    """Some hooks of the tick have been called, and others not; Ctrl-C is no Exception."""
    env = ForageEnv(small_scenario())
    wrapper = wrapper_at(4)(env)
    wrapper.reset_batch(7)
    kept = wrapper.snapshot()

    def fails(*_):
        raise fault

    vars(wrapper)[hook] = fails
    actions = np.zeros((4, 3), np.float32)
    with pytest.raises(fault):
        wrapper.step_batch(actions)
    del vars(wrapper)[hook]
    for refused in (lambda: wrapper.step_batch(actions), lambda: env.step_batch(actions), wrapper.snapshot):
        with pytest.raises(RuntimeError, match="A tick is half done"):
            refused()
    wrapper.restore(kept)
    wrapper.step_batch(actions)


def test_a_seed_that_cannot_be_is_one_kind_of_error_everywhere():
    world = small_scenario()
    for env in (
        ForageEnv(world),
        RunRecorder(ForageEnv(world)),
        parallel_env(world, interface={}),
        JointForageEnv(world),
        SwarmVectorEnv(world, n_arenas=2),
    ):
        for seed in (-1, 1.5):
            with pytest.raises(ConfigError, match=rf"seed \(or None\) to be a whole number >= 0, got {seed}"):
                env.reset(seed=seed)


def test_what_is_only_to_be_read_cannot_be_written():
    env = ForageEnv(small_scenario())
    assert not hasattr(env, "active")
    with pytest.raises(RuntimeError, match="no world before the first reset"):
        env.last_obs  # noqa: B018 - the asking is the fault
    env.reset_batch(7)
    for array in (env.active, env.terminated):
        with pytest.raises(ValueError, match="read-only"):
            array[:] = True


# RunRecorder: intervals as differences of counters


STILL = np.zeros((4, 3), np.float32)


def recorded(recorder: RunRecorder, ticks: int = 15, tasks=None) -> RunRecorder:
    recorder.reset_batch(0)
    for _ in range(ticks):
        recorder.step_batch(STILL, tasks=tasks)
    return recorder


def told(recorder: RunRecorder) -> dict[str, np.ndarray]:
    """What not every record has, without counters of the world."""
    return {name: values for name, values in recorder.columns().items() if name not in (*COUNTED, *INTERVAL_COLUMNS)}


class Contributor(SwarmWrapper):
    """Contributes the tick at the end of each interval."""

    stack_position = 3

    def interval_columns(self):
        return {"throttle": float(self.unwrapped.tick), "throttle_mean": self.unwrapped.tick / 2}


def test_totals_are_differences_and_means_are_over_ticks():
    columns = recorded(RunRecorder(FakeArena())).columns()
    assert columns["collected"].tolist() == [1 + 2 + 3 + 4 + 5, 6 + 7 + 8 + 9 + 10, 11 + 12 + 13 + 14 + 15]
    assert columns["performance"].tolist() == [15.0, 40.0, 65.0]
    assert columns["objects_moved"].tolist() == [5, 5, 5]
    assert columns["interference_ticks"].tolist() == [5, 5, 5]
    assert columns["n_active"].tolist() == columns["n_present"].tolist() == [4.0, 4.0, 4.0]
    np.testing.assert_allclose(columns["interference_fraction"], 0.25)
    assert columns["interval"].tolist() == [0, 1, 2]
    np.testing.assert_allclose(columns["t_end_s"], [1.0, 2.0, 3.0])
    assert columns["adversity"].tolist() == [0.0, 0.0, 0.0]


def test_performance_may_be_any_column_and_what_is_computed_from_them():
    def performance(name, recorder=RunRecorder, **run):
        return recorded(recorder(FakeArena(small_scenario(performance=name))), **run).columns()["performance"].tolist()

    assert performance("n_active") == [4.0, 4.0, 4.0]
    assert performance("1/interference_ticks") == [0.2, 0.2, 0.2]
    assert performance("throttle", lambda arena: RunRecorder(Contributor(arena))) == [5.0, 10.0, 15.0]
    assert performance("throttle") == [0.0, 0.0, 0.0]
    halves = performance("task_balance", tasks=np.array([1, 1, 2, 2], np.int8))
    np.testing.assert_allclose(halves, np.log(2) / np.log(7))


def test_robots_that_are_away_lower_the_mean():
    recorder = RunRecorder(FakeArena())
    recorder.reset_batch(0)
    for tick in range(15):
        if tick == 8:
            recorder.unwrapped.set_population(
                active=np.array([True, True, False, False]), present=np.array([True, True, True, False])
            )
        recorder.step_batch(STILL)
    assert recorder.columns()["n_active"].tolist() == [4.0, (3 * 4 + 2 * 2) / 5, 2.0]
    assert recorder.columns()["n_present"].tolist() == [4.0, (3 * 4 + 2 * 3) / 5, 3.0]


@pytest.mark.parametrize("further_ticks", [0, 8])
def test_after_the_last_death_the_rest_is_zero_even_if_the_world_is_stepped_on(further_ticks):
    world = FakeArena(dies_at=7)
    recorder = recorded(RunRecorder(Contributor(world)), ticks=7 + further_ticks)
    assert recorder.complete
    columns = recorder.columns()
    assert columns["collected"].tolist() == [15, 6 + 7, 0]
    assert columns["n_active"].tolist() == [4.0, 2 * 4 / 5, 0.0]
    np.testing.assert_allclose(columns["interference_fraction"], [0.25, 2 * 0.25 / 5, 0.0])
    np.testing.assert_allclose(columns["t_end_s"], [1.0, 2.0, 3.0])
    assert recorder.columns()["throttle"].tolist() == [5.0, 7.0, 0.0]


def test_task_shares_are_means_over_ticks_of_active_robots():
    recorder = RunRecorder(FakeArena())
    recorder.reset_batch(0)
    tasks = np.array([Task.HARVESTER, Task.HARVESTER, Task.COLLECTOR, Task.GENERALIST], np.int8)
    for tick in range(15):
        if tick in (5, 12):
            at_work = [True, False, True, False] if tick == 5 else [False] * 4
            recorder.unwrapped.set_population(active=np.array(at_work), present=np.ones(4, np.bool_))
        recorder.step_batch(STILL, tasks=tasks)
    shares = told(recorder)
    assert set(shares) == {f"task_share_{task.name.lower()}" for task in Task}
    np.testing.assert_allclose(shares["task_share_harvester"], [0.5, 0.5, 0.2])
    np.testing.assert_allclose(shares["task_share_collector"], [0.25, 0.5, 0.2])
    np.testing.assert_allclose(shares["task_share_generalist"], [0.25, 0.0, 0.0])
    np.testing.assert_allclose(shares["task_share_none"], 0.0)
