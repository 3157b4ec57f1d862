"""Entries side by side: what each is worth, as a table and a figure.

board = board_of([read_entry("mine.json")])
print(board)
board.draw("board.png")
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from swarm_forage_env._internal.wording import plain
from swarm_forage_env.rendering.figures import (
    COLOURS,
    SCREEN,
    FigureStyle,
    Panel,
    heat_map,
    looks,
    policy_words,
    saved_figure,
)
from swarm_forage_env.sheet import Answer, Sheet

from ..controllers import PAPER_POLICIES
from ..statistics import Estimate
from .entry import Entry
from .protocol import BenchmarkError, Protocol, load_protocol
from .standing import Reference, Standing, reference_of, scripted_entries, shares_of, standing_of

_MOST_SHADE = 2.0
"""Share of the best scripted controller at which a cell has the darkest blue: as far above 1 as 0 is below."""
_LINES = ("-", "--", ":")
"""Line styles that tell entries of one colour apart."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Board(Answer):
    """What entries are worth, including the scripted controllers."""

    standings: tuple[Standing, ...]
    """The highest score first."""
    reference: Reference
    """The best scripted controllers."""
    protocol: Protocol
    """The full protocol."""

    def sheets(self) -> tuple[Sheet, ...]:
        """Return one row per entry."""
        return (board_sheet(self.standings),)

    def to_mapping(self) -> dict[str, Any]:
        """Return the entries as plain values."""
        return {"entries": [_mapping(standing) for standing in self.standings]}

    def draw(self, path: str | Path, *, style: FigureStyle = SCREEN) -> None:
        """Draw scores, and shares in each world; see `draw_benchmark`."""
        draw_benchmark(self.standings, self.reference, self.protocol, path, style=style)


def board_of(entries: Sequence[Entry], protocol: Protocol | None = None) -> Board:
    """Return what entries are worth, and with them the scripted controllers.

    A new entry of a scripted controller is shown in place of the one in the package. All entries are compared with the
    scripted controllers of the package.

    Args:
        entries: Entries of one protocol.
        protocol: What they are entries of; default that of the package.

    Raises:
        BenchmarkError: two entries with one name, or another policy under the name of a scripted
            controller.
    """
    full = load_protocol()
    scripted = scripted_entries(full)
    reference = reference_of(scripted, full)
    digests = {entry.digest for entry in scripted}
    added = [entry for entry in entries if entry.digest not in digests]
    counts = Counter(entry.name for entry in added)
    twice = [name for name, count in counts.items() if count > 1]
    if twice:
        raise BenchmarkError(f"Expected entries of different names, got {twice[0]!r} twice.")
    foreign = [entry.name for entry in added if entry.name in PAPER_POLICIES and not entry.is_scripted]
    if foreign:
        raise BenchmarkError(
            f"Expected entries with names of their own, got one of another policy with the name {foreign[0]!r} of a "
            "scripted controller; make it again with another --name."
        )
    standings = [standing_of(entry, reference, full) for entry in scripted if entry.name not in counts]
    standings += [standing_of(entry, reference, protocol or full) for entry in added]
    return Board(standings=tuple(sorted_standings(standings)), reference=reference, protocol=full)


def sorted_standings(standings: Sequence[Standing]) -> list[Standing]:
    """Return standings, the highest score first."""
    return sorted(standings, key=lambda standing: (-standing.score.value, standing.entry.name))


def board_sheet(standings: Sequence[Standing]) -> Sheet:
    """Return one row per entry."""
    header = (
        "entry",
        "track",
        "score",
        "better than the best scripted",
        "worlds won",
        "gap",
        "calm",
        "disturbed",
        "training worlds",
        "interference",
    )
    rows = [
        (
            standing.entry.name,
            standing.entry.training.track,
            bounded(standing.score),
            percent_of(standing.improvement.value),
            f"{standing.n_won} of {standing.n_worlds}",
            share(standing.gap),
            share(standing.calm),
            share(standing.disturbed),
            share(standing.training),
            percent_of(standing.interference, 1),
        )
        for standing in standings
    ]
    return Sheet.of(header, rows)


def bounded(estimate: Estimate) -> str:
    """Return a score with its interval, "0.87 (0.80 to 0.93)"."""
    if math.isnan(estimate.lower):
        return share(estimate.value)
    return f"{share(estimate.value)} ({share(estimate.lower)} to {share(estimate.upper)})"


