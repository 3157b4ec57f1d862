"""Figures of a study, drawn and as files: measures with every run a dot, and claims. They need the extra "plots"."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import polars as pl

from swarm_forage_env._internal.fields import instance, known_name
from swarm_forage_env._internal.files import replacing
from swarm_forage_env.rendering.figures import (
    COLOURS,
    MARKERS,
    SCREEN,
    FigureStyle,
    Panel,
    legend_below,
    log_height,
    looks,
    policy_words,
    saved_figure,
    saved_panels,
    size_axis,
)
from swarm_forage_env.studies.results import StudyTable
from swarm_forage_env.wrappers.world import SIZE

from ..checks import CurveError
from ..curves import FloatArray, Variant
from ..statistics import Summary, aggregate
from .frame import label_of, words_of
from .measures import MEASURES
from .plots import FEWEST_RUNS, X_LABELS
from .study_numbers import StudyPanel, study_panels

Band: TypeAlias = Literal["ci", "sd"]
"""What bars are: the 95 % confidence interval of the mean, or the mean plus and minus two standard deviations."""

_BANDS: Mapping[str, str] = {"ci": "95 % interval of the mean", "sd": "mean ± 2 standard deviations of runs"}
_APART, _OF_GAP = 0.022, 0.17
"""Distance between policies at one level: a share of the axis, at most this one of the least gap between levels."""
_DOTS_ASIDE = 0.35
"""Distance of dots from the bar of their policy, in the same unit as those of policies."""
LIMIT_MARGIN, _ROW_STEP = 0.05, 0.3
"""What stands for a margin where a number is compared with a limit, and distance between rules in a row."""
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
        words = (first.spec.name, first.measure, first.form, first.rules, first.variant)
        return "_".join(word for word in words if word not in ("marginal", "corrected"))

    @property
    def title(self) -> str:
        """Headline."""
        first = self.panels[0]
        arrow = "higher" if MEASURES[first.measure].higher_is_better else "lower"
        measure = words_of(label_of(first.measure, first.variant, first.form))
        return f"{first.spec.name}: {measure} ({arrow} is better), rules {first.rules}"

    def to_frame(self) -> pl.DataFrame:
        """Return the numbers behind the picture: one row per panel, policy and level, and a column per run."""
        rows: list[dict[str, Any]] = []
        for panel in self.panels:
            floors = panel.floors
            for policy, scores in panel.scores.items():
                levels = zip(panel.x.tolist(), panel.levels.tolist(), scores, _summaries(scores), strict=True)
                for x, level, runs, of in levels:
                    row = {"rules": panel.rules, **panel.lines[0].others, "policy": policy}
                    row |= {panel.criterion: x, "level": level}
                    row |= {"mean": of.mean, "lower": of.lower, "upper": of.upper, "sd": of.std}
                    if floors:
                        row["noise_floor"] = floors.get(policy, np.nan)
                    seeds = (f"seed_{seed}" for seed in sorted(panel.spec.seeds))
                    rows.append({**row, "n_runs": of.n_used, **dict(zip(seeds, runs.tolist(), strict=True))})
        return pl.DataFrame(rows, infer_schema_length=None).fill_nan(None)


def study_figures(panels: Sequence[StudyPanel]) -> tuple[StudyFigure, ...]:
    """Return the figures of the panels of a study, those without a single score left out."""
    groups: dict[tuple[str, ...], list[StudyPanel]] = {}
    for panel in panels:
        if panel.frame["value"].is_finite().any():
            groups.setdefault((panel.rules, panel.variant, panel.measure, panel.form), []).append(panel)
    return tuple(StudyFigure(panels=tuple(together)) for together in groups.values())


def draw_figure(figure: StudyFigure, paths: Sequence[Path], *, band: Band = "ci", style: FigureStyle = SCREEN) -> None:
    """Draw a figure into picture files: lines are means, dots are runs, and bars are where there are `FEWEST_RUNS`.

    Policies stand beside each other at each level. Performance over swarm sizes has two logarithmic axes.

    Args:
        figure: From `study_figures`.
        paths: Files to write; as in `saved_figure`, whose errors this has.
        band: What bars are.
        style: Of the figure.
    """
    first, title = figure.panels[0], f"{figure.title}\n{caption(figure, band)}"
    # On a linear axis, all small swarms lie on a line that says nothing.
    is_log = (first.measure, first.criterion) == ("raw_performance", SIZE) and (first.frame["value"] > 0.0).any()
    with saved_panels(paths, len(figure.panels), (3.6, 3.2), sharey=True, title=title, style=style) as places:
        for place, panel in zip(places, figure.panels, strict=True):
            if is_log:
                log_height(place)
                place.yaxis.set_major_formatter("{x:,g}")
            _draw_panel(place, panel, band)


def caption(figure: StudyFigure, band: Band) -> str:
    """Return what dots, bars and others are, and why bars are missing."""
    n_runs = [of.n_used for panel in figure.panels for scores in panel.scores.values() for of in _summaries(scores)]
    has_floors = any(panel.floors for panel in figure.panels)
    floor = "\ndotted: two undisturbed runs" if has_floors else ""
    lacking = f"\nno bar: fewer than {FEWEST_RUNS} runs of a condition, which tell too little"
    return f"bars: {_BANDS[band]}; dots: runs{floor}" + (lacking if any(0 < n < FEWEST_RUNS for n in n_runs) else "")


def _draw_panel(place: Panel, panel: StudyPanel, band: Band) -> None:
    about = MEASURES[panel.measure]
    if panel.criterion == SIZE:
        size_axis(place, panel.x)
    floors = panel.floors
    for policy, look, (x, aside) in zip(panel.scores, looks(panel.scores), _beside(panel), strict=True):
        scores = panel.scores[policy]
        dots = {"color": look.colour, "alpha": 0.4, "markersize": 3.0, "zorder": 2.5}
        (marks,) = place.plot(np.repeat(aside, scores.shape[1]), scores.ravel(), ".", **dots)
        marks.set_rasterized(panel.frame["value"].count() > MANY_DOTS)
        mean, reach = _bars(panel, scores, band)
        place.errorbar(x, mean, yerr=reach, color=look.colour, marker=look.marker, label=look.name, zorder=3)
        if policy in floors:
            place.axhline(floors[policy], color=look.colour, linestyle=":", linewidth=1.0, zorder=1)
    if about.neutral is not None and panel.variant == "corrected":
        place.axhline(about.neutral, color="0.5", linewidth=0.8, zorder=0)
    words = [f"{name.replace('_', ' ')} {word}" for name, word in panel.lines[0].words.items()]
    if words:
        place.set_title(", ".join(words))
    label = X_LABELS.get(panel.criterion, panel.criterion.replace("_", " ")).split(" (")[0]
    place.set_xlabel(label if panel.departures is None else "departures λ, robots per 1,000 s")
    symbol = about.symbol.replace("N1, N2", "1, N") if panel.form == "interactive" else about.symbol
    place.set_ylabel(f"{symbol}, {panel.unit}")


def _beside(panel: StudyPanel) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield where each policy stands at each level, and where its dots are, (L,).

    Rates of a population stand at their events, not in the unit of the paper's figures.
    """
    at = panel.levels if panel.departures is None else panel.departures
    to, back = (np.log2, np.exp2) if panel.criterion == SIZE else (np.asarray, np.asarray)
    levels: FloatArray = to(at)
    whole = float(np.ptp(levels)) or abs(float(levels[0])) or 1.0
    step = min(_APART * whole, _OF_GAP * float(np.diff(levels).min(initial=whole)))
    for index in range(len(panel.lines)):
        x = levels + step * (index - 0.5 * (len(panel.lines) - 1))
        yield back(x), back(x + _DOTS_ASIDE * step)


