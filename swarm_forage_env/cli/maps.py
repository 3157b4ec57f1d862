"""The command `maps`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarm_forage_env.cli.options import Jobs, Picture, PolicyOptions, WorldOptions, refuse_others
from swarm_forage_env.cli.printer import notes, progress_bar

if TYPE_CHECKING:
    from collections.abc import Sequence

    from swarm_forage_env.inspect.maps import ComparedMaps
    from swarm_forage_env.runs.spec import RunSpec
    from swarm_forage_env.studies.study_table import StudyTable

PICTURE_FILE = "maps.png"
_OF_ALL = ("policies", "named_policies", "square", "per_robot", "own_scales", "picture")
"""Options that go with a page and a record, too."""
_OF_STUDIES = (*_OF_ALL, "seeds", "conditions", "jobs")
"""Options that go with a study."""


def maps(
    context: typer.Context,
    policies: PolicyOptions,
    described: WorldOptions,
    seeds: Annotated[
        int | None, typer.Option("--seeds", min=1, help="Runs per row; default 1, or up to 4 for a study.")
    ] = None,
    conditions: Annotated[
        list[str] | None,
        typer.Option(
            "--condition",
            metavar="KEY=VALUE,...",
            help="Only conditions of a study with these values, e.g. policy=dpo,population_size=16; may be repeated.",
        ),
    ] = None,
    square: Annotated[float, typer.Option("--square", help="Side of the squares in m.")] = 0.4,
    per_robot: Annotated[
        bool, typer.Option("--per-robot", help="Divide by the swarm size, to compare swarms of several sizes.")
    ] = False,
    own_scales: Annotated[
        bool,
        typer.Option(
            "--own-scales", help="Give each map its own scale; default one scale per column, to compare rows."
        ),
    ] = False,
    jobs: Jobs = None,
    picture: Picture = None,
) -> None:
    """Draw where robots were, where they took and left objects, and where they got in each other's way.

    Takes policies in a scenario, a page of 'swarm-forage replay', a stored run, or a study (folder or packed file). The
    picture has one row per policy, run of the page or condition of the study. Further rows show the difference of each
    from the first. The arrays go to .npz files beside the picture. Stored runs hold no positions, so the command makes
    them again.
    """
    from swarm_forage_env.cli.scenario_options import described_world, plan_runs
    from swarm_forage_env.rendering.figures import check_picture
    from swarm_forage_env.runs.record import is_record
    from swarm_forage_env.studies.study_table import read_study

    words = policies.names()
    place = Path(words[0])
    if place.suffix == ".html":
        refuse_others(context, "a page", _OF_ALL, "which describe runs; leave them out, or name a policy")
        found, file = _of_page(Path(policies.one()), square), picture or place.with_suffix(".maps.png")
        check_picture(file)
    elif place.suffix == ".parquet" and is_record(place):
        refuse_others(context, "a stored run", _OF_ALL, "which describe another one; leave them out, or name a policy")
        file = picture or place.with_suffix(".maps.png")
        check_picture(file)
        found = _of_record(Path(policies.one()), square)
    elif place.suffix == ".parquet" or place.is_dir():
        refuse_others(context, "a study", _OF_STUDIES, "which describe other runs; leave them out, or name a policy")
        study = read_study(Path(policies.one()))
        file = picture or Path("results", "maps", study.spec.name, PICTURE_FILE)
        check_picture(file)
        found = _of_study(study, conditions or (), seeds, square, jobs)
    else:
        specs = plan_runs(described, words, n_seeds=seeds or 1, first_seed=0)
        file = picture or Path("results", "maps", described_world(described)[0].file_name, PICTURE_FILE)
        check_picture(file)
        found = _of_runs(specs, square, jobs)
    try:
        (found.per_robot() if per_robot else found).write(file, own_scales=own_scales)
    except ImportError as error:
        notes().print(str(error))
    typer.echo(f"wrote maps to {file} and .npz files beside it")


def _of_page(page: Path, square: float) -> "ComparedMaps":
    from swarm_forage_env.inspect.maps import maps_of_page

    return maps_of_page(page, side_m=square)


def _of_record(place: Path, square: float) -> "ComparedMaps":
    """Make a stored run again, and tell if it came out different."""
    from swarm_forage_env.cli.printer import refusing
    from swarm_forage_env.inspect.maps import maps_of_record
    from swarm_forage_env.policies.registry import load_policy
    from swarm_forage_env.runs.record import RunRecord
    from swarm_forage_env.runs.spec import RunSpec

    record = RunRecord.read(place)
    spec = RunSpec.from_json(record.spec)
    with refusing():  # a policy that is not installed here is told of; a ValueError of its run is a fault
        load_policy(spec.policy, spec.parameters)
    with progress_bar("making the run again", spec.robot_ticks) as advance:
        found, is_same = maps_of_record(record, side_m=square, advance=advance)
    _tell_of_changed([] if is_same else [record.run_id])
    return found


def _tell_of_changed(run_ids: "Sequence[str]") -> None:
    if run_ids:
        notes().print(
            f"Runs that come out different from their records, which other versions made: {', '.join(run_ids)}; "
            "the maps show them as they are now."
        )


def _of_study(
    table: "StudyTable", conditions: "Sequence[str]", seeds: int | None, square: float, jobs: int | None
) -> "ComparedMaps":
    """Make runs of a study again, and tell which came out different."""
    from swarm_forage_env.inspect.maps import ComparedMaps
    from swarm_forage_env.inspect.study_maps import choose_places, maps_of_places, robot_ticks

    chosen = choose_places(table.spec, conditions)
    with progress_bar("making the runs again", robot_ticks(table.spec, chosen, seeds)) as advance:
        found, changed = maps_of_places(table, chosen, n_seeds=seeds, side_m=square, jobs=jobs, advance=advance)
    _tell_of_changed(changed)
    return ComparedMaps(maps=tuple(found))


def _of_runs(specs: "Sequence[RunSpec]", square: float, jobs: int | None) -> "ComparedMaps":
    """Make the runs, and show how far they are."""
    from swarm_forage_env.inspect.maps import maps_of_runs

    with progress_bar("runs", sum(spec.robot_ticks for spec in specs)) as advance:
        return maps_of_runs(specs, side_m=square, jobs=jobs, advance=advance)
