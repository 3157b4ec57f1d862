"""How `benchmark` carries out its work, and what it prints: plan, worlds, standings, the page."""

import json
import os
import shlex
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import typer

from metrics import PAPER_POLICIES
from metrics.benchmark.entry import Entry, Training, read_entry
from metrics.benchmark.page import BOARD_HEADER, board_rows, details_page, page_block, sorted_standings, with_block
from metrics.benchmark.protocol import BenchmarkError, Protocol, load_protocol, scenario_fields
from metrics.benchmark.running import BenchmarkQuestion, benchmark_question
from metrics.benchmark.standing import Reference, Standing, reference_of, scripted_entries, standing_of
from metrics.scoring.question import ask
from swarm_forage_env._internal.files import replacing
from swarm_forage_env._internal.printable import printable
from swarm_forage_env._internal.wording import aligned, counted, plain
from swarm_forage_env.cli.interrupts import resumable
from swarm_forage_env.cli.report import estimate, estimated_seconds
from swarm_forage_env.policies.mixture import is_mixture, mixture_of, mixture_parts
from swarm_forage_env.policies.registry import file_of, is_policy_file, policy_label
from swarm_forage_env.runs.store import RunStore
from swarm_forage_env.runs.workers import available_cores


@dataclass(frozen=True, kw_only=True, slots=True)
class Wanted:
    """What the options of `benchmark` ask for."""

    policies: tuple[str, ...]
    name: str
    quick: bool = False
    trained_in: str = "unknown"
    training: str = ""
    library: str = ""
    training_hours: float | None = None
    training_seeds: tuple[int, ...] = ()

    @property
    def command(self) -> str:
        """What makes the same entry again from the same folder: as given, but for files with their whole paths."""
        policies = [word for policy in self.policies for word in ("--policy", _from_here(policy))]
        return shlex.join(["swarm-forage", "benchmark", *policies, "--name", self.name])

    @property
    def is_scripted(self) -> bool:
        """Whether this makes the entry of a scripted controller again, which comes with the package."""
        return self.name in PAPER_POLICIES and self.policies == (self.name,) and not self.quick


def default_name(policy: str, *, quick: bool) -> str:
    """Return the name of an entry of one policy; a quick look at a scripted controller is not the shipped entry."""
    label = policy_label(policy)
    return f"{label}, quick" if quick and label in PAPER_POLICIES else label


def run_and_show(wanted: Wanted, file: Path | None, records: Path, jobs: int | None, *, as_json: bool) -> None:
    """Run what is missing, write the entry unless `file` is None, and show what it is worth.

    Raises:
        typer.Exit: Ctrl-C.
        ConfigError: an unknown policy, or a file that cannot be opened.
        BenchmarkError: runs failed, the name is that of a scripted controller, or one of their entries is missing.
    """
    protocol = load_protocol(quick=wanted.quick)
    question = _question(wanted, protocol)  # refuses what cannot be run, before anything is
    if not wanted.is_scripted:
        scripted_entries(load_protocol())  # what it will be shown beside
    with resumable(records):
        entry = ask(question, out=records, jobs=jobs)
    if file is not None:
        entry.write(file)
        typer.echo(f"entry {file}", err=True)
    _show([entry], protocol, as_json=as_json)
    if wanted.quick:
        typer.echo("A quick look, no entry: shorter runs than those of the scripted controllers.", err=True)


def show_entries(paths: Sequence[Path], *, as_json: bool) -> None:
    """Show what entries are worth; raises BenchmarkError for a file that is no entry."""
    protocol = load_protocol()
    _show([read_entry(path, protocol) for path in entry_files(paths)], protocol, as_json=as_json)


def write_page(paths: Sequence[Path], page: Path, picture: Path) -> tuple[Path, ...]:
    """Write the generated part of a page, its figure, and the page of details beside it; returns what was written.

    Raises:
        BenchmarkError: a file that is no entry, or a page without the marks.
    """
    from metrics.benchmark.figure import draw_benchmark

    protocol = load_protocol()
    standings, reference = _standings([read_entry(path, protocol) for path in entry_files(paths)], protocol)
    text = page.read_text(encoding="utf-8")
    link = Path(os.path.relpath(picture, page.parent)).as_posix()
    details = page.with_name(f"{page.stem}_in_detail{page.suffix}")
    text = with_block(text, page_block(standings, protocol, link, details.name), str(page))
    draw_benchmark(standings, reference, protocol, picture)
    for file, content in ((details, details_page(standings, reference, protocol, page.name)), (page, text)):
        with replacing(file) as draft:
            draft.write_text(content, encoding="utf-8")
    return page, details, picture


def entry_files(given: Sequence[Path]) -> list[Path]:
    """Return entry files; a folder stands for those in it, in the order of their names."""
    return [file for path in given for file in (sorted(path.glob("*.json")) if path.is_dir() else [path])]


