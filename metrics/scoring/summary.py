"""What runs achieved in each condition: performance, deliveries and interference.

table = run_plan(Plan.product(policy_specs(["crw", "dpo"]), [World(scenario("warehouse_small"))], seeds=range(4)))
print(summarize_runs(table))
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import polars.selectors as cs

from swarm_forage_env._internal.wording import counted, percent, plain
from swarm_forage_env.rendering.figures import SCREEN, FigureStyle
from swarm_forage_env.rendering.plots import Curve, draw_curves
from swarm_forage_env.runs.plan import Condition, Table
from swarm_forage_env.runs.record import Record
from swarm_forage_env.runs.store import failure_file, failure_lines, record_file
from swarm_forage_env.scenarios.performance import Performance, performance_of
from swarm_forage_env.sheet import Answer, Sheet
from swarm_forage_env.wrappers.world import World

from ..statistics import aggregate
from .limits import ABOUT_LIMIT, share_of_limit
from .plots import FEWEST_RUNS, about_intervals, interval_words


@dataclass(frozen=True, kw_only=True, eq=False)
class RunSummary(Answer):
    """What the runs of a table achieved."""

    table: Table
    rows: tuple[dict[str, Any], ...]
    """One per condition with finished runs: controller, world, caches, n_runs; of each quantity of a run mean, low and
    high, its 95 % interval; share_of_limit, None where there is no estimate (see `limit_of`); simulated seconds per
    second and process, policy and recording included."""

    @property
    def world(self) -> World:
        """The first world."""
        return self.table.plan.conditions[0].world

    @property
    def read_as(self) -> Performance:
        """What performance is in the first world."""
        return performance_of(self.world.scenario.performance)

    @property
    def n_worlds(self) -> int:
        """Number of worlds."""
        return len({condition.world for condition in self.table.plan.conditions})

    def sheets(self) -> tuple[Sheet, ...]:
        """Return one row per condition, and why runs failed."""
        failures = Sheet(notes=[f"failed: {line}" for line in failure_lines(self.table.failures.values())])
        if not self.rows:
            return (failures,)
        # What the scenario calls performance stands before deliveries, where it is something else.
        first = f"{self.read_as.title} {'per 1,000 s' if self.read_as.is_total else 'mean'}"
        lines = [
            {
                "policy": row["controller"],
                "world": row["world"],
                "caches": row["caches"],
                "runs": str(row["n_runs"]),
                first: _with_half(row["performance"]),
                "deliveries per 1,000 s": _with_half(row["deliveries_per_1000_s"]),
                "of the limit": "-" if row["share_of_limit"] is None else percent(row["share_of_limit"]),
                "interference": f"{row['interference_fraction']['mean']:.3f}",
                "simulated s per wall s": f"{row['simulated_s_per_wall_s'] or math.nan:,.0f}",
            }
            for row in self.rows
        ]
        has_limit = any(row["share_of_limit"] is not None for row in self.rows)
        is_hidden = {"world": self.n_worlds == 1, "of the limit": not has_limit}
        header = [name for name in lines[0] if not is_hidden.get(name)]
        notes = [f"{interval_words([row['n_runs'] for row in self.rows])}; interference: share of active robot time"]
        notes += [ABOUT_LIMIT] if has_limit else []
        cells = [[line[name] for name in header] for line in lines]
        return Sheet.of(title=self._title(), header=header, rows=cells, notes=notes), failures

    def _title(self) -> str:
        scenario = self.world.scenario
        if self.n_worlds > 1:
            return f"{scenario.name} and others: {counted(self.n_worlds, 'world')}"
        sizes = counted(self.world.n_robots, "robot"), counted(scenario.objects.n_objects, "object")
        return self.world.title(*sizes, f"{scenario.horizon_s:g} s")

    def csv(self) -> str:
        """Return `rows` as CSV: a column for each mean, and one for each end of its interval."""
        found = pl.DataFrame(self.rows, infer_schema_length=None)
        for name in found.select(cs.struct()).columns:
            parts = [name, f"{name}_low", f"{name}_high"]
            found = found.with_columns(pl.col(name).struct.rename_fields(parts)).unnest(name)
        return found.write_csv()

    def to_mapping(self) -> dict[str, Any]:
        """Return policies, runs and failures as plain values."""
        folder, read_as = self.table.folder, self.read_as
        return {
            "scenario": self.world.scenario.name,
            "performance": {"name": read_as.name, "unit": read_as.unit, "is_per_1000_s": read_as.is_total},
            "out": None if folder is None else str(folder),
            "controllers": list(self.rows),
            "runs": [
                {
                    **record.keys,
                    **_quantities(record, read_as),
                    "wall_time_s": plain(record.wall_time_s),
                    "file": None if folder is None else str(record_file(folder, record.run_id)),
                }
                for condition in self._finished()
                for record in self.table.of(condition)
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

    def _finished(self) -> list[Condition]:
        """The conditions with finished runs."""
        return [condition for condition in self.table.plan.conditions if self.table.of(condition)]

    @property
    def has_picture(self) -> bool:
        """Whether runs have finished, and all have the same intervals."""
        scenarios = [condition.world.scenario for condition in self._finished()]
        return len({(scenario.horizon_s, scenario.interval_s) for scenario in scenarios}) == 1

    def draw(self, path: str | Path, *, style: FigureStyle = SCREEN) -> None:
        """Draw performance over time, one curve per condition with the t interval over seeds."""
        if not self.has_picture:
            raise ValueError("Expected finished runs with the same intervals, got nothing to draw.")
        interval_s, read_as = self.world.scenario.interval_s, self.read_as
        curves: list[Curve] = []
        for policy, world in self._finished():
            runs = np.array([record["performance"] for record in self.table.of(Condition(policy, world))])
            points = [aggregate(column) for column in runs.T]
            mean, low, high = np.array([(point.mean, point.lower, point.upper) for point in points]).T
            if len(runs) < FEWEST_RUNS:
                low = high = np.full_like(mean, np.nan)
            label = policy.label if self.n_worlds == 1 else f"{policy.label} in {world.name}"
            curves.append(Curve(label, mean, low, high))
        draw_curves(
            path,
            self.table.of(self._finished()[0])[0]["t_end_s"],
            curves,
            title=self._title(),
            ylabel=f"{read_as.title} per {interval_s:g} s" if read_as.is_total else read_as.title,
            band=about_intervals([row["n_runs"] for row in self.rows], "bands"),
            style=style,
        )


def summarize_runs(table: Table) -> RunSummary:
    """Return what the runs of a table achieved, one row per condition that has finished runs."""
    found = ((condition, table.of(condition)) for condition in table.plan.conditions)
    return RunSummary(
        table=table, rows=tuple(_row(table, condition, records) for condition, records in found if records)
    )


def _row(table: Table, condition: Condition, records: Sequence[Record]) -> dict[str, Any]:
    planned = table.plan.specs_of(condition)[0].world
    runs = [_quantities(record, performance_of(condition.world.scenario.performance)) for record in records]
    quantities = {name: aggregate([run[name] for run in runs]) for name in runs[0]}
    simulated_s, wall_s = (sum(getattr(each, name) for each in records) for name in ("horizon_s", "wall_time_s"))
    return {
        "controller": condition.policy.label,
        "world": condition.world.name,
        "caches": planned.scenario.caches,
        "n_runs": len(records),
        **{name: {"mean": of.mean, "low": plain(of.lower), "high": plain(of.upper)} for name, of in quantities.items()},
        "share_of_limit": share_of_limit(planned, float(np.mean([each["performance"].sum() for each in records]))),
        "simulated_s_per_wall_s": plain(simulated_s / wall_s) if wall_s else None,
    }


def _quantities(record: Record, read_as: Performance) -> dict[str, float]:
    """Return what is told of a run, each as one number; performance is per 1,000 s if it is a total, else a mean."""
    delivered, present = record["collected"], record["n_present"]
    per_robot = np.divide(delivered, present, out=np.zeros(len(present)), where=present > 0.0)
    performance = record.per_1000_s("performance") if read_as.is_total else float(record["performance"].mean())
    return {
        "performance": performance,
        "deliveries_per_1000_s": record.per_1000_s("collected"),
        "deliveries_per_robot_per_1000_s": float(per_robot.sum()) * 1000.0 / record.horizon_s,  # that is present
        "first_pickups_per_1000_s": record.per_1000_s("first_picked"),
        "interference_fraction": float(record["interference_fraction"].mean()),
    }


def _with_half(of: Mapping[str, float | None]) -> str:
    """Return a mean with half of its interval, with two digits behind the point."""
    mean, high = of["mean"] or 0.0, of["high"]
    return f"{mean:.2f}" + ("" if high is None else f" ± {high - mean:.2f}")
