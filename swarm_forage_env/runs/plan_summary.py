"""What a plan would run, and how long that takes: measured here for a moment, before anything is run.

print(summarize_plan(plan, out="results/warehouse_small"))
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swarm_forage_env._internal.wording import counted
from swarm_forage_env.policies.mixture import is_mixture, mixture_parts
from swarm_forage_env.policies.registry import file_of, is_policy_file, local_policy
from swarm_forage_env.policies.trust import only_looks_at
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.runs.cost import Cost, Kind, calibrate, kind_of
from swarm_forage_env.runs.plan import Plan
from swarm_forage_env.runs.progress import duration
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import DONE, RunStore
from swarm_forage_env.runs.workers import processes_of
from swarm_forage_env.wrappers.world import World

_WORLDS_HEADER = ("scenario", "varied", "value", "robots", "objects", "seconds", "runs", "to do")
_POLICIES_HEADER = ("policy", "caches", "runs", "to do", "robot-ticks", "core-hours")
_NOT_MEASURED = (
    "What has no core-hours is not in the estimate: models, which are not opened to plan, and policies that fail."
)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanSummary(Answer):
    """The runs of a plan: which are stored, and what the others take."""

    plan: Plan
    stored: frozenset[str]
    """Ids of the runs that are stored already."""
    costs: Mapping[Kind, Cost]
    """What a run takes, of each kind that is to be run and could be measured."""
    processes: int
    """How many make runs at a time."""
    folder: Path | None = None
    """Where records go, None where they are not stored."""

    @property
    def todo(self) -> tuple[RunSpec, ...]:
        """The runs that are not stored, each once."""
        return tuple({spec.run_id: spec for spec in self.plan.specs if spec.run_id not in self.stored}.values())

    def seconds(self, spec: RunSpec) -> float:
        """Return the processor seconds of a run; NaN if it was not measured."""
        cost = self.costs.get(kind_of(spec))
        return math.nan if cost is None else cost.seconds(spec)

    @property
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
        n_runs = len({spec.run_id for spec in self.plan.specs})
        where = "" if self.folder is None else f", records go to {self.folder}"
        title = f"{counted(n_runs, 'run')}, {len(self.todo):,} to do{where}"
        measured = self._measured_s
        about = f"about {duration(self.wall_s)} on {counted(self.processes, 'core')} as fast as this one is now, "
        notes = [f"{about}and some seconds to start"] if measured else []
        notes += [_NOT_MEASURED] if len(measured) < len(self.todo) else []
        return (
            Sheet(title=title, header=_WORLDS_HEADER, rows=self._world_rows()),
            Sheet(
                header=_POLICIES_HEADER,
                rows=self._policy_rows(),
                notes=notes,
            ),
        )

    def _world_rows(self) -> list[tuple[str, ...]]:
        n_runs: Counter[tuple[str, ...]] = Counter()
        n_todo: Counter[tuple[str, ...]] = Counter()
        for condition in self.plan.conditions:
            row = _world_cells(condition.world)
            specs = self.plan.specs_of(condition)
            n_runs[row] += len(specs)
            n_todo[row] += sum(spec.run_id not in self.stored for spec in specs)
        return [(*row, f"{n_runs[row]:,}", f"{n_todo[row]:,}") for row in n_runs]

    def _policy_rows(self) -> list[tuple[str, ...]]:
        rows: dict[str, list[RunSpec]] = {}
        for condition in self.plan.conditions:
            rows.setdefault(condition.policy.label, []).extend(self.plan.specs_of(condition))
        if len(rows) > 1:
            rows["all"] = [*self.plan.specs]
        return [self._policy_row(label, specs) for label, specs in rows.items()]

    def _policy_row(self, label: str, specs: Sequence[RunSpec]) -> tuple[str, ...]:
        planned = {spec.run_id: spec for spec in specs}
        todo = [spec for run_id, spec in planned.items() if run_id not in self.stored]
        robot_ticks = sum(spec.robot_ticks for spec in todo)
        seconds = [each for each in map(self.seconds, todo) if not math.isnan(each)]
        hours = sum(seconds) / 3600.0 if seconds or not todo else math.nan
        caches = ", ".join(dict.fromkeys(spec.scenario.caches for spec in specs))
        return label, caches, f"{len(planned):,}", f"{len(todo):,}", f"{robot_ticks:.3g}", _hours_text(hours)

    def to_mapping(self) -> dict[str, Any]:
        """Return all runs with their specifications, and the estimate."""
        return {
            "policies": [policy.label for policy in self.plan.policies],
            "out": None if self.folder is None else str(self.folder),
            "core_hours": self.core_hours,
            "estimated_wall_s": self.wall_s,
            "runs": [
                {"run_id": spec.run_id, "stored": spec.run_id in self.stored, "spec": spec.to_mapping()}
                for spec in self.plan.specs
            ],
        }


def summarize_plan(
    plan: Plan,
    *,
    out: str | Path | None = None,
    jobs: int | None = None,
    tell: Callable[[str], None] | None = None,
) -> PlanSummary:
    """Say what a plan would run, and measure for a moment how long that takes.

    Args:
        plan: The runs.
        out: Folder for run records; runs that it holds are not repeated.
        jobs: Processes that are to make the runs; default one per core.
        tell: Gets a line about each measured swarm before it is measured.
    """
    store = None if out is None else RunStore(out)
    states = {} if store is None else store.look_up(plan.specs, keep=False).states
    stored = frozenset(run_id for run_id, state in states.items() if state == DONE)
    todo = {spec.run_id: spec for spec in plan.specs if spec.run_id not in stored}
    with ExitStack() as here:
        for policy in plan.policies:
            if policy.factory is not None:
                here.enter_context(local_policy(policy.label, policy.factory))
        costs = _measured(todo.values(), tell)
    return PlanSummary(
        plan=plan,
        stored=stored,
        costs=costs,
        processes=processes_of(len(todo), jobs),
        folder=None if store is None else store.folder,
    )


def _measured(specs: Iterable[RunSpec], tell: Callable[[str], None] | None) -> dict[Kind, Cost]:
    """What runs take, but for those that cannot be tried: their runs will say why."""
    by_kind: dict[Kind, list[RunSpec]] = {}
    for spec in specs:
        if not _is_closed(spec.policy):
            by_kind.setdefault(kind_of(spec), []).append(spec)
    costs: dict[Kind, Cost] = {}
    for some in by_kind.values():
        with suppress(Exception):  # whatever a run raises is its failure
            costs |= calibrate(some, tell=tell)
    return costs


def _is_closed(policy: str) -> bool:
    """Whether a policy has a file that is not to be opened, see `policies.trust.only_looks_at`."""
    parts = [part.policy for part in mixture_parts(policy)] if is_mixture(policy) else [policy]
    return any(is_policy_file(part) and only_looks_at(file_of(part)) for part in parts)


def _world_cells(world: World) -> tuple[str, ...]:
    scenario = world.scenario
    return (
        scenario.name,
        world.criterion,
        f"{world.value:g}",
        str(world.n_robots),
        str(scenario.objects.n_objects),
        f"{scenario.horizon_s:g}",
    )


def _hours_text(hours: float) -> str:
    """Hours with two digits behind the point; nobody plans with fewer than 36 s."""
    if math.isnan(hours):
        return "-"
    return f"{hours:,.2f}" if hours >= 0.01 or hours == 0.0 else "<0.01"
