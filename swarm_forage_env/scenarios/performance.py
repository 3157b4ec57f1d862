"""What performance can mean: the names that a scenario or a score may give, their units, and how each is computed.

    collected                   a recorded column, as it is
    1/interference_fraction     a column of which less is better, turned round: 1/x in each interval, where 1/0 is 0
    task_balance, cache_load    computed from several columns

Performance is a way to read a run and no part of it: a record holds all columns, so another performance needs no other
run. The paper proposes such measures beside deliveries in its discussion.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.wording import suggestion
from swarm_forage_env.scenarios.columns import CONTRIBUTED_COLUMNS, INTERVAL_COLUMNS

Curve = NDArray[np.float64]
Columns = Mapping[str, np.ndarray]

INVERTED = "1/"
"""What stands before a column of which less is better."""
_COUNTS = ("objects", "robots", "caches", "cells", "robot-ticks")
"""Units of what is counted; shares, ratios and lengths of time have others."""


@dataclass(frozen=True, slots=True)
class Performance:
    """What P(N, t) is: a column of the record of a run, or what is computed from several."""

    name: str
    unit: str = "1"
    is_total: bool = False
    """Whether a number is a total over its interval, like deliveries, which can be told as a rate; else it is a mean, a
    ratio, a share."""
    words: str = ""
    """Name for people; empty = the name itself."""
    adds_up: bool | None = None
    """Whether a swarm has what its robots have together, so that twice the swarm could have twice of it. False for
    shares and ratios; measures that compare with growth in proportion then have a note. None = as the unit says: counts
    do."""

    def __post_init__(self) -> None:
        if self.adds_up is None:
            object.__setattr__(self, "adds_up", self.unit in _COUNTS)

    @property
    def amount(self) -> str:
        """What there is so and so much of, in tables: the unit, or the name where the unit is 1."""
        return self.name if self.unit == "1" else self.unit

    @property
    def title(self) -> str:
        """Name for people."""
        return self.words or self.name.replace("_", " ")


PERFORMANCE_COLUMNS = {
    name: Performance(name, column.unit, column.is_total, column.words)
    for name, column in {**INTERVAL_COLUMNS, **CONTRIBUTED_COLUMNS}.items()
    if name not in ("interval", "t_end_s", "performance")
}
"""Columns of a record that can be its performance: all numbers but the clock."""

_NAME_OF_WORDS = {entry.title.replace("-", "").replace(" ", "_"): entry.name for entry in PERFORMANCE_COLUMNS.values()}
"""What people may type who know a column from tables, "deliveries" or "first_pickups" -> its name."""

ABSENT: dict[str, float | str] = {
    "task_share_none": 1.0,
    "believed_interference_fraction": "interference_fraction",
}
"""What a column counts as that a run does not have, because nothing in it writes one: a number, or another column;
others 0. Without a population wrapper nobody dies; if a policy tells no tasks, all of its robots are without one;
without sensor noise robots believe what is true."""

_TASKS = tuple(name for name in PERFORMANCE_COLUMNS if name.startswith("task_share_") and name != "task_share_none")


def task_balance(columns: Columns) -> Curve:
    """How evenly the robots spread over the tasks, 0 = one task (or none) to 1 = all seven alike, (T,).

    -sum(p ln p) / ln 7 with p the shares of the tasks among robots that have one. 7, not the number of a policy's own
    tasks, so that policies with different tasks can be compared: three tasks in equal parts are ln 3 / ln 7 = 0.56.

    Source: our choice. The paper's discussion names the balance of tasks as a performance and gives no formula.
    """
    shares = np.stack([_column(name, columns) for name in _TASKS])
    assigned = shares.sum(axis=0)
    parts = np.divide(shares, assigned, out=np.zeros_like(shares), where=assigned > 0.0)
    # 0 ln 0 is 0, its limit; the logarithm of 1 stands in for it. The last bits of numpy's depend on the processor.
    logarithms = np.array([math.log(part) if part > 0.0 else 0.0 for part in parts.ravel().tolist()])
    entropy = -(parts * logarithms.reshape(parts.shape)).sum(axis=0)
    return np.clip(entropy / math.log(len(_TASKS)), 0.0, 1.0)


def cache_load(columns: Columns) -> Curve:
    """Objects per cache, (T,): mean objects inside caches over mean number of caches; 0 where there was no cache.

    Source: our choice. The paper's discussion names the load of a depot as a performance and gives no formula.
    """
    caches, objects = _column("n_caches", columns), _column("n_objects_cached", columns)
    return np.divide(objects, caches, out=np.zeros_like(objects), where=caches > 0.0)


_FORMULAS: dict[str, tuple[Performance, Callable[[Columns], Curve]]] = {
    "task_balance": (Performance("task_balance", "1"), task_balance),
    "cache_load": (Performance("cache_load", "objects per cache"), cache_load),
}
DERIVED_PERFORMANCES = tuple(_FORMULAS)
"""Performances that are computed from several columns."""


def performance_of(name: str) -> Performance:
    """Return what the numbers of a performance are.

    Args:
        name: A column of `PERFORMANCE_COLUMNS`, one of `DERIVED_PERFORMANCES`, or one of them after "1/".

    Raises:
        ConfigError: there is no such performance; the message has the nearest one.
    """
    sign, own = _split(str(name))
    found = _FORMULAS[own][0] if own in _FORMULAS else PERFORMANCE_COLUMNS.get(own)
    if found is None:
        known = [sign + each for each in (*PERFORMANCE_COLUMNS, *_FORMULAS)]
        raise ConfigError(
            f"Expected performance to be a recorded column (swarm-forage list columns), {', '.join(_FORMULAS)}, or one "
            f"of them after {INVERTED!r}, got {name!r}.{suggestion(sign + _NAME_OF_WORDS.get(own, own), known)}"
        )
    if not sign:
        return found
    unit = "1" if found.unit == "1" else f"1/({found.unit})" if " " in found.unit else f"1/{found.unit}"
    return Performance(name, unit, words=f"{sign}{found.title}")


def performance_curve(name: str, columns: Columns) -> Curve:
    """Compute a performance from the columns of a run.

    Args:
        name: As in `performance_of`.
        columns: Column -> (T,) numbers; one that the run does not have counts as `ABSENT` says.

    Returns:
        (T,) float64, in the unit of `performance_of`.

    Raises:
        ConfigError: as `performance_of`.
    """
    performance_of(name)
    sign, own = _split(name)
    values = _FORMULAS[own][1](columns) if own in _FORMULAS else _column(own, columns)
    # 1/0 is 0, because distances between curves cannot take infinities. It suits columns that are rarely 0.
    return np.divide(1.0, values, out=np.zeros_like(values), where=values != 0.0) if sign else values


def _split(name: str) -> tuple[str, str]:
    """Return "1/" or "", and the name behind it."""
    return (INVERTED, name.removeprefix(INVERTED)) if name.startswith(INVERTED) else ("", name)


def _column(name: str, columns: Columns) -> Curve:
    if name in columns:
        return columns[name].astype(np.float64)
    instead = ABSENT.get(name, 0.0)
    if isinstance(instead, str):
        return _column(instead, columns)
    return np.full(len(columns["interval"]), instead)
