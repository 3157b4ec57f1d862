"""Pictures of predictions. Needs matplotlib (the optional extra "plots"), imported when something is drawn."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .plots import COLOURS, PANELS_PER_ROW, Panel
from .prediction import PredictionTable
from .texts import unread


def draw_predictions(tables: Sequence[PredictionTable], path: str | Path) -> None:
    """Draw predictions into a picture file, one panel per policy.

    Points are runs, filled where they are fitted and open where they are held back. The law is a dashed line, the band
    around it the interval; a dotted line marks the critical size, if there is one.

    Args:
        tables: One per policy.
        path: File to write; its suffix chooses the format (.png, .svg, .pdf).

    Raises:
        ImportError: matplotlib is not installed.
    """
    from matplotlib.figure import Figure  # not pyplot: no global state, no window system

    n_columns = min(PANELS_PER_ROW, len(tables))
    n_rows = math.ceil(len(tables) / n_columns)
    figure: Any = Figure(figsize=(4.2 * n_columns + 0.6, 3.4 * n_rows + 0.8), layout="constrained")
    panels: list[Panel] = figure.subplots(n_rows, n_columns, squeeze=False).ravel().tolist()
    for index, (table, panel) in enumerate(zip(tables, panels, strict=False)):
        _draw_table(panel, table, COLOURS[index % len(COLOURS)])
    for panel in panels[len(tables) :]:
        panel.set_axis_off()
    handles, labels = max((panel.get_legend_handles_labels() for panel in panels), key=lambda found: len(found[1]))
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False, fontsize=8)
    figure.savefig(path, dpi=150)


def _draw_table(panel: Panel, table: PredictionTable, colour: str) -> None:
    found = table.prediction
    curve = np.geomspace(table.fit[0], found.at[-1], 200)
    panel.fill_between(
        found.at, found.lower, found.upper, color=colour, alpha=0.18, linewidth=0, label=f"{found.level:.0%} interval"
    )
    panel.plot(curve, found.law.performance(curve), color=colour, linestyle="--", label="fitted law")
    for sizes, face, label in ((table.fit, colour, "fitted runs"), (table.hold, "white", "held-back runs")):
        points = [(size, value) for size in sizes for value in table.totals.get(size, ())]
        if points:
            x, y = zip(*points, strict=True)
            panel.plot(x, y, linestyle="", marker="o", markersize=5, color=colour, markerfacecolor=face, label=label)
    if math.isfinite(found.critical):
        panel.axvline(found.critical, color="0.4", linestyle=":", label="critical size")
    panel.set_xscale("log", base=2)
    panel.set_xticks([*table.fit, *table.predicted_sizes], [str(n) for n in (*table.fit, *table.predicted_sizes)])
    panel.minorticks_off()
    panel.set_ylim(bottom=0.0)
    panel.set_xlabel("robots", fontsize=8)
    panel.set_ylabel(table.unit, fontsize=8)
    panel.set_title(unread(f"{table.policy}{' in ' + table.scenario if table.scenario else ''}"), fontsize=9)
    panel.tick_params(labelsize=8)
    panel.grid(alpha=0.3)
