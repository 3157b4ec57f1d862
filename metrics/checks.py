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


def check_size(name: str, n_robots: int, least: float = 1) -> int:
    """Return a number of robots as int; CurveError if it is not an integer of at least `least`."""
    try:
        size = index(n_robots)
    except TypeError as error:
        raise CurveError(f"Expected {name} as a whole number of robots, got {n_robots!r}.") from error
    if size < least:
        raise CurveError(f"Expected {name} >= {least} robot, got {size}.")
    return size


def check_sizes(n1: int, n2: int) -> tuple[int, int]:
    """Return two swarm sizes, the smaller first; CurveError if they are not so."""
    n1, n2 = check_size("n1", n1), check_size("n2", n2)
    if n1 >= n2:
        raise CurveError(f"Expected sizes n1 < n2, got n1 = {n1} and n2 = {n2}; pass the smaller swarm first.")
    return n1, n2


def check_option(name: str, value: object, options: object) -> None:
    """Check a named option against the values of its `Literal` type; ValueError if it is none of them."""
    allowed = get_args(options)
    if value not in allowed:
        raise ValueError(f"Expected {name} to be one of {', '.join(map(repr, allowed))}, got {value!r}.")


def check_horizon(horizon: float) -> None:
    """Check a run length in ticks; PopulationError if it is not positive and finite."""
    if not (math.isfinite(horizon) and horizon > 0.0):
        raise PopulationError(f"Expected a horizon of more than 0 ticks, got {horizon}; pass the run length in ticks.")


def chosen_seeds(seeds: int | Sequence[int] | None, default: int) -> tuple[int, ...]:
    """Return seeds: the first `seeds` ones if it is a number, `seeds` itself if it is a list, `default` many for None.

    Raises:
        ValueError: No seed, too many, or the same seed twice.
    """
    if seeds is None or isinstance(seeds, int):
        count = default if seeds is None else seeds
        if not 1 <= count <= MOST_SEEDS:
            raise ValueError(f"Expected one or more seeds, at most {MOST_SEEDS:,}, got {count}.")
        return tuple(range(count))
    if not seeds or len(set(seeds)) < len(seeds):
        raise ValueError(f"Expected different seeds, at least one, got {list(seeds)}.")
    return tuple(seeds)
