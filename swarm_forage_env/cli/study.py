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
UntilDecided = Annotated[
    bool,
    typer.Option(
        "--until-decided",
        help="Judge the paper's claims again and again, and make the runs that decide most in the least time "
        "(docs/studies.md). --budget is then paper by default, and --seeds sets the most runs per condition; "
        "default as the folders have it, else 192.",
    ),
]
Hours = Annotated[
    float | None, typer.Option("--hours", min=0.0, help="With --until-decided: for how many hours of wall time.")
]
Cluster = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        help="Run on Dask: local, slurm, slurm-jobs (--jobs sets their number), or the address of a scheduler "
        "(docs/studies.md).",
    ),
]


def list_studies(
    budget: Annotated[str, typer.Option("--budget", help="smoke, reduced or paper.")] = "paper", as_json: AsJson = False
) -> None:
    """List the experiment sets of the paper: how many runs they make, and what a budget leaves out."""
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
    until_decided: UntilDecided = False,
    hours: Hours = None,
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
    from swarm_forage_env.studies.study_file import PAPER
    from swarm_forage_env.studies.study_folder import StudyFolder, parse_shard

    if until_decided:
        specs = [_chosen(name, budget or PAPER, None, rules) for name in names]
    else:
        specs = [_chosen(name, budget, seeds, rules) for name in names]
    part = parse_shard(shard)
    places = [_folder(spec, out, is_one=len(specs) == 1) for spec in specs]
    studies = [(spec, StudyFolder(place)) for spec, place in zip(specs, places, strict=True)]
    _check_until_decided(until_decided, hours, part, dry_run)
    if dry_run and not until_decided:
        typer.echo("\n\n".join(str(_summary(spec, folder, part, jobs)) for spec, folder in studies))
        return
    try:
        with nullcontext() if cluster is None or dry_run else cluster_executor(cluster, jobs) as executor:
            if until_decided:
                _run_until_decided(studies, seeds, 0.0 if dry_run else hours or 0.0, jobs, executor)
                n_failed = 0
            else:
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


def _check_until_decided(until_decided: bool, hours: float | None, part: tuple[int, int], dry_run: bool) -> None:
    from swarm_forage_env._internal.fields import ConfigError

    if hours is not None and not until_decided:
        raise ConfigError("Expected --hours with --until-decided only.")
    if until_decided and hours is None and not dry_run:
        raise ConfigError("Expected --hours with --until-decided, such as --hours 6.")
    if until_decided and part != (1, 1):
        raise ConfigError("Expected no --shard with --until-decided: which runs come next depends on all others.")


def _run_all(
    spec: "StudySpec", folder: "StudyFolder", part: tuple[int, int], jobs: int | None, executor: "Executor | None"
) -> int:
    """Run what is missing of a study, and return how many runs failed."""
    from swarm_forage_env.cli.printer import notes
    from swarm_forage_env.runs.store import FAILED
    from swarm_forage_env.studies.description import StudyOutcome
    from swarm_forage_env.studies.study_folder import run_study

    state = run_study(spec, folder, part=part, jobs=jobs, executor=executor, progress=True)
    if part == (1, 1):
        notes().print(f"packed into {_pack(folder.folder, None)}")
    typer.echo(StudyOutcome(outcomes=state, folder=folder))
    return state.count(FAILED)


def _run_until_decided(
    studies: "list[tuple[StudySpec, StudyFolder]]",
    seeds: int | None,
    hours: float,
    jobs: int | None,
    executor: "Executor | None",
) -> None:
    from metrics.claims.looks import looks_up_to
    from metrics.scoring import run_until_decided
    from swarm_forage_env.cli.printer import notes

    outlook = run_until_decided(
        studies,
        hours=hours,
        looks=looks_up_to(seeds) if seeds else None,
        jobs=jobs,
        executor=executor,
        progress=True,
        tell=notes().print,
    )
    for _, folder in studies if hours > 0.0 else ():
        notes().print(f"packed into {_pack(folder.folder, None)}")
    typer.echo(outlook)


def _summary(spec: "StudySpec", folder: "StudyFolder", part: tuple[int, int], jobs: int | None) -> "PlanSummary":
    """Say what is left to run, and how long it takes."""
    from swarm_forage_env.cli.printer import notes
    from swarm_forage_env.runs.plan_summary import summarize_plan
    from swarm_forage_env.studies.study_folder import shard

    index, count = part
    name = f"{spec.name}, budget {spec.budget}" + (f", shard {index} of {count}" if count > 1 else "")
    only, out = shard(spec.plan.specs, index, count), folder.store.folder
    return summarize_plan(spec.plan, name=name, only=only, out=out, jobs=jobs, tell=notes().print)


