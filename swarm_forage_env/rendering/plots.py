"""Pictures of runs, trainings, maps and networks. They need matplotlib (the optional extra "plots")."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle, repeat
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.rendering.figures import (
    MARKERS,
    SCREEN,
    FigureStyle,
    Panel,
    legend_below,
    looks,
    policy_words,
    saved_figure,
    shade,
)

_OBSTACLE = {"facecolor": "white", "edgecolor": "black", "hatch": "////", "linewidth": 0.5}
"""Hatched: neither a map nor a difference has that."""
_NEST = {"facecolor": "none", "edgecolor": "black", "linestyle": "--", "linewidth": 0.8}
_MAP_IN = 3.6
"""Width of a map with its scale, inches."""
_SMOOTHED = 5
"""Intervals of a running mean: deliveries come in bursts, which hide who delivers more (our choice)."""
_MANY_INTERVALS = 20
"""With fewer, single ones are drawn alone."""
_MOST_OF_FLOOR = 0.5
"""What happens in a smaller part of the floor is shown without the rest (our choice)."""


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
        axes.set(xlabel=f"time [s] ({band})", ylabel=ylabel, xlim=(0, None), ylim=(0, None))
        legend_below(figure)


def _running_mean(values: FloatArray) -> FloatArray:
    """Return the mean of the intervals around each one, (T,); fewer at the ends."""
    window = np.ones(_SMOOTHED)
    return np.convolve(values, window, "same") / np.convolve(np.ones_like(values), window, "same")


class MeanCurve(NamedTuple):
    """The mean of several trainings, with an interval."""

    label: str
    steps: Sequence[int]
    """(E,) decisions before each evaluation."""
    performance: FloatArray
    """(3, E): mean, lower and upper bound of what the scenario counts."""
    interference: FloatArray
    """(3, E): the same of the mean fraction of active robots in interference."""


def draw_trainings(
    path: str | Path,
    trainings: Mapping[str, tuple[Sequence[int], Sequence[float], Sequence[float]]],
    *,
    mean: MeanCurve | None = None,
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
        mean: Of the trainings, with a band for its interval; they themselves are then thin lines of one colour.
        beside: Controllers to compare with -> what they achieve, and their interference, NaN if unknown.
        stage_ends: Decisions at which the stages of the training end.
        title: Headline.
        ylabel: What is counted, with its unit.
        style: Of the figure.
    """
    with saved_figure(path, (9.0, 5.0), title=title, style=style) as figure:
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        found = looks((*(trainings if mean is None else (mean.label,) * len(trainings)), *beside))
        # Five trainings have a colour twice, so each has a marker of its own.
        lines: Iterator[dict[str, Any]] = ({"marker": marker} for marker in cycle(MARKERS))
        if mean is not None:
            lines = repeat({"linewidth": 0.8, "alpha": 0.5})
        for look, line, (steps, *curves) in zip(found, lines, trainings.values(), strict=False):
            for axes, curve in zip((upper, lower), curves, strict=True):
                shown = look.name if mean is None else f"each of {len(trainings)}"
                axes.plot(np.asarray(steps) / 1e6, curve, color=look.colour, label=shown, clip_on=False, **line)
        if mean is not None:
            for axes, (middle, low, high) in ((upper, mean.performance), (lower, mean.interference)):
                millions = np.asarray(mean.steps) / 1e6
                axes.plot(millions, middle, color=found[0].colour, marker="o", label=mean.label, clip_on=False)
                shade(axes, millions, low, high, found[0].colour)
        dashes = ("--", "-.", ":", (0, (6, 1))) * len(beside)
        for look, levels, dash in zip(found[len(trainings) :], beside.values(), dashes, strict=False):
            for axes, level in zip((upper, lower), levels, strict=True):
                if np.isfinite(level):
                    axes.axhline(level, color=look.colour, linestyle=dash, label=look.name)
        upper.set(ylabel=ylabel, ylim=(0, None))
        xlabel = "million decisions of single robots" + (" (dotted: a new stage)" if stage_ends[:-1] else "")
        lower.set(xlabel=xlabel, ylabel="interference", ylim=(0, 1))
        for axes in (upper, lower):
            axes.set_xlim(0, None)
            for end in stage_ends[:-1]:
                axes.axvline(end / 1e6, color="black", linestyle=":", linewidth=1)
        # Beside the axes: levels of others may lie anywhere in them. Not at the top, where headlines may be wide.
        shown_once = {label: handle for handle, label in zip(*upper.get_legend_handles_labels(), strict=True)}
        figure.legend([*shown_once.values()], [*shown_once], loc="outside right center")


