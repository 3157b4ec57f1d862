"""RobotPolicy: one function for one robot; runs by it, what robots remember, and what is told of faults."""

import copy
import inspect
import math
import pickle
import re
from typing import Any, ClassVar

import numpy as np
import pytest
from numba import njit

from swarm_forage_env import (
    ConfigError,
    Event,
    Grip,
    RobotPolicy,
    RunSpec,
    StepError,
    World,
    load_policy,
    run_policy,
    scenario,
)
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.detection import sees_nest
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.runs.run import LiveRun, build_stack
from tests.support.drivers import tick_by_tick
from tests.support.foraging import mild_wrappers, quick_world

EXAMPLE = "beeline"
FEW = scenario("warehouse_small", n_robots=3, n_objects=40, horizon_s=20.0, interval_s=20.0)


def acts(policy: RobotPolicy, ticks: int = 1, active: Any = (True, True, True), **columns: float) -> np.ndarray:
    """Reset a policy for three robots, and let it act; columns of the observation hold what is given."""
    spec = SwarmSpec.of(FEW)
    policy.reset(spec, stream_rng(5, Stream.POLICY))
    obs = np.zeros((3, spec.layout.size), np.float32)
    for name, value in columns.items():
        obs[:, spec.layout[name]] = value
    for _ in range(ticks):
        actions = policy.act(obs, np.array(active))
    return actions


class Counts(RobotPolicy):
    reads = ("carrying", "ground", "event")
    memory: ClassVar = {"ticks": 0, "total": 0.0, "has_seen": False, "last": (0.0, 0.0)}
    parameters: ClassVar = {"speed": 0.25, "grips": (Grip.GRASP, Grip.SITE)}
    draws = 2

    @staticmethod
    def step(see, robot, chance, known):
        robot.ticks += 1
        robot.total += chance[0]
        robot.last[0], robot.last[1] = chance[0], chance[1]
        robot.has_seen = robot.has_seen or sees_nest(see.ground)
        if int(see.event * 16.0 + 0.5) == Event.PICKED_UP:
            return 1, True, Grip.RELEASE
        return known.speed, known.arena_size_m[1] / 32.0, known.grips[1 if see.carrying > 0.5 else 0]


# Runs


@pytest.mark.parametrize(
    ("name", "wrappers"), [("warehouse_small", ()), ("search_and_rescue", mild_wrappers())], ids=["plain", "adverse"]
)
def test_a_run_without_python_is_the_run_with_it(name, wrappers):
    world = quick_world(name, interval_s=60.0)
    one, other = load_policy(EXAMPLE), load_policy(EXAMPLE)
    runs = [
        LiveRun(build_stack(world, wrappers, reads=each.reads), each, seed=4) for each in (one, tick_by_tick(other))
    ]
    assert [run.compiled_policy is None for run in runs] == [False, True]
    for run in runs:
        run.advance()
    results = [run._stack.columns() for run in runs]
    assert results[0].keys() == results[1].keys()
    for column, values in results[0].items():
        np.testing.assert_array_equal(values, results[1][column], err_msg=column)
    for state in ("position", "heading", "carried_object"):
        np.testing.assert_array_equal(*(getattr(run.forage_env.swarm, state) for run in runs))
    np.testing.assert_array_equal(one.robots, other.robots)
    assert results[0]["first_picked"].sum() > 0
    assert one.robots["find_m"].any()


# What a robot is given, and what it remembers


