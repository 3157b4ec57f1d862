"""The table of a study in numbers: one measure of all policies over the last axis.

A panel has the scores of every run. It is drawn as it is, and the claims of the paper are held against it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeAlias, cast, get_args

import numpy as np
import polars as pl

from ..checks import CurveError
from ..claims import Panel, PanelName
from ..claims.claim import DISTANCES
from ..claims.panel import TIE
from ..curves import FloatArray, Form, Variant
from ..statistics import CONFIDENCE
from .frame import SCHEMA, label_of, scores
from .measures import DISTURBANCES, MEASURES, check_words
from .run_curves import THROTTLE, StudyCurves, StudyLine, study_lines

if TYPE_CHECKING:
    from swarm_forage_env.studies.results import StudyTable
    from swarm_forage_env.studies.study_file import Value

FIGURE_MEASURES = (
    "raw_performance",
    "spatial_emergence",
    "task_emergence",
    "scalability",
    "reactivity",
    "adaptability",
    "noise_robustness",
    "population_robustness",
    "recorded_population_robustness",
)
"""Measures that the paper's figures show, and population robustness with the robots that were at work."""
FIGURE_FORMS: dict[str, tuple[Form, ...]] = {"spatial_emergence": ("interactive", "marginal")}
"""Measure -> forms that the figures show, where it is not the marginal one alone: in the warehouses a swarm is held
beside as many robots that work alone, in search and rescue, where no robot works alone, beside the next smaller swarm.
"""

_EXPERIMENTS: dict[tuple[Any, ...], str] = {
    **{(name,): name for name in ("S1a", "S1b", "S1c", "S1d", "S1e", "S1f", "S1g", "S1h")},
    ("S2a", 0.0): "S2a still",
    ("S2a", 0.001): "S2a slow",
    ("S2a", 0.051): "S2a fast",
    ("S2b", 12): "S2b 12",
    ("S2b", 115): "S2b 115",
    ("S2b", 320): "S2b 320",
    ("S2c", 115): "S2c 115",
    ("S2c", 320): "S2c 320",
    ("S2d", 115): "S2d 115",
    ("S2d", 320): "S2d 320",
}
"""Name of a set, and value on its first axis where it has two -> experiment that claims speak of."""
TIE_OF_FRACTIONS = 0.02
"""Largest difference of fractions that is a tie (our choice)."""

