"""A mean-field model of central-place foraging: a swarm whose robots meet like molecules in a gas.

A robot searches (S) or carries an object home (H), and in both it may meet something and avoid it for a while (AS, AH).
With N robots, M free objects and the rate e of encounters of a robot:

    e      = walls + encounters (N - 1)
    dS/dt  = H / homing_s + AS / avoidance_s - finding M S - e S
    dH/dt  = finding M S  + AH / avoidance_s - H / homing_s - e H
    dAS/dt = e S - AS / avoidance_s                              M = n_objects - H - AH
    dAH/dt = e H - AH / avoidance_s                              deliveries per s = H / homing_s

So the rate of finding is proportional to the free objects, and the rate of encounters to the other robots. A delivered
object is placed in the arena again. Robots and objects are well mixed: all robots are equally far from the nest, and
robots never queue. Where a swarm differs from this model, it does something that the model leaves out.

Source: after Lerman and Galstyan 2002 (foraging with interference). Ours: separate encounters with walls, avoidance
from both states with one mean duration, and objects that are placed again.
"""

import math
from dataclasses import dataclass, fields
from typing import cast

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp  # type: ignore[import-untyped] - scipy ships no types

from .checks import CurveError, check_size
from .curves import FloatArray, as_curves, as_interference

_RELATIVE_TOLERANCE, _ABSOLUTE_TOLERANCE = 1e-8, 1e-10