def test_it_sees_remembers_and_draws_what_was_said():
    policy = Counts()
    np.testing.assert_array_equal(acts(policy, ticks=2, ground=0.7), [[0.25, 0.5, Grip.GRASP]] * 3)
    drawn = stream_rng(5, Stream.POLICY).random((2, 3, 2))
    robots = policy.robots
    np.testing.assert_array_equal(robots["ticks"], 2)
    np.testing.assert_array_equal(robots["total"], drawn[0, :, 0] + drawn[1, :, 0])
    np.testing.assert_array_equal(robots["last"], drawn[1])
    np.testing.assert_array_equal(robots["has_seen"], True)
    np.testing.assert_array_equal(acts(policy, carrying=1.0)[:, 2], np.float32(Grip.SITE))
    np.testing.assert_array_equal(policy.robots["has_seen"], False)  # reset begins anew
    np.testing.assert_array_equal(acts(policy, event=1 / 16)[0], [1.0, 1.0, Grip.RELEASE])


def test_a_robot_that_is_away_stands_keeps_its_cargo_and_remembers():
    policy = Counts()
    for carrying, grip in ((0.0, Grip.RELEASE), (1.0, Grip.GRASP)):
        actions = acts(policy, ticks=3, active=(True, False, True), carrying=carrying)
        np.testing.assert_array_equal(actions[1], np.float32([0.0, 0.0, grip]))
        np.testing.assert_array_equal(policy.robots["ticks"], [3, 0, 3])


def test_arguments_change_parameters_and_others_are_refused():
    assert acts(Counts(speed=0.75))[0, 0] == 0.75
    assert acts(Counts())[0, 0] == 0.25
    with pytest.raises(ConfigError, match=r"Unknown parameter of Counts 'sped'. Did you mean 'speed'"):
        Counts(sped=1.0)


class Known(RobotPolicy):
    parameters: ClassVar = {"power": 2.0, "count": 2, "is_shy": False, "gains": (1.0, 2.0)}


def test_arguments_keep_the_kind_and_shape_of_the_default():
    changed = Known(power=3, count=np.uint8(3), gains=[3, 4]).parameters
    assert [changed[name].dtype for name in ("power", "count", "gains")] == [np.float64, np.int64, np.float64]
    assert (changed["power"], changed["count"], changed["gains"].tolist()) == (3.0, 3, [3.0, 4.0])
    for name, value in (("power", (1.0, 2.0)), ("power", "x"), ("count", 2.0), ("is_shy", 1), ("gains", 1.0)):
        with pytest.raises(StepError, match=f"Expected parameter {name} to have the kind and shape of its default"):
            Known(**{name: value})


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda policy: pickle.loads(pickle.dumps(policy))])  # noqa: S301 - made here
def test_copies_go_on_by_themselves(copied):
    policy = Counts()
    acts(policy)
    other = copied(policy)
    obs = np.zeros((3, SwarmSpec.of(FEW).layout.size), np.float32)
    for _ in range(2):
        other.act(obs, np.ones(3, np.bool_))
    assert (policy.robots["ticks"].tolist(), other.robots["ticks"].tolist()) == ([1] * 3, [3] * 3)


# Faults in a run


class Fails(RobotPolicy):
    """Each way of failing comes in tick 7, to the third robot alone, after it has changed what it remembers."""

    reads = ("proximity",)
    memory: ClassVar = {"ticks": 0}
    parameters: ClassVar = {"way": 0, "third": 0.0}

    @staticmethod
    def step(see, robot, chance, known):
        robot.ticks += 1
        late = robot.ticks == 7 and chance[0] == known.third
        if late and known.way == 0:
            raise ValueError("lost")
        if late and known.way == 1:
            see.proximity[robot.ticks + 17]
        if late and known.way == 2:
            return 1.0 / float(7 - robot.ticks), 0.0, 0.0
        if late and known.way == 3:
            return math.nan, 0.0, 0.0
        return 0.5, 0.5, Grip.GRASP


WAYS = {
    0: ("ValueError: lost", 'ValueError("lost")'),
    1: ("IndexError: index .*out of bounds.*", "see.proximity[robot"),
    2: ("ZeroDivisionError: .*division by zero", "1.0 / float"),
    3: (r"\(nan, 0.0, 0.0\)", ""),
}
"""Number -> how the fault is told, and what stands in its line, if that is told, too."""


