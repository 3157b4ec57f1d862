"""The page of the benchmark: tables of all entries, written between two marks of a Markdown file.

What is wide and long, every world and every measure, is a page of its own, `details_page`.
"""

import math
import re
from collections.abc import Iterable, Sequence

from swarm_forage_env._internal.wording import number, percent
from swarm_forage_env.runs.answer import Sheet

from ..controllers import PAPER_POLICIES
from ..statistics import Estimate
from .entry import Entry, EntryMeasure
from .pairs import pairs_sheet
from .protocol import BenchmarkError, Protocol, scenario_fields
from .standing import Reference, Standing, improvements, measure_mean

BEGIN = "<!-- generated: swarm-forage benchmark page -->"
END = "<!-- end of entries -->"
_BLOCK = re.compile(re.escape(BEGIN) + r".*?" + re.escape(END), re.DOTALL)
_TRAINED = {"given": "training worlds", "other": "also other worlds", "nothing": "not trained", "unknown": "not said"}
"""`Training.worlds` -> words of the table."""
_COORDINATION = (
    "### What coordination brings\n\nEach cell says how much better the entry is in a world than in the same world "
    "without, with its 95 % interval, and the two performances per 1,000 s. Runs with the same seed are compared with "
    "each other.\n\n"
)
_ALL_MEASURES = "## All measures\n\nMeans over runs; amounts and distances as shares of performance.\n\n"
_MEASURES = (
    "### Measure by measure\n\nEach cell counts the rows of a measure in which the entry is at least as good as the "
    "best of the paper's four controllers. Amounts and distances are compared as shares of performance.\n\n"
)
MATCHED = (
    "spatial_emergence",
    "task_emergence",
    "scalability",
    "reactivity",
    "adaptability",
    "noise_robustness",
    "population_robustness",
)
"""Measures of which the page says how often an entry is as good as the best scripted controller."""


def sorted_standings(standings: Sequence[Standing]) -> list[Standing]:
    """Return standings, the highest score first."""
    return sorted(standings, key=lambda standing: (-standing.score.value, standing.entry.name))


