"""The command `study plot`: the figures of a study, each with the numbers behind it."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import typer

from swarm_forage_env.cli.options import Variants

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import polars as pl

    from metrics.scoring.figure_panels import StudyPanels
    from metrics.scoring.study_plots import StudyFigure
    from swarm_forage_env.rendering.figures import FigureStyle
    from swarm_forage_env.studies.study import StudySpec

    Draw: TypeAlias = Callable[[Sequence[Path], FigureStyle], None]


def plot(
    place: Annotated[Path, typer.Argument(metavar="DIR|FILE", help="Folder of a study, or its packed file.")],
    out: Annotated[Path | None, typer.Option("--out", help="Folder; default results/figures/NAME.")] = None,
    band: Annotated[
        str, typer.Option("--band", help="ci: 95 % interval of the mean; sd: mean ± 2 standard deviations of runs.")
    ] = "ci",
    variants: Variants = "corrected",
    formats: Annotated[str, typer.Option("--format", help="svg, png, pdf; separated by commas.")] = "svg,png",
    width: Annotated[
        float | None,
        typer.Option("--width", min=2.0, max=100.0, help="Of a figure, in inches; default what its panels need."),
    ] = None,
    font_size: Annotated[float, typer.Option("--font-size", min=4.0, max=40.0, help="Of words, in points.")] = 9.0,
    title: Annotated[bool, typer.Option("--title/--no-title", help="Headlines; in a paper, captions say it.")] = True,
) -> None:
    """Draw the figures of a study, with tables in CSV: each measure over what is varied, and models.

    Models are laws and a mean field where swarm sizes vary, the queue where robots leave and come. theory_... has what
    follows without runs: availability curves, and sketches of the measures. NAME_snapshot.png is the arena when a run
    begins. NAME_conditions.csv has how runs of each condition spread and how many broke down, ..._pairs.csv which
    policy is better how often.
    """
    from metrics.scoring.figure_panels import study_panels
    from metrics.scoring.model_plots import draw_models
    from metrics.scoring.place_distributions import place_distributions
    from metrics.scoring.study_models import model_figures
    from metrics.scoring.theory import theory_of
    from swarm_forage_env._internal.fields import known_name
    from swarm_forage_env.cli.scenario_options import split_names
    from swarm_forage_env.cli.score_options import score_forms
    from swarm_forage_env.rendering.figures import FORMATS, FigureStyle
    from swarm_forage_env.studies.study_table import read_study

    known_name("band", band, ("ci", "sd"))
    endings = tuple(f".{name}" for name in split_names(formats))
    for ending in endings:
        known_name("format", ending[1:], [known[1:] for known in FORMATS])
    forms = score_forms(variants, "marginal")
    table = read_study(place)
    scored = study_panels(table, forms.variants)
    figures = figures_of(scored, table.spec.name)
    folder = out or Path("results", "figures", table.spec.name)
    drawing = Drawing(folder, endings, FigureStyle(width_in=width, font_size=font_size, title=title))
    for figure in figures:
        drawing.write_figure(figure, band)
    for model in model_figures(table):
        tables = {f"{model.name}.csv": model.to_frame(), f"{model.name}_facts.csv": model.facts()}
        drawing.write(model.name, lambda paths, style, it=model: draw_models(it, paths, style=style), tables)
    for sketch in theory_of(table.spec):
        tables = {f"{sketch.name}.csv": sketch.numbers}
        drawing.write(sketch.name, sketch.draw, tables)
    typer.echo(snapshot_written(table.spec, folder / f"{table.spec.name}_snapshot.png"))
    places = folder / f"{table.spec.name}_conditions.csv"
    place_distributions(table).write_csv(places)
    typer.echo(places)
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


@dataclass(frozen=True, slots=True)
class Drawing:
    """Where figures go, in which formats and in which style. Says each file that is written."""

    folder: Path
    endings: tuple[str, ...]
    style: "FigureStyle"

    def write(self, name: str, draw: "Draw", tables: "Mapping[str, pl.DataFrame]") -> None:
        """Draw a figure, and write the tables behind it beside it, by the names of their files.

        Raises:
            ImportError: matplotlib is not installed.
        """
        pictures = [self.folder / f"{name}{ending}" for ending in self.endings]
        draw(pictures, self.style)
        for file, frame in tables.items():
            frame.write_csv(self.folder / file)
        for file in (*pictures, *(self.folder / file for file in tables)):
            typer.echo(file)

    def write_figure(self, figure: "StudyFigure", band: Any) -> None:
        """Draw a figure and its heat maps, with its numbers and its pairs of policies; errors are those of `write`."""
        from metrics.scoring.policy_pairs import policy_pairs

        for name, draw in drawn_by(figure, band).items():
            self.write(name, draw, {f"{name}.csv": figure.to_frame()})
        pairs = policy_pairs(figure.panels)
        if len(pairs):
            file = self.folder / f"{figure.name}_pairs.csv"
            pairs.write_csv(file)
            typer.echo(file)


def drawn_by(figure: "StudyFigure", band: Any) -> "dict[str, Draw]":
    """Return name -> what draws it, of the curves of a figure and of its heat maps, if it has them."""
    from metrics.scoring.study_plots import draw_figure, draw_map

    draws: dict[str, Draw] = {figure.name: lambda paths, style: draw_figure(figure, paths, band=band, style=style)}
    if figure.has_map:
        draws[f"{figure.name}_map"] = lambda paths, style: draw_map(figure, paths, style=style)
    return draws


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
