"""What laws and a mean-field model say of swarms beside what they do: tables and a picture for docs/laws.md.

    swarm-forage study run docs/laws.toml --out results/laws
    python scripts/laws_beside_data.py results/laws                 write the blocks of the page, and its picture
    python scripts/laws_beside_data.py results/laws --out FOLDER    the same in a copy of the page

Takes the first line of any study of swarm sizes that the model holds for. The model knows swarms of one robot and of
the smallest other size that delivered enough. Needs the plots extra.
"""

import argparse
import math
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from metrics import ForagingRates, Ladder, Summary, aggregate, fit_ladder
from metrics.laws import LAW_WORDS, SYMBOLS
from metrics.scoring.run_curves import study_lines
from metrics.scoring.study_models import DRAWN_LAWS, ForagingRuns, foraging_runs
from swarm_forage_env.rendering.figures import COLOURS, Panel, legend_below, log_height, saved_figure, shade, size_axis
from swarm_forage_env.studies.study_table import read_study

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGE, PICTURE = "laws.md", "images/laws.png"
BLOCK = re.compile(
    r"(<!-- generated: laws\.(?P<name>\w+) by scripts/laws_beside_data\.py -->).*?(<!-- end -->)", re.DOTALL
)
N_RESAMPLES = 100
SEED = 1
"""Fixed, so that the same runs give the same intervals."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Beside:
    """Runs, laws and the model."""

    runs: ForagingRuns
    small: int
    rates: ForagingRates
    ladder: Ladder
    at: np.ndarray
    """Swarm sizes at which the model is solved: those of the runs, and between them, (K,)."""
    model: np.ndarray
    """Deliveries and share of time lost, (K, 2)."""
    bounds: np.ndarray
    """Of their 95 % intervals, (2, K, 2)."""

    @property
    def sizes(self) -> list[int]:
        """Those that were run."""
        return list(self.runs.columns)

    def delivered(self, size: int) -> Summary:
        """Objects delivered, over runs."""
        return aggregate(self.runs.columns[size]["collected"].sum(axis=-1))

    def lost(self, size: int) -> Summary:
        """Share of robot time that is lost, over runs."""
        return aggregate(self.runs.columns[size]["interference_fraction"].mean(axis=-1))


def beside(runs: ForagingRuns) -> Beside:
    """Fit laws to all sizes, and continue the model from small swarms.

    Raises:
        ValueError: too few objects were delivered to estimate rates, or too few sizes for laws.
    """
    sizes, small = list(runs.columns), runs.small
    if small is None:
        raise ValueError("Expected a swarm of two robots or more that delivered 50 objects in all runs, got none.")
    at = np.unique([*sizes, *(round(math.sqrt(low * high)) for low, high in pairwise(sizes))])
    rng = np.random.default_rng(SEED)
    rates = runs.rates(small)
    spread = np.array([runs.predicted(runs.rates(small, rng), at.tolist()) for _ in range(N_RESAMPLES)])
    return Beside(
        runs=runs,
        small=small,
        rates=rates,
        ladder=fit_ladder(sizes, [columns["collected"].sum(axis=-1) for columns in runs.columns.values()], seed=SEED),
        at=at,
        model=runs.predicted(rates, at.tolist()),
        bounds=np.quantile(spread, [0.025, 0.975], axis=0),
    )


def kinds_lines() -> Iterator[str]:
    """Yield the table of what laws say."""
    yield "| law | P(N) | largest at | what it says |"
    yield "|---|---|---|---|"
    for name, words in LAW_WORDS.items():
        yield f"| `{name}` | {words.formula} | {words.largest_at} | {words.says} |"


def size_lines(found: Beside) -> Iterator[str]:
    """Yield the table of sizes: measured and by the model, and the two rates that the model takes to be constant."""
    yield "| robots | runs | delivered | mean field | time lost, % | mean field | finds per 1,000 s searched | s home |"
    yield "|--:|--:|---|---|---|---|--:|--:|"
    for size in found.sizes:
        k = int(np.searchsorted(found.at, size))
        totals, lost, own = found.delivered(size), found.lost(size), found.runs.rates(size)
        (delivered, share), (low, high) = found.model[k], found.bounds[:, k]
        yield (
            f"| {size} | {totals.n_used} | {totals.mean:.1f} ± {totals.upper - totals.mean:.1f} "
            f"| {delivered:.1f} ({low[0]:.1f} to {high[0]:.1f}) "
            f"| {100 * lost.mean:.2f} ± {100 * (lost.upper - lost.mean):.2f} "
            f"| {100 * share:.2f} ({100 * low[1]:.2f} to {100 * high[1]:.2f}) "
            f"| {1000 * own.finding * found.runs.n_objects:.3f} | {own.homing_s:.0f} |"
        )


def law_lines(ladder: Ladder) -> Iterator[str]:
    """Yield the table of fitted laws: parameters, critical size and error."""
    yield "| law | parameters | largest at | error |"
    yield "|---|---|---|--:|"
    for name, fit in ladder.laws.items():
        parameters = ", ".join(
            f"{SYMBOLS[field]} = {found.value:.3g} ({found.lower:.3g} to {found.upper:.3g})"
            for field, found in fit.parameters.items()
        )
        peak = fit.peak
        place = "-" if math.isinf(peak.lower) else f"{peak.value:.3g} ({peak.lower:.3g} to {peak.upper:.3g})"
        yield f"| `{name}` | {parameters} | {place} | {fit.error:.3f} |"
    b = ladder.exponent
    yield ""
    yield f"Exponent up to the best size: {b.value:.3f} ({b.lower:.3f} to {b.upper:.3f}), {ladder.scaling}."


def draw(found: Beside, path: Path) -> None:
    """Draw deliveries, deliveries per robot and time lost over the swarm size."""
    words = (f"objects delivered in {found.runs.horizon_s:,.0f} s", "objects delivered per robot", "robot time lost, %")
    sizes, at = np.array(found.sizes), found.at
    measured = [found.delivered(size) for size in sizes]
    with saved_figure(path, (12.6, 4.2)) as figure:
        total, each, lost = figure.subplots(1, 3)
        for panel, word in zip((total, each, lost), words, strict=True):
            size_axis(panel, sizes)
            panel.set_ylabel(word)
        for panel, divisor, of_curves in ((total, np.ones(sizes.size), np.ones(at.size)), (each, sizes, at)):
            for name, colour in zip(DRAWN_LAWS, COLOURS[1:], strict=False):
                law = found.ladder.laws[name].law
                panel.plot(at, law.performance(at) / of_curves, "--", color=colour, linewidth=1.2, label=f"law: {name}")
            panel.plot(
                at,
                found.model[:, 0] / of_curves,
                color=COLOURS[0],
                label=f"mean field, from 1 and {found.small} robots",
            )
            low, high = found.bounds[:, :, 0] / of_curves
            shade(panel, at, low, high, COLOURS[0])
            _draw_runs(panel, sizes, measured, 1.0 / divisor)
        lost.plot(at, 100 * found.model[:, 1], color=COLOURS[0])
        low, high = 100 * found.bounds[:, :, 1]
        shade(lost, at, low, high, COLOURS[0])
        _draw_runs(lost, sizes, [found.lost(size) for size in sizes], np.full(sizes.size, 100.0))
        log_height(total)
        total.yaxis.set_major_formatter("{x:g}")
        each.set_ylim(bottom=0.0)
        lost.set_ylim(bottom=0.0)
        legend_below(figure)


def _draw_runs(panel: Panel, sizes: np.ndarray, seen: list[Summary], factor: np.ndarray) -> None:
    mean = factor * [summary.mean for summary in seen]
    half = factor * [summary.upper - summary.mean for summary in seen]
    panel.errorbar(sizes, mean, yerr=half, fmt="ko", label="runs, mean and 95 % interval")


def main() -> int:
    """Write the blocks and the picture; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("place", type=Path, metavar="DIR|FILE", help="a study of swarm sizes")
    parser.add_argument("--out", type=Path, default=DOCS, metavar="FOLDER", help="default docs")
    chosen = parser.parse_args()
    try:
        table = read_study(chosen.place)
        runs = foraging_runs(table, study_lines(table)[0])
        if runs is None:
            raise ValueError(f"Expected a study of swarm sizes without caches, got {table.spec.name}.")
        found = beside(runs)
    except ValueError as error:
        print(f"laws_beside_data: {error}", file=sys.stderr)
        return 2
    n_runs = {len(columns["collected"]) for columns in runs.columns.values()}
    about = (
        f"Swarms of {min(found.sizes)} to {max(found.sizes)} {table.spec.policies[0].label.upper()} robots, "
        f"{runs.n_objects} objects, {runs.horizon_s:,.0f} s, {' or '.join(map(str, sorted(n_runs)))} runs each. The "
        f"model uses only the runs of one and of {found.small} robots. Intervals are 95 %; those of the model are from "
        "resampled runs of these two sizes."
    )
    blocks = {
        "kinds": [*kinds_lines()],
        "about": [about],
        "sizes": [*size_lines(found)],
        "laws": [*law_lines(found.ladder)],
    }
    page = (DOCS / PAGE).read_text(encoding="utf-8")
    text = BLOCK.sub(lambda match: "\n".join([match[1], "", *blocks[match["name"]], "", match[3]]), page)
    (chosen.out / PICTURE).parent.mkdir(parents=True, exist_ok=True)
    (chosen.out / PAGE).write_text(text, encoding="utf-8")
    draw(found, chosen.out / PICTURE)
    print(f"written {chosen.out / PAGE} and {chosen.out / PICTURE}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
