"""Wrong calls of an environment: each must be refused with an error of our own, and must change nothing.

That nothing changes is seen by who runs the same world once more without them (`random_worlds.visit`).
"""

import traceback
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

import swarm_forage_env
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.policy import ActionError
from swarm_forage_env.world.snapshots import SnapshotError
from swarm_forage_env.wrappers.recorder import RunRecorder

OWN = (ActionError, ConfigError, SnapshotError, RuntimeError, ValueError)
PACKAGE = Path(swarm_forage_env.__file__).parent


def refused(call: Callable[[], Any], what: str) -> int:
    """Make a call that must fail with a message of our own; returns 1, for counting."""
    told = _error_of(call)
    assert told is not None, f"{what} was taken"
    assert isinstance(told, OWN), f"{what}: {told!r} is no error of ours"
    origin = Path(traceback.extract_tb(told.__traceback__)[-1].filename)
    assert origin.is_relative_to(PACKAGE), f"{what}: {told!r} comes from {origin}, not from us"
    assert str(told)[:1].isupper(), f"{what}: {told!r} is no sentence"
    return 1


def _error_of(call: Callable[[], Any]) -> Exception | None:
    try:
        call()
    except Exception as error:  # noqa: BLE001 - what it is, is looked at
        return error
    return None


def misuse_before_reset(stack: RunRecorder) -> int:
    """Make all calls that need a world, before there is one; returns how many."""
    env = stack.unwrapped
    n_robots = env.scenario.robots.n_robots
    calls: dict[str, Callable[[], Any]] = {
        "a step of arrays": lambda: stack.step_batch(np.zeros((n_robots, 3), np.float32)),
        "a step of dicts": lambda: stack.step(dict.fromkeys(env.possible_agents, np.zeros(3, np.float32))),
        "an empty step": lambda: stack.step({}),
        "a look at the state": env.state,
        "a look at the swarm": lambda: env.swarm,
        "a snapshot": stack.snapshot,
        "columns": stack.columns,
        "a reset with a negative seed": lambda: stack.reset_batch(-1),
        "a reset with a seed of text": lambda: stack.reset(seed="one"),
        "a reset with an option": lambda: stack.reset(options={"speed": 1}),
    }
    return sum(refused(call, f"{name} before the first reset") for name, call in calls.items())


def misuse(stack: RunRecorder, random: Random) -> int:
    """Make some wrong calls in the middle of a run; returns how many."""
    env = stack.unwrapped
    n_robots = env.scenario.robots.n_robots
    good = np.zeros(env.swarm_spec.action_shapes[-1], np.float32)
    agents = list(env.agents)
    some = good.copy()
    workers = np.flatnonzero(env.active)
    by_agent = dict.fromkeys(agents, good[0])
    calls: dict[str, Callable[[], Any]] = {
        "actions without a row": lambda: stack.step_batch(good[1:]),
        "actions with a column more": lambda: stack.step_batch(np.zeros((n_robots, good.shape[1] + 1), np.float32)),
        "one number for actions": lambda: stack.step_batch(np.float32(0.0)),
        "text for actions": lambda: stack.step_batch([["a"] * 3] * n_robots),
        "no actions": lambda: stack.step_batch(None),
        "a gain of another shape": lambda: stack.step_batch(good, wheel_gain=np.ones(n_robots + 1)),
        "a reset with a negative seed": lambda: stack.reset_batch(-1),
        "a reset with an option": lambda: stack.reset(seed=1, options={"speed": 1}),
        "something else for a snapshot": lambda: stack.restore_batch(b"snapshot"),
        "a population of another shape": lambda: env.set_population(active=np.ones(n_robots + 1, bool),
                                                                    present=np.ones(n_robots, bool)),
        "robots at work that are not there": lambda: env.set_population(active=np.ones(n_robots, bool),
                                                                        present=np.zeros(n_robots, bool)),
        "handling in no time": lambda: env.set_handling_ticks(pickup=0, drop=1),
        "an action of a stranger": lambda: stack.step({**by_agent, "robot_x": good[0]}),
    }  # fmt: skip
    if agents:
        calls |= {
            "an agent without an action": lambda: stack.step(dict.fromkeys(agents[1:], good[0])),
            "an action of two numbers": lambda: stack.step({**by_agent, agents[0]: good[0, :2]}),
            "a list for actions": lambda: stack.step([good[0]] * len(agents)),
        }
    if len(workers):
        some[random.choice(workers.tolist()), random.randrange(good.shape[1])] = random.choice(
            (np.nan, np.inf, -np.inf)
        )
        rows = dict(zip(env.possible_agents, some, strict=True))
        calls |= {
            "an action that is no number": lambda: stack.step_batch(some),
            "a gain that is no number": lambda: stack.step_batch(good, wheel_gain=np.full((n_robots, 2), np.nan)),
        }
        if agents:
            calls["an agent's action that is no number"] = lambda: stack.step({agent: rows[agent] for agent in agents})
    return sum(refused(calls[name], name) for name in random.sample(list(calls), 3))
