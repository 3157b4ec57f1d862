"""What scoring returns: one score per measure and level, with notes that help to read it, and tables of scores."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarm_forage_env._internal.wording import counted, limits, number, percent, plain
from swarm_forage_env.rendering.figures import SCREEN, FigureStyle
from swarm_forage_env.runs.answer import Answer, Sheet

from ..catalog import METRICS
from ..curves import Form, Variant
from ..statistics import Summary, aggregate
from .forecast import FORECAST_HEADER, FORECAST_TITLE, PopulationForecast
from .intervals import bounds, interval
from .measures import label_of
from .plots import draw_scores

if TYPE_CHECKING:
    import polars as pl

HEADER = ("measure", "at", "robots", "value", "95 % interval", "noise floor", "relative", "runs", "better", "unit")
"""Headings of `Score.cells`."""
BAND = "mean ± 2 sd"
"""Heading of the column that `Score.cells` adds for the authors' bands."""
DOUBTFUL = "?"
"""Mark of a value that misleads; its note says why."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Score:
    """One measure at one level of what it varies."""

    measure: str
    """Name in `METRICS`."""
    at: str
    """The level in words: "N = 25 to 50", "throttle 0.4"."""
    criterion: str
    """What is varied."""
    x: float
    """The level as a number: the larger swarm size, or the criterion's value."""
    n_robots: tuple[int, ...]
    """Swarm sizes of the runs that are used, the reference run's included."""
    unit: str
    summary: Summary
    """Mean over seeds with Student's interval."""
    per_seed: Mapping[int, float]
    """Seed -> value of the runs with this seed, one run of each experiment that is used."""
    n_lost: int = 0
    """Runs that failed or have no partner of the same seed."""
    variant: Variant = "corrected"
    form: Form = "marginal"
    is_doubtful: bool = False
    """Whether the value misleads: it weights the time lost with a performance that falls with the size."""
    noise_floor: float | None = None
    """For distances: mean distance between two different reference runs, what a perfect swarm scores by chance."""
    relative_floor: float | None = None
    """The noise floor over the mean performance that relative values are compared with."""
    relative_per_seed: Mapping[int, float] = field(default_factory=dict[int, float])
    """For amounts and distances: the values over the total performance that they are compared with, which makes
    policies of different performance comparable; NaN where that performance is zero."""
    of_mean_curves: Summary | None = None
    """For scalability and distances: the measure of the mean curves with a bootstrap interval."""
    beside: Mapping[str, float] = field(default_factory=dict[str, float])
    """Further numbers to read with the value."""
    note: str = ""
    """What to know before reading the value; empty if nothing."""

    @property
    def higher_is_better(self) -> bool:
        """Direction of the measure."""
        return METRICS[self.measure].higher_is_better

    @property
    def relative(self) -> Summary | None:
        """Mean over runs of `relative_per_seed` with its interval; None for measures that are relative themselves."""
        return aggregate(list(self.relative_per_seed.values())) if self.relative_per_seed else None

    @property
    def band(self) -> tuple[float, float]:
        """Mean minus and plus two standard deviations of single runs, which the paper shades; NaN for one run."""
        mean, std = self.summary.mean, self.summary.std
        return mean - 2.0 * std, mean + 2.0 * std

    @property
    def label(self) -> str:
        """Name of the measure, with its variant and form where they are not the usual ones."""
        return label_of(self.measure, self.variant, self.form)

    @property
    def key(self) -> tuple[str, str, tuple[int, ...]]:
        """What the score is about, the same for all policies."""
        return self.label, self.at, self.n_robots

    def cells(self, *, band: bool = False) -> tuple[str, ...]:
        """Return the score as texts under `HEADER`; with `band`, one more column after the interval."""
        summary = self.summary
        runs = str(summary.n_used) + (f" of {summary.n_used + summary.n_nan + self.n_lost}" if self.is_partial else "")
        enters = bool(self.per_seed) or self.is_partial  # a measure that follows from rates alone uses no runs
        return (
            self.label,
            self.at,
            ", ".join(map(str, self.n_robots)),
            number(summary.mean) + (f" {DOUBTFUL}" if self.is_doubtful else ""),
            interval(summary),
            *([limits(*self.band)] if band else []),
            self.floor_cell(),
            self.relative_cell(),
            runs if enters else "-",
            "higher" if self.higher_is_better else "lower",
            self.unit,
        )

    def floor_cell(self) -> str:
        """Return the noise floor, and in brackets relative to performance; empty for measures without one."""
        if self.noise_floor is None:
            return ""
        return number(self.noise_floor) + ("" if self.relative_floor is None else f" ({percent(self.relative_floor)})")

    def relative_cell(self) -> str:
        """Return the relative value, and in brackets per robot; empty for measures that are relative themselves."""
        if self.relative is None:
            return ""
        per_robot = self.beside.get("per_robot")
        return percent(self.relative.mean) + ("" if per_robot is None else f" ({percent(per_robot)} per robot)")

    @property
    def is_partial(self) -> bool:
        """Whether runs are missing from the value."""
        return self.summary.n_nan + self.n_lost > 0

    def to_mapping(self) -> dict[str, Any]:
        """Return the score as plain values; numbers that JSON does not have are None."""
        summary, means, relative = self.summary, self.of_mean_curves, self.relative
        return {
            "measure": self.measure,
            "variant": self.variant,
            "form": self.form,
            "label": self.label,
            "symbol": METRICS[self.measure].symbol,
            "at": self.at,
            "criterion": self.criterion,
            "x": self.x,
            "n_robots": list(self.n_robots),
            "unit": self.unit,
            "higher_is_better": self.higher_is_better,
            "neutral": METRICS[self.measure].neutral,
            "value": plain(summary.mean),
            "std": plain(summary.std),
            "lower": plain(summary.lower),
            "upper": plain(summary.upper),
            "two_sd": [plain(bound) for bound in self.band],
            "doubtful": self.is_doubtful,
            "n_runs": summary.n_used,
            "n_nan": summary.n_nan,
            "n_lost": self.n_lost,
            "noise_floor": plain(self.noise_floor),
            "relative_floor": plain(self.relative_floor),
            "relative": bounds(relative),
            "of_mean_curves": bounds(means),
            "beside": {name: plain(value) for name, value in self.beside.items()},
            "per_seed": {str(seed): plain(value) for seed, value in self.per_seed.items()},
            "note": self.note,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class ScoreTable(Answer):
    """All scores of one policy in one scenario."""

    policy: str
    scenario: str
    """Name of the scenario; empty if it is not known."""
    scores: tuple[Score, ...]
    forecasts: tuple[PopulationForecast, ...] = ()
    """What the queue model predicts for a changing population, beside what the runs showed."""
    missing: Mapping[str, str] = field(default_factory=dict[str, str])
    """Measure -> why it could not be computed."""
    failures: tuple[str, ...] = ()
    """Runs that failed, one line each."""
    settings: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """How the runs were made: budget, length, seeds, folder."""
    band: bool = False
    """Whether the authors' bands stand beside the intervals."""

    def __getitem__(self, measure: str) -> tuple[Score, ...]:
        """Return the scores of one measure.

        Raises:
            KeyError: there are none; the message says why.
        """
        found = tuple(score for score in self.scores if score.measure == measure)
        if not found:
            raise KeyError(f"No score for {measure!r}: {self.missing.get(measure, 'it was not asked for')}")
        return found

    def notes(self) -> tuple[str, ...]:
        """Return all notes: those of scores, missing measures, failed runs."""
        noted = [f"{places}: {note}" for note, places in self._places_of_notes().items()]
        absent = [f"{measure} is not computed: {reason}" for measure, reason in self.missing.items()]
        return (*noted, *absent, *(f"failed: {failure}" for failure in self.failures))

    def _places_of_notes(self) -> dict[str, str]:
        """Note -> the scores that have it, in words, so that a note of many scores appears once."""
        levels: dict[str, dict[str, list[str]]] = {}
        for score in self.scores:
            if score.note:
                levels.setdefault(score.note, {}).setdefault(score.label, []).append(score.at)
        return {
            note: "; ".join(f"{measure}, {', '.join(places)}" for measure, places in places_of.items())
            for note, places_of in levels.items()
        }

    def to_frame(self) -> "pl.DataFrame":
        """Return one row per score; `per_seed` and `beside` do not fit into a row and are only in `to_mapping`."""
        import polars as pl

        rows: list[dict[str, Any]] = []
        for score in self.scores:
            row = score.to_mapping()
            del row["per_seed"], row["beside"]
            for name in ("relative", "of_mean_curves"):
                values = row.pop(name) or [None, None, None]
                row |= dict(zip((name, f"{name}_lower", f"{name}_upper"), values, strict=True))
            row |= dict(zip(("two_sd_lower", "two_sd_upper"), row.pop("two_sd"), strict=True))
            row["n_robots"] = " ".join(map(str, score.n_robots))
            rows.append({"policy": self.policy, "scenario": self.scenario, **row})
        return pl.DataFrame(rows, infer_schema_length=None)

    def to_mapping(self) -> dict[str, Any]:
        """Return the table as plain values, ready for JSON."""
        return {
            "policy": self.policy,
            "scenario": self.scenario,
            "settings": dict(self.settings),
            "scores": [score.to_mapping() for score in self.scores],
            "population": [forecast.to_mapping() for forecast in self.forecasts],
            "missing": dict(self.missing),
            "failures": list(self.failures),
        }

    def sheets(self) -> tuple[Sheet, ...]:
        """Return scores, forecasts and notes."""
        place = HEADER.index("95 % interval") + 1
        header = (*HEADER[:place], BAND, *HEADER[place:]) if self.band else HEADER
        rows = [score.cells(band=self.band) for score in self.scores]
        scores = Sheet(title=title([self]), header=header, rows=rows)
        return scores, *forecast_sheets([self]), Sheet(notes=self.notes())

    @property
    def has_picture(self) -> bool:
        """Whether a score has runs."""
        return any(score.per_seed for score in self.scores)

    def draw(self, path: str | Path, *, style: FigureStyle = SCREEN) -> None:
        """Draw the scores, see `draw_scores`."""
        draw_scores([self], path, band=self.band, style=style)


def title(tables: Sequence[ScoreTable]) -> str:
    """Return who was scored, where, and how much was run: "crw in warehouse_small, budget quick, 4 seeds, 4,000 s"."""
    words = ", ".join(table.policy for table in tables)
    scenario, settings = tables[0].scenario, tables[0].settings
    if scenario:
        words += f" in {scenario}"
    if settings.get("performance", "collected") != "collected":
        words += f", performance {settings['performance']}"
    if "budget" in settings:
        seeds = counted(len(settings["seeds"]), "seed")
        words += f", budget {settings['budget']}, {seeds}, {settings['horizon_s']:,g} s"
    return words


def forecast_sheets(tables: Sequence[ScoreTable]) -> list[Sheet]:
    """Return forecasts and observations; equal ones of several policies appear once."""
    different: list[list[tuple[str, ...]]] = []
    for table in tables:
        rows = [forecast.cells() for forecast in table.forecasts]
        if rows and rows not in different:
            different.append(rows)
    return [Sheet(title=FORECAST_TITLE, header=FORECAST_HEADER, rows=rows) for rows in different]
