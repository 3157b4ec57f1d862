"""What a panel of a figure shows, and numbers per run that claims speak of: heights, slopes, bends, scatter."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..checks import CurveError
from ..curves import FloatArray, Form

Levels: TypeAlias = Literal["all", "low", "high"]
"""Of what an experiment varies: all levels, or the lower or upper half of them."""
Number: TypeAlias = Callable[["Curves"], FloatArray]
"""A number per policy and run, (P, R)."""
BEST_OF = 4
"""Runs of which one looks for the best (our choice)."""
COMPLETE = 0.75
"""Share of runs that must have a score at a level of which a claim speaks (our choice)."""


class Margin(NamedTuple):
    """What is too small to matter."""

    share: float
    of: str
    """What it is a share of."""


MARGINS: dict[str, Margin] = {
    "raw_performance": Margin(0.05, "performance, mean of the policies"),
    "scalability": Margin(0.1, "linear growth, 1"),
    "spatial_emergence": Margin(0.1, "performance lost to interference, mean of the policies"),
    "task_emergence": Margin(0.05, "performance, mean of the policies"),
    "reactivity": Margin(0.05, "undisturbed performance"),
    "adaptability": Margin(0.05, "undisturbed performance"),
    "noise_robustness": Margin(0.05, "undisturbed performance"),
    "population_robustness": Margin(0.05, "undisturbed performance"),
}
"""Measure -> the largest difference that is a tie, in the unit of the measure (our choice: about one object in twenty;
if a swarm of twice the size delivers 5 % less, its scalability is lower by up to 0.1)."""
TRIED = (0.025, 0.05, 0.1, 0.2)
"""Margins that the table of margins tries."""
HAVE_SHARES = ("reactivity", "adaptability", "noise_robustness", "population_robustness")
"""Measures that rank policies by how much they do, and are read as shares, too."""
LOWER_IS_BETTER = ("reactivity", "adaptability", "noise_robustness")


class PanelName(NamedTuple):
    """What a panel shows."""

    experiment: str
    """Name in `EXPERIMENTS`."""
    measure: str
    form: Form = "marginal"
    """With what sizes are compared: the next smaller swarm, or lone robots."""

    @property
    def words(self) -> str:
        """The name for people."""
        return f"{self.experiment} {self.measure.replace('_', ' ')}" + " beside lone robots" * (self.form != "marginal")


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """Scores of several policies over the levels of an experiment.

        Panel(levels=[1, 2], scores={"crw": [[3, 3, 4, 4], [4, 5, 4, 4]], "dpo": [[5, 5, 4, 6], [7, 6, 7, 7]]})

    Raises:
        CurveError: No policy, scores that do not match the levels or each other, or levels that do not rise.
    """

    levels: FloatArray
    """Rising values of what the experiment varies, (L,)."""
    scores: Mapping[str, FloatArray]
    """Policy -> one score per level and run, (L, R); run i of all policies has the same seed. NaN: no score."""
    unit: FloatArray | None = None
    """What scores are shares of at each level, (L,); None: the mean of all scores there."""
    margin: float = 0.05
    """Largest share that is a tie."""
    shares: Mapping[str, FloatArray] | None = None
    """Policy -> the excess over the noise floor as a share of what the policy delivers, (L, R)."""

    def __post_init__(self) -> None:
        levels = np.asarray(self.levels, dtype=np.float64)
        scores = {name: np.asarray(values, dtype=np.float64) for name, values in self.scores.items()}
        shapes = {name: values.shape for name, values in scores.items()}
        if levels.ndim != 1 or levels.size == 0 or not (np.diff(levels) > 0.0).all():
            raise CurveError(f"Expected levels in rising order, (L,), got {levels.tolist()}.")
        if len(set(shapes.values())) != 1 or any(len(s) != 2 or s[0] != levels.size for s in shapes.values()):
            raise CurveError(
                f"Expected scores of shape ({levels.size} levels, runs), the same for all policies, got {shapes}; mark "
                "a missing run with NaN."
            )
        unit = mean_of([*scores.values()]) if self.unit is None else np.asarray(self.unit, np.float64)
        for name, value in {"levels": levels, "scores": scores, "unit": unit}.items():
            object.__setattr__(self, name, value)

    def curves(
        self, policies: Iterable[str], *, shares: bool, one_unit: bool = False, unit: FloatArray | None = None
    ) -> "Curves":
        """Return scores of policies as shares, in runs that have all of them.

        Levels at which fewer than `COMPLETE` of the runs have a score are left out.

        Args:
            policies: Their names.
            shares: `shares` instead of amounts, where the panel has some.
            one_unit: Whether amounts are shares of the mean unit, so that curves keep their shape.
            unit: Another unit of amounts, (L,).

        Raises:
            CurveError: A policy without scores.
        """
        names, found = list(policies), self.shares if shares and self.shares is not None else self.scores
        absent = [name for name in names if name not in found]
        if absent:
            raise CurveError(f"Expected scores of {', '.join(absent)}, got those of {', '.join(found)}.")
        values = np.stack([found[name] for name in names])
        if found is self.scores:
            unit = np.asarray(self.unit if unit is None else unit)
            with np.errstate(divide="ignore", invalid="ignore"):
                values = values / (unit.mean() if one_unit else unit[:, None])
        is_known: NDArray[np.bool_] = np.isfinite(values)
        known: NDArray[np.bool_] = np.asarray(is_known.all(axis=0))
        planned: NDArray[np.bool_] = np.asarray(is_known.any(axis=1).all(axis=0))  # by all policies
        kept = known[:, planned].sum(axis=1) >= max(1.0, COMPLETE * planned.sum())
        runs: NDArray[np.bool_] = np.asarray(known[kept].all(axis=0)) & planned
        return Curves(self.levels[kept], values[:, kept][..., runs], runs)


def mean_of(values: Sequence[FloatArray]) -> FloatArray:
    """Return the mean of policies and runs at each level that are numbers, (L,)."""
    known = np.isfinite(values)
    with np.errstate(invalid="ignore"):
        return np.where(known, values, 0.0).sum(axis=(0, 2)) / known.sum(axis=(0, 2))


@dataclass(frozen=True, eq=False)
class Curves:
    """Scores of some policies, whole ones only."""

    levels: FloatArray
    """(L,)."""
    values: FloatArray
    """(P, L, R)."""
    runs: NDArray[np.bool_]
    """Which runs of the panel they are."""

    def part(self, levels: Levels) -> "Curves":
        """Return the lower or the upper half of the levels."""
        half = (self.levels.size + 1) // 2
        kept = {"all": slice(None), "low": slice(half), "high": slice(self.levels.size - half, None)}[levels]
        return replace(self, levels=self.levels[kept], values=self.values[:, kept])


# ------------------------------------------------------------------------------------ numbers of each policy and run


def height(curves: Curves) -> FloatArray:
    """Mean over the levels."""
    return curves.values.mean(axis=1)


def rise(curves: Curves) -> FloatArray:
    """Mean of the upper half of the levels less that of the lower half."""
    return height(curves.part("high")) - height(curves.part("low"))


def slope(curves: Curves) -> FloatArray:
    """Slope of the line through all levels, over their whole span."""
    return _slope(curves, curves.levels >= curves.levels[0])


def bend(curves: Curves) -> FloatArray:
    """How much steeper the upper half of the levels is than the lower half."""
    half = (curves.levels.size + 1) // 2
    return steeper_from(curves.levels[curves.levels.size - half])(curves) if half > 1 else np.nan * height(curves)


def steeper_from(level: float) -> Number:
    """How much steeper a curve is from a level on than before it."""

    def steeper(curves: Curves) -> FloatArray:
        below, above = curves.levels <= level, curves.levels >= level
        if min(below.sum(), above.sum()) < 2:
            return np.nan * height(curves)
        return _slope(curves, above) - _slope(curves, below)

    return steeper


def _slope(curves: Curves, kept: NDArray[np.bool_]) -> FloatArray:
    x = curves.levels[kept] - curves.levels[kept].mean()
    return np.ptp(curves.levels) * np.einsum("l,plr->pr", x, curves.values[:, kept]) / (x @ x)


def variation(curves: Curves) -> FloatArray:
    """Standard deviation over the levels."""
    return curves.values.std(axis=1)


def scatter(curves: Curves) -> FloatArray:
    """Distance of each run from the median run, mean over the levels (Brown and Forsythe 1974)."""
    return np.abs(curves.values - np.median(curves.values, axis=-1, keepdims=True)).mean(axis=1)


def best(curves: Curves) -> FloatArray:
    """The best of each `BEST_OF` runs, mean over the levels; a number per group of runs."""
    n_groups = curves.values.shape[-1] // BEST_OF
    groups = curves.values[..., : n_groups * BEST_OF].reshape(*curves.values.shape[:2], n_groups, BEST_OF)
    return groups.max(axis=-1).mean(axis=1)
