"""Foraging predicted from the scenario alone, without runs: robots search at random and carry home straight on.

A searching robot drives with constant speed v, and its heading diffuses: the cosine of its change falls as
exp(-D t). It sees objects within a strip of width w. Where they lie at a density rho, it finds one at the rate v w rho.
Meeting others at a rate s, it turns anywhere; at a wall it turns until the wall is behind it. With n(x, y, heading) the
time that a search spends at a place, and <n> its mean over headings,

    v e . grad n = D d2n / d heading2 + s (<n> - n) - v w rho n + (where the last object was dropped)

which is solved on a grid. The sum of n is the time of a search, v w rho n is where it ends; from there the way home is
straight, to a random depth of the nest. So the places of all robots are known, p(x, y) for one of them, and

    encounters of a robot with others = 2 r (4 / pi) v (N - 1) * integral of p^2

where r is the distance at which two see each other, and 4 / pi v their mean relative speed. An avoidance lasts as long
as the turn away. By Little's law, its rate times its duration are the odds of losing time, f / (1 - f). Delivered
objects are placed again, so that objects become rare where robots are; this is followed over the run.

Source: in the spirit of Harwell et al. 2021, who take rates from the diffusion of the walk, the way home,
acquisition, and rate and duration of avoidance. The equations are ours, because their text was not at hand, and because
robots cross half of these arenas before they have turned, so that a search is no diffusion yet.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix  # type: ignore[import-untyped] - scipy ships no types
from scipy.sparse.linalg import splu  # type: ignore[import-untyped] - scipy ships no types

from .checks import CurveError, check_size
from .curves import FloatArray

Places: TypeAlias = NDArray[np.int64]
Box: TypeAlias = tuple[float, float, float, float]
"""x low, y low, x high, y high in m."""
_PLACES, _HEADINGS = 600, 12
"""How fine the grid is (our choice): four times as many places change deliveries by some percent."""
_POINTS = 60
"""Points of a way home."""
_CYCLES = 3
"""After so many searches where the next one begins changes no more."""
_NOTHING = 1e-12


@dataclass(frozen=True, kw_only=True)
class Walker:
    """What a robot does, in numbers.

    Raises:
        CurveError: A number that is not positive and finite.
    """

    search_mps: float
    """Speed of the search."""
    turning_per_s: float
    """Diffusion D of the heading in the search, rad^2 / s; see `heading_diffusion`."""
    strip_m: float
    """Width of the strip in which a searching robot sees objects; see `seen_strip`."""
    blind_s: float
    """How long after a drop it ignores objects; on its way it goes, as it came, towards the centre of the nest."""
    home_mps: float
    """Speed of the way to the nest."""
    nest_mps: float
    """Speed in the nest, on the way to where the object is dropped."""
    handling_s: float
    """A pick-up and a drop together."""
    seen_m: float
    """Distance of centres at which two robots see each other."""
    turn_rad: float
    """Angle from straight ahead beyond which nothing is avoided."""
    turn_rad_per_s: float
    """How fast it turns on the spot."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value > 0.0):
                raise CurveError(f"Expected {name} > 0 and finite, got {value}.")

    @property
    def avoidance_s(self) -> float:
        """Mean duration of an avoidance of another robot: it is met at pi / 4 on average, and turned away from."""
        return (self.turn_rad - 0.25 * math.pi) / self.turn_rad_per_s


@dataclass(frozen=True, kw_only=True)
class SearchFloor:
    """Where a swarm searches.

    Raises:
        CurveError: No source, no objects, or a nest that is not inside.
    """

    interior: Box
    """Between the walls."""
    nest: Box
    sources: tuple[Box, ...]
    """Objects are placed in them, everywhere with equal chance, but not in the nest."""
    n_objects: int

    def __post_init__(self) -> None:
        check_size("n_objects", self.n_objects)
        x_low, y_low, x_high, y_high = self.interior
        is_inside = x_low <= self.nest[0] < self.nest[2] <= x_high and y_low <= self.nest[1] < self.nest[3] <= y_high
        if not (self.sources and is_inside):
            raise CurveError(f"Expected sources, and a nest in {self.interior}, got {self.sources} and {self.nest}.")


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchCurves:
    """What a swarm does by the model, (T,) each, over equal parts of the run."""

    performance: FloatArray
    """Objects delivered."""
    interference: FloatArray
    """Share of time lost to avoidance."""
    search_s: FloatArray
    """Mean time from a drop to the next pick-up, without avoidance."""
    home_s: FloatArray
    """Mean time from a pick-up to the drop, without avoidance."""
    encounters: FloatArray
    """Avoidances begun per s of a robot that does not avoid."""


