"""What runs achieved in each condition: performance, deliveries and interference.

table = run_plan(Plan.product(policy_specs(["crw", "dpo"]), [World(scenario("warehouse_small"))], seeds=range(4)))
print(summarize_runs(table))
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from swarm_forage_env._internal.wording import counted, percent, plain
from swarm_forage_env.rendering.figures import SCREEN, FigureStyle
from swarm_forage_env.rendering.plots import Curve, draw_curves
from swarm_forage_env.runs.plan import Condition, Table
from swarm_forage_env.runs.record import Record
from swarm_forage_env.runs.store import failure_file, failure_lines, record_file
from swarm_forage_env.scenarios.performance import Performance, performance_of
from swarm_forage_env.sheet import Answer, Sheet
from swarm_forage_env.wrappers.world import World

from ..statistics import Summary, aggregate
from .limits import ABOUT_LIMIT, share_of_limit
from .plots import FEWEST_RUNS, interval_words

LEVEL = 0.95
"""Confidence level of all intervals."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ConditionSummary:
    """What the runs of a policy in a world achieved."""

    condition: Condition
    caches: str
    n_runs: int
    of: Mapping[str, Summary]
    """Quantity of `_quantities` -> mean and interval over runs."""
    share_of_limit: float | None
    """Mean performance over the estimated limit of the world; None where there is no estimate, see `limit_of`."""
    simulated_s_per_wall_s: float
    """Simulated seconds per second and process, policy and recording included."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RunSummary(Answer):
    """What the runs of a table achieved."""

    table: Table
    rows: tuple[ConditionSummary, ...]
    """One per condition with finished runs."""

    @property
    def world(self) -> World:
        """The first world."""
        return self.table.plan.conditions[0].world

    @property
    def read_as(self) -> Performance:
        """What performance is in the first world."""
        return performance_of(self.world.scenario.performance)

    def sheets(self) -> tuple[Sheet, ...]:
        """Return one row per condition, and why runs failed."""
        failures = Sheet(notes=[f"failed: {line}" for line in failure_lines(self.table.failures.values())])
        if not self.rows:
            return (failures,)
        n_worlds = len({condition.world for condition in self.table.plan.conditions})
        # Deliveries are always there; what else the scenario calls performance stands before them.
        other = [] if self.read_as.name == "collected" else [f"{self.read_as.title} {span(self.read_as)}"]
        header = ["policy", *(["world"] if n_worlds > 1 else []), "caches", "runs", *other, "deliveries per 1,000 s"]
        has_limit = any(row.share_of_limit is not None for row in self.rows)
        header += [*(["of the limit"] if has_limit else []), "interference", "simulated s per wall s"]
        lines: list[list[str]] = []
        for row in self.rows:
            about = [row.condition.policy.label, *([row.condition.world.name] if n_worlds > 1 else [])]
            numbers = [spread_text(row.of["performance"])] if other else []
            numbers += [spread_text(row.of["deliveries_per_1000_s"])]
            numbers += ["-" if row.share_of_limit is None else percent(row.share_of_limit)] if has_limit else []
            tail = [f"{row.of['interference_fraction'].mean:.3f}", f"{row.simulated_s_per_wall_s:,.0f}"]
            lines.append([*about, row.caches, str(row.n_runs), *numbers, *tail])
        notes = [f"{interval_words([row.n_runs for row in self.rows])}; interference: share of active robot time"]
        notes += [ABOUT_LIMIT] if has_limit else []
        return Sheet.of(title=self._title(n_worlds), header=header, rows=lines, notes=notes), failures

    def _title(self, n_worlds: int) -> str:
        scenario = self.world.scenario
        if n_worlds > 1:
            return f"{scenario.name} and others: {counted(n_worlds, 'world')}"
        sizes = counted(self.world.n_robots, "robot"), counted(scenario.objects.n_objects, "object")
        return self.world.title(*sizes, f"{scenario.horizon_s:g} s")

    def to_mapping(self) -> dict[str, Any]:
        """Return policies, runs and failures as plain values."""
        folder = self.table.folder
        return {
            "scenario": self.world.scenario.name,
            "performance": {
                "name": self.read_as.name,
                "unit": self.read_as.unit,
                "is_per_1000_s": self.read_as.is_total,
            },
            "out": None if folder is None else str(folder),
            "controllers": [_condition_mapping(row) for row in self.rows],
            "runs": [
                {
                    **record.keys,
                    **_quantities(record, self.read_as),
                    "wall_time_s": plain(record.wall_time_s),
                    "file": None if folder is None else str(record_file(folder, record.run_id)),
                }
                for row in self.rows
                for record in self.table.of(row.condition)
            ],
            "failures": [
                {
                    "run_id": failure.run_id,
                    "error": failure.error,
                    "file": None if folder is None else str(failure_file(folder, failure.run_id)),
                }
                for failure in self.table.failures.values()
            ],
        }

    @property
    def has_picture(self) -> bool:
        """Whether runs have finished, and all have the same intervals."""
        scenarios = [row.condition.world.scenario for row in self.rows]
        return len({(scenario.horizon_s, scenario.interval_s) for scenario in scenarios}) == 1

    def draw(self, path: str | Path, *, style: FigureStyle = SCREEN) -> None:
        """Draw performance over time, one curve per condition with the t interval over seeds."""
        if not self.has_picture:
            raise ValueError("Expected finished runs with the same intervals, got nothing to draw.")
        scenario, read_as = self.world.scenario, self.read_as
        n_worlds = len({row.condition.world for row in self.rows})
        curves: list[Curve] = []
        for row in self.rows:
            runs = np.array([record["performance"] for record in self.table.of(row.condition)])
            per_interval = [aggregate(column, level=LEVEL) for column in runs.T]
            mean, low, high = np.array([(point.mean, point.lower, point.upper) for point in per_interval]).T
            if len(runs) < FEWEST_RUNS:
                low = high = np.full_like(mean, np.nan)
            policy, world = row.condition
            label = policy.label if n_worlds == 1 else f"{policy.label} in {world.name}"
            curves.append(Curve(label, mean, low, high))
        draw_curves(
            path,
            self.table.of(self.rows[0].condition)[0]["t_end_s"],
            curves,
            title=self._title(n_worlds),
            ylabel=f"{read_as.title} per {scenario.interval_s:g} s" if read_as.is_total else read_as.title,
            band=_about_bands(curves),
            style=style,
        )


def summarize_runs(table: Table) -> RunSummary:
    """Return what the runs of a table achieved, one row per condition that has finished runs."""
    return RunSummary(table=table, rows=tuple(_condition_summaries(table)))


def performance_number(record: Record, read_as: Performance) -> float:
    """Return the performance of a run as one number: per 1,000 s for totals, else the mean over intervals."""
    return record.per_1000_s("performance") if read_as.is_total else float(record["performance"].mean())


def span(read_as: Performance) -> str:
    """Return what `performance_number` counts, in words."""
    return "per 1,000 s" if read_as.is_total else "mean"


def spread_text(summary: Summary) -> str:
    """Return a mean with half of its interval, with two digits behind the point."""
    half = summary.upper - summary.mean
    return f"{summary.mean:.2f}" + ("" if math.isnan(half) else f" ± {half:.2f}")


def _quantities(record: Record, read_as: Performance) -> dict[str, float]:
    """Return what is told of a run, each as one number."""
    delivered, present = record["collected"], record["n_present"]
    per_robot = np.divide(delivered, present, out=np.zeros(len(present)), where=present > 0.0)
    return {
        "performance": performance_number(record, read_as),
        "deliveries_per_1000_s": record.per_1000_s("collected"),
        "deliveries_per_robot_per_1000_s": float(per_robot.sum()) * 1000.0 / record.horizon_s,  # that is present
        "first_pickups_per_1000_s": record.per_1000_s("first_picked"),
        "interference_fraction": float(record["interference_fraction"].mean()),
    }


def _condition_summaries(table: Table) -> Iterator[ConditionSummary]:
    for condition in table.plan.conditions:
        records = table.of(condition)
        if not records:
            continue
        wall_s = sum(record.wall_time_s for record in records)
        read_as = performance_of(condition.world.scenario.performance)
        planned = table.plan.specs_of(condition)[0].world
        runs = [_quantities(record, read_as) for record in records]
        yield ConditionSummary(
            condition=condition,
            caches=planned.scenario.caches,
            n_runs=len(records),
            of={name: aggregate([run[name] for run in runs], level=LEVEL) for name in runs[0]},
            share_of_limit=share_of_limit(planned, float(np.mean([record["performance"].sum() for record in records]))),
            simulated_s_per_wall_s=sum(record.horizon_s for record in records) / wall_s if wall_s else math.nan,
        )


def _condition_mapping(row: ConditionSummary) -> dict[str, Any]:
    return {
        "controller": row.condition.policy.label,
        "caches": row.caches,
        "n_runs": row.n_runs,
        **{
            name: {"mean": plain(of.mean), "low": plain(of.lower), "high": plain(of.upper)}
            for name, of in row.of.items()
        },
        "share_of_limit": row.share_of_limit,
        "simulated_s_per_wall_s": plain(row.simulated_s_per_wall_s),
    }


def _about_bands(curves: Sequence[Curve]) -> str:
    """Return what the bands are; of curves without them, why."""
    few = f"fewer than {FEWEST_RUNS} runs, too few for a band"
    with_band = [bool(np.isfinite(curve.low).any()) for curve in curves]
    if not any(with_band):
        return few
    return f"bands: {LEVEL:.0%} t interval over seeds" + ("" if all(with_band) else f"; elsewhere {few}")
