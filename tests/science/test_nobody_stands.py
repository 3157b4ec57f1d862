"""Nobody stands for ever: no robot stays within 5 cm for ten minutes, or there is a reason that has a name."""

import pytest

from swarm_forage_env.inspect.stuck import StuckRobot, find_stuck
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.quirks import AUTHORS_PROGRAM, Quirks
from swarm_forage_env.wrappers.registry import parse_wrapper

pytestmark = [pytest.mark.slow, pytest.mark.compiled]

CONTROLLERS = ["crw", "dpo", "cpfa", "stochm", "stochx"]
SMALL = ("warehouse_small", {"horizon_s": 4000.0})
CROWDED = ("warehouse_small", {"horizon_s": 2000.0, "n_robots": 128})
MEDIUM = ("warehouse_medium", {"horizon_s": 2000.0})
RESCUE = ("search_and_rescue", {"horizon_s": 3000.0, "side_m": 32.0})
NOISES = ["sensor_noise:sigma=0.005", "actuator_noise:sigma=0.03"]
TOUCH_M = 0.175
"""Centres of touching robots are 0.170 m apart."""

under_both_readings = pytest.mark.parametrize(
    "quirks", [Quirks(), AUTHORS_PROGRAM], ids=["as described", "authors' program"]
)


def named_reason(one: StuckRobot, noise: str | None) -> str:
    """Why a robot may stand; empty = it must not.

    Position noise of 0.5 % is 8 cm here, but a robot has arrived within 2 cm only. Two robots that press against each
    other at one point lose their common speed to noise, and neither gets there until chance parts them.
    """
    is_pressing = one.neighbour_m < TOUCH_M and ", vector, " in one.state
    if noise is not None and "sensor_noise" in noise and is_pressing:
        return "two robots after one point press against each other, and noise hides it from both"
    return ""


def unexplained(name, fields, policy, seed, quirks, noise=None) -> list[StuckRobot]:
    wrappers = () if noise is None else (parse_wrapper(noise),)
    spec = plan_run(scenario(name, quirks=quirks, **fields), policy, seed=seed, wrappers=wrappers)
    return [one for one in find_stuck(spec) if not named_reason(one, noise)]


@under_both_readings
@pytest.mark.parametrize("policy", CONTROLLERS)
@pytest.mark.parametrize("world", [SMALL, RESCUE], ids=["small", "rescue"])
def test_nobody_stands_in_calm(world, policy, quirks):
    assert unexplained(*world, policy, 2, quirks) == []


@pytest.mark.parametrize("policy", CONTROLLERS)
@pytest.mark.parametrize("noise", NOISES)
def test_nobody_stands_under_noise(policy, noise):
    assert unexplained(*SMALL, policy, 8, Quirks(), noise) == []


@under_both_readings
@pytest.mark.parametrize("noise", [None, NOISES[0]], ids=["calm", "sensor noise"])
def test_nobody_stands_among_two_hundred(noise, quirks):
    assert unexplained(*MEDIUM, "dpo", 5, quirks, noise) == []


@pytest.mark.parametrize("policy", CONTROLLERS)
def test_nobody_stands_in_a_crowd(policy):
    assert unexplained(*CROWDED, policy, 6, Quirks()) == []


@under_both_readings
def test_cache_starters_move_on_from_places_that_are_refused(quirks):
    """They stood for up to 4,300 s in this run."""
    assert unexplained("warehouse_small", {}, "stochx", 1, quirks) == []


def test_carriers_side_by_side_part():
    """Two of them turned to and fro for 1,080 s in this run, from 555 s on."""
    fields = {"n_robots": 200, "horizon_s": 1400.0}
    assert unexplained("warehouse_medium", fields, "dpo", 6, AUTHORS_PROGRAM) == []
