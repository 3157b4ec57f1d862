"""What an entry is worth: its runs, compared with the best scripted controller, as one number.

In each world, the performance of a run is divided by the mean of the best of the paper's four controllers. So 1 is as
good as this controller, and worlds with few and with many deliveries count alike. The score of a policy is the
interquartile mean of its held-out runs, so a single world in which it is lucky or breaks down does not decide it. The
score of an entry is the mean over its policies: a training that failed counts as one of them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import stdtrit  # pyright: ignore[reportMissingTypeStubs]  (scipy ships none)

from swarm_forage_env.wrappers.world import World

from ..controllers import PAPER_POLICIES
from ..curves import FloatArray
from ..statistics import CONFIDENCE, ROUNDING, Estimate, middle_mean
from . import protocol as places
from .entry import Entry, read_entry
from .protocol import Protocol

_WORST = 0.1
"""Share of the worlds that are the worst."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Standing:
    """What an entry is worth; all arrays are (policies, worlds, seeds)."""

    entry: Entry
    shares: FloatArray
    """Performance over the mean of the best scripted controller, in held-out worlds."""
    training_shares: FloatArray
    """The same in the training worlds."""
    groups: tuple[str, ...]
    """Group of each held-out world."""

    @cached_property
    def score(self) -> Estimate:
        """Mean over policies of the interquartile mean over runs; 1 = as good as the best scripted controller."""
        return score_of(self.shares, self.groups)

    @property
    def by_policy(self) -> FloatArray:
        """Score of each policy: the spread over trainings."""
        return _by_policy(self.shares)

    @property
    def by_world(self) -> FloatArray:
        """Mean share in each held-out world, over policies and seeds."""
        return self.shares.mean(axis=(0, 2))

    @property
    def worst(self) -> float:
        """Mean share in the tenth of the held-out worlds where it is lowest: in three of 33."""
        return float(np.sort(self.by_world)[: max(1, round(_WORST * len(self.by_world)))].mean())

    @property
    def won(self) -> int:
        """Number of held-out worlds in which its mean is higher than that of the best scripted controller."""
        return int((self.by_world > 1.0 + ROUNDING).sum())

    @property
    def in_training(self) -> float:
        """The score over the training worlds."""
        return float(_by_policy(self.training_shares).mean())


def score_of(shares: FloatArray, groups: Sequence[str]) -> Estimate:
    """Return the score of an entry with its interval, for other trainings and other groups of worlds.

    Trainings and groups of worlds are both samples. What trainings add to the variance of the score is that of their
    scores, over their number. What worlds add, with their runs, comes from leaving out one group after the other
    (jackknife): worlds of a group are alike. Both are summed, and Student's degrees of freedom are those of Welch and
    Satterthwaite. For one policy, the interval covers worlds and runs: it is that of this policy, and tells nothing of
    another training.

    By simulation, 93 to 96 % of such intervals hold the truth, with one, three or five trainings, and with worlds of a
    group from independent to three times as alike as groups. Leaving out single worlds would hold it in 76 to 96 %. If
    trainings differ from world to world and in nothing else, it is 99 %: this part is in both. Trainings must scatter
    about normally: if one of five fails, a third of all entries of five trainings show no failure, and their intervals
    are too short and too high.

    Args:
        shares: One per run, (policies, worlds, seeds).
        groups: Group of each world.
    """
    n_policies, names = len(shares), sorted(set(groups))
    scores = _by_policy(shares)
    without = [_by_policy(shares[:, np.array(groups) != name]).mean() for name in names]
    of_worlds = (len(names) - 1) * float(np.var(without))
    of_policies = float(np.var(scores, ddof=1)) / n_policies if n_policies > 1 else 0.0
    variance = of_worlds + of_policies
    half = 0.0
    if variance != 0.0:
        freedom = variance**2 / (of_worlds**2 / (len(names) - 1) + of_policies**2 / max(1, n_policies - 1))
        half = float(stdtrit(freedom, 0.5 + 0.5 * CONFIDENCE)) * math.sqrt(variance)
    value = float(scores.mean())
    return Estimate(value=value, lower=value - half, upper=value + half, n_runs=shares.size)


def _by_policy(shares: FloatArray) -> FloatArray:
    """The interquartile mean over runs of each policy."""
    return middle_mean(shares.reshape(len(shares), -1))


def entries_of_package(names: Sequence[str], protocol: Protocol) -> list[Entry]:
    """Return entries that come with the package: those of the scripted controllers."""
    return [read_entry(places.FOLDER / "scripted" / f"{name}.json", protocol) for name in names]


def best_of(names: Sequence[str], worlds: Sequence[World], protocol: Protocol) -> FloatArray:
    """Return the highest mean of entries of the package in some worlds, per 1,000 s, (worlds,)."""
    means = [entry.performance(worlds).mean(axis=(0, 2)) for entry in entries_of_package(names, protocol)]
    return np.max(means, axis=0)


def standings_of(entries: Sequence[Entry], protocol: Protocol) -> list[Standing]:
    """Return what entries are worth."""
    held_out, training = protocol.held_out, protocol.training
    best, there = (best_of(PAPER_POLICIES, worlds, protocol) for worlds in (held_out, training))
    return [
        Standing(
            entry=entry,
            shares=entry.performance(held_out) / best[:, None],
            training_shares=entry.performance(training) / there[:, None],
            groups=protocol.groups,
        )
        for entry in entries
    ]
