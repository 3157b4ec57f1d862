"""What coordination brings: worlds in which robots can coordinate, each beside the same one without, seed by seed."""

import math
from collections.abc import Sequence

import numpy as np

from swarm_forage_env._internal.wording import number
from swarm_forage_env.runs.answer import Sheet

from ..statistics import Summary, aggregate
from .entry import Entry
from .protocol import Protocol, ProtocolWorld

SAME = "the same"
"""A cell of an entry whose runs do not differ."""


def gain(entry: Entry, whole: ProtocolWorld, lacking: ProtocolWorld) -> Summary:
    """Return how much better an entry is in a world than in the one without, as a share of its performance there.

    Runs with the same seed are subtracted from each other. The interval is Student's over these differences; over their
    means of each training, if there are several. NaN where an entry achieves nothing without.
    """
    without = entry.performance(lacking.name)
    differences = entry.performance(whole.name) - without
    mean = float(without.mean())
    rows = differences.mean(axis=1) if len(entry.policies) > 1 else differences[0]
    return aggregate(rows / mean if mean > 0.0 else np.full(len(rows), math.nan))


def pairs_sheet(entries: Sequence[Entry], protocol: Protocol) -> Sheet:
    """Return one row per pair of worlds: the gain of each entry, and under which numbers, with and without."""
    rows = [
        (whole.name, lacking.name.removeprefix(f"{whole.name}, "), *(_cell(each, whole, lacking) for each in entries))
        for whole, lacking in protocol.pairs
    ]
    return Sheet(header=("world", "without", *(entry.name for entry in entries)), rows=rows)


def _cell(entry: Entry, whole: ProtocolWorld, lacking: ProtocolWorld) -> str:
    """Return a cell such as "+113 % (+80 % to +146 %): 42.2 against 19.8"."""
    if (entry.performance(whole.name) == entry.performance(lacking.name)).all():
        return SAME
    found = gain(entry, whole, lacking)
    if math.isnan(found.mean):
        return f"{number(float(entry.performance(whole.name).mean()))} against nothing"
    bounds = "" if math.isnan(found.lower) else f" ({found.lower:+.0%} to {found.upper:+.0%})"
    means = (number(float(entry.performance(world.name).mean())) for world in (whole, lacking))
    return f"{found.mean:+.0%}{bounds}: {' against '.join(means)}".replace("%", " %")