def status(place: Place, as_json: AsJson = False) -> None:
    """Show which runs of each condition are done, missing or failed; exit code 1 unless all are done."""
    from swarm_forage_env.cli.printer import show as print_answer
    from swarm_forage_env.studies.description import status as status_of

    found = status_of(_read(place))
    print_answer(found, as_json=as_json)
    if not found.is_complete:
        raise typer.Exit(EXIT_FAILURE)


def pack(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a study.")],
    file: Annotated[Path | None, typer.Option("--file", help="Packed study; default DIR/NAME.parquet.")] = None,
) -> None:
    """Put all runs of a study into one file, with everything that its folder knows about them."""
    typer.echo(f"packed into {_pack(folder, file)}")


def unpack(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Packed studies.")],
    out: Annotated[
        Path, typer.Option("--out", help="Parent of the folders of the studies, which are called NAME_BUDGET.")
    ] = Path("results/studies"),
) -> None:
    """Put the runs of packed studies into folders, so that study run can continue them."""
    from swarm_forage_env._internal.wording import counted
    from swarm_forage_env.studies.study_folder import StudyFolder
    from swarm_forage_env.studies.study_table import read_study, unpack_study

    for table in [read_study(file) for file in files]:  # all of them are read before anything is written
        folder = StudyFolder(_folder(table.spec, out, is_one=False))
        typer.echo(f"{counted(unpack_study(table, folder), 'run')} of {table.spec.name} added to {folder.folder}")


def _pack(folder: Path, chosen: Path | None) -> Path:
    from swarm_forage_env.cli.printer import notes
    from swarm_forage_env.studies.study_folder import StudyFolder
    from swarm_forage_env.studies.study_table import pack_study

    return pack_study(StudyFolder(folder), chosen, tell=notes().print)


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
    whole: Annotated[
        bool, typer.Option("--all", help="Also show the claims that wait for runs, which are else only counted.")
    ] = False,
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
        show_boxed(replace(found, is_folded=not whole))
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
    """Draw the figures of a study, with their numbers as CSV tables: each measure over what the study varies.

    Figures also show models: laws and a mean field if swarm sizes vary, the queue if robots leave and come back. Files
    called theory_... need no runs: availability curves and sketches of the measures. NAME_snapshot.png shows the arena
    at the start of a run. NAME_conditions.csv says how runs of each condition spread and how many broke down,
    ..._pairs.csv how often one policy is better than another.
    """
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


_PAGE_FORMS = (".html", ".md", ".txt", ".csv", ".json")


def report(
    places: Places,
    file: Annotated[
        Path,
        typer.Option("--file", help="File to write: the page (.html), or only its tables (.md, .txt, .csv, .json)."),
    ] = Path("report.html"),
    band: Band = False,
) -> None:
    """Write one page about studies: verdicts on the paper's claims, figures, numbers, settings and versions."""
    from metrics import report as report_of
    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env._internal.files import check_file
    from swarm_forage_env.cli.printer import notes

    if file.suffix not in _PAGE_FORMS:
        raise ConfigError(f"Expected --file as a file ending in {', '.join(_PAGE_FORMS)}, got {str(file)!r}.")
    tables = [_read(place) for place in places]
    check_file(file)
    report_of(*tables, band="sd" if band else "ci", tell=notes().print).write(file)
    notes().print(f"written {file}")


def diff(
    first: Annotated[Path, typer.Argument(metavar="A", help="Folder of a study, or its packed file.")],
    second: Annotated[Path, typer.Argument(metavar="B", help="Folder or packed file of the other study.")],
    columns: Annotated[
        str | None,
        typer.Option(
            "--columns", help="Recorded columns to test, separated by commas; see 'swarm-forage list columns'."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Show which conditions of two studies differ beyond chance.

    Exit code 0 if no condition differs; 1 if one does or may, or if one lacks finished runs in A or in B.
    """
    from metrics import diff as diff_of
    from metrics.scoring.study_diff import COLUMNS
    from swarm_forage_env.cli.printer import show as print_answer

    names = COLUMNS if columns is None else tuple(name.strip() for name in columns.split(","))
    found = diff_of(_read(first), _read(second), names)
    print_answer(found, as_json=as_json)
    if found.differs:
        raise typer.Exit(EXIT_FAILURE)
