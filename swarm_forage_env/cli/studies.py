"""The commands of studies: what there is, running them, and what came of them."""

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

from cyclopts import App, Parameter
from cyclopts.types import PositiveInt

from swarm_forage_env.cli import EXIT_FAILURE
from swarm_forage_env.cli.options import AnswerFile, AsJson, DryRun, Jobs, Names, StyleOptions
from swarm_forage_env.cli.printer import note, say, show

if TYPE_CHECKING:
    from collections.abc import Sequence

    from metrics.curves import Variant
    from swarm_forage_env.studies.results import StudyTable

app = App(name="study", help="Run the paper's experiments, or your own.")

Place = Annotated[Path, Parameter(help="Folder of a study, or its packed file.")]
Places = Annotated[tuple[Path, ...], Parameter(help="Folders of studies, or their packed files.")]


@app.command(name="list")
def list_studies(*, budget: str = "paper") -> None:
    """List the experiment sets of the paper: how many runs they make, and what a budget leaves out.

    Args:
        budget: smoke, reduced or paper.
    """
    from swarm_forage_env.studies.description import paper_sets

    show(paper_sets(budget))


@app.command
def run(
    name: Annotated[str, Parameter(help="A set of the paper (S1a to S2d), or a study file.")],
    /,
    *,
    budget: str | None = None,
    out: Path | None = None,
    seeds: PositiveInt | None = None,
    rules: str = "file",
    shard: str = "1/1",
    jobs: Jobs = None,
    cluster: str | None = None,
    dry_run: DryRun = False,
) -> int:
    """Make the missing runs of a study, and pack it into one file.

    'swarm-forage study run S1a --budget smoke' is a first look, in a minute or two.

    Finished runs are kept: after Ctrl-C, or with more seeds, the same command does the rest.

    Args:
        budget: How much to run; default the first budget of the file.
        out: Folder; default results/studies/NAME_BUDGET.
        seeds: Runs per condition; default the budget's number.
        rules: described, program (the authors'), both, or file: what the file says.
        shard: I/N: make only the I-th of N equal parts of the runs.
        cluster: Run on Dask: local, or the address of a scheduler (docs/studies.md).
    """
    from swarm_forage_env._internal.fields import known_name
    from swarm_forage_env.runs.cluster import cluster_executor
    from swarm_forage_env.runs.plan import planned_line
    from swarm_forage_env.runs.store import failure_file
    from swarm_forage_env.studies import results
    from swarm_forage_env.studies.description import status as status_of
    from swarm_forage_env.studies.study import load_study
    from swarm_forage_env.studies.study_file import RULES_NAMES

    known_name("rules", rules, (*RULES_NAMES, "both", "file"))
    chosen = {"both": tuple(RULES_NAMES), "file": None}.get(rules, rules)
    study = load_study(name, budget, seeds=seeds, rules=chosen)
    folder = out or Path("results", "studies", f"{study.name}_{study.budget}")
    if dry_run:
        planned = results.shard(study.plan.specs, shard)
        say(f"{study.name}, budget {study.budget}, shard {shard}: {planned_line(planned, folder / 'runs')}")
        return 0
    with nullcontext() if cluster is None else cluster_executor(cluster, jobs) as executor:
        found = results.run_study(study, folder, part=shard, jobs=jobs, executor=executor, progress=True)
    if shard == "1/1":
        file, table = results.pack_study(folder)
        note(f"packed into {file}")
        show(status_of(table))
    else:
        say(f"shard {shard}: {found.n_done:,} runs done, {len(found.failures):,} failed, in {folder}")
    for run_id in list(found.failures)[:1]:
        note(f"again, alone: swarm-forage rerun {failure_file(folder / 'runs', run_id)}")
    return EXIT_FAILURE if found.failures else 0


@app.command
def status(place: Place, /, *, as_json: AsJson = False) -> int:
    """Show which runs of each condition are done, missing or failed; exit code 1 unless all are done."""
    from swarm_forage_env.studies.description import status as status_of

    found = status_of(_read(place))
    show(found, as_json=as_json)
    return 0 if found.is_complete else EXIT_FAILURE


def _read(place: Path) -> "StudyTable":
    """Read a study, and tell of damaged files in its folder."""
    from swarm_forage_env.studies.results import read_study

    table = read_study(place)
    for line in table.damaged_lines:
        note(line)
    return table


@app.command
def verdict(places: Places, /, *, file: AnswerFile = None, as_json: AsJson = False) -> None:
    """Test the claims of the paper with runs of its sets: which claims they support, contradict or leave open.

    First come the counts of each answer and one table of all claims; then the evidence for each answer. The same
    follows for the paper's intuitions, what the authors expected of each algorithm before the experiments.
    """
    from metrics import verdict as verdict_of
    from swarm_forage_env.sheet import check_form

    if file is not None:
        check_form(file)
    found = verdict_of(*map(_read, places), tell=note)
    for remark in found.remarks:
        note(f"note: {remark}")
    show(found, as_json=as_json, file=file)


@app.command
def plot(
    place: Place,
    /,
    *,
    out: Path | None = None,
    band: bool = False,
    variant: Names = ("corrected",),
    formats: Annotated[Names, Parameter(name="--format")] = ("svg", "png"),
    style: StyleOptions = StyleOptions(),
) -> None:
    """Draw the figures of a study, with their numbers as CSV tables: each measure over what the study varies.

    Args:
        out: Folder; default results/figures/NAME.
        band: Show the paper's bands, mean ± 2 standard deviations of single runs.
        variant: Forms of equations: corrected, paper (as printed); separated by commas.
        formats: svg, png, pdf; separated by commas.
    """
    from metrics import plot as plot_study

    table = _read(place)
    files, missing = plot_study(
        table,
        out or Path("results", "figures", table.spec.name),
        band="sd" if band else "ci",
        variants=cast("Sequence[Variant]", variant),
        formats=formats,
        style=style.style(),
    )
    for file in files:
        say(file)
    for line in missing:
        note(line)