def _bars(panel: StudyPanel, scores: FloatArray, band: Band) -> tuple[FloatArray, FloatArray]:
    """Return the means, (L,), and how far bars reach down and up within the range of the measure, (2, L)."""
    mean, sd, lower, upper, n_runs, _ = np.array([astuple(of) for of in _summaries(scores)]).T
    edges = np.array([lower, upper] if band == "ci" else [mean - 2.0 * sd, mean + 2.0 * sd])
    if panel.variant == "corrected":  # other forms have other ranges
        edges = np.clip(edges, MEASURES[panel.measure].lowest, MEASURES[panel.measure].highest)
    reach = np.array([mean - edges[0], edges[1] - mean]).clip(min=0.0)
    return mean, np.where(n_runs >= FEWEST_RUNS, reach, np.nan)


def _summaries(scores: FloatArray) -> list[Summary]:
    """Return the mean of the runs at each level, with its interval; runs without a finite score are left out."""
    found = (runs[np.isfinite(runs)] for runs in scores)
    return [aggregate(known) if known.size else Summary() for known in found]


def draw_forest(parts: pl.DataFrame, paths: Sequence[Path], title: str, *, style: FigureStyle = SCREEN) -> None:
    """Draw the contrasts of claims into picture files: a row per statement, in margins, right of 0 as claimed.

    Args:
        parts: Rows of `StudyVerdict.parts`, one per statement, rules and reading; the reading "amounts" is hollow where
            there is another one.
        paths: Files to write; as in `saved_figure`, whose errors this has.
        title: Headline.
        style: Of the figure.
    """
    names = parts.select("claim", "statement", "where").unique(maintain_order=True)
    rows = {key: place for place, key in enumerate(names.iter_rows())}
    every = parts["rules"].unique(maintain_order=True).to_list()
    with saved_figure(paths, (7.5, 1.4 + 0.17 * len(rows)), title=title, style=style) as figure:
        place = figure.subplots()
        place.axvspan(-1.0, 1.0, color="0.9", zorder=0)
        place.axvline(0.0, color="0.5", linewidth=0.8, zorder=1)
        for k, rules in enumerate(every):
            for reading in ("amounts", "shares"):
                mine = parts.filter(pl.col("mean").is_finite(), rules=rules, reading=reading)
                unit = mine["margin"].to_numpy()
                unit = np.where(unit > 0.0, unit, LIMIT_MARGIN)
                mean, lower, upper = (mine[name].to_numpy() / unit for name in ("mean", "lower", "upper"))
                y = [rows[key] + _ROW_STEP * (k - 0.5 * (len(every) - 1)) for key in mine.select(names.columns).rows()]
                is_faint = reading == "amounts" and "shares" in parts["reading"]
                look = {"color": COLOURS[k], "markerfacecolor": "w" if is_faint else COLOURS[k], "markersize": 3.5}
                label = f"{rules}, {reading}" if len(mine) else None
                place.errorbar(
                    mean, y, xerr=[mean - lower, upper - mean], fmt=MARKERS[k], linewidth=0.9, label=label, **look
                )
        place.set_xscale("symlog", linthresh=1.0)
        place.set_xticks([-100, -10, -1, 0, 1, 10, 100], ["-100", "-10", "-1", "0", "1", "10", "100"])
        place.set_yticks(
            [*rows.values()], [f"{claim}  {policy_words(words)}  [{where}]" for claim, words, where in rows], fontsize=6
        )
        place.set_ylim(len(rows) - 0.4, -0.6)
        place.set_xlabel("effect in margins: right of 0 as claimed, within the grey band a tie")
        legend_below(figure)