def plan_text(wanted: Wanted, records: Path, jobs: int | None) -> str:
    """Return what would be run, with an estimate.

    Raises:
        ConfigError: an unknown policy, or a file that cannot be opened.
        BenchmarkError: the name is that of a scripted controller.
    """
    protocol = load_protocol(quick=wanted.quick)
    store = RunStore(records)
    specs = _question(wanted, protocol).plan.specs
    todo = [spec for spec in specs if spec.run_id not in store]
    processes = jobs or available_cores()
    seconds = estimated_seconds(todo, processes)
    return "\n".join(
        [
            f"{wanted.name} in the benchmark, {protocol.name}: {counted(len(protocol.worlds), 'world')}, "
            f"{counted(len(protocol.seeds), 'seed')}, {protocol.horizon_s:,g} s per run, records go to {store.folder}",
            f"{counted(len(specs), 'run')}, {len(todo):,} to do" + estimate(seconds, processes, any_left=bool(todo)),
        ]
    )


def _question(wanted: Wanted, protocol: Protocol) -> BenchmarkQuestion:
    """Return what is asked.

    Raises:
        ConfigError: an unknown policy, or a file that cannot be opened.
        BenchmarkError: the name is that of a scripted controller.
    """
    if wanted.name in PAPER_POLICIES and not wanted.is_scripted:
        raise BenchmarkError(
            f"Expected another name than {wanted.name!r}, which is that of an entry that comes with the package; "
            "choose one with --name."
        )
    return benchmark_question(
        wanted.policies,
        name=wanted.name,
        protocol=protocol,
        command=wanted.command,
        training=Training(
            worlds=wanted.trained_in,
            command=wanted.training,
            library=wanted.library,
            core_hours=wanted.training_hours,
        ),
        training_seeds=wanted.training_seeds,
    )


def worlds_text() -> str:
    """Return all worlds as a table."""
    protocol = load_protocol()
    rows: list[Sequence[str]] = [("world", "scenario", "robots", "objects", "arena", "disturbed by", "counts")]
    for world in protocol.worlds:
        why = "yes" if world.counts else "reference of measures" if world.is_held_out else "no, to train in"
        rows.append((world.name, *map(str, scenario_fields(world).values()), why))
    kinds = Counter(world.counts for world in protocol.worlds)
    return "\n".join(
        [
            f"Benchmark, {protocol.name}: seeds {', '.join(map(str, protocol.seeds))}, {protocol.horizon_s:,g} s per "
            f"run, {kinds[True]} worlds that count",
            *aligned(rows),
        ]
    )


def _standings(entries: Sequence[Entry], protocol: Protocol) -> tuple[list[Standing], Reference]:
    """What entries are worth, and what the scripted controllers are beside them.

    An entry of a scripted controller that was made again is shown in place of the one that comes with the package. All
    are held against those that come with the package.

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
    foreign = [entry.name for entry in added if entry.name in PAPER_POLICIES and not _is_scripted(entry)]
    if foreign:
        raise BenchmarkError(
            f"Expected entries with names of their own, got one of another policy with the name {foreign[0]!r} of a "
            "scripted controller; make it again with another --name."
        )
    standings = [standing_of(entry, reference, full) for entry in scripted if entry.name not in counts]
    standings += [standing_of(entry, reference, protocol) for entry in added]
    return sorted_standings(standings), reference


def _from_here(policy: str) -> str:
    """Return a policy with the path of each of its files from the current folder, where the whole path was given."""
    if is_mixture(policy):
        parts = mixture_parts(policy)
        told = [replace(part, policy=_from_here(part.policy)) for part in parts]
        return policy if told == list(parts) else mixture_of(told)  # as given: 20% stays 20%
    file = file_of(policy)
    if not (is_policy_file(policy) and Path(file).is_absolute()):
        return policy
    return Path(os.path.relpath(file)).as_posix() + policy.removeprefix(file)


def _is_scripted(entry: Entry) -> bool:
    """Whether an entry is of the installed policy whose name it has."""
    return [(policy.name, policy.digest) for policy in entry.policies] == [(entry.name, "")]


def _show(entries: Sequence[Entry], protocol: Protocol, *, as_json: bool) -> None:
    standings, _ = _standings(entries, protocol)
    if as_json:
        typer.echo(json.dumps([_mapping(standing) for standing in standings], indent=1))
        return
    for line in aligned([BOARD_HEADER, *board_rows(standings)]):
        typer.echo(printable(line))


def _mapping(standing: Standing) -> dict[str, Any]:
    """A standing as plain values for JSON."""
    score, improvement = standing.score, standing.improvement
    return {
        "name": standing.entry.name,
        "score": [plain(score.value), plain(score.lower), plain(score.upper)],
        "improvement": [plain(improvement.value), plain(improvement.lower), plain(improvement.upper)],
        "worlds_won": standing.n_won,
        "worlds": standing.n_worlds,
        "calm": plain(standing.calm),
        "disturbed": plain(standing.disturbed),
        "training_worlds": plain(standing.training),
        "groups": {name: plain(value) for name, value in standing.groups.items()},
        "interference": plain(standing.interference),
        "by_policy": [plain(value) for value in standing.by_policy],
    }
