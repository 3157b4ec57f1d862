"""Figures of a study, drawn and as files: measures with every run a dot. They need the extra "plots"."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from swarm_forage_env._internal.fields import known_name
from swarm_forage_env._internal.files import replacing
from swarm_forage_env.rendering.figures import (
    FORMATS,
    SCREEN,
    FigureStyle,
    Look,
    Panel,
    log_height,
    looks,
    saved_panels,
    size_axis,
)
from swarm_forage_env.wrappers.world import SIZE

from ..checks import CurveError
from ..claims import PanelName
from ..curves import FloatArray, Variant
from ..statistics import Summary, aggregate
from .frame import label_of, words_of
from .measures import MEASURES
from .plots import FEWEST_RUNS, X_LABELS
from .study_numbers import StudyPanel, StudyPanels, study_panels

if TYPE_CHECKING:
    import polars as pl

    from swarm_forage_env.studies.results import StudyTable

Band: TypeAlias = Literal["ci", "sd"]
"""What bars are: the 95 % confidence interval of the mean, or the mean plus and minus two standard deviations."""

_BANDS: dict[Band, str] = {"ci": "95 % interval of the mean", "sd": "mean ± 2 standard deviations of runs"}
_NOTHING = Summary()
_APART, _OF_GAP = 0.022, 0.17
"""Distance between policies at one level: a share of the axis, at most this one of the least gap between levels."""
_DOTS_ASIDE = 0.35
"""Distance of dots from the bar of their policy, in the same unit as those of policies."""
MANY_DOTS = 500
"""More dots in a panel are put into vector pictures as an image: as single marks they take a megabyte and more."""


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
        measure = words_of(label_of(first.measure, "corrected", first.form))
        words = f"{measure} ({arrow} is better), rules {first.rules}"
        return f"{first.study}: {words}" + ("" if first.variant == "corrected" else f", measure {first.variant}")

    @property
    def is_log(self) -> bool:
        """Whether its y axis is logarithmic: on a linear one, all small swarms lie on a line that says nothing."""
        first = self.panels[0]
        return (first.measure, first.criterion) == ("raw_performance", SIZE) and all(
            any((scores > 0.0).any() for scores in panel.scores.values()) for panel in self.panels
        )

    def to_frame(self) -> "pl.DataFrame":
        """Return the numbers behind the picture: one row per panel, policy and level, and a column per run."""
        import polars as pl

        rows: list[dict[str, Any]] = []
        for panel in self.panels:
            for policy, scores in panel.scores.items():
                of_means = panel.of_mean_curves.get(policy, np.full_like(scores, np.nan))
                levels = zip(panel.x, panel.levels, scores, _summaries(scores), of_means, strict=True)
                for x, level, runs, summary, of_mean in levels:
                    place = {"rules": panel.rules, **panel.others, "policy": policy}
                    means = {"mean": summary.mean, "lower": summary.lower, "upper": summary.upper, "sd": summary.std}
                    if policy in panel.floors:
                        means |= {"of_mean_curves": _mean_of(of_mean), "noise_floor": _mean_of(panel.floors[policy])}
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
    """Draw a figure into picture files: lines are means, dots are runs, and bars are where there are `FEWEST_RUNS`.

    Policies stand beside each other at each level. Performance over swarm sizes has two logarithmic axes.

    Args:
        figure: From `study_figures`.
        paths: Files to write; as in `saved_figure`, whose errors this has.
        band: What bars are.
        style: Of the figure.
    """
    title = f"{figure.title}\n{caption(figure, band)}"
    with saved_panels(paths, len(figure.panels), (3.6, 3.2), sharey=True, title=title, style=style) as places:
        for place, panel in zip(places, figure.panels, strict=True):
            _draw_panel(place, panel, band, is_log=figure.is_log)


def caption(figure: StudyFigure, band: Band) -> str:
    """Return what dots, bars and others are, and why some or all bars are missing."""
    n_runs = [s.n_used for panel in figure.panels for scores in panel.scores.values() for s in _summaries(scores)]
    floor = (
        "\ndotted: two undisturbed runs; hollow: mean curves" if any(panel.floors for panel in figure.panels) else ""
    )
    if max(n_runs) < FEWEST_RUNS:
        return f"lines: means; dots: runs{floor}\nno bars: fewer than {FEWEST_RUNS} runs of a condition tell too little"
    lacking = f"\nno bar: conditions with fewer than {FEWEST_RUNS} runs, which tell too little"
    return f"bars: {_BANDS[band]}; dots: runs{floor}" + (lacking if any(0 < n < FEWEST_RUNS for n in n_runs) else "")


def _draw_panel(place: Panel, panel: StudyPanel, band: Band, *, is_log: bool) -> None:
    if panel.criterion == SIZE:
        size_axis(place, panel.drawn_at)
    if is_log:
        log_height(place)
        place.yaxis.set_major_formatter("{x:,g}")
    are_many = sum(scores.size for scores in panel.scores.values()) > MANY_DOTS
    for (look, x, scores), (_, aside, _) in zip(_beside(panel), _beside(panel, aside=_DOTS_ASIDE), strict=True):
        style = {"color": look.colour, "alpha": 0.4, "markersize": 3.0, "zorder": 2.5}
        (marks,) = place.plot(np.repeat(aside, scores.shape[1]), scores.ravel(), ".", **style)
        marks.set_rasterized(are_many)
        _draw_policy(place, panel, x, _summaries(scores), look, band)
    for look, floor in zip(looks(panel.floors), panel.floors.values(), strict=True):
        place.axhline(_mean_of(floor), color=look.colour, linestyle=":", linewidth=1.0, zorder=1)
    for (look, x, _), of_means in zip(_beside(panel), panel.of_mean_curves.values(), strict=False):
        style = {"color": look.colour, "marker": look.marker, "markerfacecolor": "w", "linestyle": "", "zorder": 4}
        place.plot(x, [_mean_of(runs) for runs in of_means], **style)
    neutral = MEASURES[panel.measure].neutral
    if neutral is not None and panel.variant == "corrected":
        place.axhline(neutral, color="0.5", linewidth=0.8, zorder=0)
    if panel.others:
        words = ", ".join(f"{name.replace('_', ' ')} {word}" for name, word in panel.words.items())
        place.set_title(words)
    place.set_xlabel(_x_label(panel))
    symbol = MEASURES[panel.measure].symbol
    place.set_ylabel(f"{symbol.replace('N1, N2', '1, N') if panel.form == 'interactive' else symbol}, {panel.unit}")


def _beside(panel: StudyPanel, aside: float = 0.0) -> Iterator[tuple[Look, FloatArray, FloatArray]]:
    """Yield the look of each policy, where it stands at each level, or so many steps aside of it, and its scores."""
    is_log = panel.criterion == SIZE
    levels = np.log2(panel.drawn_at) if is_log else panel.drawn_at
    whole = float(np.ptp(levels)) or abs(float(levels[0])) or 1.0
    step = min(_APART * whole, _OF_GAP * float(np.diff(levels).min(initial=whole)))
    for index, (look, scores) in enumerate(zip(looks(panel.scores), panel.scores.values(), strict=True)):
        beside = levels + step * (index + aside - 0.5 * (len(panel.scores) - 1))
        yield look, np.exp2(beside) if is_log else beside, scores


def _draw_policy(
    place: Panel, panel: StudyPanel, x: FloatArray, summaries: Sequence[Summary], look: Look, band: Band
) -> None:
    """Draw the means of a policy with their bars."""
    mean = np.array([summary.mean for summary in summaries])
    lower, upper = _band(panel, summaries, band)
    reach = np.array([mean - lower, upper - mean]).clip(min=0.0)
    place.errorbar(x, mean, yerr=reach, color=look.colour, marker=look.marker, label=look.name, zorder=3)


def _mean_of(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else math.nan


def _x_label(panel: StudyPanel) -> str:
    if panel.criterion == SIZE:
        return "robots N"
    if panel.departures is not None:
        return "departures λ, robots per 1,000 s"
    if panel.x.tolist() != panel.levels.tolist():
        return "distance from ideal conditions, DTW(I_ec, V)"
    return X_LABELS.get(panel.criterion, panel.criterion.replace("_", " "))


def _band(panel: StudyPanel, summaries: Sequence[Summary], band: Band) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper edges at each level, within the range of the measure; NaN without a band."""
    edges = np.array([_edges(summary, band) for summary in summaries]).T
    if panel.variant == "corrected":  # other forms have other ranges
        about = MEASURES[panel.measure]
        edges = np.clip(edges, about.lowest, about.highest)
    return edges[0], edges[1]


