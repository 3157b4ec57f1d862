"""Entries side by side: what each is worth, as a table and a figure.

board = board_of([read_entry("mine.json")])
print(board)
board.draw("board.png")
"""

from collections.abc import Mapping, Sequence
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
from .entry import Entry, TrainedIn
from .protocol import Protocol, load_protocol
from .standing import Standing, entries_of_package, standings_of

_TRAINED_IN: Mapping[TrainedIn, str] = {
    "given": "training worlds",
    "other": "other worlds, too",
    "held-out": "held-out worlds, too",
    "nothing": "not trained",
    "unknown": "not said",
}
_MOST_SHADE = 2.0
"""Share of the best scripted controller at which a cell has the darkest blue: as far above 1 as 0 is below."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Board(Answer):
    """What entries are worth, with those of the package."""

    standings: tuple[Standing, ...]
    """The highest score first."""
    protocol: Protocol

    def sheets(self) -> tuple[Sheet, ...]:
        """Return one row per entry."""
        rows = [
            {
                "entry": standing.entry.name,
                "trained in": trained_in(standing.entry),
                "trainings": trainings(standing.entry),
                "score": f"{score.value:.2f} ({score.lower:.2f} to {score.upper:.2f})",
                "worst tenth": f"{standing.worst:.2f}",
                "worlds won": f"{standing.won} of {len(self.protocol.held_out)}",
                "training worlds": f"{standing.in_training:.2f}",
            }
            for standing in self.standings
            for score in [standing.score]
        ]
        return (Sheet.of([*rows[0]], [[*row.values()] for row in rows]),)

    def draw(self, path: str | Path, *, style: FigureStyle = SCREEN) -> None:
        """Draw all entries into a picture file: their scores above, their shares of the best scripted controller below.

        Scores have their intervals; the line at 1 is the best scripted controller of each world. Below, there is a row
        per held-out world and a column per entry: blue is better than that controller, orange is worse.
        """
        n_entries, n_worlds = len(self.standings), len(self.protocol.held_out)
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
            if len(standing.by_policy) > 1:
                panel.plot(standing.by_policy, [place] * len(standing.by_policy), "|", color=COLOURS[1], markersize=10)
        panel.axvline(1.0, color="0.5", linewidth=0.8, zorder=0)
        panel.set_yticks(np.arange(len(self.standings)), self._names())
        panel.set_ylim(len(self.standings) - 0.5, -0.5)
        panel.set_xlim(left=0.0)
        panel.set_title("score with 95 % interval; orange: each training")
        panel.set_xlabel("share of the best scripted controller")
        panel.grid(visible=False, axis="y")

    def _draw_worlds(self, panel: Panel) -> None:
        worlds = self.protocol.held_out
        shares = np.column_stack([standing.by_world for standing in self.standings])
        colours = (COLOURS[1], "white", COLOURS[0])
        heat_map(panel, shares, lambda share: f"{share:.2f}", colours=colours, vmin=0.0, vmax=_MOST_SHADE)
        panel.set_yticks(np.arange(len(worlds)), [world.name for world in worlds])
        panel.set_xticks(np.arange(len(self.standings)), self._names(), rotation=20, ha="right")
        panel.set_title("share in each held-out world, mean over runs")

    def _names(self) -> list[str]:
        return [policy_words(standing.entry.name) for standing in self.standings]


def trained_in(entry: Entry) -> str:
    """Return where the policies of an entry were trained, in words."""
    return _TRAINED_IN[entry.training.worlds]


def trainings(entry: Entry) -> str:
    """Return how many trainings an entry has, and how many decisions the longest of them: "5 x 10.0M"."""
    if entry.training.worlds == "nothing":
        return ""
    decisions = entry.training.decisions
    return f"{len(entry.policies)}{'' if decisions is None else f' x {decisions / 1e6:.1f}M'}"


def board_of(entries: Sequence[Entry]) -> Board:
    """Return what entries are worth, beside those of the package; one with the name of these takes its place."""
    protocol = load_protocol()
    added = {entry.name for entry in entries}
    packaged = entries_of_package([name for name in PAPER_POLICIES if name not in added], protocol)
    standings = standings_of([*packaged, *entries], protocol)
    standings.sort(key=lambda standing: (-standing.score.value, standing.entry.name))
    return Board(standings=tuple(standings), protocol=protocol)
