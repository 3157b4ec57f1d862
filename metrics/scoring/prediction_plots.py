"""Pictures of predictions. They need matplotlib (the optional extra "plots")."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from swarm_forage_env.rendering.figures import (
    SCREEN,
    FigureStyle,
    Look,
    Panel,
    looks,
    saved_panels,
    shade,
    size_axis,
)

if TYPE_CHECKING:
    from .prediction import PredictionTable  # a table draws itself by this


def draw_predictions(tables: "Sequence[PredictionTable]", path: str | Path, *, style: FigureStyle = SCREEN) -> None:
    """Draw predictions into a picture file, one panel per policy.

    Points are runs, filled where they are fitted and open where they are held back. The law is a dashed line, the band
    around it the interval; a dotted line marks the critical size, if there is one.

    Args:
        tables: One per policy.
        path: File to write; as in `saved_figure`, whose errors this has.
        style: Of the figure.
    """
    with saved_panels(path, len(tables), (4.2, 3.4), style=style) as panels:
        for table, panel, look in zip(tables, panels, looks(table.policy for table in tables), strict=True):
            _draw_table(panel, table, look)


def _draw_table(panel: Panel, table: "PredictionTable", look: Look) -> None:
    found = table.prediction
    curve = np.geomspace(table.fit[0], found.at[-1], 200)
    shade(panel, found.at, found.lower, found.upper, look.colour, label=f"{found.level:.0%} interval")
    panel.plot(curve, found.law.performance(curve), color=look.colour, linestyle="--", label="fitted law")
    for sizes, face, label in ((table.fit, look.colour, "fitted runs"), (table.hold, "white", "held-back runs")):
        points = [(size, value) for size in sizes for value in table.totals.get(size, ())]
        if points:
            x, y = zip(*points, strict=True)
            panel.plot(x, y, linestyle="", marker="o", color=look.colour, markerfacecolor=face, label=label)
    if math.isfinite(found.critical):
        panel.axvline(found.critical, color="0.4", linestyle=":", label="critical size")
    size_axis(panel, (*table.fit, *table.predicted_sizes))
    panel.set_ylim(bottom=0.0)
    panel.set_ylabel(table.unit)
    panel.set_title(f"{look.name}{' in ' + table.scenario if table.scenario else ''}")