def told_place(words: str) -> str:
    """Return how the line of `Fails.step` with these words is told."""
    lines, first = inspect.getsourcelines(Fails.step)
    return "".join(f" ({__file__}:{first + number})" for number, line in enumerate(lines) if words and words in line)


def fails(way: int) -> Fails:
    draws = stream_rng(5, Stream.POLICY).random((7, 3, 1))
    return Fails(way=way, third=float(draws[6, 2, 0]))


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("changed", [lambda policy: policy, tick_by_tick], ids=["compiled", "by ticks"])
def test_a_fault_ends_the_run_and_says_whose_where_and_when(way, changed, capfd):
    spec = RunSpec(world=World(FEW), policy="fails", seed=5)
    told, words = WAYS[way]
    place = re.escape(told_place(words))
    expected = rf"^Expected Fails.step to return \(left wheel, .* got {told}{place}, for robot_2 in tick 7\.$"
    with pytest.raises(StepError, match=expected) as raised:
        run_policy(changed(fails(way)), spec)
    assert "\n" not in str(raised.value)
    assert capfd.readouterr() == ("", "")


# Faults in the code


def unread(see, robot, chance, known):
    return see.light[0], 0.0, 0.0


def pair(see, robot, chance, known):
    return 0.0, 0.0


def nothing_now_and_then(see, robot, chance, known):
    if robot.ticks < 0:
        return 0.0, 0.0, 0.0
    return None


def two_kinds(see, robot, chance, known):
    return (0.0, 0.0, 0.0) if robot.ticks else 0.0


@njit
def adds_words(number):
    return number + "words"


def calls_it(see, robot, chance, known):
    return adds_words(see.proximity[0]), 0.0, 0.0


def reset_by(step):
    """Reset a policy with this step."""
    acts(type("Wrong", (RobotPolicy,), {"step": step, "reads": ("proximity",), "memory": {"ticks": 0}})())


@pytest.mark.parametrize(
    ("step", "told"),
    [
        (unread, r"under numba.njit to be Python .*, got no field 'light' \(PLACE:1\)\.$"),
        (two_kinds, r"under numba.njit to be Python .*, got Cannot unify .*float64.* \(PLACE:1\)\.$"),
        (pair, r"\(PLACE:0\) to return .*, got .*(UniTuple\(float64, 2\)|UniTuple\(float64 x 2\))"),
        (nothing_now_and_then, r"\(PLACE:0\) to return .*, got .*(OptionalType|none)"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_code_that_is_not_compiled_or_returns_no_action_is_told_with_its_place(step, told):
    for below in (0, 1):
        told = told.replace(f"PLACE:{below}", re.escape(f"{__file__}:{step.__code__.co_firstlineno + below}"))
    with pytest.raises(StepError, match=rf"^Expected {step.__name__} .*{told}"):
        reset_by(step)


def test_a_function_that_is_called_is_told_with_the_innermost_line():
    place = re.escape(f"({__file__}:{adds_words.py_func.__code__.co_firstlineno + 2})")
    with pytest.raises(StepError, match=rf"^Expected calls_it .* got No implementation of function .*add.* {place}\.$"):
        reset_by(calls_it)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ({"step": lambda obs: obs}, r"to take see, robot, chance, known and no self, got \('obs',\)"),
        ({"step": lambda self, see, robot, chance, known: 0}, "and no self, got .*'self', 'see'"),
        ({"draws": -1}, "Expected draws of Wrong to be a whole number >= 0, got -1"),
        ({"memory": {"name": "x"}}, "Expected the memory to be numbers, .* got 'name': 'x'"),
        ({"memory": {"2nd": 0}}, "Expected the memory to be numbers, .* got '2nd'"),
        ({"memory": {"size": 0}}, "Expected the memory to be numbers, .* got 'size'"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused_when_the_class_is_made(words, told):
    with pytest.raises(ConfigError, match=told):
        type("Wrong", (RobotPolicy,), words)
