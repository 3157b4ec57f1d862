"""Pictures of results. Needs matplotlib (the optional extra "plots"), which is imported when something is drawn."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from swarm_forage_env.contract.types import FloatArray

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442", "#000000")
"""Okabe-Ito palette: told apart by readers with any colour vision."""
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
    path: str | Path, t_end_s: FloatArray, curves: Sequence[Curve], *, title: str, ylabel: str, band: str
) -> None:
    """Draw curves over simulated time into a picture file.

    Args:
        path: File to write; its suffix chooses the format (.png, .svg, .pdf).
        t_end_s: (T,) ends of the recording intervals in seconds.
        curves: One per controller.
        title: Headline.
        ylabel: What is drawn, with its unit.
        band: What the bands are, or why there are none.

    Raises:
        ImportError: matplotlib is not installed.
    """
    from matplotlib.figure import Figure  # not pyplot: no global state, no window system

    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.subplots()
    marker = "o" if len(t_end_s) == 1 else ""
    for index, curve in enumerate(curves):
        colour = COLOURS[index % len(COLOURS)]
        axes.plot(t_end_s, curve.mean, color=colour, label=_unread(curve.label), marker=marker, clip_on=False)
        axes.fill_between(t_end_s, curve.low, curve.high, color=colour, alpha=0.2, linewidth=0)
    axes.set(title=_unread(title), xlabel=f"time [s] ({band})", ylabel=ylabel, xlim=(0, None), ylim=(0, None))
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    figure.savefig(path, dpi=150)


def draw_trainings(
    path: str | Path,
    trainings: Mapping[str, tuple[Sequence[int], Sequence[float], Sequence[float]]],
    *,
    beside: Mapping[str, tuple[float, float]],
    stage_ends: Sequence[int],
    title: str,
    ylabel: str,
) -> None:
    """Draw how policies did in the evaluations of their trainings into a picture file.

    Args:
        path: File to write; its suffix chooses the format (.png, .svg, .pdf).
        trainings: Name -> (E,) decisions before each evaluation, (E,) what the scenario counts, and (E,) mean fraction
            of active robots in interference.
        beside: Controllers to compare with -> what they achieve, and their interference, NaN if unknown.
        stage_ends: Decisions at which the stages of the training end.
        title: Headline.
        ylabel: What is counted, with its unit.

    Raises:
        ImportError: matplotlib is not installed.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    colours = iter(COLOURS * len((*trainings, *beside)))
    for label, (steps, performance, interference) in trainings.items():
        millions, colour = np.asarray(steps) / 1e6, next(colours)
        upper.plot(millions, performance, color=colour, marker="o", label=_unread(label), clip_on=False)
        lower.plot(millions, interference, color=colour, marker="o", clip_on=False)
    for (label, levels), dashes in zip(beside.items(), ("--", "-.", ":", (0, (6, 1))) * len(beside), strict=False):
        colour = next(colours)
        for axes, level in zip((upper, lower), levels, strict=True):
            if np.isfinite(level):
                axes.axhline(level, color=colour, linestyle=dashes, label=_unread(label))
    upper.set(title=_unread(title), ylabel=ylabel, ylim=(0, None))
    xlabel = "million decisions of single robots" + (" (dotted: a new stage)" if stage_ends[:-1] else "")
    lower.set(xlabel=xlabel, ylabel="interference", ylim=(0, 1))
    for axes in (upper, lower):
        axes.set_xlim(0, None)
        axes.grid(alpha=0.3)
        for end in stage_ends[:-1]:
            axes.axvline(end / 1e6, color="black", linestyle=":", linewidth=1)
    # Beside the axes: levels of others may lie anywhere in them.
    figure.legend(*upper.get_legend_handles_labels(), loc="outside right upper", frameon=False)
    figure.savefig(path, dpi=150)


Box: TypeAlias = tuple[float, float, float, float]
"""x low, y low, x high, y high, m."""
MapRow: TypeAlias = tuple[str, Mapping[str, FloatArray], bool, tuple[float, float], Sequence[Box]]
"""Label; arrays (ny, nx) by name, row = y from below; whether they are differences; extent of the floor in m; the boxes
on it, which are hatched."""