def heading_diffusion(most_change_rad: float, dt_s: float) -> float:
    """Diffusion D of the heading, rad^2 / s, of a walk that turns by w in every tick, w <- fmod(w + U(-m, m), m).

    In the long run w has the variance m^2 / 4, and its correlation at lag k is 2^-k, so that the heading gathers
    3 m^2 / 4 of variance per tick; by D it would be 2 D times the length of a tick.

    Args:
        most_change_rad: m, as a change of heading.
        dt_s: Length of a tick.
    """
    return 3.0 * most_change_rad**2 / (8.0 * dt_s)


def seen_strip(side_m: float, sensors_m: tuple[float, float], step_m: float) -> float:
    """Width of the strip in which a robot sees a square object, a mean over its headings.

    It sees the object while all four sensors are over it: while its centre is in a rectangle that is smaller than the
    object. It looks once per tick, so a part of the ways through that are shorter than a tick's misses it.

    Args:
        side_m: Side of the object.
        sensors_m: Distance of the sensors from the centre, ahead and to the side.
        step_m: Way of a tick.
    """
    heading = (np.arange(90) + 0.5) * (0.5 * math.pi / 90)
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    half_x = 0.5 * side_m - sensors_m[0] * cos - sensors_m[1] * sin
    half_y = 0.5 * side_m - sensors_m[0] * sin - sensors_m[1] * cos
    widest = half_x * sin + half_y * cos
    aside = np.linspace(-1.0, 1.0, 401) * widest
    x, y = -aside * sin, aside * cos
    enters = np.maximum((-half_x - x) / cos, (-half_y - y) / sin)
    leaves = np.minimum((half_x - x) / cos, (half_y - y) / sin)
    is_seen = np.minimum(1.0, np.maximum(0.0, leaves - enters) / step_m)
    return float((is_seen.mean(axis=1) * 2.0 * widest[:, 0]).mean())


def search_curves(
    walker: Walker, floor: SearchFloor, n_robots: int, horizon_s: float, *, n_parts: int = 5
) -> SearchCurves:
    """Predict a swarm of robots that search at random, all at work for the whole run.

    Args:
        walker: What a robot does.
        floor: Where.
        n_robots: Swarm size N.
        horizon_s: Length of the run, s.
        n_parts: Parts of the run T; in each the swarm is taken as settled, and objects change between them.

    Raises:
        CurveError: n_robots or n_parts < 1, or a horizon that is not positive and finite.
    """
    n, n_parts = check_size("n_robots", n_robots), check_size("n_parts", n_parts)
    if not (math.isfinite(horizon_s) and horizon_s > 0.0):
        raise CurveError(f"Expected a horizon of more than 0 s, got {horizon_s}.")
    ways, part_s = _Ways(walker, floor), horizon_s / n_parts
    sweep = 8.0 / math.pi * walker.seen_m * walker.search_mps * (n - 1) / ways.cell_m2
    objects, crowd, told = floor.n_objects * ways.placed, np.zeros(ways.n_places), np.empty((5, n_parts))
    for part in range(n_parts):
        if part == 0:  # nobody knows yet where the others are
            crowd = sweep * ways.cycle(objects, crowd).places
        cycle = ways.cycle(objects, crowd)
        crowd = sweep * cycle.places
        met = float(crowd @ cycle.places)
        odds = cycle.walls_s + met * walker.avoidance_s
        rate = n / (1.0 + odds) / (cycle.search_s + cycle.home_s + walker.handling_s)
        told[:, part] = rate * part_s, odds / (1.0 + odds), cycle.search_s, cycle.home_s, cycle.walls + met
        taken = np.maximum(rate * cycle.found / np.maximum(objects, _NOTHING), _NOTHING)
        left = np.exp(-taken * part_s)
        objects = objects * left + rate * ways.placed / taken * (1.0 - left)
        objects *= max(1.0, floor.n_objects - n * cycle.home_s / (cycle.search_s + cycle.home_s)) / objects.sum()
    return SearchCurves(performance=told[0], interference=told[1], search_s=told[2], home_s=told[3], encounters=told[4])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Cycle:
    """A search and the way home, on average."""

    search_s: float
    home_s: float
    places: FloatArray
    """(places,) share of the time that a robot is there."""
    found: FloatArray
    """(places,) share of the searches that end there."""
    walls: float
    """Walls met per s."""
    walls_s: float
    """Time of their avoidance per s of the rest."""


