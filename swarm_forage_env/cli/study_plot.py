"""The command `study plot`: the figures of a study, each with the numbers behind it."""

from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env.cli.options import Band, Variants


def plot(
    place: Annotated[Path, typer.Argument(metavar="DIR|FILE", help="Folder of a study, or its packed file.")],
    out: Annotated[Path | None, typer.Option("--out", help="Folder; default results/figures/NAME.")] = None,
    band: Band = False,
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
    from metrics import plot as plot_study
    from swarm_forage_env.cli.scenario_options import split_names
    from swarm_forage_env.cli.score_options import score_forms
    from swarm_forage_env.rendering.figures import FigureStyle
    from swarm_forage_env.studies.study_table import read_study

    forms = score_forms(variants, "marginal")
    table = read_study(place)
    plotted = plot_study(
        table,
        out or Path("results", "figures", table.spec.name),
        band="sd" if band else "ci",
        variants=forms.variants,
        formats=split_names(formats),
        style=FigureStyle(width_in=width, font_size=font_size, title=title),
    )
    for file in plotted.files:
        typer.echo(file)
    for line in plotted.missing:
        typer.echo(line, err=True)
