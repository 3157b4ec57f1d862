"""The figures of a study as files, each with the numbers behind it: `plot`."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from swarm_forage_env._internal.fields import known_name
from swarm_forage_env.inspect.snapshot import snapshot
from swarm_forage_env.rendering.figures import FORMATS, SCREEN, FigureStyle
from swarm_forage_env.studies.study import StudySpec

from ..checks import CurveError
from ..curves import Variant
from .figure_panels import StudyPanels, study_panels
from .model_plots import draw_models
from .place_distributions import place_distributions
from .policy_pairs import policy_pairs
from .study_models import model_figures
from .study_plots import Band, StudyFigure, checked_band, draw_figure, draw_map, study_figures
from .theory import theory_of

if TYPE_CHECKING:
    import polars as pl

    from swarm_forage_env.studies.study_table import StudyTable

Draw: TypeAlias = Callable[[Sequence[Path], FigureStyle], None]


@dataclass(frozen=True, kw_only=True, eq=False)
class PlottedStudy:
    """Files of `plot`."""

    files: tuple[Path, ...]
    missing: tuple[str, ...]
    """Measures without a figure, and why."""


def plot(
    table: "StudyTable",
    folder: str | Path,
    *,
    band: Band = "ci",
    variants: Sequence[Variant] = ("corrected",),
    formats: Sequence[str] = ("svg", "png"),
    style: FigureStyle = SCREEN,
) -> PlottedStudy:
    """Draw the figures of a study, with tables in CSV: each measure over what is varied, and models.

    Args:
        table: From `swarm_forage_env.read_study`.
        folder: Where the files go.
        band: "ci", the 95 % interval of the mean; "sd", mean ± 2 standard deviations of runs.
        variants: Variants of the measures.
        formats: Of the pictures: "svg", "png", "pdf".
        style: Of the figures.

    Raises:
        ValueError: the study gives nothing to draw, or an unknown band, format or variant.
        ImportError: matplotlib or Pillow is not installed.
    """
    checked_band(band)
    for name in formats:
        known_name("format", name, [known[1:] for known in FORMATS])
    scored = study_panels(table, variants)
    figures = figures_of(scored, table.spec.name)
    drawing = _Drawing(Path(folder), tuple(f".{name}" for name in formats), style)
    files = [file for figure in figures for file in drawing.measure(figure, band)]
    for model in model_figures(table):
        tables = {f"{model.name}.csv": model.to_frame(), f"{model.name}_facts.csv": model.facts()}
        files += drawing.files(model.name, lambda paths, style, it=model: draw_models(it, paths, style=style), tables)
    for sketch in theory_of(table.spec):
        files += drawing.files(sketch.name, sketch.draw, {f"{sketch.name}.csv": sketch.numbers})
    files.append(snapshot_written(table.spec, drawing.folder / f"{table.spec.name}_snapshot.png"))
    files.append(drawing.table(f"{table.spec.name}_conditions.csv", place_distributions(table)))
    missing = tuple(f"no figure of {measure}, {variant}: {why}" for (measure, variant), why in scored.missing.items())
    return PlottedStudy(files=tuple(files), missing=missing)


def figures_of(scored: StudyPanels, name: str) -> tuple[StudyFigure, ...]:
    """Return the figures of a study.

    Raises:
        CurveError: it has none.
    """
    figures = study_figures(scored)
    if not figures:
        reasons = "; ".join(dict.fromkeys(scored.missing.values()))
        raise CurveError(
            f"Expected a study with finished runs and numbers on its last axis, got {name}, which gives nothing to "
            f"draw{f': {reasons}' if reasons else ''}."
        )
    return figures


@dataclass(frozen=True, slots=True)
class _Drawing:
    """Where figures go, in which formats and in which style."""

    folder: Path
    endings: tuple[str, ...]
    style: FigureStyle

    def files(self, name: str, draw: Draw, tables: "Mapping[str, pl.DataFrame]") -> list[Path]:
        """Draw a figure, and write the tables behind it beside it, by the names of their files; returns all files."""
        pictures = [self.folder / f"{name}{ending}" for ending in self.endings]
        draw(pictures, self.style)
        return [*pictures, *(self.table(file, frame) for file, frame in tables.items())]

    def table(self, name: str, frame: "pl.DataFrame") -> Path:
        """Write a table; returns its file."""
        frame.write_csv(self.folder / name)
        return self.folder / name

    def measure(self, figure: StudyFigure, band: Band) -> Iterator[Path]:
        """Draw a figure and its heat maps, with its numbers and its pairs of policies; yields all files."""
        for name, draw in drawn_by(figure, band).items():
            yield from self.files(name, draw, {f"{name}.csv": figure.to_frame()})
        pairs = policy_pairs(figure.panels)
        if len(pairs):
            yield self.table(f"{figure.name}_pairs.csv", pairs)


def drawn_by(figure: StudyFigure, band: Band) -> dict[str, Draw]:
    """Return name -> what draws it, of the curves of a figure and of its heat maps, if it has them."""
    draws: dict[str, Draw] = {figure.name: lambda paths, style: draw_figure(figure, paths, band=band, style=style)}
    if figure.has_map:
        draws[f"{figure.name}_map"] = lambda paths, style: draw_map(figure, paths, style=style)
    return draws


def snapshot_written(spec: StudySpec, file: Path) -> Path:
    """Draw the arena of a study, as it is when a run begins, into a picture file; returns the file.

    Raises:
        ImportError: Pillow is not installed.
    """
    picture = snapshot(spec)
    from PIL import Image  # after the frame, which says what to install without it

    Image.fromarray(picture).save(file, optimize=True)
    return file
