"""The errors of the measures, and the checks of single numbers and options that raise them.

Curves are checked in `curves`, tables of curves in `scoring.curves_file`.
"""

import math
from collections.abc import Sequence
from operator import index
from typing import get_args

MOST_SEEDS = 100_000
"""Runs of one kind that may be asked for; our choice: five hundred times those of the paper."""


class CurveError(ValueError):
    """A curve or a swarm size that a measure cannot work with."""


class PopulationError(ValueError):
    """Population rates, a run length or a demand on the population for which a quantity does not exist."""


def check_whole(name: str, n_robots: int) -> int:
    """Return a number of robots as int.

    Raises:
        CurveError: Not an integer.
    """
    try:
        return index(n_robots)
    except TypeError as error:
        raise CurveError(f"Expected {name} as a whole number of robots, got {n_robots!r}.") from error


def check_size(name: str, n_robots: int) -> int:
    """Return a swarm size as int.

    Raises:
        CurveError: Not a positive integer.
    """
    size = check_whole(name, n_robots)
    if size < 1:
        raise CurveError(f"Expected {name} >= 1 robot, got {size}.")
    return size


def check_size_order(n1: int, n2: int) -> None:
    """Check n1 < n2.

    Raises:
        CurveError: The sizes are equal or in the wrong order.
    """
    if n1 >= n2:
        raise CurveError(f"Expected sizes n1 < n2, got n1 = {n1} and n2 = {n2}; pass the smaller swarm first.")


def check_option(name: str, value: object, options: object) -> None:
    """Check a named option against the values of its `Literal` type.

    Raises:
        ValueError: Unknown value.
    """
    allowed = get_args(options)
    if value not in allowed:
        raise ValueError(f"Expected {name} to be one of {', '.join(map(repr, allowed))}, got {value!r}.")


def check_horizon(horizon: float) -> None:
    """Check a run length in ticks.

    Raises:
        PopulationError: Not positive and finite.
    """
    if not (math.isfinite(horizon) and horizon > 0.0):
        raise PopulationError(f"Expected a horizon of more than 0 ticks, got {horizon}; pass the run length in ticks.")


def check_level(level: float) -> None:
    """Check a confidence level.

    Raises:
        ValueError: Outside (0, 1).
    """
    if not 0.0 < level < 1.0:
        raise ValueError(f"Expected a confidence level in (0, 1), got {level}.")


def check_resamples(n_resamples: int) -> None:
    """Check a number of resamples.

    Raises:
        ValueError: Less than one.
    """
    if n_resamples < 1:
        raise ValueError(f"Expected n_resamples >= 1, got {n_resamples}.")


def chosen_seeds(seeds: int | Sequence[int] | None, default: int) -> tuple[int, ...]:
    """Return seeds: the first `seeds` ones if it is a number, `seeds` itself if it is a list, `default` many for None.

    Raises:
        ValueError: No seed, too many, or the same seed twice.
    """
    if seeds is None or isinstance(seeds, int):
        count = default if seeds is None else seeds
        if count < 1:
            raise ValueError(f"Expected one or more seeds, got {count}.")
        if count > MOST_SEEDS:
            raise ValueError(f"Expected at most {MOST_SEEDS:,} seeds, got {count}.")
        return tuple(range(count))
    if not seeds or len(set(seeds)) < len(seeds):
        raise ValueError(f"Expected different seeds, at least one, got {list(seeds)}.")
    return tuple(seeds)
