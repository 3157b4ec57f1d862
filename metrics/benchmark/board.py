"""Entries side by side: what each is worth, as a table, a figure, and the page of the benchmark.

board = board_of([read_entry("mine.json", protocol)], protocol)
print(board)
board.write_page("docs/benchmark.md", "docs/images/benchmark.png")
"""

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swarm_forage_env._internal.files import replacing
from swarm_forage_env._internal.wording import plain
from swarm_forage_env.rendering.figures import SCREEN, FigureStyle
from swarm_forage_env.runs.answer import Answer, Sheet

from ..controllers import PAPER_POLICIES
from ..statistics import Estimate
from .entry import Entry
from .figure import draw_benchmark
from .page import board_sheet, details_page, page_block, sorted_standings, with_block
from .protocol import BenchmarkError, Protocol, load_protocol
from .standing import Reference, Standing, reference_of, scripted_entries, standing_of


@dataclass(frozen=True, kw_only=True, eq=False)
class Board(Answer):
    """What entries are worth, the scripted controllers among them."""

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

    def write_page(self, page: str | Path, picture: str | Path) -> tuple[Path, ...]:
        """Write the generated part of a page, its figure, and the page of details beside it.

        Returns:
            What was written.

        Raises:
            BenchmarkError: a page without the marks.
            OSError: the page cannot be read, or a file cannot be written.
        """
        page, picture = Path(page), Path(picture)
        before = page.read_text(encoding="utf-8")
        link = Path(os.path.relpath(picture, page.parent)).as_posix()
        details = page.with_name(f"{page.stem}_in_detail{page.suffix}")
        text = with_block(before, page_block(self.standings, self.protocol, link, details.name), str(page))
        in_detail = details_page(self.standings, self.reference, self.protocol, page.name)
        self.draw(picture)
        for file, content in ((details, in_detail), (page, text)):
            with replacing(file) as draft:
                draft.write_text(content, encoding="utf-8")
        return page, details, picture


def board_of(entries: Sequence[Entry], protocol: Protocol | None = None) -> Board:
    """Return what entries are worth, and what the scripted controllers are beside them.

    An entry of a scripted controller that was made again is shown in place of the one that comes with the package. All
    are held against those that come with the package.

    Args:
        entries: All of one protocol.
        protocol: Default the full one of the latest version.

    Raises:
        BenchmarkError: two entries of one name, or one with the name of a scripted controller that is none of it.
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


def entry_files(given: Sequence[Path]) -> list[Path]:
    """Return entry files; a folder stands for those in it, in the order of their names."""
    return [file for path in given for file in (sorted(path.glob("*.json")) if path.is_dir() else [path])]


def _mapping(standing: Standing) -> dict[str, Any]:
    return {
        "name": standing.entry.name,
        "score": _bounds(standing.score),
        "improvement": _bounds(standing.improvement),
        "worlds_won": standing.n_won,
        "worlds": standing.n_worlds,
        "calm": plain(standing.calm),
        "disturbed": plain(standing.disturbed),
        "training_worlds": plain(standing.training),
        "groups": {name: plain(value) for name, value in standing.groups.items()},
        "interference": plain(standing.interference),
        "by_policy": [plain(value) for value in standing.by_policy],
    }


def _bounds(estimate: Estimate) -> list[float | None]:
    return [plain(estimate.value), plain(estimate.lower), plain(estimate.upper)]
