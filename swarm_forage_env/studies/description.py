"""The sets of the paper in a table, and which runs of a study are done."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import polars as pl

from swarm_forage_env._internal.wording import counted
from swarm_forage_env.sheet import Answer, Sheet
from swarm_forage_env.studies.results import AXIS, StudyTable
from swarm_forage_env.studies.study import left_out, load_study, set_names
from swarm_forage_env.studies.study_file import PAPER

FAILURES_SHOWN = 10
"""Number of failed runs in a printed list; the packed file and `to_mapping` have all of them."""
STATES = ("done", "failed", "missing")


def paper_sets(budget: str = PAPER) -> Sheet:
    """List the experiment sets of the paper: how many runs they make, and what a budget leaves out.

    Raises:
        ConfigError: the sets do not have this budget.
    """
    rows = [
        {
            "set": spec.name,
            "about": spec.file.title,
            "left out": "; ".join(f"{axis} {', '.join(values)}" for axis, values in left_out(spec).items()),
            "runs each": len(spec.seeds),
            "length, s": round(spec.length.horizon_s),
            "experiments": len(spec.places) // len(spec.policies),
            "runs": len(spec.places) * len(spec.seeds),
            "robot-ticks": spec.plan.robot_ticks,
        }
        for spec in (load_study(name, budget, rules=("described",)) for name in set_names())
    ]
    frame = pl.DataFrame(rows).drop(["left out", "runs each", "length, s"] if budget == PAPER else ["about"])
    sums = frame.select(pl.lit("all").alias("set"), pl.col("experiments", "runs", "robot-ticks").sum())
    title = f"experiment sets of the paper, budget {budget}"
    notes = ("of four controllers, under each of the two rules",)
    listed = pl.concat([frame, sums], how="diagonal")
    ticks = pl.Series("robot-ticks", [f"{count:.2e}" for count in listed["robot-ticks"]])
    return Sheet(title=title, frame=listed.with_columns(ticks), notes=notes)


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyStatus(Answer):
    """Which runs of a study are done, failed and missing."""

    table: StudyTable

    @property
    def is_complete(self) -> bool:
        """Whether every run is done."""
        return not any(self.table.places().select("failed", "missing").sum().row(0))

    def sheets(self) -> Sequence[Sheet]:
        """Return how many runs are in which state, the conditions that are not complete, and failed runs."""
        spec, places = self.table.spec, self.table.places()
        sums = dict(zip(STATES, places.select(STATES).sum().row(0), strict=True))
        told = [f"{sums['done']:,} of {counted(sum(sums.values()), 'run')} done"]
        told += [f"{sums[name]:,} {name}" for name in STATES[1:] if sums[name]]
        left = places.filter(places["failed"] + places["missing"] > 0)
        lines = [f"{len(places) - len(left):,} of {counted(len(places), 'condition')} complete"]
        if len(self.table.versions) > 1:
            lines.append(f"The runs were made by {len(self.table.versions)} versions or commits of the packages.")
        failed = self._failed()
        notes = [f"  {row['policy']}, seed {row['seed']}: {row['error']}" for row in failed[:FAILURES_SHOWN]]
        if len(failed) > FAILURES_SHOWN:
            notes.append(f"  and {len(failed) - FAILURES_SHOWN} more")
        axes = (pl.col(AXIS + axis.name).alias(axis.name) for axis in spec.axes)
        return [
            Sheet(title=f"{spec.name}, budget {spec.budget}: {', '.join(told)}", notes=lines),
            *([Sheet(frame=left.select("rules", "policy", *axes, *STATES))] if len(left) else []),
            *([Sheet(title="failed", notes=notes)] if notes else []),
        ]

    def to_mapping(self) -> dict[str, Any]:
        """Return the states of all conditions, and all failed runs."""
        return {
            "study": self.table.spec.to_toml(),
            "versions": [dict(one) for one in self.table.versions],
            "conditions": self.table.places().to_dicts(),
            "failures": self._failed(),
        }

    def _failed(self) -> list[dict[str, Any]]:
        failed = self.table.frame.filter(self.table.frame["error"].is_not_null())
        return failed.select("rules", "policy", "seed", "error").to_dicts()


def status(table: StudyTable) -> StudyStatus:
    """Return which runs of a study are done, failed and missing, from the table that `read_study` returns."""
    return StudyStatus(table=table)
