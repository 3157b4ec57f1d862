"""The commands `study list`, `show`, `run`, `status`, `pack` and those of their results."""

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarm_forage_env.cli.options import EXIT_FAILURE, AsJson, DryRun, Jobs, complain
from swarm_forage_env.cli.signals import EXIT_INTERRUPTED

if TYPE_CHECKING:
    from swarm_forage_env.runs.plan_summary import PlanSummary
    from swarm_forage_env.studies.study import StudySpec
    from swarm_forage_env.studies.study_folder import StudyFolder

Name = Annotated[str, typer.Argument(metavar="NAME|FILE", help="A set of the paper (S1a to S2d), or a study file.")]
Place = Annotated[Path, typer.Argument(metavar="DIR|FILE", help="Folder of a study, or its packed file.")]
Budget = Annotated[str | None, typer.Option("--budget", help="How much is run; default the first of the file.")]
Seeds = Annotated[int | None, typer.Option("--seeds", min=1, help="Runs per condition; default those of the budget.")]
Rules = Annotated[str, typer.Option("--rules", help="described, program (the authors'), both, or file: as it says.")]


def list_studies(
    budget: Annotated[str, typer.Option("--budget", help="smoke, reduced or paper.")] = "paper", as_json: AsJson = False
) -> None:
    """List the experiment sets of the paper: what they take, and what a budget leaves out."""
    from swarm_forage_env.cli.printer import show as print_answer
    from swarm_forage_env.studies.description import paper_sets

    print_answer(paper_sets(budget), as_json=as_json)


def show(
    name: Name, budget: Budget = None, seeds: Seeds = None, rules: Rules = "file", as_json: AsJson = False
) -> None:
    """Show what a study varies, and how many runs each of its budgets makes."""
    from swarm_forage_env.cli.printer import show as print_answer
    from swarm_forage_env.studies.description import describe
    from swarm_forage_env.studies.study_file import budget_names

    print_answer(describe(_chosen(name, budget, seeds, rules)), as_json=as_json)
    if as_json:
        return
    others = [other for other in budget_names(name) if other != budget]
    typer.echo(f"\nBudgets: {', '.join(budget_names(name))}" + ("" if budget or len(others) < 2 else "; see --budget"))


def run(  # long: one parameter per option
    name: Name,
    budget: Budget = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder; default results/studies/NAME_BUDGET.")] = None,
    seeds: Seeds = None,
    rules: Rules = "file",
    shard: Annotated[str, typer.Option("--shard", metavar="I/N", help="Only the I-th of N equal parts.")] = "1/1",
    jobs: Jobs = None,
    cluster: Annotated[
        str | None,
        typer.Option(
            "--cluster",
            help="Run by Dask: local, slurm, slurm-jobs (--jobs of them), or the address of a scheduler "
            "(docs/studies.md).",
        ),
    ] = None,
    dry_run: DryRun = False,
) -> None:
    """Run what is missing of a study, and pack its runs into one file.

    Finished runs are kept: after Ctrl-C, or with more seeds, the same command does the rest.
    """
    from swarm_forage_env.cli.terminal import notes
    from swarm_forage_env.runs.cluster import cluster_executor
    from swarm_forage_env.runs.store import FAILED
    from swarm_forage_env.studies.status import StudyOutcome
    from swarm_forage_env.studies.study_folder import StudyFolder, parse_shard, run_study

    spec = _chosen(name, budget, seeds, rules)
    part = parse_shard(shard)
    folder = StudyFolder(out or Path("results", "studies", f"{spec.name}_{spec.budget}"))
    if dry_run:
        typer.echo(_summary(spec, folder, part, jobs))
        return
    try:
        with nullcontext() if cluster is None else cluster_executor(cluster, jobs) as executor:
            state = run_study(spec, folder, part=part, jobs=jobs, executor=executor, progress=True)
    except KeyboardInterrupt:
        words = f"Interrupted. Finished runs are kept in {folder.folder}; the same command does the rest."
        raise typer.Exit(complain(words, EXIT_INTERRUPTED)) from None
    if part == (1, 1):
        packed = _pack(folder.folder, None)
        notes().print(f"packed into {packed}")
    typer.echo(StudyOutcome(outcomes=state, folder=folder))
    if state.count(FAILED):
        raise typer.Exit(EXIT_FAILURE)


def _summary(spec: "StudySpec", folder: "StudyFolder", part: tuple[int, int], jobs: int | None) -> "PlanSummary":
    """Say what is left to run, and how long it takes."""
    from swarm_forage_env.cli.terminal import notes
    from swarm_forage_env.runs.plan_summary import summarize_plan
    from swarm_forage_env.studies.study_folder import shard

    index, count = part
    name = f"{spec.name}, budget {spec.budget}" + (f", shard {index} of {count}" if count > 1 else "")
    only, out = shard(spec.plan.specs, index, count), folder.store.folder
    return summarize_plan(spec.plan, name=name, only=only, out=out, jobs=jobs, tell=notes().print)


def status(place: Place, as_json: AsJson = False) -> None:
    """Show which runs of each condition are done, missing or failed; exit code 1 unless all are done."""
    from swarm_forage_env.cli.printer import show as print_answer
    from swarm_forage_env.studies.status import status as status_of
    from swarm_forage_env.studies.study_table import read_study

    found = status_of(read_study(place))
    print_answer(found, as_json=as_json)
    if not found.is_complete:
        raise typer.Exit(EXIT_FAILURE)


def pack(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a study.")],
    file: Annotated[Path | None, typer.Option("--file", help="Packed study; default DIR/NAME.parquet.")] = None,
) -> None:
    """Put all runs of a study into one file, which holds everything that is known of them."""
    typer.echo(f"packed into {_pack(folder, file)}")


def _pack(folder: Path, chosen: Path | None) -> Path:
    from swarm_forage_env.studies.study_folder import StudyFolder
    from swarm_forage_env.studies.study_table import gather_study

    table = gather_study(StudyFolder(folder))
    file = chosen or folder / f"{table.spec.name}.parquet"
    file.parent.mkdir(parents=True, exist_ok=True)
    table.write(file)
    return file


def _chosen(name: str, budget: str | None, seeds: int | None, rules: str) -> "StudySpec":
    """Return the study that the options describe."""
    from swarm_forage_env._internal.fields import known_name
    from swarm_forage_env.studies.study import RULES_NAMES
    from swarm_forage_env.studies.study_file import load_study

    known_name("rules", rules, (*RULES_NAMES, "both", "file"))
    chosen = {"both": tuple(RULES_NAMES), "file": None}.get(rules, (rules,))
    return load_study(name, budget, seeds=seeds, rules=chosen)
