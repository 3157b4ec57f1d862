"""The table of a study in numbers: one measure of all policies over the last axis.

A panel has the scores of every run. It is drawn as it is, and the claims of the paper are held against it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, Any, TypeAlias, cast, get_args

import numpy as np
import polars as pl
from numpy.typing import NDArray

from ..checks import CurveError
from ..claims import EXPERIMENTS, MARGINS, Panel, PanelName
from ..claims.panel import mean_of
from ..curves import FloatArray, Form, Variant
from .frame import SCHEMA, scores
from .measures import DISTURBANCES, MEASURES, PICTURED, check_words
from .run_curves import THROTTLE, RunCurves, StudyLine, study_lines

if TYPE_CHECKING:
    from swarm_forage_env.studies.results import StudyTable
    from swarm_forage_env.studies.study import StudySpec

Key: TypeAlias = tuple[str, Variant, Form]
"""Measure, variant and form."""
FIGURES: tuple[tuple[str, Form], ...] = (
    ("raw_performance", "marginal"),
    ("spatial_emergence", "interactive"),
    *((measure, "marginal") for measure in PICTURED if measure not in ("raw_performance", "t_lost_fraction")),
    ("recorded_population_robustness", "marginal"),
)
"""Measures that the paper's figures show, and population robustness with the robots that were at work.

Spatial emergence has two forms: in the warehouses a swarm is held beside as many robots that work alone, in search and
rescue, where no robot works alone, beside the next smaller swarm.
"""
INTERACTING = 8
"""Robots from which a swarm counts where a claim is about interaction (our choice)."""
_PACES = {0.0: "still", 0.001: "slow", 0.051: "fast"}
"""Value on the first axis of S2a -> its word in the name of an experiment."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyPanel:
    """One measure in one variant, of all policies under one of the rules, at one value of each other axis."""

    spec: "StudySpec"
    lines: tuple[StudyLine, ...]
    """One per policy."""
    frame: pl.DataFrame
    """Their scores, as in `frame.SCHEMA`."""
    measure: str
    """Name in `MEASURES`."""
    variant: Variant
    form: Form
    """With what a swarm size is compared; "marginal" for measures that compare none."""
    criterion: str
    """What is varied along x."""
    unit: str

    @property
    def rules(self) -> str:
        """Which rules: "described" or "program"."""
        return self.lines[0].rules

    @property
    def name(self) -> PanelName:
        """Its name in claims; without an experiment if they are not about it."""
        values = self.lines[0].others.values()
        experiment = " ".join([self.spec.name, *(str(_PACES.get(cast(Any, value), value)) for value in values)])
        return PanelName(experiment if experiment in EXPERIMENTS else "", self.measure, self.form)

    @cached_property
    def x(self) -> FloatArray:
        """What is varied, rising, (L,): swarm sizes, amplitudes, ..., without what the others are compared with."""
        return self.frame["x"].unique().sort().to_numpy()

    @cached_property
    def levels(self) -> FloatArray:
        """Where they are in the paper's figures, rising, (L,): of throttles the distance from ideal conditions."""
        distances = dict(self.frame.select("x", "distance").drop_nulls().iter_rows())
        far = np.array([distances.get(x, np.nan) for x in self.x])
        return far if np.isfinite(far).all() and (np.diff(far) > 0.0).all() else self.x

    @cached_property
    def departures(self) -> FloatArray | None:
        """Of a changing population, robots that die or fail per 1,000 s at each level, (L,)."""
        rates = {runs.value: runs.rates for runs in self.lines[0].curves.experiments}
        known = [1000.0 * of.lam for x in self.x if (of := rates.get(x)) is not None]
        return np.array(known) if len(known) == len(self.x) else None

    @cached_property
    def _cells(self) -> pl.DataFrame:
        """The frame with a row for every policy, level and seed, in this order."""
        places = product([line.policy for line in self.lines], self.x.tolist(), sorted(self.spec.seeds))
        grid = pl.DataFrame(list(places), schema=["policy", "x", "seed"], orient="row")
        return grid.join(self.frame, on=grid.columns, how="left", maintain_order="left")

    def of(self, column: str) -> dict[str, FloatArray]:
        """Return a column of the frame by policy, (L, R) each with seeds rising; NaN is a run without a number."""
        values = self._cells[column].to_numpy().reshape(len(self.lines), len(self.x), len(self.spec.seeds))
        return {line.policy: each for line, each in zip(self.lines, values, strict=True)}

    @property
    def scores(self) -> dict[str, FloatArray]:
        """Policy -> one score per level and run, (L, R)."""
        return self.of("value")

    @property
    def floors(self) -> dict[str, float]:
        """For distances, policy -> mean distance of two undisturbed runs of one map; empty where there are none."""
        known = self.frame.drop_nulls("floor").group_by("policy", maintain_order=True).agg(pl.col("floor").first())
        return dict(known.iter_rows())

    def for_claims(self) -> Panel:
        """Return the scores that claims are held against, in the unit of their measure (`claims.MARGINS`)."""
        is_large = self.x >= INTERACTING if MEASURES[self.measure].compares else np.ones_like(self.x, dtype=np.bool_)
        kept = is_large if is_large.any() else ~is_large
        found = {name: values[kept] for name, values in self.scores.items()}
        margin = MARGINS[self.measure].share if self.measure in MARGINS else 0.05
        return Panel(
            levels=self.levels[kept], scores=found, unit=self._unit[kept], shares=self._shares(kept), margin=margin
        )

    def _shares(self, kept: NDArray[np.bool_]) -> dict[str, FloatArray] | None:
        """Return amounts as shares of performance, above the noise floor; of time lost as shares of the mean one."""
        about = MEASURES[self.measure]
        if not about.is_amount:
            return None
        totals = {name: values[kept] for name, values in self.of("total").items()}
        found = {name: values[kept] for name, values in self.of("excess" if about.is_distance else "value").items()}
        with np.errstate(divide="ignore", invalid="ignore"):  # where nothing was delivered there are no shares
            shares = {name: values / totals[name] for name, values in found.items()}
        if self.measure != "spatial_emergence":
            return shares
        with np.errstate(divide="ignore", invalid="ignore"):
            one = np.mean(self._unit[kept] / mean_of([*totals.values()]))
        return {name: values / one for name, values in shares.items()}

    @property
    def _unit(self) -> FloatArray:
        """What scores are shares of at each level, mean of the policies, (L,)."""
        if self.measure == "spatial_emergence":
            lost = [{runs.value: _lost(runs) for runs in line.curves.experiments} for line in self.lines]
            return np.mean([[of[x] for x in self.x] for of in lost], axis=0)
        if not MEASURES[self.measure].is_amount and self.measure != "raw_performance":
            return np.ones_like(self.x)
        column = "value" if self.measure == "raw_performance" else "total"
        means = self.frame.group_by("policy", "x").agg(pl.col(column).mean()).group_by("x").agg(pl.col(column).mean())
        return means.sort("x")[column].to_numpy()


