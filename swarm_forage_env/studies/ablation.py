"""Which quirk makes which result: each one switched on in the description, and off in the authors' program.

`plan_ablation` says which runs that needs and `run_ablation` makes them. A quirk whose first run equals that of its
reading, bit for bit, is taken to do nothing there; its other seeds are not run.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, known_name
from swarm_forage_env.contract.codes import Task
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.runs.record import RunRecord
from swarm_forage_env.runs.runner import run_all
from swarm_forage_env.runs.spec import RunSpec, plan_run
from swarm_forage_env.runs.store import RunFailure, RunStore
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.quirks import QUIRK_NAMES, READINGS

if TYPE_CHECKING:
    from swarm_forage_env.wrappers.base import WrapperConfig

TASK_COLUMNS = tuple(f"task_share_{task.name.lower()}" for task in Task)


class Cell(NamedTuple):
    """One place of an ablation: a policy in a world, under a reading, with one quirk switched."""

    scenario: str
    n_robots: int
    policy: str
    reading: str
    """Key of `scenarios.quirks.READINGS`."""
    quirk: str
    """The quirk that differs from the reading; empty = none."""


@dataclass(frozen=True, kw_only=True)
class Ablation:
    """The runs of an ablation, one per cell and seed."""

    specs: Mapping[Cell, tuple[RunSpec, ...]]

    @property
    def first(self) -> tuple[RunSpec, ...]:
        """The runs of both readings, and the first run of each switched quirk."""
        return tuple(spec for cell, specs in self.specs.items() for spec in (specs[:1] if cell.quirk else specs))

    @property
    def all(self) -> tuple[RunSpec, ...]:
        """All runs, those of quirks without effect included."""
        return tuple(spec for specs in self.specs.values() for spec in specs)


@dataclass(frozen=True, kw_only=True, eq=False)
class Effect:
    """What one switched quirk changed, seed by seed against its reading."""

    cell: Cell
    is_same: bool
    """Whether the first run equals that of the reading bit for bit. Then no other was made, and R = 1."""
    performance: FloatArray
    """(R,) difference as a share of the reading's mean performance; NaN if that is 0."""
    interference: FloatArray
    """(R,) difference of the share of robot time in interference."""
    task_shares: FloatArray | None
    """(R, 8) differences of the mean share of robots in each task; None if the policy has no tasks."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AblationResult:
    """Records by cell, and what failed."""

    records: Mapping[Cell, tuple[RunRecord, ...]]
    failures: tuple[RunFailure, ...]

    def effects(self) -> tuple[Effect, ...]:
        """Return one effect per switched quirk; cells whose runs failed are left out."""
        return tuple(
            _effect(cell, self.records[cell._replace(quirk="")], records)
            for cell, records in self.records.items()
            if cell.quirk and cell._replace(quirk="") in self.records
        )

    def means(self, cell: Cell) -> dict[str, float]:
        """Return the mean performance of each policy in a cell's world under its rules, best first.

        A policy whose runs failed is left out. One that the quirk does not touch has the runs of its reading.
        """
        found = {}
        for policy in dict.fromkeys(other.policy for other in self.records):
            own = self.records.get(cell._replace(policy=policy))
            if own is not None:
                found[policy] = _mean_performance(own)
        return dict(sorted(found.items(), key=lambda item: -item[1]))


def plan_ablation(
    scenarios: Iterable[ScenarioConfig],
    policies: Sequence[str],
    *,
    quirks: Sequence[str] = QUIRK_NAMES,
    seeds: Sequence[int] = (0, 1, 2),
    caches: str | None = None,
    wrappers: "Iterable[WrapperConfig]" = (),
) -> Ablation:
    """Return the runs that show what each quirk does.

    Args:
        scenarios: The worlds, with their numbers of robots; their own quirks are replaced.
        policies: Registered names, or paths of policy files.
        quirks: Names of the quirks to switch; none = compare the two readings only.
        seeds: Seeds of the runs; differences are taken seed by seed.
        caches: Which caches there are; default those of each policy.
        wrappers: Configurations of noise, throttling and population dynamics, the same in all runs.

    Raises:
        ConfigError: an unknown quirk, no policy, no seed, or two worlds of one name and size.
        ValueError: an unknown policy.
    """
    for name in quirks:
        known_name("quirk", name, QUIRK_NAMES)
    if not policies or not seeds:
        raise ConfigError(f"Expected one or more policies and seeds, got {len(policies)} and {len(seeds)}.")
    specs: dict[Cell, tuple[RunSpec, ...]] = {}
    for scenario, (reading, rules), quirk, policy in product(scenarios, READINGS.items(), ("", *quirks), policies):
        switched = replace(rules, **{quirk: not getattr(rules, quirk)}) if quirk else rules
        planned = plan_run(replace(scenario, quirks=switched), policy, caches=caches, wrappers=tuple(wrappers))
        cell = Cell(scenario.name, scenario.robots.n_robots, policy, reading, quirk)
        if cell in specs:
            raise ConfigError(
                f"Expected worlds that differ in name or number of robots, got {cell.scenario} with {cell.n_robots} "
                "robots twice."
            )
        specs[cell] = tuple(replace(planned, seed=seed) for seed in seeds)
    return Ablation(specs=specs)


def run_ablation(
    plan: Ablation, *, store: RunStore | None = None, jobs: int | None = None, progress: bool = False
) -> AblationResult:
    """Make the runs of a plan; arguments and errors as in `runs.runner.run_all`.

    First both readings and the first seed of each quirk; then the other seeds of the quirks that changed something.
    """
    found = run_all(plan.first, store=store, jobs=jobs, progress=progress)
    first = {record.run_id: record for record in found.records}
    same = {cell for cell, specs in plan.specs.items() if cell.quirk and _changed_nothing(plan, cell, specs, first)}
    todo = [spec for cell, specs in plan.specs.items() if cell.quirk and cell not in same for spec in specs[1:]]
    rest = run_all(todo, store=store, jobs=jobs, progress=progress)
    by_id = first | {record.run_id: record for record in rest.records}
    records: dict[Cell, tuple[RunRecord, ...]] = {}
    for cell in plan.specs:
        # A quirk that changed nothing has the runs of its reading.
        specs = plan.specs[cell._replace(quirk="")] if cell in same else plan.specs[cell]
        own = tuple(by_id[spec.run_id] for spec in specs if spec.run_id in by_id)
        if len(own) == len(specs):
            records[cell] = own
    return AblationResult(records=records, failures=(*found.failures, *rest.failures))


def _changed_nothing(plan: Ablation, cell: Cell, specs: Sequence[RunSpec], first: Mapping[str, RunRecord]) -> bool:
    """Whether the first run of a cell was made and equals that of its reading."""
    switched, base = (first.get(spec.run_id) for spec in (specs[0], plan.specs[cell._replace(quirk="")][0]))
    return switched is not None and base is not None and switched.same_columns(base)


def _mean_performance(records: Sequence[RunRecord]) -> float:
    return float(np.mean([record.performance.sum() for record in records]))


def _effect(cell: Cell, base: Sequence[RunRecord], switched: Sequence[RunRecord]) -> Effect:
    is_same = switched[0].same_columns(base[0])
    pairs = list(zip(base, switched, strict=True))[: 1 if is_same else None]
    whole = _mean_performance(base)
    gains = np.array([after.performance.sum() - before.performance.sum() for before, after in pairs])
    shares = [
        [after.contributed[name].mean() - before.contributed[name].mean() for name in TASK_COLUMNS]
        for before, after in pairs
        if TASK_COLUMNS[0] in before.contributed
    ]
    return Effect(
        cell=cell,
        is_same=is_same,
        performance=gains / whole if whole else np.full(len(pairs), np.nan),
        interference=np.array(
            [after.interference_fraction.mean() - before.interference_fraction.mean() for before, after in pairs]
        ),
        task_shares=np.array(shares) if shares else None,
    )