def plot(
    table: "StudyTable",
    folder: str | Path,
    *,
    band: Band = "ci",
    variants: Sequence[Variant] = ("corrected",),
    formats: Sequence[str] = ("svg", "png"),
    style: FigureStyle = SCREEN,
) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Draw the figures of a study, with tables in CSV: each measure over what is varied.

    Args:
        table: From `swarm_forage_env.read_study`.
        folder: Where the files go.
        band: "ci", the 95 % interval of the mean; "sd", mean ± 2 standard deviations of runs.
        variants: Variants of the measures.
        formats: Of the pictures: "svg", "png", "pdf".
        style: Of the figures.

    Returns:
        The files, and the measures without a figure, with the reason.

    Raises:
        ValueError: the study gives nothing to draw, or an unknown band, format or variant.
        ImportError: matplotlib is not installed.
    """
    instance("table", table, StudyTable, hint="; read_study(path) reads one")
    known_name("band", band, _BANDS)
    panels, missing = study_panels(table, variants)
    figures = study_figures(panels)
    if not figures:
        raise CurveError(
            f"Expected a study with finished runs and numbers on its last axis, got {table.spec.name}, which gives "
            f"nothing to draw. {'; '.join(dict.fromkeys(missing.values()))}".strip()
        )
    files: list[Path] = []
    for figure in figures:
        pictures = [Path(folder, f"{figure.name}.{name}") for name in formats]
        draw_figure(figure, pictures, band=band, style=style)
        numbers = Path(folder, f"{figure.name}.csv")
        with replacing(numbers) as draft:
            figure.to_frame().write_csv(draft)
        files += [*pictures, numbers]
    return tuple(files), tuple(f"no figure of {label_of(*key)}: {why}" for key, why in missing.items())
