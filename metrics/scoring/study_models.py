"""Models beside the runs of a study: laws and a mean field over swarm sizes, queues over time.

Laws know all sizes of a line; the mean field knows one small swarm, the queue only the rates.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swarm_forage_env._internal.wording import number
from swarm_forage_env.rendering.figures import (
    COLOURS,
    SCREEN,
    FigureStyle,
    Panel,
    policy_words,
    saved_panels,
    shade,
    size_axis,
)
from swarm_forage_env.wrappers.world import SIZE

from ..checks import CurveError
from ..curves import FloatArray
from ..foraging_model import ForagingRates, estimate_rates, mean_field
from ..ladder import Ladder, fit_ladder
from ..queues import compare_population
from ..statistics import aggregate
from .plots import FEWEST_RUNS
from .run_curves import RunCurves, StudyLine, study_lines

if TYPE_CHECKING:
    import polars as pl

    from swarm_forage_env.studies.study_table import StudyTable

DRAWN_LAWS = ("linear", "contention", "universal", "hamann")
"""Laws that are drawn; the table has those of `metrics.fit_ladder`."""
MEAN_FIELD = "mean field"
LEAST_DELIVERED = 50.0
"""Objects that the runs of the small swarm delivered together: enough for rates within 15 % (our choice)."""
FORAGING_COLUMNS = ("free_pickups", "collected", "n_carrying", "interference_fraction")
"""Recorded columns from which the rates of the mean-field model are estimated."""
MIN_SIZES, MIN_RUNS = 4, 2
"""What a ladder of laws takes at least."""
_SEED = 1
"""Fixed, so that the same runs give the same intervals."""
_DASH = 3.0
"""Length of dashes and gaps, in widths of the line."""
RUNS_COLOUR = "black"
"""What was seen; the colours are for models."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """One line of a panel."""

    name: str
    x: FloatArray
    """Rising, (K,)."""
    y: FloatArray
    lower: FloatArray | None = None
    """Bounds of the 95 % interval of the mean, of what was seen."""
    upper: FloatArray | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelPanel:
    """What was seen, and what models say of it."""

    place: "Mapping[str, Any]"
    """Policy, and the value on each axis but the last."""
    words: str
    """The same for people."""
    seen: tuple[Curve, ...]
    expected: tuple[Curve, ...]
    facts: tuple[Mapping[str, Any], ...]
    """Rows of the table beside the picture: parameters with intervals, or how far off a model is."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelFigure:
    """Panels of one kind of model under one of the rules."""

    study: str
    kind: str
    """laws, or population."""
    rules: str
    title: str
    x_label: str
    y_label: str
    is_log: bool
    panels: tuple[ModelPanel, ...]

    @property
    def name(self) -> str:
        """Name of its files."""
        return f"{self.study}_{self.kind}_{self.rules}"

    @property
    def caption(self) -> str:
        """What is shaded and dashed."""
        edges = [curve.lower for panel in self.panels for curve in panel.seen if curve.lower is not None]
        is_shaded = any(np.isfinite(edge).any() for edge in edges)
        few = f"no interval: fewer than {FEWEST_RUNS} runs tell too little"
        return f"{'shaded: 95 % interval of the mean' if is_shaded else few}; dashed: models"

    def to_frame(self) -> "pl.DataFrame":
        """Return the numbers behind the picture, one row per point of a curve."""
        import polars as pl

        rows: list[dict[str, Any]] = []
        for panel in self.panels:
            for what, curves in (("runs", panel.seen), ("model", panel.expected)):
                for curve in curves:
                    nothing = np.full(curve.x.shape, np.nan)
                    low, high = (nothing if edge is None else edge for edge in (curve.lower, curve.upper))
                    for x, y, lower, upper in zip(curve.x, curve.y, low, high, strict=True):
                        where = {"rules": self.rules, **panel.place, "what": what, "curve": curve.name}
                        rows.append(
                            {**where, "x": float(x), "y": float(y), "lower": float(lower), "upper": float(upper)}
                        )
        return pl.DataFrame(rows, infer_schema_length=None).fill_nan(None)

    def facts(self) -> "pl.DataFrame":
        """Return the table beside the picture."""
        import polars as pl

        rows = [{"rules": self.rules, **panel.place, **row} for panel in self.panels for row in panel.facts]
        return pl.DataFrame(rows, infer_schema_length=None).fill_nan(None)

    def draw(self, paths: Sequence[Path], style: FigureStyle = SCREEN) -> None:
        """Draw what was seen, solid with its 95 % interval where there are `FEWEST_RUNS`, and what models say, dashed.

        Args:
            paths: Files to write; as in `saved_figure`, whose errors this has.
            style: Of the figure.
        """
        title = f"{self.title}\n{self.caption}"
        with saved_panels(paths, len(self.panels), (3.6, 3.0), title=title, style=style) as places:
            for place, panel in zip(places, self.panels, strict=True):
                _draw_panel(place, panel, self)