def _edges(summary: Summary, band: Band) -> tuple[float, float]:
    if summary.n_used < FEWEST_RUNS:
        return math.nan, math.nan
    if band == "ci":
        return summary.lower, summary.upper
    return summary.mean - 2.0 * summary.std, summary.mean + 2.0 * summary.std


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
    """Draw the figures of a study, with tables in CSV: each measure over what is varied.

    Args:
        table: From `swarm_forage_env.read_study`.
        folder: Where the files go.
        band: "ci", the 95 % interval of the mean; "sd", mean ± 2 standard deviations of runs.
        variants: Variants of the measures.
        formats: Of the pictures: "svg", "png", "pdf".
        style: Of the figures.

    Raises:
        ValueError: the study gives nothing to draw, or an unknown band, format or variant.
        ImportError: matplotlib is not installed.
    """
    checked_band(band)
    for name in formats:
        known_name("format", name, [known[1:] for known in FORMATS])
    scored = study_panels(table, variants)
    figures = figures_of(scored, table.spec.name)
    drawing = _Drawing(Path(folder), tuple(f".{name}" for name in formats), style)
    files = [file for figure in figures for file in drawing.measure(figure, band)]
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

    def measure(self, figure: StudyFigure, band: Band) -> Iterator[Path]:
        """Draw a figure, and write its numbers beside it, whole or not at all; yields all files."""
        pictures = [self.folder / f"{figure.name}{ending}" for ending in self.endings]
        draw_figure(figure, pictures, band=band, style=self.style)
        yield from pictures
        table = self.folder / f"{figure.name}.csv"
        with replacing(table) as draft:
            draft.write_text(figure.to_frame().write_csv(), encoding="utf-8", newline="")
        yield table
