"""Pictures of runs and trainings. They need matplotlib (the optional extra "plots")."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle, repeat
from pathlib import Path
from typing import Any

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
_MEAN = "mean with its\n95 % interval\n(Student's)"
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
    trainings: Mapping[str, tuple[Sequence[int], Sequence[float], Sequence[float]]],
    *,
    mean: tuple[Sequence[int], FloatArray, FloatArray] | None = None,
    beside: Mapping[str, tuple[float, float]],
    stage_ends: Sequence[int],
    title: str,
    ylabel: str,
    style: FigureStyle = SCREEN,
) -> None:
    """Draw how policies did in the evaluations of their trainings into a picture file.

    Args:
        path: File to write; as in `saved_figure`, whose errors this has.
        trainings: Name -> (E,) decisions before each evaluation, (E,) what the scenario counts, and (E,) mean fraction
            of active robots in interference.
        mean: Of the trainings, which are then thin lines of one colour: (E,) decisions; (3, E) mean, lower and upper
            bound of what the scenario counts; the same of interference.
        beside: Controllers to compare with -> what they achieve, and their interference, NaN if unknown.
        stage_ends: Decisions at which the stages of the training end.
        title: Headline.
        ylabel: What is counted, with its unit.
        style: Of the figure.
    """
    with saved_figure(path, (9.0, 5.0), title=title, style=style) as figure:
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        found = looks((*(trainings if mean is None else (_MEAN,) * len(trainings)), *beside))
        # Five trainings have a colour twice, so each has a marker of its own.
        lines: Iterator[dict[str, Any]] = ({"marker": marker} for marker in cycle(MARKERS))
        if mean is not None:
            lines = repeat({"linewidth": 0.8, "alpha": 0.5})
        for look, line, (steps, *curves) in zip(found, lines, trainings.values(), strict=False):
            for axes, curve in zip((upper, lower), curves, strict=True):
                shown = look.name if mean is None else f"each of {len(trainings)}"
                axes.plot(np.asarray(steps) / 1e6, curve, color=look.colour, label=shown, clip_on=False, **line)
        if mean is not None:
            decisions, *curves = mean
            millions = np.asarray(decisions) / 1e6
            for axes, (middle, low, high) in zip((upper, lower), curves, strict=True):
                axes.plot(millions, middle, color=found[0].colour, marker="o", label=_MEAN, clip_on=False)
                shade(axes, millions, low, high, found[0].colour)
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
        shown_once = {label: handle for handle, label in zip(*upper.get_legend_handles_labels(), strict=True)}
        figure.legend([*shown_once.values()], [*shown_once], loc="outside right center")
