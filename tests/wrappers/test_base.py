"""The stack of wrappers: order, hooks, gains, and the dict API over it."""

import itertools

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.policy import ActionError
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.views.gymnasium import JointForageEnv, SwarmVectorEnv
from swarm_forage_env.views.pettingzoo import parallel_env
from swarm_forage_env.wrappers.base import STACK_ORDER, SwarmWrapper
from swarm_forage_env.wrappers.recorder import RunRecorder
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


def test_a_hook_of_an_instance_is_a_hook():
    """What the world would refuse is refused before it acts."""
    wrapper = wrapper_at(4)(ForageEnv(small_scenario()))
    wrapper.reset_batch(7)
    called = []
    wrapper.before_step = lambda: called.append(True)
    with pytest.raises(ActionError, match="Expected finite actions"):
        wrapper.step_batch(np.full((4, 3), np.nan, np.float32))
    wrapper.step_batch(np.zeros((4, 3), np.float32))
    assert called == [True]


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