def draw_maps(
    path: str | Path, rows: Sequence[MapRow], columns: Mapping[str, tuple[str, str]], *, own_scales: bool = False
) -> None:
    """Draw maps of floors of the same proportions: a row of panels per map or difference, a column per quantity.

    Colours of a column mean the same in all rows of maps, and the same in all rows of differences, where white is 0.

    Args:
        path: File to write; its suffix chooses the format (.png, .svg, .pdf).
        rows: One per map or difference.
        columns: What is counted, and its unit, by name of the array; their order is that of the columns.
        own_scales: Whether every panel has a scale of its own instead, which shows more of what is rare.

    Raises:
        ImportError: matplotlib is not installed.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    shape = rows[0][3][1] / rows[0][3][0]
    width, height = 4.4, 3.5 * shape + 0.9
    figure = Figure(figsize=(width * len(columns), height * len(rows)), layout="constrained")
    panels = figure.subplots(len(rows), len(columns), squeeze=False)
    bar = min(1.0, 1.2 * shape)  # as long as a panel is high
    for (label, arrays, is_difference, size_m, obstacles), line in zip(rows, panels, strict=True):
        alike = [row for row in rows if row[2] == is_difference]
        for (name, (what, unit)), axes in zip(columns.items(), line, strict=True):
            top = _map_top([arrays[name]] if own_scales else [row[1][name] for row in alike])
            low, colours, ends = (-top, "RdBu_r", "both") if is_difference else (0.0, "cividis", "max")
            image = axes.imshow(
                arrays[name], origin="lower", extent=(0, size_m[0], 0, size_m[1]), vmin=low, vmax=top, cmap=colours
            )
            for x_low, y_low, x_high, y_high in obstacles:
                axes.add_patch(Rectangle((x_low, y_low), x_high - x_low, y_high - y_low, **_OBSTACLE))
            axes.set_title(f"{_unread(label)}\n{what}", fontsize=9)
            axes.set_xlabel("x [m]", fontsize=7)
            axes.set_ylabel("y [m]", fontsize=7)
            axes.tick_params(labelsize=7)
            scale = figure.colorbar(image, ax=axes, shrink=bar, extend=ends)
            scale.set_label(f"more {unit}" if is_difference else unit, fontsize=7)
            scale.ax.tick_params(labelsize=7)
    figure.savefig(path, dpi=110)


def _map_top(arrays: Sequence[FloatArray]) -> float:
    """Return the end of the scale of maps: few squares hold most; the last percent would hide all others."""
    values = np.abs(np.concatenate([array.ravel() for array in arrays]))
    return float(np.quantile(values[values > 0], 0.99)) if values.any() else 1.0


def draw_saliency(
    path: str | Path, slices: Sequence[str], bars: Mapping[str, FloatArray], *, title: str, xlabel: str
) -> None:
    """Draw what a network looks at: a group of bars per slice of its observations, the longest on top.

    Args:
        path: File to write; its suffix chooses the format (.png, .svg, .pdf).
        slices: (S,) names.
        bars: Name of a group of robots -> (S,) lengths.
        title: Headline.
        xlabel: What the lengths are.

    Raises:
        ImportError: matplotlib is not installed.
    """
    from matplotlib.figure import Figure

    order = np.argsort(np.max([*bars.values()], axis=0), kind="stable")
    height = 0.8 / len(bars)
    figure = Figure(figsize=(7.0, 1.2 + 0.42 * len(slices)), layout="constrained")
    axes = figure.subplots()
    for index, (group, lengths) in enumerate(bars.items()):
        places = np.arange(len(slices)) + (0.5 * (len(bars) - 1) - index) * height
        axes.barh(places, lengths[order], height, color=COLOURS[index], label=f"{group} robots")
    axes.set_yticks(np.arange(len(slices)), [slices[row].replace("_", " ") for row in map(int, order)])
    axes.set(title=_unread(title), xlabel=xlabel, xlim=(0, None))
    axes.grid(alpha=0.3, axis="x")
    axes.legend(frameon=False, loc="lower right")
    figure.savefig(path, dpi=110)


def _unread(text: str) -> str:
    """Return a text that matplotlib shows as it is: without it, dollar signs in a name would begin a formula."""
    # The twin of `metrics.scoring.texts.unread`: rendering imports no measures.
    return text.replace("$", r"\$")
