"""The figure of the benchmark. It needs matplotlib (the optional extra "plots")."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from swarm_forage_env.rendering.figures import (
    COLOURS,
    SCREEN,
    FigureStyle,
    Panel,
    heat_map,
    policy_words,
    saved_figure,
)

from .page import share, sorted_standings
from .protocol import Protocol
from .standing import Reference, Standing, shares_of

_MOST_SHADE = 2.0
"""Share of the best scripted controller from which a cell is as blue as it gets: as far from 1 as nothing is."""


def draw_benchmark(
    standings: Sequence[Standing],
    reference: Reference,
    protocol: Protocol,
    path: str | Path,
    *,
    style: FigureStyle = SCREEN,
) -> None:
    """Draw all entries into a picture file: their scores, and their shares in each world.

    Above, the score of each entry with its interval; the line at 1 is the best scripted controller of each world.
    Below, a row per held-out world and a column per entry: blue is better than that controller, orange is worse.

    Args:
        standings: All entries.
        reference: The best scripted controllers.
        protocol: What they are entries of.
        path: File to write; as in `saved_figure`, whose errors this has.
        style: Of the figure.
    """
    ranked = sorted_standings(standings)
    n_worlds = len(protocol.scored)
    heights = (0.5 * len(ranked) + 0.9, 0.27 * n_worlds + 1.2)
    with saved_figure(path, (max(7.0, 3.6 + 1.0 * len(ranked)), sum(heights)), style=style) as figure:
        above, below = figure.subplots(2, 1, height_ratios=heights)
        _draw_scores(above, ranked)
        _draw_worlds(below, ranked, reference, protocol)


def _draw_scores(panel: Panel, ranked: Sequence[Standing]) -> None:
    places = np.arange(len(ranked))
    for place, standing in zip(places, ranked, strict=True):
        score = standing.score
        panel.plot([score.lower, score.upper], [place, place], color=COLOURS[0], linewidth=3, solid_capstyle="butt")
        panel.plot(score.value, place, "o", color=COLOURS[0], markersize=7)
        panel.plot(standing.by_policy, [place] * len(standing.by_policy), "|", color=COLOURS[1], markersize=10)
    panel.axvline(1.0, color="0.5", linewidth=0.8, zorder=0)
    panel.set_yticks(places, [policy_words(standing.entry.name) for standing in ranked])
    panel.set_ylim(len(ranked) - 0.5, -0.5)
    panel.set_xlim(left=0.0)
    seeds = "; orange: each training seed" if any(standing.by_policy for standing in ranked) else ""
    panel.set_title(f"score: share of the best scripted controller, interquartile mean and 95 % interval{seeds}")
    panel.grid(visible=False, axis="y")


def _draw_worlds(panel: Panel, ranked: Sequence[Standing], reference: Reference, protocol: Protocol) -> None:
    worlds = protocol.scored
    shares = np.array([[shares_of(standing.entry, world, reference).mean() for standing in ranked] for world in worlds])
    heat_map(panel, shares, share, colours=(COLOURS[1], "white", COLOURS[0]), vmin=0.0, vmax=_MOST_SHADE)
    panel.set_yticks(np.arange(len(worlds)), [world.name for world in worlds])
    names = [policy_words(standing.entry.name) for standing in ranked]
    panel.set_xticks(np.arange(len(ranked)), names, rotation=20, ha="right")
    panel.set_title("share in each held-out world, mean over runs")
