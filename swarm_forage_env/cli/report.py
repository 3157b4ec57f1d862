"""Output of a command: tables for people, JSON for programs, a picture."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from metrics.scoring.plots import FEWEST_RUNS
from metrics.statistics import aggregate
from swarm_forage_env._internal.wording import counted
from swarm_forage_env.policies.mixture import Part, is_mixture, mixture_of, mixture_parts, part_sizes
from swarm_forage_env.policies.registry import part_labels
from swarm_forage_env.rendering.plots import Curve, draw_curves
from swarm_forage_env.runs.progress import duration
from swarm_forage_env.runs.record import RunRecord
from swarm_forage_env.runs.runner import Outcomes
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import RunStore
from swarm_forage_env.scenarios.columns import part_column
from swarm_forage_env.scenarios.kinds import kind_sizes
from swarm_forage_env.scenarios.performance import Performance, performance_curve, performance_of

LEVEL = 0.95
"""Confidence level of all intervals."""
NO_NUMBER = "-"
"""In a table, what robots do on average where there are none."""
ASSUMED_ROBOT_TICKS_PER_S = 0.5e6
"""Speed that estimates assume per core, in robots times ticks per second; our choice: the low end of what scripted
controllers reach."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """A mean over seeds with its t interval; NaN ends where a single seed allows none, all NaN of what nobody does."""

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        if math.isnan(self.mean):
            return NO_NUMBER
        half = self.high - self.mean
        return f"{self.mean:.2f}" + ("" if math.isnan(half) else f" ± {half:.2f}")


_NONE = Estimate(math.nan, math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class PartSummary:
    """What one part of a mixed swarm does."""

    policy: str
    n_robots: int
    deliveries_per_1000_s: Estimate
    deliveries_per_robot_per_1000_s: Estimate
    """Per robot of the part that is present; NaN where the part has no robots, as of a share that is too small."""
    first_pickups_per_1000_s: Estimate
    interference_fraction: float
    """NaN where the part has no robots."""


@dataclass(frozen=True, slots=True)
class ControllerSummary:
    """One row of the table."""

    controller: str
    caches: str
    n_runs: int
    performance: Estimate
    """Of what the scenario names: per 1,000 s for totals, else the mean over intervals."""
    deliveries_per_1000_s: Estimate
    deliveries_per_robot_per_1000_s: Estimate
    """Per robot that is present."""
    first_pickups_per_1000_s: Estimate
    interference_fraction: float
    simulated_s_per_wall_s: float
    """Simulated seconds per second and process, policy and recording included."""
    parts: tuple[PartSummary, ...] = ()
    """Of a mixed swarm, or of several kinds of robots, in order."""


def summarize(specs: Sequence[RunSpec], records: Sequence[RunRecord]) -> tuple[ControllerSummary, ...]:
    """Return one summary per controller that has a record, in the order of `specs`."""
    caches = {spec.policy: spec.scenario.caches for spec in specs}
    read_as = performance_of(specs[0].scenario.performance)
    summaries = []
    for controller, kind in caches.items():
        own = [record for record in records if record.controller == controller]
        if own:
            wall_s = sum(record.wall_time_s for record in own)
            summaries.append(
                ControllerSummary(
                    controller=controller,
                    caches=kind,
                    n_runs=len(own),
                    performance=_estimate([performance_number(record, read_as) for record in own]),
                    deliveries_per_1000_s=_estimate([record.rate_per_1000_s("collected") for record in own]),
                    deliveries_per_robot_per_1000_s=_per_robot(own),
                    first_pickups_per_1000_s=_estimate([record.rate_per_1000_s("first_picked") for record in own]),
                    interference_fraction=float(np.mean([record.interference_fraction.mean() for record in own])),
                    simulated_s_per_wall_s=sum(record.horizon_s for record in own) / wall_s if wall_s else math.nan,
                    parts=_parts(next(spec for spec in specs if spec.policy == controller), own),
                )
            )
    return tuple(summaries)


def _per_robot(records: Sequence[RunRecord]) -> Estimate:
    shares = [
        np.divide(record.collected, record.n_present, out=np.zeros(record.n_intervals), where=record.n_present > 0.0)
        for record in records
    ]
    return _estimate([float(each.sum()) * 1000.0 / one.horizon_s for each, one in zip(shares, records, strict=True)])


def _parts(spec: RunSpec, records: Sequence[RunRecord]) -> tuple[PartSummary, ...]:
    """Return what each part of a mixed swarm, or each of several kinds of robots, has done; nothing of others."""
    robots = spec.scenario.robots
    if is_mixture(spec.policy):
        labels = part_labels(spec.policy)
        sizes = part_sizes(spec.policy, robots.n_robots, spec.parameters.get("share"))
    elif robots.tells_kinds:
        labels = tuple(kind.name for kind in robots.robot_kinds)
        sizes = kind_sizes(robots.robot_kinds, robots.n_robots)
    else:
        return ()
    summaries: list[PartSummary] = []
    for number, (label, size) in enumerate(zip(labels, sizes, strict=True), start=1):

        def rate(name: str, part: int = number) -> Estimate:
            totals = [float(performance_curve(part_column(part, name), one.columns()).sum()) for one in records]
            return _estimate([total * 1000.0 / one.horizon_s for total, one in zip(totals, records, strict=True)])

        fractions = [performance_curve(part_column(number, "interference_fraction"), one.columns()) for one in records]
        summaries.append(
            PartSummary(
                policy=label,
                n_robots=size,
                deliveries_per_1000_s=rate("collected"),
                deliveries_per_robot_per_1000_s=rate("collected_per_robot") if size else _NONE,
                first_pickups_per_1000_s=rate("first_picked"),
                interference_fraction=float(np.mean(fractions)) if size else math.nan,
            )
        )
    return tuple(summaries)


def results_table(specs: Sequence[RunSpec], summaries: Sequence[ControllerSummary]) -> Table:
    """Return the table of results, one row per controller."""
    first = specs[0].scenario
    headline = f"{first.name}: {first.robots.n_robots} robots, {first.objects.n_objects} objects, {first.horizon_s:g} s"
    disturbed = ", ".join(config.name for config in specs[0].wrappers)
    is_spread_known = any(row.n_runs > 1 for row in summaries)
    interval = f"± {LEVEL:.0%} t interval over seeds" if is_spread_known else "one seed, so no interval"
    table = Table(
        title=f"{headline}, with {disturbed}" if disturbed else headline,
        caption=f"{interval}; interference: share of active robot time",
    )
    # Deliveries are always there; what else the scenario calls performance stands before them.
    other = None if first.performance == "collected" else performance_of(first.performance)
    for name in ("controller", "caches"):
        table.add_column(name)
    numbers = ["runs", *([f"{other.title}\n{span(other)}"] if other else []), "deliveries\nper 1,000 s"]
    any_is_mixed = any(row.parts for row in summaries)
    numbers += ["per robot"] if any_is_mixed else []
    for name in (*numbers, "interference", "simulated s\nper wall s"):
        table.add_column(name, justify="right")
    for row in summaries:
        rates = [*([str(row.performance)] if other else []), str(row.deliveries_per_1000_s)]
        rates += [str(row.deliveries_per_robot_per_1000_s)] if any_is_mixed else []
        tail = [f"{row.interference_fraction:.3f}", f"{row.simulated_s_per_wall_s:,.0f}"]
        table.add_row(shown(row.controller), row.caches, str(row.n_runs), *rates, *tail)
        for part in row.parts:
            name = f"  of which {part.policy} ({counted(part.n_robots, 'robot')})"
            rates = [str(part.deliveries_per_1000_s), str(part.deliveries_per_robot_per_1000_s)]
            interference = f"{part.interference_fraction:.3f}" if part.n_robots else NO_NUMBER
            table.add_row(name, "", "", *([""] if other else []), *rates, interference, "")
    return table


def shown(policy: str) -> str:
    """Return the name of a policy for people; a file below the current folder is shown relative to it."""
    if is_mixture(policy):
        return mixture_of([Part(shown(part.policy), part.amount) for part in mixture_parts(policy)])
    path = Path(policy)
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else policy


def plan_table(specs: Sequence[RunSpec], store: RunStore) -> Table:
    """Return the table of planned runs."""
    table = Table(title=f"{counted(len(specs), 'planned run')}, records go to {store.folder}")
    for name in ("run", "controller", "caches", "robots", "seed", "seconds", "state"):
        table.add_column(name)
    for spec in specs:
        scenario = spec.scenario
        state = "stored" if spec.run_id in store else "to do"
        numbers = (str(scenario.robots.n_robots), str(spec.seed), f"{scenario.horizon_s:g}")
        table.add_row(spec.run_id, shown(spec.policy), scenario.caches, *numbers, state)
    return table


def plan_json(specs: Sequence[RunSpec], store: RunStore, seconds: float) -> str:
    """Return the planned runs as a JSON document."""
    runs = [{"run_id": spec.run_id, "stored": spec.run_id in store, "spec": spec.to_mapping()} for spec in specs]
    return json.dumps({"out": str(store.folder), "estimated_wall_s": seconds, "runs": runs}, indent=1)


def results_json(specs: Sequence[RunSpec], result: Outcomes, store: RunStore, plot: Path | None) -> str:
    """Return the results as a JSON document; numbers that do not exist are null."""
    read_as = performance_of(specs[0].scenario.performance)
    runs = [
        {
            **record.keys(),
            "performance": performance_number(record, read_as),
            "deliveries_per_1000_s": record.rate_per_1000_s("collected"),
            "first_pickups_per_1000_s": record.rate_per_1000_s("first_picked"),
            "interference_fraction": float(record.interference_fraction.mean()),
            "wall_time_s": record.wall_time_s,
            "file": str(store.path(record.run_id)),
        }
        for record in result.records.values()
    ]
    failures = [
        {"run_id": failure.run_id, "error": failure.error, "file": str(store.failure_path(failure.run_id))}
        for failure in result.failures.values()
    ]
    document = {
        "scenario": specs[0].scenario.name,
        "performance": {"name": read_as.name, "unit": read_as.unit, "is_per_1000_s": read_as.is_total},
        "out": str(store.folder),
        "plot": None if plot is None else str(plot),
        "controllers": [asdict(summary) for summary in summarize(specs, [*result.records.values()])],
        "runs": runs,
        "failures": failures,
    }
    return json.dumps(_without_nan(document), indent=1)


def draw_performance(specs: Sequence[RunSpec], records: Sequence[RunRecord], path: Path) -> None:
    """Draw performance over time, one curve per controller with the t interval over seeds.

    Raises:
        ImportError: matplotlib is not installed.
    """
    scenario = specs[0].scenario
    curves = []
    for controller in dict.fromkeys(record.controller for record in records):
        runs = np.array([record.performance for record in records if record.controller == controller])
        per_interval = [aggregate(column, level=LEVEL) for column in runs.T]
        mean, low, high = np.array([(point.mean, point.lower, point.upper) for point in per_interval]).T
        if len(runs) < FEWEST_RUNS:
            low = high = np.full_like(mean, np.nan)
        curves.append(Curve(shown(controller), mean, low, high))
    read_as = performance_of(scenario.performance)
    draw_curves(
        path,
        records[0].t_end_s,
        curves,
        title=f"{scenario.name}, {scenario.robots.n_robots} robots",
        ylabel=f"{read_as.title} per {scenario.interval_s:g} s" if read_as.is_total else read_as.title,
        band=_about_bands(curves),
    )


def _about_bands(curves: Sequence[Curve]) -> str:
    """Return what the bands are; of curves without them, why."""
    few = f"fewer than {FEWEST_RUNS} runs, too few for a band"
    with_band = [bool(np.isfinite(curve.low).any()) for curve in curves]
    if not any(with_band):
        return few
    return f"bands: {LEVEL:.0%} t interval over seeds" + ("" if all(with_band) else f"; elsewhere {few}")


def plan_note(specs: Sequence[RunSpec], seconds: float, jobs: int) -> str:
    """Return the estimate in words."""
    simulated = sum(spec.scenario.horizon_s for spec in specs)
    left = f"{counted(len(specs), 'run')} to do, {simulated:,.0f} simulated seconds"
    return left + estimate(seconds, jobs, any_left=bool(specs))


def estimated_seconds(specs: Sequence[RunSpec], jobs: int) -> float:
    """Return a rough wall-clock time for `specs` on `jobs` processes, in seconds."""
    robot_ticks = sum(spec.scenario.robots.n_robots * spec.scenario.horizon_ticks for spec in specs)
    return robot_ticks / (ASSUMED_ROBOT_TICKS_PER_S * min(jobs, max(1, len(specs))))


def estimate(seconds: float, jobs: int, *, any_left: bool) -> str:
    """Return how long planned runs will take, as the end of a sentence."""
    if not any_left:
        return "."
    return (
        f": roughly {duration(seconds)} on {jobs} process{'es' if jobs > 1 else ''}, "
        f"if each does {ASSUMED_ROBOT_TICKS_PER_S / 1e6:g} million robot-ticks per second."
    )


def performance_number(record: RunRecord, read_as: Performance) -> float:
    """Return the performance of a run as one number: per 1,000 s for totals, else the mean over intervals."""
    return record.rate_per_1000_s("performance") if read_as.is_total else float(record.performance.mean())


def span(read_as: Performance) -> str:
    """Return what `performance_number` counts, in words."""
    return "per 1,000 s" if read_as.is_total else "mean"


def _estimate(values: Sequence[float]) -> Estimate:
    summary = aggregate(values, level=LEVEL)
    return Estimate(summary.mean, summary.lower, summary.upper)


def _without_nan(value: Any) -> Any:
    """Replace NaN, which JSON does not have, by None."""
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and math.isnan(value) else value