def share(value: float) -> str:
    """Return a share of the best scripted controller, with two decimals; a dash where there is none."""
    return "-" if math.isnan(value) else f"{value:.2f}"


def percent_of(value: float, decimals: int = 0) -> str:
    """Return a share in percent, with so many decimals."""
    return "-" if math.isnan(value) else f"{100.0 * value:.{decimals}f} %"


def _mapping(standing: Standing) -> dict[str, Any]:
    return {
        "name": standing.entry.name,
        "track": standing.entry.training.track,
        "score": _bounds(standing.score),
        "improvement": _bounds(standing.improvement),
        "optimality_gap": plain(standing.gap),
        "worlds_won": standing.n_won,
        "worlds": standing.n_worlds,
        "calm": plain(standing.calm),
        "disturbed": plain(standing.disturbed),
        "training_worlds": plain(standing.training),
        "interference": plain(standing.interference),
        "by_policy": [plain(value) for value in standing.by_policy],
        "worlds_won_by_policy": [*standing.won_by_policy],
    }


def _bounds(estimate: Estimate) -> list[float | None]:
    return [plain(estimate.value), plain(estimate.lower), plain(estimate.upper)]


def draw_benchmark(
    standings: Sequence[Standing],
    reference: Reference,
    protocol: Protocol,
    path: str | Path,
    *,
    style: FigureStyle = SCREEN,
) -> None:
    """Draw all entries into a picture file: their scores, their performance profiles, and their shares in each world.

    Above on the left, the score of each entry with its interval; the line at 1 is the best scripted controller of each
    world. On the right, how many of the runs in held-out worlds reach each share of that controller. Below, a row per
    held-out world and a column per entry: blue is better than that controller, orange is worse.

    Args:
        standings: All entries.
        reference: The best scripted controllers.
        protocol: The protocol of the entries.
        path: File to write; raises as `saved_figure`.
        style: Style of the figure.
    """
    ranked = sorted_standings(standings)
    n_worlds = len(protocol.scored)
    heights = (0.5 * len(ranked) + 0.9, 0.27 * n_worlds + 1.2)
    with saved_figure(path, (max(7.0, 3.6 + 1.0 * len(ranked)), sum(heights)), style=style) as figure:
        panels: dict[str, Panel] = figure.subplot_mosaic(
            [["scores", "profiles"], ["worlds"] * 2], height_ratios=heights
        )
        _draw_scores(panels["scores"], ranked)
        _draw_profiles(panels["profiles"], ranked, reference, protocol)
        _draw_worlds(panels["worlds"], ranked, reference, protocol)


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
    trainings = "; orange: each training" if any(standing.by_policy for standing in ranked) else ""
    panel.set_title(f"score with 95 % interval{trainings}")
    panel.set_xlabel("share of the best scripted controller")
    panel.grid(visible=False, axis="y")


def _draw_profiles(panel: Panel, ranked: Sequence[Standing], reference: Reference, protocol: Protocol) -> None:
    thresholds = np.linspace(0.0, _MOST_SHADE, 201)
    drawn: Counter[str] = Counter()  # there are more entries than colours
    for look, standing in zip(looks(standing.entry.name for standing in ranked), ranked, strict=True):
        shares = [shares_of(standing.entry, world, reference).ravel() for world in protocol.scored]
        profile = (np.concatenate(shares) > thresholds[:, None]).mean(axis=1)
        style = _LINES[drawn[look.colour] % len(_LINES)]
        drawn[look.colour] += 1
        panel.plot(thresholds, profile, style, color=look.colour, label=look.name)
    panel.axvline(1.0, color="0.5", linewidth=0.8, zorder=0)
    panel.set_title("share of the runs that achieve more")
    panel.set_xlabel("share of the best scripted controller")
    panel.set_ylim(0.0, 1.02)
    panel.legend(fontsize="x-small")


def _draw_worlds(panel: Panel, ranked: Sequence[Standing], reference: Reference, protocol: Protocol) -> None:
    worlds = protocol.scored
    shares = np.array([[shares_of(standing.entry, world, reference).mean() for standing in ranked] for world in worlds])
    heat_map(panel, shares, share, colours=(COLOURS[1], "white", COLOURS[0]), vmin=0.0, vmax=_MOST_SHADE)
    panel.set_yticks(np.arange(len(worlds)), [world.name for world in worlds])
    names = [policy_words(standing.entry.name) for standing in ranked]
    panel.set_xticks(np.arange(len(ranked)), names, rotation=20, ha="right")
    panel.set_title("share in each held-out world, mean over runs")
