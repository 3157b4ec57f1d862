"""Pictures of scores. They need matplotlib (the optional extra "plots")."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import polars as pl

from swarm_forage_env.rendering.figures import (
    SCREEN,
    FigureStyle,
    Look,
    Panel,
    looks,
    saved_panels,
)
from swarm_forage_env.wrappers.world import SIZE

from ..claims.contrast import MIN_RUNS
from ..curves import FloatArray
from .frame import label_of, words_of
from .measures import MEASURES, PICTURED
from .run_curves import NOISE, POPULATION, THROTTLE

FEWEST_RUNS = MIN_RUNS
"""Fewer runs are drawn without an interval: they decide nothing, and that of two runs reaches nine standard deviations
to either side, which would leave nothing else to be seen."""
X_LABELS = {
    SIZE: "robots N",
    THROTTLE: "distance from ideal conditions (amplitude)",
    NOISE: "standard deviation of the noise",
    POPULATION: "level of population dynamics",
}
_ASIDE, _MOST_ASIDE = 0.04, 0.1
"""Distance between policies at one level, and of the outer ones from the level at most; levels are 1 apart."""


def draw_scores(summary: pl.DataFrame, path: str | Path, *, title: str = "", style: FigureStyle = SCREEN) -> None:
    """Draw scores into a picture file: one panel per measure, one line per policy.

    Amounts and distances are drawn relative to performance, where they have such values: a swarm that does little has
    little to lose. Error bars are the intervals of the tables; below its dotted line, the noise floor, a distance says
    nothing; hollow marks are values that mislead. The measures are those of `PICTURED`, or all where only some were
    scored. Measures that are computed without runs (availability) and values that are not finite are left out.

    Args:
        summary: From `summarized`.
        path: File to write; as in `saved_figure`, whose errors this has.
        title: What was scored.
        style: Of the figure.

    Raises:
        ValueError: there is no score that can be drawn.
    """
    has_shares = pl.col("relative").is_finite().any().over("measure", "variant", "form")
    drawn = summary.filter(pl.col("runs") > 0).with_columns(is_relative=has_shares)
    drawn = drawn.with_columns(
        y=pl.when("is_relative").then("relative").otherwise("mean"),
        top=pl.when("is_relative").then("relative_upper").otherwise("upper"),
        ground=pl.when("is_relative").then("relative_floor").otherwise("floor"),
    ).filter(pl.col("y").is_finite())
    if set(drawn["measure"]) >= {*PICTURED}:
        drawn = drawn.filter(pl.col("measure").is_in(PICTURED))
    if drawn.is_empty():
        raise ValueError("Expected a score to draw, got none with a finite value from runs.")
    policies = drawn["policy"].unique(maintain_order=True).to_list()
    step = min(_ASIDE, 2.0 * _MOST_ASIDE / max(len(policies) - 1, 1))
    steps = step * (np.arange(len(policies)) - 0.5 * (len(policies) - 1))
    of_look = [*zip(policies, looks(policies), steps.tolist(), strict=True)]
    groups = drawn.partition_by("measure", "variant", "form", maintain_order=True)
    floors = "; dotted: noise floor" if drawn["ground"].count() else ""
    hollow = "; hollow: misleads" if drawn["misleads"].any() else ""
    about = f"{title + ': ' if title else ''}means; {about_intervals(drawn['runs'].to_list(), 'bars')}{floors}{hollow}"
    with saved_panels(path, len(groups), (3.4, 2.8), title=about, style=style) as panels:
        for rows, panel in zip(groups, panels, strict=True):
            _draw_panel(panel, rows, of_look)


def interval_words(n_runs: Sequence[int]) -> str:
    """Return what stands behind ±, of means over so many runs; of few, why it is wide."""
    most = max(n_runs, default=0)
    if most < 2:
        return "one seed, so no interval"
    if most < FEWEST_RUNS:
        return f"± 95% t interval over {most} seeds, wide because so few say little (make {FEWEST_RUNS} or more)"
    return "± 95% t interval over seeds"


def about_intervals(n_runs: Sequence[int], called: str) -> str:
    """Return what the bars or bands around means over so many runs are, and where there are none."""
    few = f"fewer than {FEWEST_RUNS} runs"
    if max(n_runs) < FEWEST_RUNS:
        return f"no {called}: {few}"
    return f"{called}: 95 % interval over seeds" + (f", none of {few}" if min(n_runs) < FEWEST_RUNS else "")


def _draw_panel(panel: Panel, rows: pl.DataFrame, of_look: Sequence[tuple[str, Look, float]]) -> None:
    first = rows.row(0, named=True)
    measure = MEASURES[first["measure"]]
    places = sorted(set(rows["x"]))
    for policy, look, aside in of_look:
        mine = rows.filter(policy=policy)
        x = np.array([places.index(place) for place in mine["x"]]) + aside  # levels are categories
        if len(mine):
            _draw_policy(panel, mine, x, look)
    if measure.neutral is not None and not measure.is_distance and first["variant"] == "corrected":
        panel.axhline(measure.neutral, color="0.6", linewidth=0.8, zorder=0)
    name = words_of(label_of(first["measure"], first["variant"], first["form"]))
    panel.set_title(f"{name} ({measure.better} is better)")
    panel.set_ylabel("share of performance" if first["is_relative"] else first["unit"])
    panel.set_xlabel(X_LABELS[measure.varies])
    distance = dict(rows.select("x", "distance").drop_nulls().iter_rows())
    texts = [f"{distance[place]:.3g} ({place:.3g})" if place in distance else f"{place:.3g}" for place in places]
    panel.set_xticks(range(len(places)), texts)
    panel.set_xlim(-0.5, len(places) - 0.5)


def _draw_policy(panel: Panel, rows: pl.DataFrame, x: FloatArray, look: Look) -> None:
    has_bar = pl.col("top").is_finite() & (pl.col("runs") >= FEWEST_RUNS)
    half = rows.select(pl.when(has_bar).then(pl.col("top") - pl.col("y")).otherwise(0.0)).to_series()
    style = {"color": look.colour, "marker": look.marker}
    panel.errorbar(x, rows["y"], yerr=half.to_list(), label=look.name, **style)
    hollow = rows["misleads"].to_numpy()
    if hollow.any():
        panel.plot(x[hollow], rows["y"].to_numpy()[hollow], markerfacecolor="w", linestyle="", **style)
    if rows["ground"].count():
        panel.plot(x, rows["ground"], color=look.colour, linestyle=":", linewidth=1.0, zorder=1)
