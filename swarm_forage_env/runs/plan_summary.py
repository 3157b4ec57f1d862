"""What a plan would run, and how long that takes: measured here for a moment, before anything is run.

print(summarize_plan(plan, out="results/warehouse_small"))
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from swarm_forage_env._internal.wording import counted
from swarm_forage_env.policies.registry import local_policy
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.runs.cost import Cost, Kind, calibrate, duration, kind_of
from swarm_forage_env.runs.plan import Condition, Plan
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import DONE, RunStore
from swarm_forage_env.runs.workers import processes_of
from swarm_forage_env.wrappers.world import World

WORLDS_SHOWN = 60
"""Worlds that the text names; `to_mapping` has all."""
_WORLDS_HEADER = ("scenario", "varied", "value", "robots", "objects", "seconds", "runs", "to do")
_DENSITIES = ("robots/m2", "objects/m2")
_POLICIES_HEADER = ("policy", "caches", "runs", "to do", "robot-ticks", "core-hours")
_NOT_MEASURED = "What has no core-hours is not in the estimate: policies that fail."


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanSummary(Answer):
    """The runs of a plan: which are stored, and what the others take."""

    name: str
    """What stands before the numbers, empty where a plan has no name."""
    runs: tuple[tuple[Condition, Mapping[str, RunSpec]], ...]
    """Each condition with its runs by their ids."""
    stored: frozenset[str]
    """Ids of the runs that are stored already."""
    costs: Mapping[Kind, Cost]
    """What a run takes, of each kind that is to be run and could be measured."""
    processes: int
    """How many make runs at a time."""
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

    def seconds(self, spec: RunSpec) -> float:
        """Return the processor seconds of a run; NaN if it was not measured."""
        cost = self.costs.get(kind_of(spec))
        return math.nan if cost is None else cost.seconds(spec)

    @cached_property
    def _measured_s(self) -> list[float]:
        return [seconds for seconds in map(self.seconds, self.todo) if not math.isnan(seconds)]

    @property
    def core_hours(self) -> float:
        """Processor time of all that is to do and was measured."""
        return sum(self._measured_s) / 3600.0

    @property
    def wall_s(self) -> float:
        """Seconds until all that was measured is done."""
        seconds = self._measured_s
        return max(sum(seconds) / self.processes, *seconds, 0.0)

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the worlds, and the policies with what their runs take."""
        where = "" if self.folder is None else f", records go to {self.folder}"
        named = f"{self.name}: " if self.name else ""
        title = f"{named}{counted(len(self.planned), 'run')}, {len(self.todo):,} to do{where}"
        measured = self._measured_s
        about = f"about {duration(self.wall_s)} on {counted(self.processes, 'core')} as fast as this one is now, "
        notes = [f"{about}and some seconds to start"] if measured else []
        notes += [_NOT_MEASURED] if len(measured) < len(self.todo) else []
        worlds = self._world_rows()
        more = [f"and {len(worlds) - WORLDS_SHOWN} more worlds"] if len(worlds) > WORLDS_SHOWN else []
        return (
            Sheet(title=title, header=self._worlds_header, rows=worlds[:WORLDS_SHOWN], notes=more),
            Sheet(header=_POLICIES_HEADER, rows=self._policy_rows(), notes=notes),
        )

    @cached_property
    def _has_densities(self) -> bool:
        """Whether swarms of one size have several arenas, so that sizes do not tell how dense they are."""
        arenas: dict[tuple[str, int], set[tuple[float, float]]] = {}
        for condition, _ in self.runs:
            world = condition.world.scenario
            size = world.arena.width_m, world.arena.height_m
            arenas.setdefault((world.name, condition.world.n_robots), set()).add(size)
        return any(len(sizes) > 1 for sizes in arenas.values())

    @property
    def _worlds_header(self) -> tuple[str, ...]:
        at = _WORLDS_HEADER.index("seconds")
        more = _DENSITIES if self._has_densities else ()
        return (*_WORLDS_HEADER[:at], *more, *_WORLDS_HEADER[at:])

    def _world_cells(self, world: World) -> tuple[str, ...]:
        scenario = world.scenario
        counts = world.n_robots, scenario.objects.n_objects
        area_m2 = scenario.arena.width_m * scenario.arena.height_m
        densities = (f"{count / area_m2:.3g}" for count in counts) if self._has_densities else ()
        where = scenario.name, world.criterion, f"{world.value:g}"
        return (*where, *map(str, counts), *densities, f"{scenario.horizon_s:g}")

    def _world_rows(self) -> list[tuple[str, ...]]:
        n_runs: Counter[tuple[str, ...]] = Counter()
        n_todo: Counter[tuple[str, ...]] = Counter()
        for condition, specs in self.runs:
            row = self._world_cells(condition.world)
            n_runs[row] += len(specs)
            n_todo[row] += len(specs.keys() - self.stored)
        return [(*row, f"{n_runs[row]:,}", f"{n_todo[row]:,}") for row in n_runs]

    def _policy_rows(self) -> list[tuple[str, ...]]:
        rows: dict[str, dict[str, RunSpec]] = {}
        for condition, specs in self.runs:
            rows.setdefault(condition.policy.label, {}).update(specs)
        if len(rows) > 1:
            rows["all"] = self.planned
        return [self._policy_row(label, specs) for label, specs in rows.items()]

    def _policy_row(self, label: str, planned: Mapping[str, RunSpec]) -> tuple[str, ...]:
        todo = [spec for run_id, spec in planned.items() if run_id not in self.stored]
        robot_ticks = sum(spec.robot_ticks for spec in todo)
        seconds = [each for each in map(self.seconds, todo) if not math.isnan(each)]
        hours = sum(seconds) / 3600.0 if seconds or not todo else math.nan
        caches = ", ".join(dict.fromkeys(spec.scenario.caches for spec in planned.values()))
        return label, caches, f"{len(planned):,}", f"{len(todo):,}", f"{robot_ticks:.3g}", _hours_text(hours)

    def to_mapping(self) -> dict[str, Any]:
        """Return all runs with their specifications, and the estimate."""
        return {
            "policies": list(dict.fromkeys(condition.policy.label for condition, _ in self.runs)),
            "out": None if self.folder is None else str(self.folder),
            "core_hours": self.core_hours,
            "estimated_wall_s": self.wall_s,
            "runs": [
                {"run_id": run_id, "stored": run_id in self.stored, "spec": spec.to_mapping()}
                for _, specs in self.runs
                for run_id, spec in specs.items()
            ],
        }


