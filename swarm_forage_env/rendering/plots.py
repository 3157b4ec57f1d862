"""Pictures of runs, trainings, maps and networks. They need matplotlib (the optional extra "plots")."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.rendering.figures import (
    COLOURS,
    SCREEN,
    FigureStyle,
    legend_below,
    looks,
    policy_words,
    saved_figure,
    shade,
)

_OBSTACLE = {"facecolor": "white", "edgecolor": "black", "hatch": "////", "linewidth": 0.5}
"""Hatched: neither a map nor a difference has that."""


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
    """Draw curves over simulated time into a picture file.

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
        for curve, look in zip(curves, looks(curve.label for curve in curves), strict=True):
            axes.plot(t_end_s, curve.mean, color=look.colour, label=look.name, marker=marker, clip_on=False)
            shade(axes, t_end_s, curve.low, curve.high, look.colour)
        axes.set(xlabel=f"time [s] ({band})", ylabel=ylabel, xlim=(0, None), ylim=(0, None))
        legend_below(figure)


def draw_trainings(
    path: str | Path,
    trainings: Mapping[str, tuple[Sequence[int], Sequence[float], Sequence[float]]],
    *,
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
        beside: Controllers to compare with -> what they achieve, and their interference, NaN if unknown.
        stage_ends: Decisions at which the stages of the training end.
        title: Headline.
        ylabel: What is counted, with its unit.
        style: Of the figure.
    """
    with saved_figure(path, (9.0, 5.0), title=title, style=style) as figure:
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        found = looks((*trainings, *beside))
        for look, (steps, performance, interference) in zip(found, trainings.values(), strict=False):
            millions = np.asarray(steps) / 1e6
            upper.plot(millions, performance, color=look.colour, marker="o", label=look.name, clip_on=False)
            lower.plot(millions, interference, color=look.colour, marker="o", clip_on=False)
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
        # Beside the axes: levels of others may lie anywhere in them.
        figure.legend(*upper.get_legend_handles_labels(), loc="outside right upper")


Box: TypeAlias = tuple[float, float, float, float]
"""x low, y low, x high, y high, m."""
MapRow: TypeAlias = tuple[str, Mapping[str, FloatArray], bool, tuple[float, float], Sequence[Box]]
"""Label; arrays (ny, nx) by name, row = y from below; whether they are differences; extent of the floor in m; the boxes
on it, which are hatched."""


def draw_maps(
    path: str | Path,
    rows: Sequence[MapRow],
    columns: Mapping[str, tuple[str, str]],
    *,
    own_scales: bool = False,
    style: FigureStyle = SCREEN,
) -> None:
    """Draw maps of floors of the same proportions: a row of panels per map or difference, a column per quantity.

    Colours of a column mean the same in all rows of maps, and the same in all rows of differences, where white is 0.

    Args:
        path: File to write; as in `saved_figure`, whose errors this has.
        rows: One per map or difference.
        columns: What is counted, and its unit, by name of the array; their order is that of the columns.
        own_scales: Whether every panel has a scale of its own instead, which shows more of what is rare.
        style: Of the figure.
    """
    shape = rows[0][3][1] / rows[0][3][0]
    width = style.width_in or 3.6 * len(columns)
    size_in = width, (0.75 * shape * width / len(columns) + 0.1 * style.font_size) * len(rows)
    with saved_figure(path, size_in, style=style) as figure:
        panels = figure.subplots(len(rows), len(columns), squeeze=False)
        bar = min(1.0, 1.2 * shape)  # as long as a panel is high
        for (label, arrays, is_difference, size_m, obstacles), line in zip(rows, panels, strict=True):
            alike = [row for row in rows if row[2] == is_difference]
            for (name, (what, unit)), axes in zip(columns.items(), line, strict=True):
                top = _map_top([arrays[name]] if own_scales else [row[1][name] for row in alike])
                low, colours, ends = (-top, "RdBu_r", "both") if is_difference else (0.0, None, "max")
                extent = (0, size_m[0], 0, size_m[1])
                image = axes.imshow(arrays[name], origin="lower", extent=extent, vmin=low, vmax=top, cmap=colours)
                for x_low, y_low, x_high, y_high in obstacles:
                    axes.fill([x_low, x_high, x_high, x_low], [y_low, y_low, y_high, y_high], **_OBSTACLE)
                axes.set(title=f"{policy_words(label)}\n{what}", xlabel="x [m]", ylabel="y [m]")
                axes.grid(visible=False)
                scale = figure.colorbar(image, ax=axes, shrink=bar, extend=ends)
                scale.set_label(f"more {unit}" if is_difference else unit)


def _map_top(arrays: Sequence[FloatArray]) -> float:
    """Return the end of the scale of maps: few squares hold most; the last percent would hide all others."""
    values = np.abs(np.concatenate([array.ravel() for array in arrays]))
    return float(np.quantile(values[values > 0], 0.99)) if values.any() else 1.0


def draw_saliency(
    path: str | Path,
    slices: Sequence[str],
    bars: Mapping[str, FloatArray],
    *,
    title: str,
    xlabel: str,
    style: FigureStyle = SCREEN,
) -> None:
    """Draw what a network looks at: a group of bars per slice of its observations, the longest on top.

    Args:
        path: File to write; as in `saved_figure`, whose errors this has.
        slices: (S,) names.
        bars: Name of a group of robots -> (S,) lengths.
        title: Headline.
        xlabel: What the lengths are.
        style: Of the figure.
    """
    order = np.argsort(np.max([*bars.values()], axis=0), kind="stable")
    height = 0.8 / len(bars)
    with saved_figure(path, (7.0, 1.2 + 0.42 * len(slices)), title=title, style=style) as figure:
        axes = figure.subplots()
        for index, (group, lengths) in enumerate(bars.items()):
            places = np.arange(len(slices)) + (0.5 * (len(bars) - 1) - index) * height
            axes.barh(places, lengths[order], height, color=COLOURS[index], label=f"{group} robots")
        axes.set_yticks(np.arange(len(slices)), [slices[row].replace("_", " ") for row in map(int, order)])
        axes.set(xlabel=xlabel, xlim=(0, None))
        axes.grid(visible=False, axis="y")
        axes.legend(loc="lower right")
