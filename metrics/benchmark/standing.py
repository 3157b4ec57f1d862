"""What an entry is worth: its runs, compared with the best scripted controller, as one number.

In each world, the performance of a run is divided by the mean of the best of the paper's four controllers. So 1 is as
good as this controller, and worlds with few and with many deliveries count alike. The score of a policy is the
interquartile mean of its held-out runs, so a single world in which it is lucky or breaks down does not decide it.

Trainings of one plan differ far more than runs of one network. So the score of a trained entry is the mean of the
scores of its trainings: a training that failed counts as one of them. Its interval covers trainings, that of a scripted
entry runs.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from ..controllers import PAPER_POLICIES
from ..curves import FloatArray
from ..statistics import N_RESAMPLES, Estimate, aggregate, interquartile_mean, probability_of_improvement
from . import protocol as places
from .entry import Entry, read_entry
from .protocol import Protocol, ProtocolWorld

_SEED = 1
"""Seed of the bootstrap; fixed, so that the same entries give the same page."""
Reference: TypeAlias = Mapping[str, FloatArray]
"""World -> performance of the runs of the best scripted controller there, per 1,000 s, (runs,)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Standing:
    """What an entry is worth."""

    entry: Entry
    score: Estimate
    """Interquartile mean over the runs of all held-out worlds, mean over trainings if there are any; 1 = as good as the
    best scripted controller."""
    improvement: Estimate
    """Probability that one of its runs beats a run of the best scripted controller in the same world, in [0, 1]."""
    n_won: int
    """Number of held-out worlds in which its mean is higher than the means of the paper's four controllers."""
    n_worlds: int
    calm: float
    """Interquartile mean over undisturbed held-out worlds, mean over trainings if there are any."""
    disturbed: float
    training: float
    """The same over the training worlds."""
    interference: float
    """Share of robot time lost in held-out worlds, mean over runs."""
    by_policy: tuple[float, ...]
    """Score of each policy, where there are several: the spread over trainings."""
    won_by_policy: tuple[int, ...]
    """Number of held-out worlds that each policy wins, where there are several."""


def scripted_entries(protocol: Protocol) -> tuple[Entry, ...]:
    """Return the entries of the scripted controllers, which come with the package; of the full protocol."""
    return tuple(read_entry(places.FOLDER / "scripted" / f"{name}.json", protocol) for name in PAPER_POLICIES)


def reference_of(scripted: Sequence[Entry], protocol: Protocol) -> Reference:
    """Return the runs of the best scripted controller in each held-out world and each training world."""
    return {
        world.name: max((entry.performance(world.name) for entry in scripted), key=np.mean).ravel()
        for world in protocol.worlds
        if world.is_scored
    }


def standing_of(entry: Entry, reference: Reference, protocol: Protocol) -> Standing:
    """Return what an entry is worth; the rates of a quick entry are compared with rates of longer runs."""
    judged = [world for world in protocol.worlds if world.is_scored]
    shares = {world.name: shares_of(entry, world, reference) for world in judged}
    policies = [[k] for k in range(len(entry.policies))]
    parts = policies if entry.is_trained else [[k for (k,) in policies]]  # what each has a score of its own
    resampled = 1 if entry.is_trained else N_RESAMPLES  # the interval of trainings needs none

    def scores(chosen: Callable[[ProtocolWorld], bool], of: Sequence[list[int]] = parts) -> list[Estimate]:
        """Return the score of each part in some of the worlds."""
        picked = [shares[world.name] for world in judged if chosen(world)]
        return [
            interquartile_mean([runs[part].ravel() for runs in picked], seed=_SEED, n_resamples=resampled)
            for part in of
        ]

    def middle(chosen: Callable[[ProtocolWorld], bool]) -> float:
        return float(np.mean([one.value for one in scores(chosen)]))

    held_out = scores(lambda world: world.counts)
    counting = protocol.scored
    performances = [entry.performance(world.name) for world in counting]
    theirs = [reference[world.name] for world in counting]
    chances = [
        probability_of_improvement(
            [runs[part].ravel() for runs in performances], theirs, seed=_SEED, n_resamples=resampled
        )
        for part in parts
    ]
    is_several = len(policies) > 1
    by_policy = scores(lambda world: world.counts, policies) if is_several else ()
    won = [_n_won([runs[k] for runs in performances], theirs) for (k,) in policies] if is_several else ()
    return Standing(
        entry=entry,
        score=over_trainings(held_out) if entry.is_trained else held_out[0],
        improvement=_within_0_and_1(over_trainings(chances)) if entry.is_trained else chances[0],
        n_won=_n_won(performances, theirs),
        n_worlds=len(counting),
        calm=middle(lambda world: world.counts and not world.is_disturbed),
        disturbed=middle(lambda world: world.counts and world.is_disturbed),
        training=middle(lambda world: not world.group),
        interference=float(np.mean([entry.interference(world.name).mean() for world in counting])),
        by_policy=tuple(each.value for each in by_policy),
        won_by_policy=tuple(won),
    )


def _n_won(ours: Sequence[FloatArray], theirs: Sequence[FloatArray]) -> int:
    """Count the worlds in which our mean performance is higher; as shares, equal ones may differ by rounding."""
    return sum(bool(our.mean() > their.mean()) for our, their in zip(ours, theirs, strict=True))


def over_trainings(by_training: Sequence[Estimate]) -> Estimate:
    """Return the mean of trainings with Student's interval over them; without an interval for one training.

    Our choice: resampling trainings, then runs, gives intervals that are too short. By simulation, 71 to 76 % of such
    95 % intervals hold the truth with three trainings, 85 to 88 % with five, but 94 to 96 % of Student's. This is for
    trainings that scatter about normally. If one of five fails, a third of all entries of five trainings show no
    failure, and their intervals are too short and too high.

    Args:
        by_training: A number of each training, from its runs alone.
    """
    over = aggregate([estimate.value for estimate in by_training])
    n_runs = sum(estimate.n_runs for estimate in by_training)
    return Estimate(value=over.mean, lower=over.lower, upper=over.upper, n_runs=n_runs)


def _within_0_and_1(estimate: Estimate) -> Estimate:
    """Cut bounds that a share cannot have; NaN stays NaN."""
    lower, upper = np.clip([estimate.lower, estimate.upper], 0.0, 1.0)
    return replace(estimate, lower=float(lower), upper=float(upper))


def shares_of(entry: Entry, world: ProtocolWorld, reference: Reference) -> FloatArray:
    """Return the performance of an entry's runs over the best scripted mean in a world, (policies, seeds)."""
    return entry.performance(world.name) / reference[world.name].mean()