_ByLevel: TypeAlias = Mapping[str, Mapping[float, Mapping[int, float]]]
"""Policy -> level -> seed -> value."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyPanel:
    """One measure in one variant, of all policies under one of the rules, at one value of each other axis."""

    study: str
    """Name of the study."""
    rules: str
    """Which rules: "described" or "program"."""
    others: "Mapping[str, Value]"
    """Value on each axis but the last, by its name."""
    words: Mapping[str, str]
    """How these values are shown."""
    measure: str
    """Name in `MEASURES`."""
    variant: Variant
    form: Form
    """With what a swarm size is compared; "marginal" for measures that compare none."""
    criterion: str
    """What is varied along x."""
    x: FloatArray
    """Its values, rising, (L,): swarm sizes, amplitudes, ...; the level that others are compared with is left out."""
    levels: FloatArray
    """Where they are in the paper's figures, rising, (L,): of throttles the distance of conditions from the ideal."""
    unit: str
    seeds: tuple[int, ...]
    """Seed of each run, (R,)."""
    scores: Mapping[str, FloatArray]
    """Policy -> one score per level and run, (L, R); NaN is a run without a score."""
    relative: Mapping[str, FloatArray] = field(default_factory=dict[str, FloatArray])
    """The same as shares of the performance that they are compared with; empty for measures without such shares."""
    compared_with: FloatArray | None = None
    """That performance, mean of runs and policies, (L,)."""
    of_mean_curves: Mapping[str, FloatArray] = field(default_factory=dict[str, FloatArray])
    """For distances, policy -> pseudo-values of the distance of mean curves per level and run, (L, R)."""
    relative_of_mean_curves: Mapping[str, FloatArray] = field(default_factory=dict[str, FloatArray])
    """The same as shares of the performance that they are compared with."""
    floors: Mapping[str, FloatArray] = field(default_factory=dict[str, FloatArray])
    """For distances, policy -> distances between undisturbed runs, (R,)."""
    departures: FloatArray | None = None
    """Of a changing population, robots that die or fail per 1,000 s at each level, (L,)."""
    n_runs_of: Mapping[str, int] = field(default_factory=dict[str, int])
    """As in `Panel`."""
    confidence: float = CONFIDENCE
    """As in `Panel`."""

    @property
    def drawn_at(self) -> FloatArray:
        """Where the levels are in our figures, (L,): rates of a population in events, not in the paper's words."""
        return self.levels if self.departures is None else self.departures

    @property
    def experiment(self) -> str | None:
        """Name of the experiment in `metrics.claims.EXPERIMENTS`; None if the paper's claims are not about it."""
        return experiment_of(self.study, tuple(self.others.values()))

    @property
    def name(self) -> PanelName:
        """Its name in claims; without an experiment if they are not about it."""
        return PanelName(self.experiment or "", self.measure, self.form)

    @property
    def higher_is_better(self) -> bool:
        """Direction of the measure."""
        return MEASURES[self.measure].higher_is_better

    def scores_of(self, name: PanelName) -> Mapping[str, FloatArray]:
        """Return the scores that a panel of claims shows, (L, R) each; empty where it has none."""
        if name.of_mean_curves:
            return self.relative_of_mean_curves if name.is_relative else self.of_mean_curves
        return self.relative if name.is_relative else self.scores

    def for_claims(self, name: PanelName | None = None) -> Panel:
        """Return the scores as claims want them, or those of this name: shares of performance, of mean curves.

        Margins of ties are in the measure's own unit (our choice): a tenth of the performance that an amount is
        compared with, a tenth of 1 for scalability, 0.02 for fractions. Else, and at levels where nothing was
        delivered, they are shares of the scores.
        """
        measure, n_levels = MEASURES[self.measure], len(self.levels)
        total = self.compared_with
        panel = Panel(levels=self.levels, scores=self.scores, n_runs_of=self.n_runs_of, confidence=self.confidence)
        if self.measure == "scalability":
            return replace(panel, margins=np.full(n_levels, TIE), unit=1.0)
        if np.isfinite((measure.lowest, measure.highest)).all():
            return replace(panel, margins=np.full(n_levels, TIE_OF_FRACTIONS), unit=1.0)
        shown = self.name if name is None else name
        floors = None if shown.of_mean_curves else self.floors or None  # undisturbed runs have no second mean curve
        margins = None if total is None else np.where(total > 0.0, TIE * total, panel.tie_margins)
        if shown.is_relative:
            margins = np.full(n_levels, TIE)
            if floors is not None and total is not None:
                with np.errstate(divide="ignore", invalid="ignore"):  # where nothing was delivered there are no shares
                    floors = {policy: floor / total[0] for policy, floor in floors.items()}
        return replace(panel, scores=self.scores_of(shown), margins=margins, undisturbed=floors)


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyPanels:
    """All panels of a study."""

    panels: tuple[StudyPanel, ...]
    missing: Mapping[tuple[str, str], str]
    """Measure (in a form of it) and variant -> why no policy has scores, of those for what the study varies."""


def experiment_of(study: str, others: "Sequence[Value]") -> str | None:
    """Return the experiment in `metrics.claims.EXPERIMENTS` that a study has at these values on its first axes."""
    return _EXPERIMENTS.get((study, *others))