Box: TypeAlias = tuple[float, float, float, float]
"""x low, y low, x high, y high, m."""


class MapRow(NamedTuple):
    """A map of a floor, or a difference of two, to draw."""

    label: str
    arrays: Mapping[str, FloatArray]
    """Name of a quantity -> (ny, nx), row = y from below."""
    is_difference: bool
    size_m: tuple[float, float]
    """Extent of the floor along x and y."""
    obstacles_m: Sequence[Box] = ()
    """They are hatched."""
    nests_m: Sequence[Box] = ()
    """They are outlined."""


def draw_maps(
    path: str | Path,
    rows: Sequence[MapRow],
    columns: Mapping[str, tuple[str, str]],
) -> None:
    """Draw maps of floors of the same proportions: a row of panels per map or difference, a column per quantity.

    Colours of a quantity mean the same in all maps, and the same in all differences, where white is 0. Squares in which
    nothing happened are white, and what happened in a small part of the floor only is shown there.

    Args:
        path: File to write; as in `saved_figure`, whose errors this has.
        rows: One per map or difference.
        columns: What is counted, and its unit, by name of the array; their order is that of the columns.
    """
    shape = rows[0].size_m[1] / rows[0].size_m[0]
    size_in = _MAP_IN * len(columns), (0.75 * shape * _MAP_IN + 0.9) * len(rows)
    with saved_figure(path, size_in) as figure:
        panels = figure.subplots(len(rows), len(columns), squeeze=False)
        for row, line in zip(rows, panels, strict=True):
            alike = [one for one in rows if one.is_difference == row.is_difference]
            for name, axes in zip(columns, line, strict=True):
                top = _map_top([one.arrays[name] for one in alike])
                image = _draw_map(axes, row, name, top)
                x_low, y_low, x_high, y_high = _busy_part([one.arrays[name] for one in rows])
                axes.set_xlim(x_low * row.size_m[0], x_high * row.size_m[0])
                axes.set_ylim(y_low * row.size_m[1], y_high * row.size_m[1])
                what, unit = columns[name]
                axes.set_title(f"{policy_words(row.label)}\n{what}")
                ends = "both" if row.is_difference else "max"
                scale = figure.colorbar(image, ax=axes, extend=ends, shrink=min(1.0, 1.2 * shape))
                scale.set_label(f"more {unit}" if row.is_difference else unit)


def _draw_map(axes: Panel, row: MapRow, name: str, top: float) -> Any:
    """Draw the squares of one map, and what stands on its floor; returns the image."""
    low, colours = (-top, "RdBu_r") if row.is_difference else (0.0, "cividis_r")
    squares = np.ma.masked_equal(row.arrays[name], 0.0)
    extent = (0, row.size_m[0], 0, row.size_m[1])
    image = axes.imshow(squares, origin="lower", extent=extent, vmin=low, vmax=top, cmap=colours)
    for boxes, look in ((row.obstacles_m, _OBSTACLE), (row.nests_m, _NEST)):
        for x_low, y_low, x_high, y_high in boxes:
            axes.fill([x_low, x_high, x_high, x_low], [y_low, y_low, y_high, y_high], **look)
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.grid(visible=False)
    return image


def _busy_part(arrays: Sequence[FloatArray]) -> Box:
    """Return the part of the floor to show, in shares of it: all, or where something is if that is less than half.

    It has the proportions of the floor, and one square around whatever is there.
    """
    ny, nx = arrays[0].shape
    y, x = np.nonzero(np.any([array != 0.0 for array in arrays], axis=0))
    if not len(x):
        return 0.0, 0.0, 1.0, 1.0
    lows = np.maximum([(x.min() - 1) / nx, (y.min() - 1) / ny], 0.0)
    highs = np.minimum([(x.max() + 2) / nx, (y.max() + 2) / ny], 1.0)
    side = float((highs - lows).max())
    if side**2 >= _MOST_OF_FLOOR:
        return 0.0, 0.0, 1.0, 1.0
    x_low, y_low = np.clip(0.5 * (lows + highs - side), 0.0, 1.0 - side).tolist()
    return x_low, y_low, x_low + side, y_low + side


def _map_top(arrays: Sequence[FloatArray]) -> float:
    """Return the end of the scale of maps: few squares hold most; the last percent would hide all others."""
    values = np.abs(np.concatenate([array.ravel() for array in arrays]))
    return float(np.quantile(values[values > 0], 0.99)) if values.any() else 1.0
