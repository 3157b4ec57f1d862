"""Figures of models beside the runs of a study. They need matplotlib (the optional extra "plots")."""

from collections.abc import Sequence
from pathlib import Path

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

from .study_models import ModelFigure, ModelPanel

RUNS_COLOUR = "black"
"""What was seen; the colours are for models."""


def draw_models(figure: ModelFigure, paths: Sequence[Path], *, style: FigureStyle = SCREEN) -> None:
    """Draw what was seen, solid with its 95 % interval, and what models say, dashed.

    Args:
        figure: From `model_figures`.
        paths: Files to write; as in `saved_figure`, whose errors this has.
        style: Of the figure.
    """
    title = f"{figure.title}\nshaded: 95 % interval of the mean; dashed: models"
    with saved_panels(paths, len(figure.panels), (3.6, 3.0), title=title, style=style) as places:
        for place, panel in zip(places, figure.panels, strict=True):
            _draw_panel(place, panel, figure)


def _draw_panel(place: Panel, panel: ModelPanel, figure: ModelFigure) -> None:
    for curve, colour in zip(panel.expected, COLOURS, strict=False):
        place.plot(curve.x, curve.y, "--", color=colour, label=curve.name, zorder=3)
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