def board_sheet(standings: Sequence[Standing]) -> Sheet:
    """Return one row per entry; with its track where there are tracks."""
    has_tracks = any(standing.entry.training.track for standing in standings)
    header = (
        "entry",
        *(("track",) if has_tracks else ()),
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
            *((standing.entry.training.track,) if has_tracks else ()),
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
    return Sheet(header=header, rows=rows)


def page_block(standings: Sequence[Standing], protocol: Protocol, picture: str = "", details: str = "") -> str:
    """Return the generated part of the page.

    Args:
        standings: All entries.
        protocol: What they are entries of.
        picture: Path of the figure as the page links it; empty for none.
        details: Path of `details_page` as the page links it; empty for none.
    """
    ranked = sorted_standings(standings)
    entries = [standing.entry for standing in ranked]
    n_runs = len(protocol.scored) * len(protocol.seeds)
    has_measures = any(entry.measures for entry in entries)
    parts = [
        f"Version {protocol.version} has {len(protocol.scored)} held-out worlds and {len(protocol.seeds)} seeds, so "
        f"{n_runs} runs of {protocol.horizon_s:,g} s count for each policy.",
        board_sheet(ranked).markdown(),
        *([f"![Scores of all entries, and their shares in each world]({picture})"] if picture else []),
        *([f"All numbers, world by world and measure by measure: [{details}]({details})."] if details else []),
        "### How each was made\n\n" + _origins(entries).markdown(),
        "These commands repeat them:\n\n" + _commands(entries),
        "### Group by group\n\n" + _groups(ranked, protocol).markdown(),
        *([_COORDINATION + pairs_sheet(entries, protocol).markdown()] if protocol.pairs else []),
        *([_MEASURES + matched(entries).markdown()] if has_measures else []),
        "### One against the other\n\nHow often a run of the row's entry is better than a run of the column's entry in "
        "the same world.\n\n" + _duels(entries, protocol).markdown(),
    ]
    return f"{BEGIN}\n\n" + "\n\n".join(parts) + f"\n\n{END}"


def details_page(standings: Sequence[Standing], reference: Reference, protocol: Protocol, page: str) -> str:
    """Return the page of all worlds and measures, which is generated as a whole.

    Args:
        standings: All entries.
        reference: The best scripted controllers.
        protocol: What they are entries of.
        page: Path of the page of the benchmark, as this one links it.
    """
    entries = [standing.entry for standing in sorted_standings(standings)]
    has_measures = any(entry.measures for entry in entries)
    of_version = "" if protocol.version == 1 else f", version {protocol.version}"
    parts = [
        f"# Benchmark in detail{of_version}",
        f"The numbers behind the [benchmark]({page}), the entry with the highest score first. `swarm-forage benchmark "
        "page` writes this page.",
        "## World by world\n\nPerformance per 1,000 s, mean over runs; the best of all entries is bold.\n\n"
        + _worlds(entries, reference, protocol).markdown(),
        *([_ALL_MEASURES + _measures(entries).markdown()] if has_measures else []),
    ]
    return "\n\n".join(parts) + "\n"


def with_block(text: str, block: str, where: str) -> str:
    """Return a page with another generated part.

    Raises:
        BenchmarkError: the page does not have the two marks once.
    """
    if len(_BLOCK.findall(text)) != 1:
        raise BenchmarkError(f"Expected one part between {BEGIN} and {END} in {where}; write these two lines into it.")
    return _BLOCK.sub(lambda _: block, text)


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


def _origins(entries: Sequence[Entry]) -> Sheet:
    has_tracks = any(entry.training.track for entry in entries)
    header = (
        "entry",
        "trained in",
        *(("decisions of a training",) if has_tracks else ()),
        "library",
        "training seeds",
        "core-hours of training",
        "core-hours of its runs",
        "runs made by version",
    )
    rows = [
        (
            entry.name,
            _TRAINED[entry.training.worlds],
            *((_decisions(entry),) if has_tracks else ()),
            entry.training.library or "-",
            ", ".join("-" if p.training_seed is None else str(p.training_seed) for p in entry.policies),
            "-" if entry.training.core_hours is None else number(entry.training.core_hours),
            "-" if entry.core_hours is None else number(entry.core_hours),
            entry.versions.get("swarm-forage-env", "-"),
        )
        for entry in entries
    ]
    return Sheet(header=header, rows=rows)


def _decisions(entry: Entry) -> str:
    return "-" if entry.training.decisions is None else f"{entry.training.decisions:,}"


def _commands(entries: Sequence[Entry]) -> str:
    """What to type for each entry, its training first, as a block of code that no text of an entry can end."""
    lines = [
        line for entry in entries for line in (f"# {entry.name}", entry.training.command, entry.command) if line.strip()
    ]
    return "\n".join(["```bash", *(" ".join(line.replace("```", "").split()) for line in lines), "```"])


def _groups(ranked: Sequence[Standing], protocol: Protocol) -> Sheet:
    names = [group.name for group in protocol.groups]
    several = any(standing.by_policy for standing in ranked)
    header = ("entry", *names, *(("score of each training", "worlds won by each") if several else ()))
    rows = [
        (
            standing.entry.name,
            *(share(standing.groups[name]) for name in names),
            *(_of_each(map(share, standing.by_policy)) if several else ()),
            *(_of_each(map(str, standing.won_by_policy)) if several else ()),
        )
        for standing in ranked
    ]
    return Sheet(header=header, rows=rows)


def _of_each(numbers: Iterable[str]) -> tuple[str]:
    return (", ".join(numbers) or "-",)


def matched(entries: Sequence[Entry]) -> Sheet:
    """Return how many rows of each measure an entry is at least as good in as the best of the scripted controllers.

    Args:
        entries: Of one version, the scripted controllers among them.
    """
    scripted = [entry for entry in entries if entry.name in PAPER_POLICIES]
    best: dict[tuple[str, str, str], float] = {}
    for entry in scripted:
        for measure in entry.measures:
            best[measure.key] = max(best.get(measure.key, -math.inf), _goodness(measure))  # NaN is never the larger
    compared = [label for label in MATCHED if any(key[1] == label for key in best)]
    rows: list[tuple[str, ...]] = []
    for entry in entries:
        won = {label: [0, 0] for label in compared}
        for measure in entry.measures:
            if measure.label in won and measure.key in best:
                won[measure.label][0] += _goodness(measure) >= best[measure.key]
                won[measure.label][1] += 1
        rows.append((entry.name, *(f"{reached} of {of}" if of else "-" for reached, of in won.values())))
    return Sheet(header=("entry", *(label.replace("_", " ") for label in compared)), rows=rows)


def _goodness(measure: EntryMeasure) -> float:
    """The mean of a measure, higher where it is better."""
    return measure_mean(measure) * (1.0 if measure.higher_is_better else -1.0)


def _duels(entries: Sequence[Entry], protocol: Protocol) -> Sheet:
    shares = improvements(entries, protocol)
    names = [entry.name for entry in entries]
    rows = [
        (name, *("" if k == other else percent_of(shares[k, other]) for other in range(len(names))))
        for k, name in enumerate(names)
    ]
    return Sheet(header=("", *names), rows=rows)


def _worlds(entries: Sequence[Entry], reference: Reference, protocol: Protocol) -> Sheet:
    rows: list[tuple[str, ...]] = []
    for world in protocol.worlds:
        if not world.is_scored:
            continue
        told = scenario_fields(world)
        means = [float(entry.performance(world.name).mean()) for entry in entries]
        rows.append(
            (
                world.name,
                f"{told['robots']} robots, {told['objects']} objects, {told['arena']}",
                reference.best[world.name],
                *(f"**{number(mean)}**" if mean == max(means) else number(mean) for mean in means),
            )
        )
    return Sheet(header=("world", "what it is", "best scripted", *(entry.name for entry in entries)), rows=rows)


def _measures(entries: Sequence[Entry]) -> Sheet:
    """All measures but those that only say the performance of a world again."""
    known = [{measure.key: measure for measure in entry.measures} for entry in entries]
    places = {key: measure for of_entry in known for key, measure in of_entry.items()}
    rows: list[tuple[str, ...]] = []
    for key, measure in places.items():
        if measure.label in ("raw_performance", "efficiency"):
            continue
        show = percent if measure.relative else number
        values = [measure_mean(found[key]) if key in found else math.nan for found in known]
        better = "higher" if measure.higher_is_better else "lower"
        rows.append((f"{measure.label}, {measure.group}", measure.at, better, *map(show, values)))
    return Sheet(header=("measure", "at", "better", *(entry.name for entry in entries)), rows=rows)