def _draw_panel(place: Panel, panel: ModelPanel, figure: ModelFigure) -> None:
    for index, (curve, colour) in enumerate(zip(panel.expected, COLOURS, strict=False)):
        # Laws that agree show in turn: each has its dashes where the next one has gaps.
        dashes = (_DASH * index, (_DASH, _DASH))
        place.plot(curve.x, curve.y, color=colour, linestyle=dashes, label=curve.name, zorder=3)
    for curve in panel.seen:
        marker = "o" if figure.is_log else ""
        place.plot(curve.x, curve.y, color=RUNS_COLOUR, linewidth=1.1, label=curve.name, zorder=4, marker=marker)
        if curve.lower is not None and curve.upper is not None:
            shade(place, curve.x, curve.lower, curve.upper, RUNS_COLOUR)
    place.set_title(policy_words(panel.words))
    if figure.is_log:
        size_axis(place, panel.seen[0].x)
    # Neither a law far off nor the interval of two runs may flatten what was seen.
    place.set_ylim(0.0, 1.3 * float(max(curve.y.max() for curve in (*panel.seen, *panel.expected[:1]))))
    place.set_xlabel(figure.x_label)
    place.set_ylabel(figure.y_label)


def model_figures(table: "StudyTable") -> tuple[ModelFigure, ...]:
    """Return the figures of models of a study: laws where sizes vary, queues where the population does.

    Args:
        table: From `swarm_forage_env.read_study`.

    Returns:
        One figure per rules and kind; none for a study that varies neither, or without enough runs.
    """
    found: dict[tuple[str, str], list[ModelPanel]] = {}
    lines = study_lines(table)
    for line in lines:
        panel = _law_panel(table, line)
        if panel is not None:
            found.setdefault(("laws", line.rules), []).append(panel)
    for rules in table.spec.rules:
        panels = _population_panels([line for line in lines if line.rules == rules])
        if panels:
            found["population", rules] = panels
    amount = f"P(N) / N, {lines[0].curves.read_as.amount} per robot in {table.spec.horizon_s:,.0f} s"
    words = {
        "laws": ("performance per robot beside laws", "robots N", amount, True),
        "population": ("robots at work beside the queue model", "time, s", "robots at work", False),
    }
    return tuple(
        ModelFigure(
            study=table.spec.name,
            kind=kind,
            rules=rules,
            title=f"{table.spec.name}: {words[kind][0]}, rules {rules}",
            x_label=words[kind][1],
            y_label=words[kind][2],
            is_log=words[kind][3],
            panels=tuple(panels),
        )
        for (kind, rules), panels in found.items()
    )


def _place(line: StudyLine) -> dict[str, Any]:
    return {**line.others, "policy": line.policy}


def _words(line: StudyLine) -> str:
    return ", ".join([*_axis_words(line), line.policy])


def _axis_words(line: StudyLine) -> list[str]:
    return [f"{name.replace('_', ' ')} {word}" for name, word in line.words.items()]


