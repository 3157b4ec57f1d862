"""Figures of a study, drawn and as files: measures with every run a dot, and models. They need the extra "plots"."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env._internal.fields import known_name
from swarm_forage_env._internal.wording import number
from swarm_forage_env.inspect.study_maps import snapshot
from swarm_forage_env.rendering.figures import (
    FORMATS,
    SCREEN,
    FigureStyle,
    Look,
    Panel,
    heat_map,
    looks,
    policy_words,
    saved_panels,
    shade,
    size_axis,
)
from swarm_forage_env.studies.study import StudySpec
from swarm_forage_env.wrappers.world import SIZE

from ..catalog import METRICS
from ..checks import CurveError
from ..claims import PanelName
from ..curves import FloatArray, Variant
from ..statistics import Summary, aggregate
from .plots import FEWEST_RUNS, X_LABELS
from .scores import label_of
from .study_models import model_figures
from .study_numbers import StudyPanel, StudyPanels, place_distributions, policy_pairs, study_panels
from .theory import theory_of

if TYPE_CHECKING:
    import polars as pl

    from swarm_forage_env.studies.study_table import StudyTable

Band: TypeAlias = Literal["ci", "sd"]
"""What is shaded: the 95 % confidence interval of the mean, or the mean plus and minus two standard deviations."""

_BANDS: dict[Band, str] = {"ci": "95 % interval of the mean", "sd": "mean ± 2 standard deviations of runs"}
_NOTHING = Summary.without_interval()
_APART = 0.012
"""Distance between the dots of different policies at one level, as a share of the axis."""
MANY_DOTS = 500
"""More dots in a panel are put into vector pictures as an image: as single marks they take a megabyte and more."""
Draw: TypeAlias = Callable[[Sequence[Path], FigureStyle], None]


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyFigure:
    """Panels of one measure in one form, variant and rules: one per value of the axes before the last."""

    panels: tuple[StudyPanel, ...]

    @property
    def name(self) -> str:
        """Name of its files: study, measure, rules; the form and the variant if it is not the usual one."""
        first = self.panels[0]
        form = "" if first.form == "marginal" else first.form
        variant = "" if first.variant == "corrected" else first.variant
        words = (first.study, first.measure, form, first.rules, variant)
        return "_".join(word for word in words if word)

    @property
    def title(self) -> str:
        """Headline."""
        first = self.panels[0]
        arrow = "higher" if first.higher_is_better else "lower"
        measure = label_of(first.measure, "corrected", first.form).replace("_", " ")
        words = f"{measure} ({arrow} is better), rules {first.rules}"
        return f"{first.study}: {words}" + ("" if first.variant == "corrected" else f", measure {first.variant}")

    @property
    def has_map(self) -> bool:
        """Whether it varies two numbers, so that a heat map shows it whole."""
        others = [tuple(panel.others.values()) for panel in self.panels]
        numbers = all(len(place) == 1 and not isinstance(place[0], str | bool) for place in others)
        return (
            numbers and len(others) > 1 and all(panel.x.tolist() == self.panels[0].x.tolist() for panel in self.panels)
        )

    def to_frame(self) -> "pl.DataFrame":
        """Return the numbers behind the picture: one row per panel, policy and level, and a column per run."""
        import polars as pl

        rows: list[dict[str, Any]] = []
        for panel in self.panels:
            for policy, scores in panel.scores.items():
                for x, level, runs, summary in zip(panel.x, panel.levels, scores, _summaries(scores), strict=True):
                    place = {"rules": panel.rules, **panel.others, "policy": policy}
                    means = {"mean": summary.mean, "lower": summary.lower, "upper": summary.upper, "sd": summary.std}
                    of_runs = {f"seed_{seed}": value for seed, value in zip(panel.seeds, runs.tolist(), strict=True)}
                    where = {panel.criterion: float(x), "level": float(level)}
                    rows.append({**place, **where, **means, "n_runs": summary.n_used, **of_runs})
        return pl.DataFrame(rows, infer_schema_length=None).fill_nan(None)


def study_figures(scored: StudyPanels) -> tuple[StudyFigure, ...]:
    """Return the figures of a study, those without a single score left out."""
    groups: dict[tuple[str, str, PanelName], list[StudyPanel]] = {}
    for panel in scored.panels:
        if any(np.isfinite(scores).any() for scores in panel.scores.values()):
            groups.setdefault((panel.rules, panel.variant, panel.name._replace(experiment="")), []).append(panel)
    return tuple(StudyFigure(panels=tuple(panels)) for panels in groups.values())


def checked_band(word: str) -> Band:
    """Return a band by its name; raises ConfigError on an unknown one."""
    known_name("band", word, _BANDS)
    return "sd" if word == "sd" else "ci"


def draw_figure(figure: StudyFigure, paths: Sequence[Path], *, band: Band = "ci", style: FigureStyle = SCREEN) -> None:
    """Draw a figure into picture files: lines are means, dots are runs, and bands are where there are `FEWEST_RUNS`.

    Args:
        figure: From `study_figures`.
        paths: Files to write; as in `saved_figure`, whose errors this has.
        band: What is shaded.
        style: Of the figure.
    """
    title = f"{figure.title}\n{caption(figure, band)}"
    with saved_panels(paths, len(figure.panels), (3.6, 3.2), sharey=True, title=title, style=style) as places:
        for place, panel in zip(places, figure.panels, strict=True):
            _draw_panel(place, panel, band)
        limit_height(places[0], figure)


def caption(figure: StudyFigure, band: Band) -> str:
    """Return what dots and bands are, and why some or all bands are missing."""
    n_runs = [s.n_used for panel in figure.panels for scores in panel.scores.values() for s in _summaries(scores)]
    if max(n_runs) < FEWEST_RUNS:
        return f"lines: means; dots: runs\nno bands: fewer than {FEWEST_RUNS} runs of a condition tell too little"
    lacking = f"\nno band: conditions with fewer than {FEWEST_RUNS} runs, which tell too little"
    return f"shaded: {_BANDS[band]}; dots: runs" + (lacking if any(0 < n < FEWEST_RUNS for n in n_runs) else "")


def draw_map(figure: StudyFigure, paths: Sequence[Path], *, style: FigureStyle = SCREEN) -> None:
    """Draw the means of a figure as heat maps, one per policy, into picture files.

    Args:
        figure: One that `has_map`.
        paths: Files to write; as in `saved_figure`, whose errors this has.
        style: Of the figure.
    """
    first = figure.panels[0]
    means = {
        policy: np.array([[s.mean for s in _summaries(panel.scores[policy])] for panel in figure.panels])
        for policy in first.scores
    }
    known = np.concatenate([values[np.isfinite(values)] for values in means.values()])
    low, high = float(known.min()), float(known.max())
    ((axis, _),) = first.others.items()
    panel_in = 1.0 + 0.55 * len(first.x), 1.0 + 0.4 * len(figure.panels)
    with saved_panels(paths, len(means), panel_in, title=f"{figure.title}\nmeans of runs", style=style) as places:
        images = [
            heat_map(place, values, number, origin="lower", vmin=low, vmax=high)
            for values, place in zip(means.values(), places, strict=True)
        ]
        for policy, place in zip(means, places, strict=True):
            place.set_title(policy_words(policy))
            place.set_xticks(range(len(first.x)), [number(value) for value in first.levels], rotation=45)
            place.set_xlabel(_x_label(first))
            place.set_yticks(range(len(figure.panels)), [panel.words[axis] for panel in figure.panels])
            place.set_ylabel(axis.replace("_", " "))
        places[0].figure.colorbar(images[0], ax=places, label=first.unit)


def _draw_panel(place: Panel, panel: StudyPanel, band: Band) -> None:
    is_log = panel.criterion == SIZE
    levels = np.log2(panel.levels) if is_log else panel.levels
    step = _APART * (float(np.ptp(levels)) or abs(float(levels[0])) or 1.0)
    are_many = sum(scores.size for scores in panel.scores.values()) > MANY_DOTS
    for index, (look, scores) in enumerate(zip(looks(panel.scores), panel.scores.values(), strict=True)):
        beside = levels + step * (index - 0.5 * (len(panel.scores) - 1))
        dots = np.repeat(2.0**beside if is_log else beside, scores.shape[1])
        (marks,) = place.plot(dots, scores.ravel(), ".", color=look.colour, alpha=0.35, zorder=2.5)
        marks.set_rasterized(are_many)
        _draw_policy(place, panel, _summaries(scores), look, band)
    neutral = METRICS[panel.measure].neutral
    if neutral is not None and panel.variant == "corrected":
        place.axhline(neutral, color="0.5", linewidth=0.8, zorder=0)
    if is_log:
        size_axis(place, panel.levels)
    if panel.others:
        words = ", ".join(f"{name.replace('_', ' ')} {word}" for name, word in panel.words.items())
        place.set_title(words)
    place.set_xlabel(_x_label(panel))
    place.set_ylabel(panel.unit)


def _draw_policy(place: Panel, panel: StudyPanel, summaries: Sequence[Summary], look: Look, band: Band) -> None:
    """Draw the means of a policy with their bands."""
    mean = np.array([summary.mean for summary in summaries])
    lower, upper = _band(panel, summaries, band)
    place.plot(panel.levels, mean, color=look.colour, marker=look.marker, label=look.name, zorder=3)
    shade(place, panel.levels, lower, upper, look.colour)
    equal = np.where(lower == upper, mean, np.nan)  # all runs are equal: a band without height would not be seen
    place.plot(panel.levels, equal, color=look.colour, linewidth=5.0, alpha=0.2, zorder=2)
    alone = _alone(np.isfinite(lower))  # a band without neighbours has no width
    place.vlines(panel.levels[alone], lower[alone], upper[alone], color=look.colour, linewidth=3.0, alpha=0.4, zorder=2)


def limit_height(place: Panel, figure: StudyFigure) -> None:
    """Let bands reach beyond the runs by half of their range at most: the interval of two runs is of any size."""
    known = np.concatenate([scores[np.isfinite(scores)] for panel in figure.panels for scores in panel.scores.values()])
    low, high = float(known.min()), float(known.max())
    reach = 0.5 * (high - low) or abs(high) or 1.0
    bottom, top = place.get_ylim()
    place.set_ylim(max(bottom, low - reach), min(top, high + reach))


def _x_label(panel: StudyPanel) -> str:
    if panel.criterion == SIZE:
        return "robots"
    if panel.x.tolist() != panel.levels.tolist():
        return "distance from ideal conditions"
    return X_LABELS.get(panel.criterion, panel.criterion.replace("_", " "))


def _band(panel: StudyPanel, summaries: Sequence[Summary], band: Band) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper edges at each level, within the range of the measure; NaN without a band."""
    edges = np.array([_edges(summary, band) for summary in summaries]).T
    if panel.variant == "corrected":  # other forms have other ranges
        about = METRICS[panel.measure]
        edges = np.clip(edges, about.lowest, about.highest)
    return edges[0], edges[1]


def _edges(summary: Summary, band: Band) -> tuple[float, float]:
    if summary.n_used < FEWEST_RUNS:
        return math.nan, math.nan
    if band == "ci":
        return summary.lower, summary.upper
    return summary.mean - 2.0 * summary.std, summary.mean + 2.0 * summary.std


def _alone(known: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which levels have a band while their neighbours have none."""
    beside = np.concatenate([[False], known, [False]])
    return known & ~beside[:-2] & ~beside[2:]


def _summaries(scores: FloatArray) -> list[Summary]:
    """Return the mean of the runs at each level, with its interval; runs without a finite score are left out."""
    return [aggregate(known) if known.size else _NOTHING for known in (runs[np.isfinite(runs)] for runs in scores)]


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
        files += drawing.files(model.name, model.draw, tables)
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
