"""The command `study plot`: the figures of a study, each with the numbers behind it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import typer

from swarm_forage_env.cli.options import Variants

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import polars as pl

    from metrics.scoring.figure_panels import StudyPanels
    from metrics.scoring.study_models import ModelFigure
    from metrics.scoring.study_plots import StudyFigure
    from swarm_forage_env.cli.theory import TheoryFigure
    from swarm_forage_env.studies.study import StudySpec

    Draw: TypeAlias = Callable[[Sequence[Path]], None]

FORMATS = (".svg", ".png")


def plot(
    place: Annotated[Path, typer.Argument(metavar="DIR|FILE", help="Folder of a study, or its packed file.")],
    out: Annotated[Path | None, typer.Option("--out", help="Folder; default results/figures/NAME.")] = None,
    band: Annotated[
        str, typer.Option("--band", help="ci: 95 % interval of the mean; sd: mean ± 2 standard deviations of runs.")
    ] = "ci",
    variants: Variants = "corrected",
) -> None:
    """Draw the figures of a study as SVG, PNG and tables in CSV: each measure over what is varied, and models.

    Models are laws and a mean field where swarm sizes vary, the queue where robots leave and come. theory_... has what
    follows without runs: availability curves, and sketches of the measures. NAME_snapshot.png is the arena when a run
    begins. NAME_cells.csv has how runs of each cell spread and how many broke down, ..._pairs.csv which policy is
    better how often.
    """
    from metrics.scoring.cell_distributions import cell_distributions
    from metrics.scoring.figure_panels import study_panels
    from metrics.scoring.study_models import model_figures
    from swarm_forage_env._internal.fields import known_name
    from swarm_forage_env.cli.score_options import score_forms
    from swarm_forage_env.cli.theory import theory_of
    from swarm_forage_env.studies.study_table import read_study

    known_name("band", band, ("ci", "sd"))
    forms = score_forms(variants, "marginal")
    table = read_study(place)
    scored = study_panels(table, forms.variants)
    figures = figures_of(scored, table.spec.name)
    folder = out or Path("results", "figures", table.spec.name)
    for figure in figures:
        for file in written(figure, folder, band):
            typer.echo(file)
    for model in model_figures(table):
        for file in models_written(model, folder):
            typer.echo(file)
    for sketch in theory_of(table.spec):
        for file in theory_written(sketch, folder):
            typer.echo(file)
    typer.echo(snapshot_written(table.spec, folder / f"{table.spec.name}_snapshot.png"))
    cells = folder / f"{table.spec.name}_cells.csv"
    cell_distributions(table).write_csv(cells)
    typer.echo(cells)
    for (measure, variant), why in scored.missing.items():
        typer.echo(f"no figure of {measure}, {variant}: {why}", err=True)


def figures_of(scored: "StudyPanels", name: str) -> "tuple[StudyFigure, ...]":
    """Return the figures of a study.

    Raises:
        ConfigError: it has none.
    """
    from metrics.scoring.study_plots import study_figures
    from swarm_forage_env._internal.fields import ConfigError

    figures = study_figures(scored)
    if not figures:
        reasons = "; ".join(dict.fromkeys(scored.missing.values()))
        raise ConfigError(
            f"Expected a study with finished runs and numbers on its last axis, got {name}, which gives nothing to "
            f"draw{f': {reasons}' if reasons else ''}."
        )
    return figures


def written(figure: "StudyFigure", folder: Path, band: Any) -> list[Path]:
    """Draw a figure into a folder, and write its numbers and its pairs of policies beside it; returns the files.

    Raises:
        ImportError: matplotlib is not installed.
    """
    from metrics.scoring.policy_pairs import policy_pairs

    files: list[Path] = []
    for name, draw in drawn_by(figure, band).items():
        files += _written(name, folder, draw, {f"{name}.csv": figure.to_frame()})
    pairs = policy_pairs(figure.panels)
    if len(pairs):
        files.append(folder / f"{figure.name}_pairs.csv")
        pairs.write_csv(files[-1])
    return files


def drawn_by(figure: "StudyFigure", band: Any) -> "dict[str, Draw]":
    """Return name -> what draws it, of the curves of a figure and of its heat maps, if it has them."""
    from metrics.scoring.study_plots import draw_figure, draw_map

    draws: dict[str, Draw] = {figure.name: lambda paths: draw_figure(figure, paths, band=band)}
    if figure.has_map:
        draws[f"{figure.name}_map"] = lambda paths: draw_map(figure, paths)
    return draws


def models_written(figure: "ModelFigure", folder: Path) -> list[Path]:
    """Draw models into a folder, and write the curves and what models say in numbers beside them; returns the files.

    Raises:
        ImportError: matplotlib is not installed.
    """
    from metrics.scoring.model_plots import draw_models

    tables = {f"{figure.name}.csv": figure.to_frame(), f"{figure.name}_facts.csv": figure.facts()}
    return _written(figure.name, folder, lambda paths: draw_models(figure, paths), tables)


def theory_written(figure: "TheoryFigure", folder: Path) -> list[Path]:
    """Draw a figure of theory into a folder, and write its numbers beside it; returns the files.

    Raises:
        ImportError: matplotlib is not installed.
    """
    from swarm_forage_env.cli.theory import draw_theory

    tables = {f"{figure.name}.csv": figure.numbers}
    return _written(figure.name, folder, lambda paths: draw_theory(figure, paths), tables)


def snapshot_written(spec: "StudySpec", file: Path) -> Path:
    """Draw the arena of a study, as it is when a run begins, into a picture file; returns the file.

    Raises:
        ImportError: Pillow is not installed.
    """
    from swarm_forage_env.inspect.snapshot import snapshot

    picture = snapshot(spec)
    from PIL import Image  # after the frame, which says what to install without it

    Image.fromarray(picture).save(file, optimize=True)
    return file


def _written(name: str, folder: Path, draw: "Draw", tables: "Mapping[str, pl.DataFrame]") -> list[Path]:
    pictures = [folder / f"{name}{suffix}" for suffix in FORMATS]
    draw(pictures)
    for file, frame in tables.items():
        frame.write_csv(folder / file)
    return [*pictures, *(folder / file for file in tables)]