def _lost(runs: RunCurves) -> float:
    """Performance lost to interference, mean over runs."""
    return float((runs.performance * runs.interference).sum(axis=-1).mean()) if runs.seeds else np.nan


def study_panels(
    table: "StudyTable", variants: Sequence[Variant] = ("corrected",)
) -> tuple[tuple[StudyPanel, ...], dict[Key, str]]:
    """Score a study and return its panels, by rules, other axes, variant, measure and form.

    A study whose last axis is no criterion of these measures has panels of its performance, where the axis has numbers.

    Args:
        table: From `swarm_forage_env.read_study`.
        variants: Variants of the measures; a measure has a panel in each that it has.

    Returns:
        The panels, and why no policy has scores of a measure for what the study varies.

    Raises:
        CurveError: an unknown variant.
    """
    check_words("variant", variants, get_args(Variant))
    groups: dict[tuple[Any, ...], list[StudyLine]] = {}
    for line in study_lines(table):
        groups.setdefault((line.rules, *line.others.values()), []).append(line)
    panels: list[StudyPanel] = []
    missing: dict[Key, str] = {}
    is_scored = bool(table.spec.axes) and table.spec.axes[-1].is_criterion
    for lines, variant, (measure, form) in product(groups.values(), variants, FIGURES) if is_scored else ():
        criteria = {runs.criterion for runs in lines[0].curves.experiments}
        varied = {THROTTLE if name in DISTURBANCES else name for name in criteria}
        if MEASURES[measure].varies in varied and variant in MEASURES[measure].variants:
            frame, why = _scores(lines, measure, variant, form)
            if len(frame):
                panels.append(_panel(table, lines, frame))
            else:
                missing[measure, variant, form] = why
    levels = table.spec.axes[-1].values if table.spec.axes else ()
    if levels and not panels and not any(isinstance(level, str | bool) for level in levels):
        panels = [_panel(table, lines, _performance(table, lines)) for lines in groups.values()]
    return tuple(panels), missing


def _panel(table: "StudyTable", lines: Sequence[StudyLine], frame: pl.DataFrame) -> StudyPanel:
    about = frame.select("measure", "variant", "form", "criterion", "unit").row(0, named=True)
    return StudyPanel(spec=table.spec, lines=tuple(lines), frame=frame, **about)


def _scores(lines: Sequence[StudyLine], measure: str, variant: Variant, form: Form) -> tuple[pl.DataFrame, str]:
    """Return the scores of all policies that have some, and why others have none."""
    frames, reasons = [pl.DataFrame(schema=SCHEMA)], dict[str, None]()
    for line in lines:
        try:
            frame, missing = scores([line.curves], [measure], variants=[variant], forms=[form])
            frames.append(frame)
            reasons |= dict.fromkeys(missing.values())
        except CurveError as error:
            reasons[str(error)] = None
    return pl.concat(frames), "; ".join(reasons)


def _performance(table: "StudyTable", lines: Sequence[StudyLine]) -> pl.DataFrame:
    """Return the performance of each run over the last axis, whatever that is."""
    axis, counted = table.spec.axes[-1], lines[0].curves.read_as
    over = f"in {table.spec.length.horizon_s:,.0f} s" if counted.is_total else "summed over intervals"
    about = {"measure": "raw_performance", "variant": "corrected", "form": "marginal", "criterion": axis.name}
    rows: list[dict[str, Any]] = []
    for line in lines:
        for level, runs in zip(axis.values, line.curves.experiments, strict=True):
            place = {**about, "unit": f"{counted.amount} {over}", "policy": line.policy, "x": float(cast(Any, level))}
            totals = zip(runs.seeds, runs.performance.sum(axis=-1), strict=True) if runs.seeds else [(None, None)]
            rows += [{**place, "seed": seed, "value": total} for seed, total in totals]
    return pl.DataFrame(rows, schema=SCHEMA)
