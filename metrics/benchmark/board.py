"""Entries side by side: what each is worth, as a table and a figure.

board = board_of([read_entry("mine.json")])
print(board)
board.draw("board.png")
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
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
from swarm_forage_env.sheet import Answer, Sheet

from ..controllers import PAPER_POLICIES
from ..statistics import Estimate
from .entry import Entry
from .protocol import BenchmarkError, Protocol, load_protocol
from .standing import Reference, Standing, reference_of, scripted_entries, shares_of, standing_of

_MOST_SHADE = 2.0
"""Share of the best scripted controller at which a cell has the darkest blue: as far above 1 as 0 is below."""


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
        rows = [
            {
                "entry": standing.entry.name,
                "track": standing.entry.training.track,
                "score": bounded(standing.score),
                "better than the best scripted": f"{100.0 * standing.improvement.value:.0f} %",
                "worlds won": f"{standing.n_won} of {standing.n_worlds}",
                "calm": f"{standing.calm:.2f}",
                "disturbed": f"{standing.disturbed:.2f}",
                "training worlds": f"{standing.training:.2f}",
                "interference": f"{100.0 * standing.interference:.1f} %",
            }
            for standing in self.standings
        ]
        return (Sheet.of([*rows[0]], [[*row.values()] for row in rows]),)

    def draw(self, path: str | Path, *, style: FigureStyle = SCREEN) -> None:
        """Draw all entries into a picture file: their scores above, their shares of the best scripted controller below.

        Scores have their intervals; the line at 1 is the best scripted controller of each world. Below, there is a row
        per held-out world and a column per entry: blue is better than that controller, orange is worse.
        """
        n_entries, n_worlds = len(self.standings), len(self.protocol.scored)
        heights = (0.3 * n_entries + 0.9, 0.27 * n_worlds + 1.2)
        with saved_figure(path, (max(7.0, 3.6 + 1.0 * n_entries), sum(heights)), style=style) as figure:
            above, below = figure.subplots(2, 1, height_ratios=heights)
            self._draw_scores(above)
            self._draw_worlds(below)

    def _draw_scores(self, panel: Panel) -> None:
        for place, standing in enumerate(self.standings):
            score = standing.score
            panel.plot([score.lower, score.upper], [place, place], color=COLOURS[0], linewidth=3, solid_capstyle="butt")
            panel.plot(score.value, place, "o", color=COLOURS[0], markersize=7)
            panel.plot(standing.by_policy, [place] * len(standing.by_policy), "|", color=COLOURS[1], markersize=10)
        panel.axvline(1.0, color="0.5", linewidth=0.8, zorder=0)
        panel.set_yticks(np.arange(len(self.standings)), self._names())
        panel.set_ylim(len(self.standings) - 0.5, -0.5)
        panel.set_xlim(left=0.0)
        trainings = "; orange: each training" if any(standing.by_policy for standing in self.standings) else ""
        panel.set_title(f"score with 95 % interval{trainings}")
        panel.set_xlabel("share of the best scripted controller")
        panel.grid(visible=False, axis="y")

    def _draw_worlds(self, panel: Panel) -> None:
        worlds, entries = self.protocol.scored, [standing.entry for standing in self.standings]
        shares = np.array([[shares_of(entry, world, self.reference).mean() for entry in entries] for world in worlds])
        colours = (COLOURS[1], "white", COLOURS[0])
        heat_map(panel, shares, lambda share: f"{share:.2f}", colours=colours, vmin=0.0, vmax=_MOST_SHADE)
        panel.set_yticks(np.arange(len(worlds)), [world.name for world in worlds])
        panel.set_xticks(np.arange(len(entries)), self._names(), rotation=20, ha="right")
        panel.set_title("share in each held-out world, mean over runs")

    def _names(self) -> list[str]:
        return [policy_words(standing.entry.name) for standing in self.standings]


def board_of(entries: Sequence[Entry], protocol: Protocol | None = None) -> Board:
    """Return what entries are worth, and with them the scripted controllers.

    A new entry of a scripted controller is shown in place of the one in the package. All entries are compared with the
    scripted controllers of the package.

    Args:
        entries: Entries of one protocol.
        protocol: What they are entries of; default that of the package.

    Raises:
        BenchmarkError: two entries with one name, or another policy under the name of a scripted controller.
    """
    full = load_protocol()
    scripted = scripted_entries(full)
    reference = reference_of(scripted, full)
    digests = {entry.digest for entry in scripted}
    added = [entry for entry in entries if entry.digest not in digests]
    names = [entry.name for entry in added]
    for entry in added:
        if names.count(entry.name) > 1:
            raise BenchmarkError(f"Expected entries of different names, got {entry.name!r} twice.")
        if entry.name in PAPER_POLICIES and not entry.is_scripted:
            raise BenchmarkError(
                f"Expected entries with names of their own, got one of another policy with the name {entry.name!r} of "
                "a scripted controller; make it again with another --name."
            )
    standings = [standing_of(entry, reference, full) for entry in scripted if entry.name not in names]
    standings += [standing_of(entry, reference, protocol or full) for entry in added]
    standings.sort(key=lambda standing: (-standing.score.value, standing.entry.name))
    return Board(standings=tuple(standings), reference=reference, protocol=full)


def bounded(estimate: Estimate) -> str:
    """Return a score with its interval, "0.87 (0.80 to 0.93)"."""
    limits = "" if math.isnan(estimate.lower) else f" ({estimate.lower:.2f} to {estimate.upper:.2f})"
    return f"{estimate.value:.2f}{limits}"
