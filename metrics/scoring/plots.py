"""Pictures of score tables. Needs matplotlib (the optional extra "plots"), imported when something is drawn."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

from metrics.catalog import METRICS

from .columns import NOISE, POPULATION, SIZE, THROTTLE
from .measures import MEASURE_CRITERIA
from .table import Score, ScoreTable

Panel: TypeAlias = Any
"""An `Axes` of matplotlib, whose types leave too much open for strict checking."""

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442", "#000000")
"""Okabe-Ito palette: told apart by readers with any colour vision."""
PANELS_PER_ROW = 4
_X_LABELS = {
    SIZE: "robots (the larger swarm)",
    THROTTLE: "amplitude of throttle, or of handling cost in ticks",
    NOISE: "standard deviation of noise",
    POPULATION: "level of population dynamics",
}


def draw_scores(tables: Sequence[ScoreTable], path: str | Path) -> None:
    """Draw score tables side by side into a picture file: one panel per measure, one line per policy.

    Error bars are the intervals of the tables, dotted lines the noise floors. Measures that are computed without runs
    (availability) and values that are not finite are left out.

    Args:
        tables: One per policy.
        path: File to write; its suffix chooses the format (.png, .svg, .pdf).

    Raises:
        ImportError: matplotlib is not installed.
        ValueError: no table has a score that can be drawn.
    """
    from matplotlib.figure import Figure  # not pyplot: no global state, no window system

    drawn = [name for name in MEASURE_CRITERIA if any(_drawable(table, name) for table in tables)]
    if not drawn:
        raise ValueError("Expected a score to draw, got tables without a finite value from runs.")
    n_rows = math.ceil(len(drawn) / PANELS_PER_ROW)
    n_columns = min(PANELS_PER_ROW, len(drawn))
    figure: Any = Figure(figsize=(3.4 * n_columns + 0.6, 2.8 * n_rows + 0.8), layout="constrained")
    panels: list[Panel] = figure.subplots(n_rows, n_columns, squeeze=False).ravel().tolist()
    for name, panel in zip(drawn, panels, strict=False):
        _draw_measure(panel, name, tables)
    for panel in panels[len(drawn) :]:
        panel.set_axis_off()
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(tables), frameon=False)
    where = next((table.scenario for table in tables if table.scenario), "")
    figure.suptitle(f"{where + ': ' if where else ''}mean and 95 % interval over seeds; dotted: noise floor")
    figure.savefig(path, dpi=150)


def _drawable(table: ScoreTable, measure: str) -> list[Score]:
    found = (score for score in table.scores if score.measure == measure and score.per_seed)
    return [score for score in found if math.isfinite(score.summary.mean)]


def _draw_measure(panel: Panel, measure: str, tables: Sequence[ScoreTable]) -> None:
    about = METRICS[measure]
    places = sorted({score.x for table in tables for score in _drawable(table, measure)})
    for index, table in enumerate(tables):
        scores = _drawable(table, measure)
        colour = COLOURS[index % len(COLOURS)]
        # Levels are categories, side by side, so that error bars of different policies do not cover each other.
        shift = 0.08 * (index - 0.5 * (len(tables) - 1))
        x = [places.index(score.x) + shift for score in scores]
        y = [score.summary.mean for score in scores]
        half = [0.0 if math.isnan(s.summary.upper) else s.summary.upper - s.summary.mean for s in scores]
        panel.errorbar(x, y, yerr=half, color=colour, marker="o", markersize=4, capsize=2, label=table.policy)
        floors = [(place, score.noise_floor) for place, score in zip(x, scores, strict=True) if score.noise_floor]
        if floors:
            panel.plot(*zip(*floors, strict=True), color=colour, linestyle=":", marker="_")
    if about.neutral is not None and not about.is_distance:
        panel.axhline(about.neutral, color="0.6", linewidth=0.8, zorder=0)
    arrow = "higher" if about.higher_is_better else "lower"
    panel.set_title(f"{measure} ({arrow} is better)", fontsize=9)
    panel.set_ylabel(next(score.unit for table in tables for score in _drawable(table, measure)), fontsize=8)
    panel.set_xlabel(_X_LABELS[MEASURE_CRITERIA[measure]], fontsize=8)
    panel.set_xticks(range(len(places)), [f"{place:.3g}" for place in places])
    panel.tick_params(labelsize=8)
    panel.margins(x=0.15)
    panel.grid(alpha=0.3)
