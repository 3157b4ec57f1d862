"""Pictures of runs and trainings. They need matplotlib (the optional extra "plots")."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path

import numpy as np

from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.rendering.figures import (
    MARKERS,
    SCREEN,
    FigureStyle,
    legend_below,
    looks,
    saved_figure,
    shade,
)

_SMOOTHED = 5
"""Intervals of a running mean: deliveries come in bursts, which hide who delivers more (our choice)."""
_MANY_INTERVALS = 20
"""With fewer, single ones are drawn alone."""


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
    path: str | Path,
    t_end_s: FloatArray,
    curves: Sequence[Curve],
    *,
    title: str,
    ylabel: str,
    band: str,
    style: FigureStyle = SCREEN,
) -> None:
    """Draw curves over simulated time into a picture file; bold lines are running means where intervals are many.

    Args:
        path: File to write; as in `saved_figure`, whose errors this has.
        t_end_s: (T,) ends of the recording intervals in seconds.
        curves: One per controller.
        title: Headline.
        ylabel: What is drawn, with its unit.
        band: What the bands are, or why there are none.
        style: Of the figure.
    """
    with saved_figure(path, (8.0, 4.5), title=title, style=style) as figure:
        axes = figure.subplots()
        marker = "o" if len(t_end_s) == 1 else ""
        has_means = len(t_end_s) >= _MANY_INTERVALS
        if has_means:
            band += f"; bold: running mean of {_SMOOTHED} intervals"
        for curve, look in zip(curves, looks(curve.label for curve in curves), strict=True):
            shade(axes, t_end_s, curve.low, curve.high, look.colour)
            bold = curve.mean
            if has_means:
                axes.plot(t_end_s, curve.mean, color=look.colour, linewidth=0.6, alpha=0.6)
                bold = _running_mean(curve.mean)
            axes.plot(t_end_s, bold, color=look.colour, label=look.name, marker=marker, clip_on=False, zorder=3)
        axes.set(xlabel=f"time (s)\n{band}", ylabel=ylabel, xlim=(0, None), ylim=(0, None))
        legend_below(figure)


def _running_mean(values: FloatArray) -> FloatArray:
    """Return the mean of the intervals around each one, (T,); fewer at the ends."""
    window = np.ones(_SMOOTHED)
    return np.convolve(values, window, "same") / np.convolve(np.ones_like(values), window, "same")


def draw_trainings(
    path: str | Path,
    trainings: Mapping[str, Sequence[tuple[int, float, float]]],
    *,
    methods: Sequence[str],
    beside: Mapping[str, tuple[float, float]],
    stage_ends: Sequence[int],
    title: str,
    ylabel: str,
    style: FigureStyle = SCREEN,
) -> None:
    """Draw how policies did in the evaluations of their trainings into a picture file.

    Args:
        path: File to write; as in `saved_figure`, whose errors this has.
        trainings: Name -> each evaluation: decisions before it, what the scenario counts, and mean fraction of active
            robots in interference.
        methods: One per training; those of one method look alike, and the legend names the method.
        beside: Controllers to compare with -> what they achieve, and their interference, NaN if unknown.
        stage_ends: Decisions at which the stages of the training end.
        title: Headline.
        ylabel: What is counted, with its unit.
        style: Of the figure.
    """
    with saved_figure(path, (9.0, 5.0), title=title, style=style) as figure:
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        found = looks((*methods, *beside))
        # Five methods have a colour twice, so each has a marker of its own.
        markers = dict(zip(dict.fromkeys(methods), cycle(MARKERS), strict=False))
        for method, look, evaluations in zip(methods, found, trainings.values(), strict=False):
            steps, *curves = np.transpose(evaluations)
            for axes, curve in zip((upper, lower), curves, strict=True):
                axes.plot(steps / 1e6, curve, color=look.colour, label=look.name, clip_on=False, marker=markers[method])
        dashes = ("--", "-.", ":", (0, (6, 1))) * len(beside)
        for look, levels, dash in zip(found[len(trainings) :], beside.values(), dashes, strict=False):
            for axes, level in zip((upper, lower), levels, strict=True):
                if np.isfinite(level):
                    axes.axhline(level, color=look.colour, linestyle=dash, label=look.name)
        upper.set(ylabel=ylabel, ylim=(0, None))
        xlabel = "million decisions of single robots" + (" (dotted: a new stage)" if stage_ends[:-1] else "")
        lower.set(xlabel=xlabel, ylim=(0, 1))
        lower.set_title("interference", loc="left")  # beside the axis it would have no room
        for axes in (upper, lower):
            axes.set_xlim(0, None)
            for end in stage_ends[:-1]:
                axes.axvline(end / 1e6, color="black", linestyle=":", linewidth=1)
        # Beside the axes: levels of others may lie anywhere in them. Not at the top, where headlines may be wide.
        handles, labels = upper.get_legend_handles_labels()
        once = dict(zip(labels, handles, strict=True))
        figure.legend(once.values(), once.keys(), loc="outside right center")
