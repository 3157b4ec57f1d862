"""The commands of studies: what there is, running them, and what came of them."""

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarm_forage_env.cli.options import EXIT_FAILURE, AsJson, Band, DryRun, Jobs, StyleOptions, Variants, complain
from swarm_forage_env.cli.signals import EXIT_INTERRUPTED

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from swarm_forage_env.runs.plan_summary import PlanSummary
    from swarm_forage_env.studies.study import StudySpec
    from swarm_forage_env.studies.study_folder import StudyFolder
    from swarm_forage_env.studies.study_table import StudyTable

Name = Annotated[str, typer.Argument(metavar="NAME|FILE", help="A set of the paper (S1a to S2d), or a study file.")]
Place = Annotated[Path, typer.Argument(metavar="DIR|FILE", help="Folder of a study, or its packed file.")]
Budget = Annotated[str | None, typer.Option("--budget", help="How much to run; default the first budget of the file.")]
Seeds = Annotated[int | None, typer.Option("--seeds", min=1, help="Runs per condition; default the budget's number.")]
Rules = Annotated[
    str, typer.Option("--rules", help="described, program (the authors'), both, or file: what the file says.")
]
Cluster = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        help="Run on Dask: local, or the address of a scheduler (docs/studies.md).",
    ),
]


def list_studies(
    budget: Annotated[str, typer.Option("--budget", help="smoke, reduced or paper.")] = "paper", as_json: AsJson = False
) -> None:
    """List the experiment sets of the paper: how many runs they make, and what a budget leaves out."""
    from swarm_forage_env.cli.printer import show as print_answer
    from swarm_forage_env.studies.description import paper_sets

    print_answer(paper_sets(budget), as_json=as_json)


def run(
    names: Annotated[
        list[str], typer.Argument(metavar="NAME|FILE...", help="Sets of the paper (S1a to S2d), or study files.")
    ],
    budget: Budget = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="Folder; default results/studies/NAME_BUDGET. For several studies, the parent of their folders.",
        ),
    ] = None,
    seeds: Seeds = None,
    rules: Rules = "file",
    shard: Annotated[
        str, typer.Option("--shard", metavar="I/N", help="Make only the I-th of N equal parts of the runs.")
    ] = "1/1",
    jobs: Jobs = None,
    cluster: Cluster = None,
    dry_run: DryRun = False,
) -> None:
    """Make the missing runs of studies, and pack each study into one file.

    Finished runs are kept: after Ctrl-C, or with more seeds, the same command does the rest.
    """
    from swarm_forage_env.runs.cluster import cluster_executor
    from swarm_forage_env.runs.workers import WorkerError
    from swarm_forage_env.studies.study_folder import StudyFolder, parse_shard

    specs = [_chosen(name, budget, seeds, rules) for name in names]
    part = parse_shard(shard)
    places = [_folder(spec, out, is_one=len(specs) == 1) for spec in specs]
    studies = [(spec, StudyFolder(place)) for spec, place in zip(specs, places, strict=True)]
    if dry_run:
        typer.echo("\n".join(str(_summary(spec, folder, part)) for spec, folder in studies))
        return
    try:
        with nullcontext() if cluster is None else cluster_executor(cluster, jobs) as executor:
            n_failed = sum(_run_all(spec, folder, part, jobs, executor) for spec, folder in studies)
    except (KeyboardInterrupt, WorkerError) as error:
        kept = ", ".join(str(folder.folder) for _, folder in studies)
        why, code = (
            ("Interrupted.", EXIT_INTERRUPTED) if isinstance(error, KeyboardInterrupt) else (error, EXIT_FAILURE)
        )
        words = f"{why} Finished runs are kept in {kept}; the same command does the rest."
        raise typer.Exit(complain(words, code)) from None
    if n_failed:
        raise typer.Exit(EXIT_FAILURE)


def _folder(spec: "StudySpec", out: Path | None, *, is_one: bool) -> Path:
    own = f"{spec.name}_{spec.budget}"
    return Path("results", "studies", own) if out is None else out if is_one else out / own


def _run_all(
    spec: "StudySpec", folder: "StudyFolder", part: tuple[int, int], jobs: int | None, executor: "Executor | None"
) -> int:
    """Run what is missing of a study, and return how many runs failed."""
    from swarm_forage_env.cli.printer import notes
    from swarm_forage_env.runs.store import FAILED
    from swarm_forage_env.studies.description import StudyOutcome
    from swarm_forage_env.studies.study_folder import run_study
    from swarm_forage_env.studies.study_table import pack_study

    state = run_study(spec, folder, part=part, jobs=jobs, executor=executor, progress=True)
    if part == (1, 1):
        notes().print(f"packed into {pack_study(folder, tell=notes().print)}")
    typer.echo(StudyOutcome(outcomes=state, folder=folder))
    return state.count(FAILED)