def summarize_plan(
    plan: Plan,
    *,
    name: str = "",
    only: Iterable[RunSpec] | None = None,
    out: str | Path | None = None,
    jobs: int | None = None,
    tell: Callable[[str], None] | None = None,
) -> PlanSummary:
    """Say what a plan would run, and measure for a moment how long that takes.

    Args:
        plan: The runs.
        name: What stands before the numbers.
        only: Those of its runs that are meant, such as the shard of a study; default all.
        out: Folder for run records; runs that it holds are not repeated.
        jobs: Processes that are to make the runs; default one per core.
        tell: Gets a line about each measured swarm before it is measured.
    """
    meant = None if only is None else {spec.run_id for spec in only}
    runs: list[tuple[Condition, dict[str, RunSpec]]] = []
    for condition in plan.conditions:
        by_id = {spec.run_id: spec for spec in plan.specs_of(condition)}
        runs.append((condition, {run_id: spec for run_id, spec in by_id.items() if meant is None or run_id in meant}))
    planned = {run_id: spec for _, specs in runs for run_id, spec in specs.items()}
    store = None if out is None else RunStore(out)
    states = {} if store is None else store.look_up(planned.values(), keep=False).states
    stored = frozenset(run_id for run_id, state in states.items() if state == DONE)
    todo = [spec for run_id, spec in planned.items() if run_id not in stored]
    with ExitStack() as here:
        for policy in plan.policies:
            if policy.factory is not None:
                here.enter_context(local_policy(policy.label, policy.factory))
        costs = measured_costs(todo, tell)
    return PlanSummary(
        name=name,
        runs=tuple(runs),
        stored=stored,
        costs=costs,
        processes=processes_of(len(todo), jobs),
        folder=None if store is None else store.folder,
    )


def measured_costs(specs: Iterable[RunSpec], tell: Callable[[str], None] | None) -> dict[Kind, Cost]:
    """Return what runs take, but for those that cannot be tried: their runs will say why."""
    by_kind: dict[Kind, list[RunSpec]] = {}
    for spec in specs:
        by_kind.setdefault(kind_of(spec), []).append(spec)
    costs: dict[Kind, Cost] = {}
    for some in by_kind.values():
        with suppress(Exception):  # whatever a run raises is its failure
            costs |= calibrate(some, tell=tell)
    return costs


def _hours_text(hours: float) -> str:
    """Hours with two digits behind the point; nobody plans with fewer than 36 s."""
    if math.isnan(hours):
        return "-"
    return f"{hours:,.2f}" if hours >= 0.01 or hours == 0.0 else "<0.01"