@dataclass(frozen=True, kw_only=True)
class ForagingRates:
    """Rates of one robot; the same for every swarm size in the same arena.

    Raises:
        CurveError: A rate is negative or not finite, or a time or the number of objects is 0.
    """

    finding: float
    """Objects found per s of searching and per free object in the arena."""
    homing_s: float
    """Mean time from pick-up to delivery without avoidance, s."""
    encounters: float
    """Encounters per s of a robot and per other robot in the arena."""
    walls: float = 0.0
    """Encounters with walls per s of a robot."""
    avoidance_s: float = 1.0
    """Mean duration of an avoidance, s. Shares of time depend on its products with the two rates above alone."""
    n_objects: float
    """Objects in the arena, carried ones included."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            is_positive = field.name in ("homing_s", "avoidance_s", "n_objects")
            if not (math.isfinite(value) and value >= 0.0) or (is_positive and value == 0.0):
                raise CurveError(f"Expected {field.name} {'> 0' if is_positive else '>= 0'} and finite, got {value}.")

    def encounter_rate(self, n_robots: int) -> float:
        """Return the encounters per s of a robot in a swarm, with robots and walls."""
        return self.walls + self.encounters * (n_robots - 1)


@dataclass(frozen=True, kw_only=True, eq=False)
class MeanField:
    """The model over time: numbers of robots, (K,) each; they sum to the swarm size."""

    time_s: FloatArray
    searching: FloatArray
    carrying: FloatArray
    """On the way home, not avoiding."""
    avoiding_searching: FloatArray
    avoiding_carrying: FloatArray
    delivered: FloatArray
    """Objects delivered since the start."""

    @property
    def interference(self) -> FloatArray:
        """Share of robots that avoid, (K,)."""
        avoiding = self.avoiding_searching + self.avoiding_carrying
        return avoiding / (self.searching + self.carrying + avoiding)


@dataclass(frozen=True, kw_only=True)
class SteadyState:
    """The model after a long time."""

    searching: float
    carrying: float
    """On the way home, not avoiding."""
    avoiding: float
    """In both states."""
    deliveries_per_s: float
    interference: float
    """Share of robots that avoid."""


def steady_state(rates: ForagingRates, n_robots: int) -> SteadyState:
    """Return the steady state of the model, in closed form.

    A robot spends the share f = e a / (1 + e a) of its time on avoidance, with the rate of encounters e and the
    duration of an avoidance a. Then H / homing_s = finding (N (1 - f) - H) (n_objects - H (1 + e a)), a quadratic
    equation for H. While objects are plentiful, this is the law of contention: deliveries are proportional to N / (1 +
    s (N - 1)) with s = encounters a / (1 + walls a).

    Raises:
        CurveError: n_robots < 1.
    """
    n = check_size("n_robots", n_robots)
    longer = 1.0 + rates.encounter_rate(n) * rates.avoidance_s
    working = n / longer
    linear = rates.finding * (rates.n_objects + longer * working) + 1.0 / rates.homing_s
    product = rates.finding * rates.n_objects * working
    # The smaller root, in the form that does not cancel.
    root = math.sqrt(linear * linear - 4.0 * rates.finding * longer * product)
    carrying = 2.0 * product / (linear + root)
    return SteadyState(
        searching=working - carrying,
        carrying=carrying,
        avoiding=n - working,
        deliveries_per_s=carrying / rates.homing_s,
        interference=1.0 - 1.0 / longer,
    )


def mean_field(rates: ForagingRates, n_robots: int, horizon_s: float, *, n_points: int = 201) -> MeanField:
    """Solve the model from a start in which every robot searches.

        mean_field(ForagingRates(finding=1e-5, homing_s=300, encounters=2e-4, n_objects=500), 20, 2000).delivered[-1]

    Args:
        rates: Rates of one robot.
        n_robots: Swarm size N.
        horizon_s: Length of the run, s.
        n_points: Number of times K, evenly spaced from 0 to the horizon.

    Raises:
        CurveError: n_robots < 1, a horizon that is not positive and finite, or fewer than two points.
    """
    n = check_size("n_robots", n_robots)
    if not (math.isfinite(horizon_s) and horizon_s > 0.0) or n_points < 2:
        raise CurveError(f"Expected a horizon of more than 0 s and two points or more, got {horizon_s}, {n_points}.")
    met, freed, home = rates.encounter_rate(n), 1.0 / rates.avoidance_s, 1.0 / rates.homing_s

    def change(_time: float, state: FloatArray) -> FloatArray:
        searching, carrying, avoiding_searching, avoiding_carrying, _ = state
        found = rates.finding * (rates.n_objects - carrying - avoiding_carrying) * searching
        held_up, held_up_carrying = (
            met * searching - freed * avoiding_searching,
            met * carrying - freed * avoiding_carrying,
        )
        delivered = home * carrying
        return np.array(
            [delivered - found - held_up, found - delivered - held_up_carrying, held_up, held_up_carrying, delivered]
        )

    times = np.linspace(0.0, horizon_s, n_points)
    solved = solve_ivp(  # pyright: ignore[reportUnknownVariableType] - scipy ships no types
        change,
        (0.0, horizon_s),
        np.array([n, 0.0, 0.0, 0.0, 0.0]),
        method="LSODA",
        t_eval=times,
        rtol=_RELATIVE_TOLERANCE,
        atol=_ABSOLUTE_TOLERANCE,
    )
    searching, carrying, avoiding_searching, avoiding_carrying, delivered = cast("FloatArray", solved.y)  # pyright: ignore[reportUnknownMemberType] - scipy ships no types
    return MeanField(
        time_s=times,
        searching=searching,
        carrying=carrying,
        avoiding_searching=avoiding_searching,
        avoiding_carrying=avoiding_carrying,
        delivered=delivered,
    )


def estimate_rates(
    n_robots: int,
    *,
    pickups: ArrayLike,
    deliveries: ArrayLike,
    n_carrying: ArrayLike,
    interference: ArrayLike,
    interval_s: float,
    n_objects: float,
    lone_interference: ArrayLike | None = None,
    avoidance_s: float = 1.0,
) -> ForagingRates:
    """Estimate the rates from recorded columns of runs of one small swarm, all robots at work.

    Each rate is the number of events divided by the time in which they could happen. For finds, this is the time of
    robots that neither carry nor avoid, times the free objects. For deliveries, it is the time of robots that carry and
    do not avoid. The odds of avoidance, f / (1 - f), are the rate of encounters times the duration. The function
    assumes that robots avoid as often with an object as without, because the columns do not distinguish the two.

    Args:
        n_robots: Swarm size N.
        pickups: Objects picked up in each interval, (R, T): the column `free_pickups`.
        deliveries: Objects delivered, (R, T): `collected`.
        n_carrying: Robots that carry, mean over each interval, (R, T): the column of that name.
        interference: Share of robots that avoid, (R, T): `interference_fraction`.
        interval_s: Length of an interval, s.
        n_objects: Objects in the arena.
        lone_interference: The share of robots alone in the same arena, (R', T) or a number: what is lost to walls.
            Without it there are no walls, and a swarm of one robot shows nothing of encounters.
        avoidance_s: Mean duration of an avoidance, s; the columns do not contain it. It sets how fast the shares
            settle, not their final values.

    Raises:
        CurveError: Curves that are missing, negative, infinite or of different shape, shares above 1, more robots that
            carry than there are robots or objects, no pick-up or no delivery at all, or an interval or duration that is
            not positive.
    """
    n = check_size("n_robots", n_robots)
    found, delivered, carrying = as_curves(pickups=pickups, deliveries=deliveries, n_carrying=n_carrying)
    (share,) = as_interference(interference=interference)
    (alone,) = as_interference(lone_interference=0.0 if lone_interference is None else lone_interference)
    shapes = {values.shape for values in (found, delivered, carrying, share)}
    if len(shapes) > 1 or any(np.isnan(values).any() for values in (found, delivered, carrying, share, alone)):
        raise CurveError(f"Expected columns of the same runs without NaN, (R, T), got shapes {sorted(shapes)}.")
    if carrying.max() > min(n, n_objects):
        raise CurveError(f"Expected at most {min(n, n_objects):g} robots that carry, got {carrying.max():g}.")
    if not (found.any() and delivered.any()):
        raise CurveError("Expected pick-ups and deliveries, got none of one of them; take longer or more runs.")
    if not (interval_s > 0.0 and avoidance_s > 0.0):
        raise CurveError(f"Expected an interval and an avoidance of more than 0 s, got {interval_s}, {avoidance_s}.")
    odds, odds_alone = _odds(share), _odds(alone)
    free = 1.0 - share
    chances = ((n - carrying) * free * (n_objects - carrying)).sum() * interval_s
    if chances == 0.0:
        raise CurveError("Expected robots that search at times, got robots that all carry in every interval.")
    return ForagingRates(
        finding=float(found.sum() / chances),
        homing_s=float((carrying * free).sum() * interval_s / delivered.sum()),
        encounters=max(0.0, odds - odds_alone) / (avoidance_s * (n - 1)) if n > 1 else 0.0,
        walls=odds_alone / avoidance_s,
        avoidance_s=avoidance_s,
        n_objects=float(n_objects),
    )


def _odds(share: FloatArray) -> float:
    """Odds of the mean of shares."""
    mean = float(share.mean())
    if mean >= 1.0:
        raise CurveError("Expected robots that are not always avoiding, got an interference of 1 in every interval.")
    return mean / (1.0 - mean)
