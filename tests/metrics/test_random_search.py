"""Foraging from the scenario alone: closed forms where everything is mixed, and single walkers elsewhere."""

import math
from dataclasses import replace

import numpy as np
import pytest

from metrics import CurveError, SearchFloor, Walker, heading_diffusion, search_curves, seen_strip
from tests.reference import random_walks

WALKER = Walker(
    search_mps=0.09,
    turning_per_s=0.015,
    strip_m=0.145,
    blind_s=10.0,
    home_mps=0.08,
    nest_mps=0.10,
    handling_s=0.4,
    seen_m=0.27,
    turn_rad=2.61,
    turn_rad_per_s=1.43,
)
ROOM = (0.0, 0.0, 12.0, 8.0)
MIXED = SearchFloor(interior=ROOM, nest=(5.9, 3.9, 6.1, 4.1), sources=(ROOM,), n_objects=20)
"""Objects everywhere: how long a search takes does not depend on where it goes."""
STRIP = SearchFloor(interior=ROOM, nest=(0.5, 1.0, 1.5, 7.0), sources=((10.0, 1.0, 11.0, 7.0),), n_objects=60)
"""Objects far from the nest."""


def test_headings_diffuse_as_the_formula_says():
    most, dt_s, n_ticks = 0.09, 0.2, 400
    headings = random_walks.wander_turns(most, 20_000, n_ticks, seed=1)
    expected = math.exp(-heading_diffusion(most, dt_s) * n_ticks * dt_s)
    assert np.cos(headings).mean() == pytest.approx(expected, abs=0.02)


def test_an_object_is_seen_in_a_strip_as_wide_as_rides_at_random_say():
    sensors, step = (0.063, 0.0116), 0.018
    rides = random_walks.share_of_strip(0.2, sensors, step, 3000, seed=2)
    assert seen_strip(0.2, sensors, step) == pytest.approx(rides, abs=3.3 * 0.4 * math.sqrt(0.25 / 3000))
    assert seen_strip(0.2, sensors, 0.1) < seen_strip(0.2, sensors, 0.001) < 0.2


def test_where_objects_are_everywhere_a_search_takes_what_they_are_apart():
    found = search_curves(WALKER, MIXED, 1, 1000.0, n_parts=1)
    area = 12.0 * 8.0 - 0.2 * 0.2
    assert found.search_s[0] == pytest.approx(10.0 + area / (0.09 * 0.145 * 20), rel=0.02)


def test_where_robots_are_everywhere_walls_and_others_are_met_as_in_a_gas():
    lost = replace(MIXED, n_objects=1)  # searching all the time
    alone, among = (search_curves(WALKER, lost, n, 1000.0, n_parts=1) for n in (1, 11))
    assert alone.encounters[0] == pytest.approx(0.09 * 40.0 / (math.pi * 96.0), rel=0.1)
    met = 2.0 * 0.27 * 4.0 / math.pi * 0.09 * 10 / 96.0
    assert among.encounters[0] - alone.encounters[0] == pytest.approx(met, rel=0.1)
    odds = among.interference / (1.0 - among.interference)
    alone_odds = alone.interference / (1.0 - alone.interference)
    assert odds[0] - alone_odds[0] == pytest.approx(met * WALKER.avoidance_s, rel=0.1), "Little's law"


def test_the_time_of_a_search_is_that_of_single_walkers():
    """They leave the nest from where they dropped an object, in the direction in which they came."""
    rng = np.random.default_rng(3)
    starts = np.column_stack([np.clip(rng.uniform(1.0, 1.5, 400) - 0.9, 0.0, 12.0), np.full(400, 4.0)])
    headings = math.pi + rng.uniform(-0.3, 0.3, 400)
    times = 10.0 + random_walks.search_times(WALKER, STRIP, starts, headings, dt_s=0.5, seed=4)
    found = search_curves(WALKER, STRIP, 1, 1000.0, n_parts=1)
    error = times.std() / math.sqrt(400)
    assert found.search_s[0] == pytest.approx(times.mean(), abs=0.05 * times.mean() + 3.0 * error)


def test_the_way_home_is_straight():
    found = search_curves(WALKER, STRIP, 1, 1000.0, n_parts=1)
    # From the middle of the source, 10.5 m, to the edge of the nest, 1.5 m, and 0.25 m into it.
    assert found.home_s[0] == pytest.approx(9.0 / 0.08 + 0.25 / 0.10, rel=0.05)


def test_robots_hinder_each_other_and_use_objects_up():
    found = {n: search_curves(WALKER, STRIP, n, 4000.0) for n in (1, 10, 40)}
    per_robot = [curves.performance.sum() / n for n, curves in found.items()]
    assert per_robot == sorted(per_robot, reverse=True)
    assert found[1].interference[0] < found[10].interference[0] < found[40].interference[0] < 0.5
    alone = 4000.0 / (found[1].search_s + found[1].home_s + 0.4).mean() * (1.0 - found[1].interference.mean())
    assert per_robot[0] == pytest.approx(alone, rel=1e-3)
    few = search_curves(WALKER, replace(STRIP, n_objects=6), 10, 4000.0)
    assert few.performance.sum() < found[10].performance.sum()


def test_a_finer_division_of_the_run_changes_little():
    coarse, fine = (search_curves(WALKER, STRIP, 20, 4000.0, n_parts=n).performance.sum() for n in (4, 16))
    assert coarse == pytest.approx(fine, rel=0.05)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"search_mps": 0.0}, "search_mps > 0"),
        ({"turn_rad": math.inf}, "turn_rad > 0"),
    ],
)
def test_walkers_that_cannot_be_are_refused(changed, message):
    with pytest.raises(CurveError, match=message):
        replace(WALKER, **changed)


@pytest.mark.parametrize("changed", [{"sources": ()}, {"nest": (-1.0, 1.0, 1.0, 2.0)}, {"nest": (1.0, 1.0, 1.0, 2.0)}])
def test_floors_that_cannot_be_are_refused(changed):
    with pytest.raises(CurveError, match="sources, and a nest in"):
        replace(STRIP, **changed)


@pytest.mark.parametrize(("n", "horizon_s"), [(0, 100.0), (1, 0.0), (1, math.nan)])
def test_swarms_and_runs_that_cannot_be_are_refused(n, horizon_s):
    with pytest.raises(CurveError, match="Expected"):
        search_curves(WALKER, STRIP, n, horizon_s)
