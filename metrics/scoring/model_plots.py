"""Figures of models beside the runs of a study. Needs matplotlib (the optional extra "plots")."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .plots import COLOURS, Panel
from .study_models import ModelFigure, ModelPanel
from .study_plots import columns_of, save_picture
from .texts import number, unread

RUNS_COLOUR = "black"
"""What was seen; the colours are for models."""


def draw_models(figure: ModelFigure, paths: Sequence[Path]) -> None:
    """Draw what was seen, solid with its 95 % interval, and what models say, dashed.

    Args:
        figure: From `model_figures`.
        paths: Files to write; their suffixes choose the formats (.svg, .png, .pdf).

    Raises:
        ImportError: matplotlib is not installed.
    """
    from matplotlib.figure import Figure  # not pyplot: no global state, no window system

    n_columns = columns_of(len(figure.panels))
    n_rows = math.ceil(len(figure.panels) / n_columns)
    picture: Any = Figure(figsize=(max(5.2, 3.6 * n_columns + 0.6), 3.0 * n_rows + 0.9), layout="constrained")
    axes: list[Panel] = picture.subplots(n_rows, n_columns, squeeze=False).ravel().tolist()
    for place, panel in zip(axes, figure.panels, strict=False):
        _draw_panel(place, panel, figure)
    for place in axes[len(figure.panels) :]:
        place.set_axis_off()
    shown: dict[str, Any] = {}
    for place in axes:
        handles, labels = place.get_legend_handles_labels()
        shown |= dict(zip(labels, handles, strict=True))
    picture.legend(
        [*shown.values()], [*shown], loc="outside lower center", ncols=min(len(shown), 8), frameon=False, fontsize=9
    )
    picture.suptitle(f"{unread(figure.title)}\nshaded: 95 % interval of the mean; dashed: models", fontsize=10)
    save_picture(picture, figure.name, paths)


def _draw_panel(place: Panel, panel: ModelPanel, figure: ModelFigure) -> None:
    for curve, colour in zip(panel.expected, COLOURS, strict=False):
        place.plot(curve.x, curve.y, "--", color=colour, linewidth=1.4, label=curve.name, zorder=3)
    for curve in panel.seen:
        marks = {"marker": "o", "markersize": 4} if figure.is_log else {}
        place.plot(curve.x, curve.y, color=RUNS_COLOUR, linewidth=1.1, label=curve.name, zorder=4, **marks)
        if curve.lower is not None and curve.upper is not None:
            place.fill_between(curve.x, curve.lower, curve.upper, color=RUNS_COLOUR, alpha=0.15, linewidth=0.0)
    place.set_title(unread(panel.words), fontsize=9)
    if figure.is_log:
        place.set_xscale("log", base=2)
        place.set_xticks(panel.seen[0].x, [number(size) for size in panel.seen[0].x])
        place.minorticks_off()
    # Neither a law far off nor the interval of two runs may flatten what was seen.
    place.set_ylim(0.0, 1.3 * float(max(curve.y.max() for curve in (*panel.seen, *panel.expected[:1]))))
    place.set_xlabel(figure.x_label, fontsize=8)
    place.set_ylabel(figure.y_label, fontsize=8)
    place.tick_params(labelsize=8)
    place.grid(alpha=0.25)
