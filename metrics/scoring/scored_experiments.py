"""How one score is made: which experiments are used, how their runs are paired, and which notes it gets."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ..curves import FloatArray, Form, Variant
from ..statistics import Summary, aggregate, bootstrap_measure
from .studies import RunCurves, common_runs
from .table import Score

_BOOTSTRAP_SEED = 1
"""Fixed, so that the same runs give the same table."""
_UNDEFINED = Summary(mean=math.nan, std=math.nan, lower=math.nan, upper=math.nan, n_used=0, n_nan=0)

Values: TypeAlias = Callable[..., ArrayLike]
"""A measure of experiments: it takes their common runs and returns one value per run."""


class Uncomputable(Exception):  # noqa: N818 - not an error: the table notes it and continues
    """The curves do not allow this measure; the message says why."""


@dataclass(frozen=True, kw_only=True)
class ScoredExperiments:
    """The experiments that a score is made of, and what is known of it before its values."""

    measure: str
    at: str
    x: float
    unit: str
    experiments: tuple[RunCurves, ...]
    """Experiments that are used, the reference first."""
    compared_with: int | None = None
    """Index in `experiments` of the swarm whose total performance divides relative values; None: no relative values."""
    beside: dict[str, float] = field(default_factory=dict[str, float])
    variant: Variant = "corrected"
    form: Form = "marginal"
    is_doubtful: bool = False
    """As in `Score`."""
    remark: str = ""
    """What to know before reading the value, whatever the runs are."""

    def score(self, values: Values, *, floor: float | None = None, order_matters: bool = False) -> Score:
        """Return the score with one value per common run.

        Args:
            values: The measure.
            floor: Noise floor, for distances.
            order_matters: Whether to add the measure of the mean curves, which differs from the mean of the measures.
        """
        paired = common_runs(*self.experiments)
        seeds = paired[0].seeds
        n_lost = max(experiment.n_lost + len(experiment.seeds) for experiment in self.experiments) - len(seeds)
        per_run = np.atleast_1d(np.asarray(values(*paired), dtype=np.float64)) if seeds else np.empty(0)
        relative = relative_floor = None
        if self.compared_with is not None and seeds:
            total = paired[self.compared_with].performance.sum(axis=-1)
            mean_total = float(total.mean())
            relative_floor = None if floor is None or mean_total == 0.0 else floor / mean_total
            relative = np.divide(per_run, total, out=np.full(len(seeds), math.nan), where=total > 0.0)
        return Score(
            measure=self.measure,
            variant=self.variant,
            form=self.form,
            at=self.at,
            criterion=self.experiments[-1].criterion,
            x=self.x,
            n_robots=tuple(dict.fromkeys(experiment.n_robots for experiment in self.experiments)),
            unit=self.unit,
            summary=aggregate(per_run) if seeds else _UNDEFINED,
            per_seed=dict(zip(seeds, per_run.tolist(), strict=True)),
            relative_per_seed={} if relative is None else dict(zip(seeds, relative.tolist(), strict=True)),
            n_lost=n_lost,
            noise_floor=floor,
            relative_floor=relative_floor,
            of_mean_curves=_of_mean_curves(values, paired) if order_matters and seeds else None,
            beside=self.beside,
            is_doubtful=self.is_doubtful,
            note="; ".join(filter(None, (self.remark, _note(per_run, n_lost, relative)))),
        )


def _of_mean_curves(values: Values, paired: tuple[RunCurves, ...]) -> Summary:
    """The measure of mean performance curves, with runs of each experiment resampled on their own."""

    def of_curves(*curves: FloatArray) -> ArrayLike:
        return values(*(e.averaged(curve) for e, curve in zip(paired, curves, strict=True)))

    performances = [experiment.performance for experiment in paired]
    return bootstrap_measure(of_curves, *performances, order="mean_curve", seed=_BOOTSTRAP_SEED)


def _note(per_run: FloatArray, n_lost: int, relative: FloatArray | None) -> str:
    notes: list[str] = []
    n_nan, n_infinite = int(np.isnan(per_run).sum()), int(np.isinf(per_run).sum())
    if n_lost:
        notes.append(f"{n_lost} of {len(per_run) + n_lost} runs failed or have no partner of the same seed")
    if n_nan:
        notes.append(f"undefined in {n_nan} of {len(per_run)} runs, in which neither swarm achieved anything")
    if n_infinite:
        notes.append(f"infinite in {n_infinite} of {len(per_run)} runs, in which one swarm achieved nothing")
    if relative is not None and (n_idle := int(np.isnan(relative).sum())):
        notes.append(f"says nothing in {n_idle} of {len(per_run)} runs: the performance it compares with is zero")
    return "; ".join(notes)