def _law_panel(table: "StudyTable", line: StudyLine) -> ModelPanel | None:
    """Deliveries per robot over the size, with laws fitted to all sizes, and the mean field of one small swarm."""
    if not table.spec.axes or table.spec.axes[-1].name != SIZE or not line.curves.read_as.is_total:
        return None
    ladder_runs = [runs for runs in line.curves.sizes() if len(runs.seeds) >= MIN_RUNS]
    if len(ladder_runs) < MIN_SIZES:
        return None
    sizes = [runs.n_robots for runs in ladder_runs]
    totals = [runs.performance.sum(axis=-1) for runs in ladder_runs]
    if not any(total.any() for total in totals):
        return None
    ladder = fit_ladder(sizes, totals, seed=_SEED)
    n = np.array(sizes, dtype=np.float64)
    at: FloatArray = np.exp2(np.linspace(math.log2(sizes[0]), math.log2(sizes[-1]), 8 * (len(sizes) - 1) + 1))
    means = [aggregate(total) for total in totals]
    lower, upper = (
        np.array([getattr(mean, name) if mean.n_used >= FEWEST_RUNS else math.nan for mean in means]) / n
        for name in ("lower", "upper")
    )
    seen = Curve(name="runs", x=n, y=np.array([mean.mean for mean in means]) / n, lower=lower, upper=upper)
    laws = [Curve(name=name, x=at, y=ladder.laws[name].law.performance(at) / at) for name in DRAWN_LAWS]
    continued, knows = _mean_field(foraging_runs(table, line), sizes)
    return ModelPanel(
        place=_place(line),
        words=_words(line),
        seen=(seen,),
        expected=(*laws, *continued),
        facts=(*_law_rows(ladder), *knows),
    )


def _law_rows(ladder: Ladder) -> Iterator[dict[str, Any]]:
    """Yield parameters, critical size and class of scaling, each with its interval."""
    for name, fit in ladder.laws.items():
        for parameter, found in (*fit.parameters.items(), ("peak", fit.peak)):
            if parameter != "peak" or math.isfinite(found.lower):
                yield {
                    "model": name,
                    "parameter": parameter,
                    "value": found.value,
                    "lower": found.lower,
                    "upper": found.upper,
                    "error": fit.error,
                }
    b = ladder.exponent
    yield {
        "model": f"power, sizes up to {ladder.best_size}: {ladder.scaling}",
        "parameter": "exponent",
        "value": b.value,
        "lower": b.lower,
        "upper": b.upper,
        "error": math.nan,
    }


@dataclass(frozen=True, kw_only=True, eq=False)
class ForagingRuns:
    """Runs of several swarm sizes in one world that the mean-field model holds for."""

    columns: Mapping[int, Mapping[str, FloatArray]]
    """Swarm size -> what is recorded of its runs, each (R, T), of `FORAGING_COLUMNS`."""
    interval_s: float
    horizon_s: float
    n_objects: int

    @property
    def small(self) -> int | None:
        """The smallest swarm of several robots whose runs delivered enough for its rates; None if none did."""
        enough = (
            size for size, runs in self.columns.items() if size > 1 and runs["collected"].sum() >= LEAST_DELIVERED
        )
        return min(enough, default=None)

    def rates(self, size: int, rng: np.random.Generator | None = None) -> ForagingRates:
        """Return the rates of swarms of one size; robots alone show how many encounters are with walls.

        Args:
            size: One that was run.
            rng: Draws the runs anew; default each run once.

        Raises:
            CurveError: robots that never search, or always avoid, have none.
        """
        mine, alone = (self._drawn(n, rng) for n in (size, 1))
        return estimate_rates(
            size,
            pickups=mine["free_pickups"],
            deliveries=mine["collected"],
            n_carrying=mine["n_carrying"],
            interference=mine["interference_fraction"],
            interval_s=self.interval_s,
            n_objects=self.n_objects,
            lone_interference=alone["interference_fraction"],
        )

    def _drawn(self, size: int, rng: np.random.Generator | None) -> Mapping[str, FloatArray]:
        runs = self.columns[size]
        if rng is None:
            return runs
        n_runs = len(runs["collected"])
        drawn = rng.integers(n_runs, size=n_runs)
        return {name: values[drawn] for name, values in runs.items()}

    def predicted(self, rates: ForagingRates, sizes: Sequence[int]) -> FloatArray:
        """Return objects delivered and the mean share of time lost of such robots, (S, 2)."""
        solved = [mean_field(rates, size, self.horizon_s) for size in sizes]
        return np.array([(each.delivered[-1], each.interference.mean()) for each in solved])