def study_panels(
    table: "StudyTable", variants: Sequence[Variant] = ("corrected",), measures: Sequence[str] = FIGURE_MEASURES
) -> StudyPanels:
    """Score a study and return its panels, by rules, other axes, variant, measure and form.

    A study whose last axis is no criterion of these measures has panels of its performance, where the axis has numbers.

    Args:
        table: From `swarm_forage_env.read_study`.
        variants: Variants of the measures; a measure has a panel in each that it has.
        measures: Names in `MEASURES`; those of another criterion than the study's are left out.

    Raises:
        CurveError: an unknown measure or variant.
    """
    check_words("variant", variants, get_args(Variant))
    lines: dict[tuple[Any, ...], list[StudyLine]] = {}
    for line in study_lines(table):
        lines.setdefault((line.rules, *line.others.values()), []).append(line)
    panels: list[StudyPanel] = []
    missing: dict[tuple[str, str], str] = {}
    is_scored = bool(table.spec.axes) and table.spec.axes[-1].is_criterion
    for together in lines.values() if is_scored else ():
        about: dict[str, Any] = {}
        if table.spec.run.looks:  # each look is wrong in its share of 5 % (Bonferroni)
            about["n_runs_of"] = {line.policy: len(line.curves.experiments[0].seeds) for line in together}
            about["confidence"] = 1.0 - (1.0 - CONFIDENCE) / len(table.spec.run.looks)
        for variant in variants:
            for measure, form in _measures_in(measures, variant, together[0].curves):
                scored = {line.policy: _scores(line.curves, measure, variant, form) for line in together}
                found = {policy: frame for policy, (frame, _) in scored.items()}
                if any(len(each) for each in found.values()):
                    panels.append(replace(_score_panel(table, together[0], variant, form, found), **about))
                else:
                    reasons = dict.fromkeys(why for _, why in scored.values() if why)
                    missing[label_of(measure, "corrected", form), variant] = "; ".join(reasons)
    if not panels and "raw_performance" in measures:
        panels = _performance_panels(table, list(lines.values()))
    return StudyPanels(panels=tuple(panels), missing=missing)


def _measures_in(measures: Sequence[str], variant: Variant, curves: StudyCurves) -> list[tuple[str, Form]]:
    """Return the measures that have a variant, and whose criterion is varied, in each form that figures show.

    The interactive form is left out where no robot works alone: it cannot be computed, and no figure shows it.
    """
    varied = {experiment.criterion for experiment in curves.experiments}
    if varied & set(DISTURBANCES):
        varied.add(THROTTLE)
    sizes = curves.sizes()
    has_lone_robot = bool(sizes) and sizes[0].n_robots == 1
    return [
        (measure, form)
        for measure in measures
        for form in FIGURE_FORMS.get(measure, ("marginal",))
        if form == "marginal" or has_lone_robot
        if MEASURES[measure].varies in varied and variant in MEASURES[measure].variants
    ]


def _scores(curves: StudyCurves, measure: str, variant: Variant, form: Form) -> tuple[pl.DataFrame, str]:
    """Return the scores of one line, and why there are none."""
    try:
        found, missing = scores([curves], [measure], variants=[variant], forms=[form])
    except CurveError as error:
        return pl.DataFrame(schema=SCHEMA), str(error)
    return found, "; ".join(missing.values())


def _panel(
    table: "StudyTable",
    line: StudyLine,
    values: _ByLevel,
    distances: Mapping[float, float],
    **told: Any,
) -> StudyPanel:
    """Put the values of several policies beside each other.

    Args:
        table: The study.
        line: Of one of the policies.
        values: Policy -> level -> seed -> value.
        distances: Level -> distance of its conditions from the ideal ones, where it is known.
        told: Fields of `StudyPanel` that no value tells.
    """
    x = _levels_of(values)
    seeds = tuple(sorted(table.spec.seeds))
    far = np.array([distances.get(level, np.nan) for level in x])
    leaving = {runs.value: 1000.0 * runs.rates.lam for runs in line.curves.experiments if runs.rates is not None}
    return StudyPanel(
        study=table.spec.name,
        rules=line.rules,
        others=line.others,
        words=line.words,
        x=np.array(x),
        levels=far if np.isfinite(far).all() and (np.diff(far) > 0.0).all() else np.array(x),
        seeds=seeds,
        scores=_arrays(values, seeds),
        departures=np.array([leaving[level] for level in x]) if x and leaving.keys() >= {*x} else None,
        **told,
    )