class _Ways:
    """Ways of robots over a grid of places, y by x, and headings."""

    def __init__(self, walker: Walker, floor: SearchFloor) -> None:
        self._walker = walker
        x_low, y_low, x_high, y_high = floor.interior
        side = math.sqrt((x_high - x_low) * (y_high - y_low) / _PLACES)
        self._shape = (max(2, round((y_high - y_low) / side)), max(2, round((x_high - x_low) / side)))
        self._edges = (
            np.linspace(y_low, y_high, self._shape[0] + 1),
            np.linspace(x_low, x_high, self._shape[1] + 1),
        )
        self._sides = tuple(float(edges[1] - edges[0]) for edges in self._edges)
        self.n_places = self._shape[0] * self._shape[1]
        self.cell_m2 = self._sides[0] * self._sides[1]
        room = sum((self._inside(box) for box in floor.sources), np.zeros(self.n_places))
        room *= 1.0 - self._inside(floor.nest)
        self.placed: FloatArray = room / room.sum()
        """(places,) share of the objects that are placed there."""
        nest = self._inside(floor.nest)
        self._start: FloatArray = np.repeat(nest / nest.sum() / _HEADINGS, _HEADINGS)
        """(states,) where searches begin, once objects are no longer ignored."""
        self._find_ways_home(floor.nest)
        self._find_moves()

    def _inside(self, box: Box) -> FloatArray:
        """Share of each place that is inside a box, (places,)."""
        along = [
            np.clip(np.minimum(edges[1:], high) - np.maximum(edges[:-1], low), 0.0, None) / side
            for edges, low, high, side in zip(self._edges, box[1::-1], box[:1:-1], self._sides, strict=True)
        ]
        return np.outer(along[0], along[1]).ravel()

    def _find_ways_home(self, nest: Box) -> None:
        """Straight to the centre of the nest, and there as deep as chance has it: uniform between edge and centre."""
        middles = [0.5 * (edges[1:] + edges[:-1]) for edges in self._edges]
        centre = np.array([0.5 * (nest[1] + nest[3]), 0.5 * (nest[0] + nest[2])])
        half = centre - np.array([nest[1], nest[0]])
        away = np.stack(np.meshgrid(*middles, indexing="ij"), axis=-1).reshape(-1, 2) - centre
        distance = np.maximum(np.hypot(away[:, 0], away[:, 1]), 1e-9)
        ahead = away / distance[:, None]
        edge = np.minimum(distance, (half / np.maximum(np.abs(ahead), _NOTHING)).min(axis=1))
        outside_s, inside_s = (distance - edge) / self._walker.home_mps, edge / self._walker.nest_mps
        share = (np.arange(_POINTS) + 0.5) / _POINTS

        def places(way: FloatArray) -> Places:
            """Places at these distances from the centre, (places, points)."""
            at = centre + ahead[:, None, :] * way[:, :, None]
            y, x = (
                np.clip(((at[..., k] - self._edges[k][0]) / self._sides[k]).astype(np.int64), 0, self._shape[k] - 1)
                for k in (0, 1)
            )
            return y * self._shape[1] + x

        self._home_s: FloatArray = outside_s + 0.5 * inside_s
        self._outer = places(edge[:, None] + (distance - edge)[:, None] * share)
        self._inner = places(edge[:, None] * share)
        step = 2.0 * math.pi / _HEADINGS
        inwards = np.floor(np.arctan2(-ahead[:, 0], -ahead[:, 1]) / step).astype(np.int64) % _HEADINGS
        blind_m = self._walker.search_mps * self._walker.blind_s
        self._begun = places(edge[:, None] * share - blind_m) * _HEADINGS + inwards[:, None]
        self._outer_s: FloatArray = np.repeat(outside_s[:, None] / _POINTS, _POINTS, axis=1)
        self._inner_s: FloatArray = inside_s[:, None] / _POINTS * share  # few come as near to the centre as that

    def _find_moves(self) -> None:
        """List the jumps between states (place, heading) of a search, and what happens at walls."""
        walker, (ny, nx), step = self._walker, self._shape, 2.0 * math.pi / _HEADINGS
        heading = (np.arange(_HEADINGS) + 0.5) * step
        states = np.arange(ny * nx * _HEADINGS).reshape(ny, nx, _HEADINGS)
        turning = walker.turning_per_s / step**2
        jumps: list[tuple[Any, Any, Any]] = [(states, np.roll(states, side, axis=2), turning) for side in (-1, 1)]
        walls, walls_s = np.zeros(states.shape), np.zeros(states.shape)
        for axis, towards in ((0, np.sin(heading)), (1, np.cos(heading))):
            for sign in (-1, 1):
                rate = walker.search_mps * np.maximum(0.0, sign * towards) / self._sides[axis]
                lines, at_wall, at_wall_s = (np.moveaxis(each, axis, 0)[::sign] for each in (states, walls, walls_s))
                wall = math.pi * (0.5 * sign if axis == 0 else 0.5 - 0.5 * sign)
                bearing = (wall - heading + math.pi) % (2.0 * math.pi) - math.pi
                after = (wall - np.copysign(walker.turn_rad, bearing)) / step - 0.5
                lower, part = np.floor(after).astype(np.int64), after - np.floor(after)
                jumps += [
                    (lines[:-1], lines[1:], rate),
                    (lines[-1], lines[-1][:, lower % _HEADINGS], rate * (1.0 - part)),
                    (lines[-1], lines[-1][:, (lower + 1) % _HEADINGS], rate * part),
                ]
                at_wall[-1] += rate
                at_wall_s[-1] += rate * np.maximum(0.0, walker.turn_rad - np.abs(bearing)) / walker.turn_rad_per_s
        flat = [np.broadcast_arrays(*jump) for jump in jumps]
        sources, targets, rates = (np.concatenate([jump[k].ravel() for jump in flat]) for k in range(3))
        everywhere = states.reshape(-1, _HEADINGS)  # who meets another goes on anywhere: from each heading to all
        self._sources: Places = np.concatenate([sources, np.repeat(everywhere, _HEADINGS, axis=1).ravel()])
        self._targets: Places = np.concatenate([targets, np.tile(everywhere, _HEADINGS).ravel()])
        self._rates: FloatArray = rates
        self._walls, self._walls_s = walls.ravel(), walls_s.ravel()

    def cycle(self, objects: FloatArray, crowd: FloatArray) -> _Cycle:
        """Follow searches and ways home until the places of drops settle.

        Args:
            objects: (places,) objects that lie there.
            crowd: (places,) others met per s there.
        """
        finding = self._walker.search_mps * self._walker.strip_m * objects / self.cell_m2
        rates = np.concatenate([self._rates, np.repeat(crowd / _HEADINGS, _HEADINGS**2)])
        solve = _solver(self._sources, self._targets, rates, np.repeat(finding, _HEADINGS))
        spent = solve(self._start)
        for _ in range(_CYCLES - 1):
            self._start = _spread(self._begun, _ends(spent, finding)[:, None] / _POINTS, spent.size)
            spent = solve(self._start)
        found = _ends(spent, finding)
        at = spent.reshape(-1, _HEADINGS).sum(axis=1)
        at += self._walker.blind_s * self._start.reshape(-1, _HEADINGS).sum(axis=1)
        search_s, home_s = float(at.sum()), float(found @ self._home_s)
        at += _spread(self._outer, found[:, None] * self._outer_s, at.size)
        at += _spread(self._inner, found[:, None] * self._inner_s, at.size)
        whole_s = search_s + home_s
        return _Cycle(
            search_s=search_s,
            home_s=home_s,
            places=at / whole_s,
            found=found,
            walls=float(spent @ self._walls) / whole_s,
            walls_s=float(spent @ self._walls_s) / whole_s,
        )


def _spread(places: Places, weights: FloatArray, size: int) -> FloatArray:
    """Add weights up by place, (size,)."""
    each = np.broadcast_to(weights, places.shape).ravel()
    return np.bincount(places.ravel(), weights=each, minlength=size).astype(np.float64)


def _ends(spent: FloatArray, finding: FloatArray) -> FloatArray:
    """Share of the searches that end at each place, (places,)."""
    ends = finding * spent.reshape(-1, _HEADINGS).sum(axis=1)
    return ends / ends.sum()


def _solver(
    sources: Places, targets: Places, rates: FloatArray, ending: FloatArray
) -> Callable[[FloatArray], FloatArray]:
    """Return a function: where walks begin -> time that they spend in each state, until they end at the given rates."""
    n = ending.size
    leaving = np.bincount(sources, weights=rates, minlength=n) + ending
    every = np.arange(n)
    values, rows, columns = (np.concatenate(parts) for parts in ((-rates, leaving), (targets, every), (sources, every)))
    factors = cast("Any", splu(csc_matrix((values, (rows, columns)), shape=(n, n))))
    return lambda begins: cast("FloatArray", factors.solve(begins))
