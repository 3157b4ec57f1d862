"""Pictures of results. Needs matplotlib (the optional extra "plots"), which is imported when something is drawn."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from swarm_forage_env.types import FloatArray

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442", "#000000")
"""Okabe-Ito palette: told apart by readers with any colour vision."""


@dataclass(frozen=True, slots=True)
class Curve:
    """A line over recording intervals with a band around it."""

    label: str
    mean: FloatArray
    """(T,) line."""
    low: FloatArray
    """(T,) lower edge of the band; NaN where there is none."""
    high: FloatArray
    """(T,) upper edge of the band."""


def draw_curves(
    path: str | Path, t_end_s: FloatArray, curves: Sequence[Curve], *, title: str, ylabel: str, band: str
) -> None:
    """Draw curves over simulated time into a picture file.

    Args:
        path: File to write; its suffix chooses the format (.png, .svg, .pdf).
        t_end_s: (T,) ends of the recording intervals in seconds.
        curves: One per controller.
        title: Headline.
        ylabel: What is drawn, with its unit.
        band: What the bands are.

    Raises:
        ImportError: matplotlib is not installed.
    """
    from matplotlib.figure import Figure  # not pyplot: no global state, no window system

    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.subplots()
    marker = "o" if len(t_end_s) == 1 else ""
    for index, curve in enumerate(curves):
        colour = COLOURS[index % len(COLOURS)]
        axes.plot(t_end_s, curve.mean, color=colour, label=curve.label, marker=marker, clip_on=False)
        axes.fill_between(t_end_s, curve.low, curve.high, color=colour, alpha=0.2, linewidth=0)
    has_band = any(np.isfinite(curve.low).any() for curve in curves)
    xlabel = f"time [s] (bands: {band})" if has_band else "time [s]"
    axes.set(title=title, xlabel=xlabel, ylabel=ylabel, xlim=(0, None), ylim=(0, None))
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    figure.savefig(path, dpi=150)