def _summary(spec: "StudySpec", folder: "StudyFolder", part: tuple[int, int]) -> "PlanSummary":
    """Say what is left to run."""
    from swarm_forage_env.runs.plan_summary import summarize_plan
    from swarm_forage_env.studies.study_folder import shard

    index, count = part
    name = f"{spec.name}, budget {spec.budget}" + (f", shard {index} of {count}" if count > 1 else "")
    only, out = shard(spec.plan.specs, index, count), folder.store.folder
    return summarize_plan(spec.plan, name=name, only=only, out=out)


def status(place: Place, as_json: AsJson = False) -> None:
    """Show which runs of each condition are done, missing or failed; exit code 1 unless all are done."""
    from swarm_forage_env.cli.printer import show as print_answer
    from swarm_forage_env.studies.description import status as status_of

    found = status_of(_read(place))
    print_answer(found, as_json=as_json)
    if not found.is_complete:
        raise typer.Exit(EXIT_FAILURE)


def _read(place: Path) -> "StudyTable":
    """Read a study, and tell of damaged files in its folder."""
    from swarm_forage_env.cli.printer import notes
    from swarm_forage_env.studies.study_table import read_study

    table = read_study(place)
    for line in table.damaged_lines:
        notes().print(line)
    return table


def _chosen(name: str, budget: str | None, seeds: int | None, rules: str) -> "StudySpec":
    """Return the study that the options describe."""
    from swarm_forage_env._internal.fields import known_name
    from swarm_forage_env.studies.study import RULES_NAMES
    from swarm_forage_env.studies.study_file import load_study

    known_name("rules", rules, (*RULES_NAMES, "both", "file"))
    chosen = {"both": tuple(RULES_NAMES), "file": None}.get(rules, (rules,))
    return load_study(name, budget, seeds=seeds, rules=chosen)


Places = Annotated[list[Path], typer.Argument(metavar="DIR|FILE...", help="Folders of studies, or their packed files.")]


def verdict(
    places: Places,
    table: Annotated[bool, typer.Option("--table", help="Show only the counts and the table of all claims.")] = False,
    file: Annotated[
        Path | None,
        typer.Option("--file", help="Also write the answer to a file: .txt, .md, .csv or .json, with more numbers."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Test the claims of the paper with runs of its sets: which claims they support, contradict or leave open.

    First come the counts of each answer and one table of all claims; then the evidence for each answer. The same
    follows for the paper's intuitions, what the authors expected of each algorithm before the experiments.
    """
    from metrics import verdict as verdict_of
    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env._internal.files import check_file
    from swarm_forage_env.cli.printer import notes, show_boxed
    from swarm_forage_env.runs.answer import FORMS

    if file is not None and file.suffix not in FORMS:
        raise ConfigError(f"Expected --file as a file ending in {', '.join(FORMS)}, got {str(file)!r}.")
    aside = notes()
    tables = [_read(place) for place in places]
    if file is not None:
        check_file(file)
    found = replace(verdict_of(*tables, tell=aside.print), is_short=table)
    for remark in found.remarks:
        aside.print(f"note: {remark}")
    if as_json:
        typer.echo(found.json())
    else:
        show_boxed(replace(found, is_folded=True))
    if file is not None:
        found.write(file)
        aside.print(f"written {file}")


def plot(
    place: Annotated[Path, typer.Argument(metavar="DIR|FILE", help="Folder of a study, or its packed file.")],
    looks: StyleOptions,
    out: Annotated[Path | None, typer.Option("--out", help="Folder; default results/figures/NAME.")] = None,
    band: Band = False,
    variants: Variants = "corrected",
    formats: Annotated[str, typer.Option("--format", help="svg, png, pdf; separated by commas.")] = "svg,png",
) -> None:
    """Draw the figures of a study, with their numbers as CSV tables: each measure over what the study varies."""
    from metrics import plot as plot_study
    from swarm_forage_env.cli.questions import score_forms
    from swarm_forage_env.cli.scenario_options import split_names

    forms = score_forms(variants, "marginal")
    table = _read(place)
    plotted = plot_study(
        table,
        out or Path("results", "figures", table.spec.name),
        band="sd" if band else "ci",
        variants=forms.variants,
        formats=split_names(formats),
        style=looks.style(),
    )
    for file in plotted.files:
        typer.echo(file)
    for line in plotted.missing:
        typer.echo(line, err=True)
