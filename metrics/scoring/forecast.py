"""What the queue model predicts for a changing population, beside what runs show."""

import math
from dataclasses import dataclass
from typing import Any

from swarm_forage_env._internal.wording import plain

from ..queues import PopulationRates, mean_away, queue_statistics
from ..statistics import Summary, aggregate
from .columns import POPULATION
from .studies import RunCurves, StudyCurves

FORECAST_TITLE = "Population: what the queueing model predicts for runs of this length, beside what the runs showed"
FORECAST_HEADER = (
    "level",
    "robots",
    "at work: predicted",
    "observed",
    "s in per departure: predicted",
    "observed",
    "s out: predicted",
    "observed",
    "s per repair: observed",
    "without end",
    "printed",
)
"""Headings of `PopulationForecast.cells`."""


@dataclass(frozen=True, kw_only=True)
class PopulationForecast:
    """One level of population dynamics: predicted and observed.

    Times per departure are the seconds that all robots together spend in or out of the swarm, divided by the number of
    departures (deaths and malfunctions). Prediction and observation both end with the run, so they can be compared. The
    time per repair counts only absences that ended within a run, which leaves out the longest. The equilibrium time is
    that of a run without end.
    """

    level: float
    n_robots: int
    n_runs: int
    horizon_s: float
    predicted_at_work: float
    """Mean robots at work over the run, N - m_T (`mean_away`)."""
    observed_at_work: Summary
    """The same in the runs."""
    predicted_time_in_s: float
    """Robot-seconds at work per departure: (horizon times robots at work) / (lambda times horizon)."""
    observed_time_in_s: float
    """The same in the runs; NaN if no robot departed or departures were not recorded."""
    predicted_time_out_s: float
    """Robot-seconds away per departure."""
    observed_time_out_s: float
    observed_time_per_repair_s: float
    """Mean length of absences that ended with a repair; NaN where there was none."""
    equilibrium_time_out_s: float
    """1 / (mu - lambda), of an unlimited queue without end; infinite if no robot returns."""
    printed_time_out_s: float
    """1 / (mu - lambda) + 1 / mu, as the paper prints it, which counts the repair itself twice."""

    def to_mapping(self) -> dict[str, Any]:
        """Return the level as plain values; numbers that JSON does not have are None."""
        names = [name for name in self.__dataclass_fields__ if name != "observed_at_work"]
        values = {name: plain(getattr(self, name)) for name in names}
        observed = self.observed_at_work
        bounds = {"observed_at_work": observed.mean, "lower": observed.lower, "upper": observed.upper}
        return values | {name: plain(value) for name, value in bounds.items()}

    def cells(self) -> tuple[str, ...]:
        """Return the level as texts under `FORECAST_HEADER`."""
        observed = self.observed_at_work
        spread = "" if math.isnan(observed.lower) else f" ({observed.lower:.1f} to {observed.upper:.1f})"
        times = (
            self.predicted_time_in_s,
            self.observed_time_in_s,
            self.predicted_time_out_s,
            self.observed_time_out_s,
            self.observed_time_per_repair_s,
            self.equilibrium_time_out_s,
            self.printed_time_out_s,
        )
        return (
            f"{self.level:g}",
            str(self.n_robots),
            f"{self.predicted_at_work:.1f}",
            f"{observed.mean:.1f}{spread}",
            *("-" if math.isnan(time) else f"{time:,.0f}" for time in times),
        )


def forecast_population(study: StudyCurves) -> tuple[PopulationForecast, ...]:
    """Return one forecast per level of population dynamics whose rates, clock and robots at work are known."""
    horizon_s = study.horizon_s
    if horizon_s is None:
        return ()
    levels = sorted(
        (e for e in study.experiments if e.criterion == POPULATION), key=lambda level: (level.n_robots, level.value)
    )
    return tuple(
        _forecast(level, level.rates, horizon_s)
        for level in levels
        if level.rates is not None and level.rates.lam > 0.0 and "n_active" in level.curves and level.seeds
    )


def _forecast(level: RunCurves, rates: PopulationRates, horizon_s: float) -> PopulationForecast:
    n_robots = level.n_robots
    away = mean_away(rates, n_robots, horizon_s)
    at_work = level.curves["n_active"].mean(axis=-1)
    queue = queue_statistics(rates)
    departures = _departures(level, rates)
    time_in = time_out = math.nan
    if departures > 0.0:
        time_in = horizon_s * float(at_work.sum()) / departures
        time_out = horizon_s * float((n_robots - at_work).sum()) / departures
    return PopulationForecast(
        level=level.value,
        n_robots=n_robots,
        n_runs=len(level.seeds),
        horizon_s=horizon_s,
        predicted_at_work=n_robots - away,
        observed_at_work=aggregate(at_work),
        predicted_time_in_s=(n_robots - away) / rates.lam,
        observed_time_in_s=time_in,
        predicted_time_out_s=away / rates.lam,
        observed_time_out_s=time_out,
        observed_time_per_repair_s=_time_per_repair(level),
        equilibrium_time_out_s=queue.time,
        printed_time_out_s=queue.time_printed,
    )


def _departures(level: RunCurves, rates: PopulationRates) -> float:
    """Robots that left the swarm in all runs together; NaN where they were not recorded."""
    wanted = [name for name, rate in (("deaths", rates.lambda_d), ("malfunctions", rates.lambda_bd)) if rate > 0.0]
    if any(name not in level.curves for name in wanted):
        return math.nan
    return float(sum(level.curves[name].sum() for name in wanted))


def _time_per_repair(level: RunCurves) -> float:
    """Mean over all absences that ended with a repair."""
    if not {"repairs", "time_in_repair_s"} <= level.curves.keys():
        return math.nan
    repairs = level.curves["repairs"]
    total = repairs.sum()
    return float((repairs * level.curves["time_in_repair_s"]).sum() / total) if total else math.nan
