"""Pictures of results. Needs matplotlib (the optional extra "plots"), which is imported when something is drawn."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from swarm_forage_env.contract.types import FloatArray

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
        axes.plot(t_end_s, curve.mean, color=colour, label=_unread(curve.label), marker=marker, clip_on=False)
        axes.fill_between(t_end_s, curve.low, curve.high, color=colour, alpha=0.2, linewidth=0)
    has_band = any(np.isfinite(curve.low).any() for curve in curves)
    xlabel = f"time [s] (bands: {band})" if has_band else "time [s]"
    axes.set(title=_unread(title), xlabel=xlabel, ylabel=ylabel, xlim=(0, None), ylim=(0, None))
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    figure.savefig(path, dpi=150)


def draw_training(
    path: str | Path,
    steps: Sequence[int],
    performance: Sequence[float],
    interference: Sequence[float],
    *,
    baseline: tuple[str, float],
    stage_ends: Sequence[int],
    title: str,
    ylabel: str,
) -> None:
    """Draw how a policy did in the evaluations of its training into a picture file.

    Args:
        path: File to write; its suffix chooses the format (.png, .svg, .pdf).
        steps: (E,) decisions before each evaluation.
        performance: (E,) what the scenario counts.
        interference: (E,) mean fraction of active robots in interference.
        baseline: Name of the controller to compare with, and its performance.
        stage_ends: Decisions at which the stages of the training end.
        title: Headline.
        ylabel: What is counted, with its unit.

    Raises:
        ImportError: matplotlib is not installed.
    """
    from matplotlib.figure import Figure

    millions = np.asarray(steps) / 1e6
    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    upper.plot(millions, performance, color=COLOURS[0], marker="o", label="trained policy")
    upper.axhline(baseline[1], color=COLOURS[1], linestyle="--", label=_unread(baseline[0]))
    lower.plot(millions, interference, color=COLOURS[0], marker="o")
    upper.set(title=_unread(title), ylabel=ylabel, ylim=(0, None))
    lower.set(xlabel="million decisions of single robots (dotted: a new stage)", ylabel="interference", ylim=(0, 1))
    for axes in (upper, lower):
        axes.set_xlim(0, None)
        axes.grid(alpha=0.3)
        for end in stage_ends[:-1]:
            axes.axvline(end / 1e6, color="black", linestyle=":", linewidth=1)
    upper.legend(frameon=False)
    figure.savefig(path, dpi=150)


def draw_availability(path: str | Path, curves: Mapping[int, FloatArray], teams: Sequence[float]) -> None:
    """Draw how likely enough robots are at work over how many are needed: one panel per swarm size, one line per team.

    Args:
        path: File to write; its suffix chooses the format (.png, .svg, .pdf).
        curves: Swarm size N -> (K, N) availability of 1, 2, ..., N robots, for each of the K teams.
        teams: (K,) mean numbers of robots at work.

    Raises:
        ImportError: matplotlib is not installed.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.0 * len(curves) + 0.8, 4.0), layout="constrained")
    panels = figure.subplots(1, len(curves), sharey=True, squeeze=False)[0]
    for axes, (n_robots, lines) in zip(panels, curves.items(), strict=True):
        needed = np.arange(1, n_robots + 1)
        for index, (team, line) in enumerate(zip(teams, lines, strict=True)):
            axes.plot(needed, line, color=COLOURS[index % len(COLOURS)], label=f"mean team {team:g}", clip_on=False)
        axes.axvline(n_robots / 10.0, color="0.5", linestyle=":", linewidth=1)
        axes.set(title=f"{n_robots} robots (dotted: a tenth)", xlabel="robots needed at work", xlim=(0, n_robots))
        axes.grid(alpha=0.3)
    panels[0].set(ylabel="availability", ylim=(0, 1))
    panels[-1].legend(frameon=False)
    figure.savefig(path, dpi=150)


def draw_maps(
    path: str | Path,
    rows: Sequence[tuple[str, Mapping[str, FloatArray], bool]],
    titles: Mapping[str, str],
    size_m: tuple[float, float],
) -> None:
    """Draw maps of a floor: a row of panels per run or difference, a column per quantity.

    Args:
        path: File to write; its suffix chooses the format (.png, .svg, .pdf).
        rows: Label; arrays (ny, nx) by name, row = y from below; and whether they are differences.
        titles: Headline of each column, by name of the array; their order is that of the columns.
        size_m: Extent of the floor along x and y.

    Raises:
        ImportError: matplotlib is not installed.
    """
    from matplotlib.figure import Figure

    width, height = 4.2, 4.2 * size_m[1] / size_m[0] + 0.7
    figure = Figure(figsize=(width * len(titles), height * len(rows)), layout="constrained")
    panels = figure.subplots(len(rows), len(titles), squeeze=False)
    bar = min(1.0, 1.2 * size_m[1] / size_m[0])  # as long as a panel is high
    for (label, arrays, is_difference), line in zip(rows, panels, strict=True):
        for (name, title), axes in zip(titles.items(), line, strict=True):
            values = arrays[name]
            # Few squares hold most; the last percent would leave all others in one colour.
            top = float(np.quantile(np.abs(values[values != 0]), 0.99)) if values.any() else 1.0
            low, colours = (-top, "RdBu_r") if is_difference else (0.0, "cividis")
            image = axes.imshow(
                values, origin="lower", extent=(0, size_m[0], 0, size_m[1]), vmin=low, vmax=top, cmap=colours
            )
            axes.set_title(f"{_unread(label)}\n{title}", fontsize=9)
            axes.tick_params(labelsize=7)
            figure.colorbar(image, ax=axes, shrink=bar).ax.tick_params(labelsize=7)
    figure.savefig(path, dpi=110)


def _unread(text: str) -> str:
    """Return a text that matplotlib shows as it is: without it, dollar signs in a name would begin a formula."""
    return text.replace("$", r"\$")
