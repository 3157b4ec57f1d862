"""The command `study plot`: the figures of a study, each with the numbers behind it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swarm_forage_env.cli.options import NO_PICTURE, Variants

if TYPE_CHECKING:
    from metrics.scoring.figure_panels import StudyPanels
    from metrics.scoring.study_models import ModelFigure
    from metrics.scoring.study_plots import StudyFigure

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

    Models are laws and a mean field where swarm sizes vary, the queue where robots leave and come. NAME_cells.csv has
    how runs of each cell spread and how many broke down, ..._pairs.csv which policy is better how often.
    """
    from metrics.scoring.cell_distributions import cell_distributions
    from metrics.scoring.figure_panels import study_panels
    from metrics.scoring.study_models import model_figures
    from swarm_forage_env._internal.fields import known_name
    from swarm_forage_env.cli.score_options import score_forms
    from swarm_forage_env.study.study_table import read_study

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
    from metrics.scoring.study_plots import draw_figure, draw_map

    folder.mkdir(parents=True, exist_ok=True)
    names = [figure.name, f"{figure.name}_map"] if figure.has_map else [figure.name]
    files: list[Path] = []
    for name in names:
        pictures = [folder / f"{name}{suffix}" for suffix in FORMATS]
        try:
            if name == figure.name:
                draw_figure(figure, pictures, band=band)
            else:
                draw_map(figure, pictures)
        except ImportError as error:
            raise ImportError(NO_PICTURE) from error
        numbers = folder / f"{name}.csv"
        figure.to_frame().write_csv(numbers)
        files += [*pictures, numbers]
    pairs = policy_pairs(figure.panels)
    if len(pairs):
        files.append(folder / f"{figure.name}_pairs.csv")
        pairs.write_csv(files[-1])
    return files


def models_written(figure: "ModelFigure", folder: Path) -> list[Path]:
    """Draw models into a folder, and write the curves and what models say in numbers beside them; returns the files.

    Raises:
        ImportError: matplotlib is not installed.
    """
    from metrics.scoring.model_plots import draw_models

    folder.mkdir(parents=True, exist_ok=True)
    pictures = [folder / f"{figure.name}{suffix}" for suffix in FORMATS]
    try:
        draw_models(figure, pictures)
    except ImportError as error:
        raise ImportError(NO_PICTURE) from error
    tables = {f"{figure.name}.csv": figure.to_frame(), f"{figure.name}_facts.csv": figure.facts()}
    for name, frame in tables.items():
        frame.write_csv(folder / name)
    return [*pictures, *(folder / name for name in tables)]
