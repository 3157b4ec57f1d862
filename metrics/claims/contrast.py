"""Statistics of claims: one number per run, above 0 where a claim holds, and what the runs say of its mean.

    found = Contrast([0.3, 0.5, 0.4, 0.6])
    found.mean, found.d             # 0.45, and 3.5 standard deviations of runs
    found.p_differs                 # of Student's t test that the mean is 0
    found.p_within(0.1)             # of the two one-sided tests that it is 0.1 or further from 0 (Schuirmann 1987)

Values have runs on their last axis, so that thousands of contrasts are computed at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr, stdtrit  # pyright: ignore[reportMissingTypeStubs]  (scipy ships none)

from ..curves import FloatArray
from ..statistics import CONFIDENCE, ROUNDING, SIGNIFICANT, holm

Answer: TypeAlias = Literal["supported", "contradicted", "equivalent", "open", "untestable", "no runs"]
"""`equivalent`: a claim says that something differs, and runs exclude a difference as large as the margin. `open`: the
runs allow several of these. `untestable`: no number of such runs could answer. `no runs`: runs are missing."""
Kind: TypeAlias = Literal["more", "tie", "differ"]
"""What a claim says of the mean of a number: that it is above 0, within the margin of 0, or anything but 0."""
MIN_RUNS = 4
"""Runs that decide (our choice: the deviation of three runs is too often wrong by half)."""


@dataclass(frozen=True, eq=False)
class Contrast:
    """A number per run, (..., R)."""

    values: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", np.asarray(self.values, dtype=np.float64))

    @property
    def n_runs(self) -> int:
        """R."""
        return self.values.shape[-1]

    @cached_property
    def mean(self) -> FloatArray:
        """Mean over runs, (...,); NaN without runs."""
        return self.values.mean(axis=-1) if self.n_runs else np.full(self.values.shape[:-1], np.nan)

    @cached_property
    def sd(self) -> FloatArray:
        """Standard deviation of runs, (...,)."""
        return self.values.std(axis=-1, ddof=1) if self.n_runs > 1 else np.full(self.values.shape[:-1], np.nan)

    @property
    def d(self) -> FloatArray:
        """Cohen's d: the mean in standard deviations of runs."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.mean / self.sd

    @property
    def interval(self) -> tuple[FloatArray, FloatArray]:
        """Student's 95 % interval of the mean."""
        half = stdtrit(self.n_runs - 1.0, 0.5 + 0.5 * CONFIDENCE) * self._error
        return self.mean - half, self.mean + half

    @property
    def band(self) -> tuple[FloatArray, FloatArray]:
        """The authors' band: mean less and plus two standard deviations of runs."""
        return self.mean - 2.0 * self.sd, self.mean + 2.0 * self.sd

    @property
    def p_differs(self) -> FloatArray:
        """Two-sided p value that the mean is 0."""
        return 2.0 * self._tail(-np.abs(self.mean))

    def p_within(self, margin: float) -> FloatArray:
        """P value of the two one-sided tests together that the mean is not within a margin of 0."""
        return self._tail(np.abs(self.mean) - margin)

    def p_beyond(self, margin: float) -> FloatArray:
        """One-sided p value that the mean is within a margin of 0."""
        return self._tail(margin - np.abs(self.mean))

    @property
    def _error(self) -> FloatArray:
        return self.sd / np.sqrt(self.n_runs)

    def _tail(self, distance: FloatArray) -> FloatArray:
        """Student's probability below a distance; of equal runs that of the sign test, of too few NaN."""
        if self.n_runs < MIN_RUNS:
            return np.full(self.mean.shape, np.nan)
        is_equal = self.sd <= ROUNDING * np.abs(self.mean)
        p: FloatArray = stdtr(self.n_runs - 1.0, distance / np.maximum(self._error, 1e-300))
        return np.where(is_equal, np.maximum(p, 0.5**self.n_runs), p)


def decide(kind: Kind, mean: FloatArray, p: "PValues") -> NDArray[np.str_]:
    """Return the answers to statements of one kind, (...,), by p values after correction."""
    differs, within, beyond = (np.asarray(each) <= SIGNIFICANT for each in p)
    if kind == "tie":
        return np.select([within, beyond], ["supported", "contradicted"], "open")
    holds = differs if kind == "differ" else differs & (mean > 0.0)
    return np.select([within, holds, differs], ["equivalent", "supported", "contradicted"], "open")


PValues: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]
"""P values that a mean differs from 0, is within the margin, and is beyond it; NaN is a test that nobody asked for."""


def p_values(kind: Kind, found: Contrast, margin: float) -> PValues:
    """Return the p values that a kind of statement is decided by."""
    nothing, within = np.full(found.mean.shape, np.nan), found.p_within(margin)
    return (nothing, within, found.p_beyond(margin)) if kind == "tie" else (found.p_differs, within, nothing)


def corrected(family: Sequence[PValues], pairs: FloatArray | None = None) -> tuple[list[PValues], FloatArray]:
    """Return the p values of a family after one correction, so that the whole family errs once in twenty times.

    It is Holm's with Shaffer's bound: a mean cannot be 0 and outside of a margin at once, so of the tests of a contrast
    at most one can err, and there are as many errors to guard against as contrasts and pairs.

    Args:
        family: P values of its contrasts.
        pairs: Further p values, each of a test of its own, (K,).
    """
    tests, others = np.array(family, dtype=np.float64).reshape(-1, 3), np.empty(0) if pairs is None else pairs
    adjusted = holm(np.concatenate([tests.ravel(), others]), most_true=len(tests) + others.size)
    return [(p[0], p[1], p[2]) for p in adjusted[: tests.size].reshape(-1, 3)], adjusted[tests.size :]


def all_of(answers: Sequence[Answer]) -> Answer:
    """Return the answer to statements that must all hold: the worst."""
    worst: tuple[Answer, ...] = ("contradicted", "no runs", "equivalent", "untestable", "open", "supported")
    return next(answer for answer in worst if answer in answers)


def most_of(answers: Sequence[Answer]) -> Answer:
    """Return the answer that more than half of some statements have; open without one."""
    if "no runs" in answers:
        return "no runs"
    many: list[Answer] = [answer for answer in answers if 2 * answers.count(answer) > len(answers)]
    return many[0] if many else "open"
