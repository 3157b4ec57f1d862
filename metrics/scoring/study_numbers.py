"""The table of a study in numbers: one measure of all policies over the last axis.

A panel has the scores of every run. It is drawn as it is, and the claims of the paper are held against it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, Any, TypeAlias, cast, get_args

import numpy as np
import polars as pl

from ..checks import CurveError
from ..claims import EXPERIMENTS, Panel, PanelName
from ..claims.panel import TIE
from ..curves import FloatArray, Form, Variant
from ..statistics import CONFIDENCE
from .frame import SCHEMA, scores
from .measures import DISTURBANCES, MEASURES, PICTURED, check_words
from .run_curves import THROTTLE, StudyLine, study_lines

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
_PACES = {0.0: "still", 0.001: "slow", 0.051: "fast"}
"""Value on the first axis of S2a -> its word in the name of an experiment."""
TIE_OF_FRACTIONS = 0.02
"""Largest difference of fractions that is a tie (our choice)."""


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
    def floors(self) -> dict[str, FloatArray]:
        """For distances, policy -> distances between undisturbed runs, (R,); empty unless all policies have some."""
        floors = {policy: values[0] for policy, values in self.of("floor_of_seed").items()}
        return floors if all(np.isfinite(floor).any() for floor in floors.values()) else {}

    @property
    def compared_with(self) -> FloatArray | None:
        """Performance that amounts are compared with, mean of policies, (L,); performance with the mean of all runs."""
        column, by = ("value", ["x"]) if self.measure == "raw_performance" else ("total", ["policy", "x"])
        means = self.frame.group_by(by).agg(pl.col(column).mean())
        total = means.group_by("x").agg(pl.col(column).mean()).sort("x")[column]
        return total.to_numpy() if total.count() else None

    def for_claims(self, name: PanelName) -> Panel | None:
        """Return the scores that a panel of claims shows: shares of performance, of mean curves; None if it has none.

        Margins of ties are in the measure's own unit (our choice): a tenth of the performance that an amount is
        compared with, a tenth of 1 for scalability, 0.02 for fractions. Else, and at levels where nothing was
        delivered, they are shares of the scores.
        """
        columns = ("mean_curve", "relative_mean_curve") if name.of_mean_curves else ("value", "relative")
        column = columns[name.is_relative]
        if not self.frame[column].count():
            return None
        panel = Panel(levels=self.levels, scores=self.of(column))
        looks = self.spec.run.looks
        if looks:  # each look is wrong in its share of 5 % (Bonferroni)
            n_runs_of = {line.policy: len(line.curves.experiments[0].seeds) for line in self.lines}
            panel = replace(panel, n_runs_of=n_runs_of, confidence=1.0 - (1.0 - CONFIDENCE) / len(looks))
        measure, same = MEASURES[self.measure], np.ones_like(self.levels)
        if self.measure == "scalability":
            return replace(panel, margins=TIE * same, unit=1.0)
        if np.isfinite((measure.lowest, measure.highest)).all():
            return replace(panel, margins=TIE_OF_FRACTIONS * same, unit=1.0)
        floors = {} if name.of_mean_curves else self.floors  # undisturbed runs have no second mean curve
        total = self.compared_with
        if total is None:
            return replace(panel, undisturbed=floors or None)
        margins = np.where(total > 0.0, TIE * total, panel.tie_margins)
        if name.is_relative:
            margins = TIE * same
            with np.errstate(divide="ignore", invalid="ignore"):  # where nothing was delivered there are no shares
                floors = {policy: floor / total[0] for policy, floor in floors.items()}
        return replace(panel, margins=margins, undisturbed=floors or None)


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
