"""What a plan would run.

print(summarize_plan(plan, out="results/warehouse_small"))
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from swarm_forage_env._internal.wording import counted
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.runs.plan import Condition, Plan
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import DONE, RunStore


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanSummary(Answer):
    """The runs of a plan, and which of them are stored."""

    name: str
    """What stands before the numbers, empty where a plan has no name."""
    runs: tuple[tuple[Condition, Mapping[str, RunSpec]], ...]
    """Each condition with its runs by their ids."""
    stored: frozenset[str]
    """Ids of the runs that are stored already."""
    folder: Path | None = None
    """Where records go, None where they are not stored."""

    @cached_property
    def planned(self) -> dict[str, RunSpec]:
        """All runs by their ids, each once."""
        return {run_id: spec for _, specs in self.runs for run_id, spec in specs.items()}

    @cached_property
    def todo(self) -> tuple[RunSpec, ...]:
        """The runs that are not stored, each once."""
        return tuple(spec for run_id, spec in self.planned.items() if run_id not in self.stored)

    def sheets(self) -> tuple[Sheet, ...]:
        """Return one line."""
        named = f"{self.name}: " if self.name else ""
        where = "" if self.folder is None else f"; records go to {self.folder}"
        robot_ticks = sum(spec.robot_ticks for spec in self.todo)
        counts = f"{counted(len(self.planned), 'run')}, {len(self.stored):,} stored, {len(self.todo):,} to do"
        return (Sheet(title=f"{named}{counts} with {robot_ticks:.3g} robot-ticks{where}"),)

    def to_mapping(self) -> dict[str, Any]:
        """Return all runs with their specifications."""
        return {
            "policies": list(dict.fromkeys(condition.policy.label for condition, _ in self.runs)),
            "out": None if self.folder is None else str(self.folder),
            "runs": [
                {"run_id": run_id, "stored": run_id in self.stored, "spec": spec.to_mapping()}
                for _, specs in self.runs
                for run_id, spec in specs.items()
            ],
        }


def summarize_plan(
    plan: Plan, *, name: str = "", only: Iterable[RunSpec] | None = None, out: str | Path | None = None
) -> PlanSummary:
    """Say what a plan would run.

    Args:
        plan: The runs.
        name: What stands before the numbers.
        only: Those of its runs that are meant, such as the shard of a study; default all.
        out: Folder for run records; runs that it holds are not repeated.
    """
    meant = None if only is None else {spec.run_id for spec in only}
    runs: list[tuple[Condition, dict[str, RunSpec]]] = []
    for condition in plan.conditions:
        by_id = {spec.run_id: spec for spec in plan.specs_of(condition)}
        runs.append((condition, {run_id: spec for run_id, spec in by_id.items() if meant is None or run_id in meant}))
    planned = {run_id: spec for _, specs in runs for run_id, spec in specs.items()}
    store = None if out is None else RunStore(out)
    states = {} if store is None else store.look_up(planned.values(), keep=False).states
    return PlanSummary(
        name=name,
        runs=tuple(runs),
        stored=frozenset(run_id for run_id, state in states.items() if state == DONE),
        folder=None if store is None else store.folder,
    )