def _levels_of(values: _ByLevel) -> list[float]:
    return sorted({level for of_policy in values.values() for level in of_policy})


def _arrays(values: _ByLevel, seeds: Sequence[int]) -> dict[str, FloatArray]:
    """Return policy -> (L, R), NaN where there is no value."""
    x = _levels_of(values)
    return {
        policy: np.array([[of_policy.get(level, {}).get(seed, np.nan) for seed in seeds] for level in x])
        for policy, of_policy in values.items()
    }


def _score_panel(
    table: "StudyTable", line: StudyLine, variant: Variant, form: Form, found: Mapping[str, pl.DataFrame]
) -> StudyPanel:
    frame, seeds = pl.concat(found.values()), sorted(table.spec.seeds)
    first = frame.row(0, named=True)
    about: dict[str, Any] = {name: first[name] for name in ("measure", "criterion", "unit")}
    if first["measure"] == "raw_performance":  # an amount that is compared with itself
        about["compared_with"] = frame.group_by("x").agg(pl.col("value").mean()).sort("x")["value"].to_numpy()
    elif frame["total"].count():
        means = frame.group_by("policy", "x").agg(pl.col("total").mean())
        about["compared_with"] = means.group_by("x").agg(pl.col("total").mean()).sort("x")["total"].to_numpy()
    of = {column: _by_level(found, column) for column in ("value", "relative", "mean_curve", "relative_mean_curve")}
    if frame["relative"].count():
        about["relative"] = _arrays(of["relative"], seeds)
    if first["measure"] in DISTANCES:
        about["of_mean_curves"] = _arrays(of["mean_curve"], seeds)
        about["relative_of_mean_curves"] = _arrays(of["relative_mean_curve"], seeds)
    floors = {policy: _floors(each) for policy, each in found.items() if len(each)}
    if all(floors.values()):
        about["floors"] = {policy: np.array([of.get(seed, np.nan) for seed in seeds]) for policy, of in floors.items()}
    distances = dict(frame.select("x", "distance").drop_nulls().iter_rows())
    return _panel(table, line, of["value"], distances, variant=variant, form=form, **about)


def _floors(frame: pl.DataFrame) -> dict[int, float]:
    """Return seed -> distance of undisturbed runs, of the first level; those of others are the same runs."""
    first = frame.filter(pl.col("x") == frame["x"][0])
    return dict(first.select("seed", "floor_of_seed").drop_nulls().iter_rows())


def _by_level(found: Mapping[str, pl.DataFrame], column: str) -> _ByLevel:
    """Return the values of a column, policy -> level -> seed; levels whose runs all failed have none."""
    values: dict[str, dict[float, dict[int, float]]] = {policy: {} for policy in found}
    for policy, frame in found.items():
        for x, seed, value in frame.select("x", "seed", column).iter_rows():
            of_level = values[policy].setdefault(x, {})
            if value is not None:
                of_level[seed] = value
    return values


def _performance_panels(table: "StudyTable", groups: Sequence[Sequence[StudyLine]]) -> list[StudyPanel]:
    """Return the performance of each run over the last axis, whatever that is, where it has numbers."""
    levels = table.spec.axes[-1].values if table.spec.axes else ()
    if not levels or any(isinstance(level, str | bool) for level in levels):
        return []
    panels: list[StudyPanel] = []
    for lines in groups:
        first = lines[0].curves
        values = {
            line.policy: {
                float(cast(Any, level)): dict(zip(runs.seeds, runs.performance.sum(axis=-1).tolist(), strict=True))
                if runs.seeds
                else {}
                for level, runs in zip(levels, line.curves.experiments, strict=True)
            }
            for line in lines
        }
        over = f"in {table.spec.length.horizon_s:,.0f} s" if first.read_as.is_total else "summed over intervals"
        about = {"measure": "raw_performance", "variant": "corrected", "form": "marginal"}
        about |= {"criterion": table.spec.axes[-1].name, "unit": f"{first.read_as.amount} {over}"}
        panels.append(_panel(table, lines[0], values, {}, **about))
    return panels
