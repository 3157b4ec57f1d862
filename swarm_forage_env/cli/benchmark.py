"""The commands `benchmark`, `benchmark worlds`, `show` and `page`."""

from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env.cli.options import AsJson, DryRun, Jobs

Entries = Annotated[list[Path], typer.Argument(metavar="ENTRY...", help="Entry files; the scripted four come along.")]

benchmark = typer.Typer(
    help="A fixed protocol of worlds and seeds: run policies in it, and compare entries.",
    invoke_without_command=True,
    rich_markup_mode=None,
)


@benchmark.callback()
def run(  # long: one parameter per option
    context: typer.Context,
    policy: Annotated[
        list[str] | None,
        typer.Option(
            "--policy", help="Name, or file of a trained policy. May be repeated: training seeds of one method."
        ),
    ] = None,
    name: Annotated[str | None, typer.Option("--name", help="Name of the entry; default that of the policy.")] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Entry file; default results/benchmark/NAME.json.")] = None,
    records: Annotated[
        Path, typer.Option("--records", help="Folder for records of runs, which are not repeated.")
    ] = Path("results/benchmark/records"),
    quick: Annotated[bool, typer.Option("--quick", help="Short runs and few seeds, for a look; no entry.")] = False,
    trained_in: Annotated[
        str,
        typer.Option(
            "--trained-in",
            help="given: in the training worlds only; other: also elsewhere; nothing: not trained; unknown.",
        ),
    ] = "unknown",
    training: Annotated[str, typer.Option("--training", help="Command that trained the policies, for the page.")] = "",
    library: Annotated[str, typer.Option("--library", help="Library that trained them, with its version.")] = "",
    training_hours: Annotated[
        float | None, typer.Option("--training-hours", min=0.0, help="Core-hours of all trainings together.")
    ] = None,
    training_seeds: Annotated[
        list[int] | None,
        typer.Option("--training-seed", min=0, help="Per policy, in their order; default what their files tell."),
    ] = None,
    jobs: Jobs = None,
    as_json: AsJson = False,
    dry_run: DryRun = False,
) -> None:
    """Run policies in all worlds of the benchmark, write one entry file, and show what it is worth.

    Runs that the folder of records holds are not repeated: after Ctrl-C the same command does the rest.
    """
    if context.invoked_subcommand is not None:
        return
    from swarm_forage_env._internal.files import as_file_name, check_file
    from swarm_forage_env.cli.benchmark_report import Wanted, default_name, plan_text, run_and_show

    if not policy:
        raise typer.BadParameter(
            "Expected --policy, the name or the file of a policy; swarm-forage list has the names."
        )
    if name is None and len(policy) > 1:
        raise typer.BadParameter("Expected --name for an entry of several policies.")
    if quick and out is not None:
        raise typer.BadParameter("Expected --out without --quick: a quick look is no entry.")
    called = name or default_name(policy[0], quick=quick)
    wanted = Wanted(
        policies=tuple(policy),
        name=called,
        quick=quick,
        trained_in=trained_in,
        training=training,
        library=library,
        training_hours=training_hours,
        training_seeds=tuple(training_seeds or ()),
    )
    if dry_run:
        typer.echo(plan_text(wanted, records, jobs))
        return
    file = None if quick else out or Path("results/benchmark", f"{as_file_name(called)}.json")
    if file is not None:
        check_file(file)
    run_and_show(wanted, file, records, jobs, as_json=as_json)


@benchmark.command()
def worlds() -> None:
    """Show the worlds of the benchmark: those to train in, and those that are held out."""
    from swarm_forage_env.cli.benchmark_report import worlds_text

    typer.echo(worlds_text())


@benchmark.command()
def show(entries: Entries, as_json: AsJson = False) -> None:
    """Show what entries are worth, beside the scripted controllers."""
    from swarm_forage_env.cli.benchmark_report import show_entries

    show_entries(entries, as_json=as_json)


@benchmark.command()
def page(
    entries: Entries,
    into: Annotated[Path, typer.Option("--into", help="Page whose generated part is written anew.")] = Path(
        "docs/benchmark.md"
    ),
    picture: Annotated[Path, typer.Option("--picture", help="Figure that the page shows.")] = Path(
        "docs/images/benchmark.png"
    ),
) -> None:
    """Write the tables of all entries into a page, and draw its figure."""
    from swarm_forage_env.cli.benchmark_report import write_page

    for file in write_page(entries, into, picture):
        typer.echo(file)
