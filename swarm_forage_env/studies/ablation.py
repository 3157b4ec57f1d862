"""Which quirk makes which result: each one switched on in the description, and off in the authors' program.

`plan_ablation` says which runs that needs and `run_ablation` makes them. A quirk whose first run equals that of its
reading, bit for bit, is taken to do nothing there; its other seeds are not run.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, known_name
from swarm_forage_env.contract.codes import Task
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.runs.plan import Condition, Plan
from swarm_forage_env.runs.policy_spec import PolicyLike, policy_specs
from swarm_forage_env.runs.record import RunRecord
from swarm_forage_env.runs.runner import run_plan
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import RunFailure, RunStore
from swarm_forage_env.runs.table import Table
from swarm_forage_env.scenarios.quirks import QUIRK_NAMES, READINGS
from swarm_forage_env.wrappers.world import WorldLike, world_of

TASK_COLUMNS = tuple(f"task_share_{task.name.lower()}" for task in Task)


class Switch(NamedTuple):
    """One condition of an ablation: a policy in a world, under a reading, with one quirk switched."""

    scenario: str
    n_robots: int
    policy: str
    reading: str
    """Key of `scenarios.quirks.READINGS`."""
    quirk: str
    """The quirk that differs from the reading; empty = none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Ablation:
    """What an ablation runs."""

    conditions: Mapping[Switch, Condition]
    seeds: tuple[int, ...]

    @property
    def readings(self) -> Plan:
        """All runs of both readings."""
        return Plan(conditions=tuple(c for switch, c in self.conditions.items() if not switch.quirk), seeds=self.seeds)

    @property
    def specs(self) -> tuple[RunSpec, ...]:
        """All runs, those of quirks without effect included."""
        return Plan(conditions=tuple(self.conditions.values()), seeds=self.seeds).specs

    def of(self, switches: Iterable[Switch], seeds: Sequence[int]) -> Plan | None:
        """Return the runs of some switches; None if there is none."""
        chosen = [self.conditions[switch] for switch in switches]
        return Plan(conditions=tuple(chosen), seeds=tuple(seeds)) if chosen and seeds else None


@dataclass(frozen=True, kw_only=True, eq=False)
class Effect:
    """What one switched quirk changed, seed by seed against its reading."""

    switch: Switch
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
    """Records by switch, and what failed."""

    records: Mapping[Switch, tuple[RunRecord, ...]]
    failures: tuple[RunFailure, ...]

    def effects(self) -> tuple[Effect, ...]:
        """Return one effect per switched quirk; switches whose runs failed are left out."""
        return tuple(
            _effect(switch, self.records[switch._replace(quirk="")], records)
            for switch, records in self.records.items()
            if switch.quirk and switch._replace(quirk="") in self.records
        )

    def means(self, switch: Switch) -> dict[str, float]:
        """Return the mean performance of each policy in a switch's world under its rules, best first.

        A policy whose runs failed is left out. One that the quirk does not touch has the runs of its reading.
        """
        found = {}
        for policy in dict.fromkeys(other.policy for other in self.records):
            own = self.records.get(switch._replace(policy=policy))
            if own is not None:
                found[policy] = _mean_performance(own)
        return dict(sorted(found.items(), key=lambda item: -item[1]))


def plan_ablation(
    worlds: Iterable[WorldLike],
    policies: Sequence[PolicyLike] | Mapping[str, PolicyLike],
    *,
    quirks: Sequence[str] = QUIRK_NAMES,
    seeds: Sequence[int] = (0, 1, 2),
    caches: str | None = None,
) -> Ablation:
    """Return the conditions that show what each quirk does.

    Args:
        worlds: The worlds, with their numbers of robots; their own quirks are replaced.
        policies: As in `runs.policy_spec.policy_specs`.
        quirks: Names of the quirks to switch; none = compare the two readings only.
        seeds: Seeds of the runs; differences are taken seed by seed.
        caches: Which caches there are; default those of each policy.

    Raises:
        ConfigError: an unknown quirk or policy, no policy, no seed, or two worlds of one name and size.
    """
    for name in quirks:
        known_name("quirk", name, QUIRK_NAMES)
    if not policies or not seeds:
        raise ConfigError(f"Expected one or more policies and seeds, got {len(policies)} and {len(seeds)}.")
    chosen = policy_specs(policies, caches=caches)
    conditions: dict[Switch, Condition] = {}
    for world, (reading, rules), quirk, policy in product(
        map(world_of, worlds), READINGS.items(), ("", *quirks), chosen
    ):
        switched = replace(rules, **{quirk: not getattr(rules, quirk)}) if quirk else rules
        switch = Switch(world.scenario.name, world.n_robots, policy.policy, reading, quirk)
        if switch in conditions:
            raise ConfigError(
                f"Expected worlds that differ in name or number of robots, got {switch.scenario} with "
                f"{switch.n_robots} robots twice."
            )
        conditions[switch] = Condition(policy, replace(world, scenario=replace(world.scenario, quirks=switched)))
    return Ablation(conditions=conditions, seeds=tuple(seeds))


def run_ablation(
    ablation: Ablation, *, store: RunStore | None = None, jobs: int | None = None, progress: bool = False
) -> AblationResult:
    """Make the runs of an ablation; arguments and errors as in `runs.runner.run_plan`.

    First both readings and the first seed of each quirk; then the other seeds of the quirks that changed something.
    """
    conditions = ablation.conditions
    firsts = ablation.of([switch for switch in conditions if switch.quirk], ablation.seeds[:1])
    tables = [run_plan(ablation.readings, store=store, jobs=jobs, progress=progress)]
    if firsts is not None:
        tables.append(run_plan(firsts, store=store, jobs=jobs, progress=progress))
    first = {switch: _found(tables, condition) for switch, condition in conditions.items()}
    same = {switch for switch in conditions if switch.quirk and _changed_nothing(switch, first)}
    rest = ablation.of([s for s in conditions if s.quirk and s not in same], ablation.seeds[1:])
    if rest is not None:
        tables.append(run_plan(rest, store=store, jobs=jobs, progress=progress))
    records: dict[Switch, tuple[RunRecord, ...]] = {}
    for switch in conditions:
        # A quirk that changed nothing has the runs of its reading.
        own = _found(tables, conditions[switch._replace(quirk="") if switch in same else switch])
        if len(own) == len(ablation.seeds):
            records[switch] = own
    failures = tuple(failure for table in tables for failure in table.failures.values())
    return AblationResult(records=records, failures=failures)


def _found(tables: Sequence[Table], condition: Condition) -> tuple[RunRecord, ...]:
    """The runs of a condition in all tables, in the order of the seeds."""
    return tuple(record for table in tables if condition in table.plan.conditions for record in table.of(condition))


def _changed_nothing(switch: Switch, first: Mapping[Switch, tuple[RunRecord, ...]]) -> bool:
    """Whether the first run of a switch was made and equals that of its reading."""
    switched, base = first[switch][:1], first[switch._replace(quirk="")][:1]
    return bool(switched and base) and switched[0].same_columns(base[0])


def _mean_performance(records: Sequence[RunRecord]) -> float:
    return float(np.mean([record.performance.sum() for record in records]))


def _effect(switch: Switch, base: Sequence[RunRecord], switched: Sequence[RunRecord]) -> Effect:
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
        switch=switch,
        is_same=is_same,
        performance=gains / whole if whole else np.full(len(pairs), np.nan),
        interference=np.array(
            [after.interference_fraction.mean() - before.interference_fraction.mean() for before, after in pairs]
        ),
        task_shares=np.array(shares) if shares else None,
    )