def foraging_runs(table: "StudyTable", line: StudyLine) -> ForagingRuns | None:
    """Return the runs of a line over swarm sizes for the mean-field model; None where the model does not hold.

    That is with caches, in arenas that grow, for another performance than deliveries, for mixed swarms, and without
    runs of one robot.
    """
    worlds = [table.spec.specs_of(place)[0].scenario for place in line.places]
    arenas = {(world.arena.width_m, world.arena.height_m) for world in worlds}
    if any(world.performance != "collected" for world in worlds) or line.policy.startswith("mixed:"):
        return None
    if len(arenas) > 1 or any(world.caches != "none" for world in worlds):
        return None
    columns: dict[int, Mapping[str, FloatArray]] = {}
    for place, runs in zip(line.places, line.curves.experiments, strict=True):
        found = table.curves(place, *FORAGING_COLUMNS)[1]
        if found.keys() >= {*FORAGING_COLUMNS} and len(found["collected"]):
            columns[runs.n_robots] = found
    if 1 not in columns:
        return None
    return ForagingRuns(
        columns=columns,
        interval_s=table.spec.interval_s,
        horizon_s=table.spec.horizon_s,
        n_objects=worlds[0].objects.n_objects,
    )


def _mean_field(runs: ForagingRuns | None, sizes: list[int]) -> tuple[tuple[Curve, ...], tuple[dict[str, Any], ...]]:
    """What small swarms promise larger ones; nothing where the model does not hold, or the runs give no rates."""
    small = None if runs is None else runs.small
    if runs is None or small is None:
        return (), ()
    try:
        rates = runs.rates(small)
    except CurveError:  # robots that never search, or always avoid: no rates
        return (), ()
    values = {
        "finding": rates.finding,
        "homing_s": rates.homing_s,
        "encounters": rates.encounters,
        "walls": rates.walls,
    }
    facts = [{"model": MEAN_FIELD, "parameter": name, "value": value} for name, value in values.items()]
    facts.append({"model": MEAN_FIELD, "parameter": "robots that it knows", "value": float(small)})
    n = np.array(sizes, dtype=np.float64)
    return (Curve(name=MEAN_FIELD, x=n, y=runs.predicted(rates, sizes)[:, 0] / n),), tuple(facts)


def _population_panels(lines: Sequence[StudyLine]) -> list[ModelPanel]:
    """Robots at work over time at each level of the population dynamics, beside the queue of its rates.

    The rates alone decide who is at work, so a panel has the runs of all policies; those that are the same in several,
    because seeds are, count once.
    """
    together: dict[tuple[Any, ...], list[tuple[StudyLine, RunCurves]]] = {}
    for line in lines:
        for runs in line.curves.experiments:
            if runs.rates is not None and runs.seeds and "n_active" in runs.curves:
                together.setdefault((*line.others.values(), runs.value), []).append((line, runs))
    return [_population_panel(some) for some in together.values()]


def _ends(line: StudyLine) -> FloatArray:
    assert line.curves.t_end_s is not None, "studies have a clock"
    return line.curves.t_end_s


def _population_panel(together: Sequence[tuple[StudyLine, RunCurves]]) -> ModelPanel:
    line, first = together[0]
    rates, ends = first.rates, _ends(line)
    assert rates is not None, "others are left out"
    curves = {
        (seed, curve.tobytes()): curve
        for _, runs in together
        for seed, curve in zip(runs.seeds, runs.curves["n_active"], strict=True)
    }
    at_work = np.array(list(curves.values()))
    held = compare_population(at_work, rates, first.n_robots, ends)
    middle = ends - 0.5 * ends[0]
    edges = (held.lower, held.upper) if len(at_work) >= FEWEST_RUNS else (None, None)
    seen = Curve(name="runs", x=middle, y=held.observed, lower=edges[0], upper=edges[1])
    facts = {
        "observed": float(held.observed.mean()),
        "predicted": float(held.predicted.mean()),
        "rms_error": held.rms_error,
        "share_inside": held.inside,
        "n_runs": len(at_work),
    }
    return ModelPanel(
        place={**line.others, "level": first.value},
        words=", ".join([*_axis_words(line), f"{number(1000.0 * rates.lam)} departures per 1,000 s"]),
        seen=(seen,),
        expected=(Curve(name="queue", x=middle, y=held.predicted),),
        facts=(facts,),
    )
