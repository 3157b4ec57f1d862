"""Pictures of score tables. They need matplotlib (the optional extra "plots")."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from swarm_forage_env.rendering.figures import (
    SCREEN,
    FigureStyle,
    Look,
    Panel,
    looks,
    saved_panels,
    shade,
)
from swarm_forage_env.wrappers.world import SIZE

from ..catalog import METRICS
from ..claims.panel import MIN_RUNS
from ..statistics import Summary
from .run_curves import NOISE, POPULATION, THROTTLE
from .scores import MEASURE_CRITERIA, PICTURED, words_of

if TYPE_CHECKING:
    from .score_tables import ScoreTable  # a table draws itself by this
    from .scores import Score  # a table draws itself by this

FEWEST_RUNS = MIN_RUNS
"""Fewer runs are drawn without an interval: they decide nothing, and that of two runs reaches nine standard deviations
to either side, which would leave nothing else to be seen."""
X_LABELS = {
    SIZE: "robots N (the larger swarm)",
    THROTTLE: "distance from ideal conditions, DTW(I_ec, V) (amplitude)",
    NOISE: "noise \N{GREEK SMALL LETTER SIGMA}, in the unit of each sensor",
    POPULATION: "level of population dynamics (rates λ, μ)",
}


def draw_scores(
    tables: "Sequence[ScoreTable]",
    path: str | Path,
    *,
    band: bool = False,
    style: FigureStyle = SCREEN,
) -> None:
    """Draw score tables side by side into a picture file: one panel per measure, one line per policy.

    Amounts and distances are drawn relative to performance, where they have such values: a swarm that does little has
    little to lose. Error bars are the intervals of the tables; below a dotted line, the noise floor, a distance says
    nothing; hollow marks are values that mislead. The measures are those of `PICTURED`, or all where only some were
    scored. Measures that are computed without runs (availability) and values that are not finite are left out.

    Args:
        tables: One per policy.
        path: File to write; as in `saved_figure`, whose errors this has.
        band: Shade the mean plus and minus two standard deviations of single runs, as the paper does.
        style: Of the figure.

    Raises:
        ValueError: no table has a score that can be drawn.
    """
    drawn = _contents(tables)
    if not drawn:
        raise ValueError("Expected a score to draw, got tables without a finite value from runs.")
    where = next((table.scenario for table in tables if table.scenario), "")
    words = _about_bars(
        score.summary.n_used for content in drawn for table in tables for score in content.scores(table)
    )
    words += "; shaded: mean ± 2 sd of runs" if band else ""
    title = f"{where + ': ' if where else ''}{words}; dotted: noise floor; hollow: misleads"
    with saved_panels(path, len(drawn), (3.4, 2.8), title=title, style=style) as panels:
        for content, panel in zip(drawn, panels, strict=True):
            _draw_panel(panel, content, tables, band=band)


def _about_bars(n_runs: Iterable[int]) -> str:
    """Return what is drawn of scores of so many runs."""
    with_bar = {n >= FEWEST_RUNS for n in n_runs}
    if True not in with_bar:
        return f"mean over seeds; no intervals, of fewer than {FEWEST_RUNS} runs"
    return "mean and 95 % interval over seeds" + (f"; none of fewer than {FEWEST_RUNS}" if False in with_bar else "")


@dataclass(frozen=True, kw_only=True)
class _Content:
    """What one panel shows: a measure in one variant and form, itself or relative to performance."""

    label: str
    is_relative: bool

    @property
    def measure(self) -> str:
        """Name of the measure."""
        return self.label.partition(",")[0]

    def scores(self, table: "ScoreTable") -> "list[Score]":
        """Return the scores of a table that can be drawn here."""
        found = [score for score in table.scores if score.label == self.label and score.per_seed]
        return [score for score in found if math.isfinite(self.summary(score).mean)]

    def summary(self, score: "Score") -> Summary:
        """Return the numbers of a score that are shown here; all NaN where there are none."""
        return (score.relative or Summary.without_interval()) if self.is_relative else score.summary

    def floor(self, score: "Score") -> float | None:
        """Return the noise floor of a score, in the unit of this panel."""
        return score.relative_floor if self.is_relative else score.noise_floor


def _contents(tables: "Sequence[ScoreTable]") -> list[_Content]:
    """Return the panels that have something to show, in the order of tables, relative ones beside their measure."""
    found = _all_contents(tables)
    relative = {content.label for content in found if content.is_relative}
    each = [content for content in found if content.is_relative or content.label not in relative]
    measures = {content.measure for content in found}
    return [content for content in each if content.measure in PICTURED] if measures >= {*PICTURED} else each


def _all_contents(tables: "Sequence[ScoreTable]") -> list[_Content]:
    scores = [score for table in tables for score in table.scores]
    order = list(MEASURE_CRITERIA)
    labels = dict.fromkeys(score.label for score in sorted(scores, key=lambda score: order.index(score.measure)))
    wanted = [_Content(label=label, is_relative=is_relative) for label in labels for is_relative in (False, True)]
    return [content for content in wanted if any(content.scores(table) for table in tables)]


def _draw_panel(panel: Panel, content: _Content, tables: "Sequence[ScoreTable]", *, band: bool) -> None:
    shown = [score for table in tables for score in content.scores(table)]
    first = shown[0]
    about = METRICS[first.measure]
    places = sorted({score.x for score in shown})
    for index, (table, look) in enumerate(zip(tables, looks(table.policy for table in tables), strict=True)):
        # Levels are categories, side by side, so that error bars of different policies do not cover each other.
        shift = 0.08 * (index - 0.5 * (len(tables) - 1))
        scores = content.scores(table)
        x = [places.index(score.x) + shift for score in scores]
        _draw_policy(panel, content, scores, x, look, band=band)
    if about.neutral is not None and not about.is_distance and first.variant == "corrected":
        panel.axhline(about.neutral, color="0.6", linewidth=0.8, zorder=0)
    arrow = "higher" if about.higher_is_better else "lower"
    panel.set_title(f"{words_of(content.label)} ({arrow} is better)")
    panel.set_ylabel(f"{about.symbol}, {'share of performance' if content.is_relative else first.unit}")
    panel.set_xlabel(X_LABELS[MEASURE_CRITERIA[first.measure]])
    panel.set_xticks(range(len(places)), [_place(place, shown) for place in places])
    panel.margins(x=0.15)


def _draw_policy(
    panel: Panel, content: _Content, scores: "Sequence[Score]", x: Sequence[float], look: Look, *, band: bool
) -> None:
    summaries = [content.summary(score) for score in scores]
    y = [summary.mean for summary in summaries]
    half = [0.0 if math.isnan(s.upper) or s.n_used < FEWEST_RUNS else s.upper - s.mean for s in summaries]
    panel.errorbar(x, y, yerr=half, color=look.colour, marker=look.marker, label=look.name)
    hollow = [(place, value) for place, value, score in zip(x, y, scores, strict=True) if score.is_doubtful]
    if hollow:
        panel.plot(*zip(*hollow, strict=True), color=look.colour, marker=look.marker, markerfacecolor="w", linestyle="")
    if band:
        spread = [0.0 if math.isnan(s.std) or s.n_used < FEWEST_RUNS else 2.0 * s.std for s in summaries]
        lower = [value - width for value, width in zip(y, spread, strict=True)]
        upper = [value + width for value, width in zip(y, spread, strict=True)]
        shade(panel, x, lower, upper, look.colour)
    floors = [(place, floor) for place, score in zip(x, scores, strict=True) if (floor := content.floor(score))]
    if floors:
        places, heights = zip(*floors, strict=True)
        panel.plot(places, heights, color=look.colour, linestyle=":", marker="_")
        panel.fill_between(places, 0.0, heights, color=look.colour, alpha=0.06, linewidth=0.0)


def _place(x: float, shown: "Sequence[Score]") -> str:
    """Return the text of a level; for throttles the distance of the conditions from the ideal, as in the paper."""
    distances = (score.beside.get("environment_distance") for score in shown if score.x == x)
    distance = next((distance for distance in distances if distance is not None), None)
    return f"{x:.3g}" if distance is None else f"{distance:.3g} ({x:.3g})"
