"""The commands `benchmark`, `benchmark show` and `benchmark verify`."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from metrics.controllers import PAPER_POLICIES
from swarm_forage_env.cli.options import EXIT_FAILURE, AsJson, DryRun, Jobs, Picture, PolicyOptions

if TYPE_CHECKING:
    from metrics.benchmark import Board, Training


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
    training_command: Annotated[str, typer.Option("--training", help="Command that trained the policies.")] = ""
    track: Annotated[str, typer.Option("--track", help="10M, 40M or open: most decisions of a training.")] = "open"
    decisions: Annotated[
        int | None, typer.Option("--decisions", min=0, help="Decisions of the longest training, of all its robots.")
    ] = None

    def training(self) -> "Training":
        """Return it as an entry tells it."""
        from metrics.benchmark import Training

        return Training(
            worlds=self.trained_in, command=self.training_command, track=self.track, decisions=self.decisions
        )


def run(
    policies: PolicyOptions,
    *,
    name: Annotated[str | None, typer.Option("--name", help="Name of the entry; default the policy's.")] = None,
    file: Annotated[
        Path | None, typer.Option("--file", help="Entry to write; default NAME.json in results/benchmark.")
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
    from metrics.scoring.question import ask
    from swarm_forage_env._internal.files import as_file_name, check_file
    from swarm_forage_env.cli.errors import resumable
    from swarm_forage_env.policies.registry import policy_label
    from swarm_forage_env.runs.plan_summary import summarize_plan

    protocol = load_protocol(quick=quick)
    called = name or f"{policy_label(names[0])}{', quick' if quick else ''}"
    question = benchmark_question(names, name=called, protocol=protocol, training=trained.training())
    if dry_run:
        typer.echo(summarize_plan(question.plan, out=out))
        return
    entry_file = None if quick else file or Path("results/benchmark") / f"{as_file_name(called)}.json"
    if entry_file is not None:
        check_file(entry_file)
    if called not in PAPER_POLICIES:
        scripted_entries(load_protocol())  # what it will be shown beside
    with resumable(out):
        entry = ask(question, out=out, jobs=jobs)
    if entry_file is not None:
        entry.write(entry_file)
        typer.echo(f"entry {entry_file}", err=True)
    _show(board_of([entry], protocol), as_json=as_json)
    if quick:
        typer.echo("A quick look, no entry: shorter runs than those of the scripted controllers.", err=True)


def show(
    entries: Annotated[
        list[Path] | None,
        typer.Argument(metavar="ENTRY...", help="Entry files; the scripted four are always shown, too."),
    ] = None,
    picture: Picture = None,
    as_json: AsJson = False,
) -> None:
    """Show the scores of entries, beside the scripted controllers."""
    from metrics.benchmark import board_of, read_entry
    from swarm_forage_env.rendering.figures import check_picture

    board = board_of([read_entry(file) for file in entries or ()])
    if picture is not None:
        check_picture(picture)
        board.draw(picture)
    _show(board, as_json=as_json)


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
    jobs: Jobs = None,
) -> None:
    """Make runs of an entry again and say whether its numbers come out; exit code 1 if not."""
    from metrics.benchmark import SAME, verify_entry
    from swarm_forage_env._internal.wording import printable

    again = verify_entry(entry, policy or (), n_worlds=n_worlds, jobs=jobs)
    typer.echo(printable(again.text()))
    if any(row[-1] != SAME for row in again.rows):
        raise typer.Exit(EXIT_FAILURE)


def _show(board: "Board", *, as_json: bool) -> None:
    from swarm_forage_env._internal.wording import printable

    typer.echo(json.dumps(board.to_mapping()["entries"], indent=1) if as_json else printable(board.text()))
