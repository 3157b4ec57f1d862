"""The commands `benchmark`, `benchmark worlds`, `show` and `page`."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from metrics.controllers import PAPER_POLICIES
from swarm_forage_env._internal.wording import printable
from swarm_forage_env.cli.options import EXIT_FAILURE, AsJson, DryRun, Jobs, PolicyOptions

if TYPE_CHECKING:
    from metrics.benchmark import BenchmarkQuestion, Board, Training

Entries = Annotated[
    list[Path], typer.Argument(metavar="ENTRY...", help="Entry files; the scripted four are always shown, too.")
]
Version = Annotated[int, typer.Option("--version", metavar="1|2|3", help="Version of the benchmark.")]


@dataclass(frozen=True, kw_only=True, slots=True)
class TrainedOptions:
    """How the policies of an entry were trained."""

    trained_in: Annotated[
        str,
        typer.Option(
            "--trained-in",
            help="given: only in the training worlds; other: also elsewhere; nothing: not trained; unknown.",
        ),
    ] = "unknown"
    training_command: Annotated[
        str, typer.Option("--training", help="Command that trained the policies, for the page.")
    ] = ""
    library: Annotated[str, typer.Option("--library", help="Library that trained them, with its version.")] = ""
    training_hours: Annotated[
        float | None, typer.Option("--training-hours", min=0.0, help="Core-hours of all trainings together.")
    ] = None
    training_seeds: Annotated[
        list[int] | None,
        typer.Option(
            "--training-seed", min=0, help="Training seed of each policy, in their order; default what their files say."
        ),
    ] = None

    track: Annotated[
        str,
        typer.Option(
            "--track", help="10M, 40M or open: most decisions of a training. From version 2 on; default open."
        ),
    ] = ""
    decisions: Annotated[
        int | None, typer.Option("--decisions", min=0, help="Decisions of the longest training, of all its robots.")
    ] = None

    def training(self) -> "Training":
        """Return it as an entry tells it."""
        from metrics.benchmark import Training

        return Training(
            worlds=self.trained_in,
            command=self.training_command,
            library=self.library,
            core_hours=self.training_hours,
            track=self.track,
            decisions=self.decisions,
        )


def run(
    policies: PolicyOptions,
    *,
    name: Annotated[str | None, typer.Option("--name", help="Name of the entry; default the policy's.")] = None,
    version: Version = 1,
    file: Annotated[
        Path | None,
        typer.Option("--file", help="Entry to write; default NAME.json in results/benchmark, or in its v2 or v3."),
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Folder for records of runs.")] = Path(
        "results/benchmark/records"
    ),
    quick: Annotated[
        bool, typer.Option("--quick", help="Quick look: short runs and few seeds, without an entry.")
    ] = False,
    trained: TrainedOptions,
    jobs: Jobs = None,
    as_json: AsJson = False,
    dry_run: DryRun = False,
) -> None:
    """Run policies in all worlds of the benchmark, write one entry file, and show its score.

    Several policies count as training seeds of one method. The command does not repeat runs that the folder of records
    holds: after Ctrl-C, the same command does the rest.
    """
    names = list(policies.names())
    if name is None and len(names) > 1:
        raise typer.BadParameter("Expected --name for an entry of several policies.")
    if quick and file is not None:
        raise typer.BadParameter("Expected --file without --quick: a quick look is no entry.")
    from metrics.benchmark import benchmark_question, board_of, load_protocol, scripted_entries
    from metrics.benchmark.protocol import folder_of
    from metrics.benchmark.running import entry_name
    from metrics.scoring.question import ask
    from swarm_forage_env._internal.files import as_file_name, check_file
    from swarm_forage_env.cli.errors import resumable

    protocol = load_protocol(version=version, quick=quick)
    called = name or entry_name(names[0], quick=quick)
    question = benchmark_question(
        names,
        name=called,
        protocol=protocol,
        training=trained.training(),
        training_seeds=trained.training_seeds or (),
    )
    if dry_run:
        typer.echo(_plan_text(question, out, jobs))
        return
    entry_file = (
        None if quick else file or folder_of(version, Path("results/benchmark")) / f"{as_file_name(called)}.json"
    )
    if entry_file is not None:
        check_file(entry_file)
    if called not in PAPER_POLICIES:
        scripted_entries(load_protocol(version=version))  # what it will be shown beside
    with resumable(out):
        entry = ask(question, out=out, jobs=jobs)
    if entry_file is not None:
        entry.write(entry_file)
        typer.echo(f"entry {entry_file}", err=True)
    _show(board_of([entry], protocol), as_json=as_json)
    if quick:
        typer.echo("A quick look, no entry: shorter runs than those of the scripted controllers.", err=True)


def worlds(version: Version = 1, as_json: AsJson = False) -> None:
    """Show the worlds of the benchmark: training worlds and held-out worlds."""
    from metrics.benchmark import load_protocol
    from swarm_forage_env.cli.printer import show as print_answer

    print_answer(load_protocol(version=version), as_json=as_json)


def show(entries: Entries, as_json: AsJson = False) -> None:
    """Show the scores of entries, beside the scripted controllers."""
    _show(_board_of(entries), as_json=as_json)


def verify(
    entry: Annotated[Path, typer.Argument(metavar="ENTRY", help="Entry file.")],
    policy: Annotated[
        list[str] | None,
        typer.Option(
            "--policy",
            metavar="NAME|FILE",
            help="Policies of the entry in their order; default those installed under their names.",
        ),
    ] = None,
    n_worlds: Annotated[
        int, typer.Option("--worlds", min=1, help="How many worlds to draw, counted for each policy.")
    ] = 8,
    every: Annotated[bool, typer.Option("--all", help="Take all worlds.")] = False,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Draws the worlds.")] = 0,
    out: Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Folder for records of runs.")] = Path(
        "results/benchmark/verified"
    ),
    jobs: Jobs = None,
    as_json: AsJson = False,
    dry_run: DryRun = False,
) -> None:
    """Make runs of an entry again and say whether its numbers come out.

    Scripted controllers and network files must give the same numbers, other policies numbers within chance.
    """
    from metrics.benchmark import verification_question
    from metrics.scoring.question import ask
    from swarm_forage_env.cli.errors import resumable
    from swarm_forage_env.cli.printer import notes
    from swarm_forage_env.cli.printer import show as print_answer
    from swarm_forage_env.runs.plan_summary import summarize_plan

    question = verification_question(entry, policy or (), n_worlds=None if every else n_worlds, seed=seed)
    if dry_run:
        typer.echo(summarize_plan(question.plan, out=out, jobs=jobs, tell=notes().print))
        return
    with resumable(out):
        answer = ask(question, out=out, jobs=jobs)
    print_answer(answer, as_json=as_json)
    if answer.verdict == "differs":
        raise typer.Exit(EXIT_FAILURE)


def page(
    entries: Entries,
    file: Annotated[
        Path | None,
        typer.Option(
            "--file",
            help="Page whose generated part to write again; default docs/benchmark.md, of later versions "
            "docs/benchmark_v2.md or docs/benchmark_v3.md.",
        ),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option("--picture", help="Figure that the page shows; default of the page's name, in docs/images."),
    ] = None,
) -> None:
    """Write the tables of all entries into a page, and draw its figure.

    A folder of entries also gets croissant.json, its metadata in the format of ML Commons.
    """
    from metrics.benchmark import describe_entries
    from metrics.benchmark.board import entry_files

    board = _board_of(entries)
    version = board.protocol.version
    name = "benchmark" if version == 1 else f"benchmark_v{version}"
    for written in board.write_page(file or Path(f"docs/{name}.md"), picture or Path(f"docs/images/{name}.png")):
        typer.echo(written)
    for folder in entries:
        if folder.is_dir() and entry_files([folder]):
            typer.echo(describe_entries(folder))


def _board_of(paths: list[Path]) -> "Board":
    from metrics.benchmark import board_of, read_entry
    from metrics.benchmark.board import entry_files

    return board_of([read_entry(file) for file in entry_files(paths)])


def _show(board: "Board", *, as_json: bool) -> None:
    typer.echo(json.dumps(board.to_mapping()["entries"], indent=1) if as_json else printable(board.text()))


def _plan_text(question: "BenchmarkQuestion", records: Path, jobs: int | None) -> str:
    """What would be run, with an estimate."""
    from swarm_forage_env._internal.wording import counted
    from swarm_forage_env.cli.printer import notes
    from swarm_forage_env.runs.plan_summary import summarize_plan

    protocol = question.protocol
    return (
        f"{question.name} in the benchmark, {protocol.name}: {counted(len(protocol.worlds), 'world')}, "
        f"{counted(len(protocol.seeds), 'seed')}, {protocol.horizon_s:,g} s per run\n"
        f"{summarize_plan(question.plan, out=records, jobs=jobs, tell=notes().print)}"
    )
