"""Table: what the runs of a plan were, condition by condition. Every question is a function of it.

seeds, curves = table.curves(condition, "performance", "interference_fraction")     # (R,), name -> (R, T)
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.policies.registry import policy_label
from swarm_forage_env.runs.plan import Condition, Plan
from swarm_forage_env.runs.policy_spec import PolicySpec
from swarm_forage_env.runs.record import RunRecord
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import RunFailure, failure_lines, load
from swarm_forage_env.scenarios.differences import preset_of
from swarm_forage_env.wrappers.world import UNDISTURBED

if TYPE_CHECKING:
    import polars as pl

Curves = tuple[tuple[int, ...], dict[str, FloatArray]]
"""Seeds of the R finished runs, and for each column its values in T intervals, (R, T)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """The runs of a plan."""

    plan: Plan
    records: Mapping[str, RunRecord]
    """run_id -> record, of the runs that finished."""
    failures: Mapping[str, RunFailure] = field(default_factory=dict[str, RunFailure])
    """run_id -> why a run failed."""
    n_stored: int = 0
    """How many of the records had been stored before and were not run again."""
    folder: Path | None = None
    """Where the records are, None where they are not stored."""

    def of(self, condition: Condition) -> tuple[RunRecord, ...]:
        """Return the records of a condition, in the order of the seeds; runs that failed are left out.

        They are read with the performance of its world: worlds that differ in that alone share their runs.
        """
        ids = (spec.run_id for spec in self.plan.specs_of(condition))
        performance = condition.world.scenario.performance
        return tuple(self.records[run_id].read_as(performance) for run_id in ids if run_id in self.records)

    def failures_of(self, condition: Condition) -> tuple[RunFailure, ...]:
        """Return the runs of a condition that failed."""
        ids = (spec.run_id for spec in self.plan.specs_of(condition))
        return tuple(self.failures[run_id] for run_id in ids if run_id in self.failures)

    def failure_lines(self, policy: str) -> tuple[str, ...]:
        """Return why runs of a policy failed, see `store.failure_lines`."""
        conditions = self.plan.of_policy(policy)
        return failure_lines(failure for condition in conditions for failure in self.failures_of(condition))

    def curves(self, condition: Condition, *columns: str) -> Curves:
        """Return the finished runs of a condition as arrays.

        Args:
            condition: One of the plan.
            columns: Columns of records; those that its runs do not have are left out. Default all.
        """
        records = self.of(condition)
        if not records:
            return (), {}
        found = [record.columns() for record in records]
        names = [name for name in columns or found[0] if all(name in one for one in found)]
        return (
            tuple(record.seed for record in records),
            {name: np.stack([one[name] for one in found]).astype(np.float64) for name in names},
        )

    @cached_property
    def frame(self) -> "pl.DataFrame":
        """All records below each other, one row per interval, with the name of the world and the policy."""
        import polars as pl

        return pl.concat(list(self._frames()), how="diagonal") if self.records else pl.DataFrame()

    def _frames(self) -> "Iterator[pl.DataFrame]":
        import polars as pl

        for condition in self.plan.conditions:
            for record in self.of(condition):
                told = {"policy": condition.policy.label, "world": condition.world.name}
                yield record.to_frame().select(*(pl.lit(word).alias(name) for name, word in told.items()), pl.all())


def read_table(folder: str | Path, *, performance: str | None = None) -> Table:
    """Return the runs that a folder holds as the table that made them; of scores and studies those of the plain world.

    Caches that are not those of the scenario count as the policy's, as in runs of several policies in one world.

    Args:
        folder: Where records are.
        performance: What of them is performance; default what each was made for.

    Raises:
        RecordError: the folder holds no records, or a damaged one.
        ConfigError: it holds runs of several lengths, or of disturbed worlds only.
    """
    records = {record.run_id: record for record in load(folder)}
    specs = [RunSpec.from_json(record.spec) for record in records.values()]
    plain = [spec for spec in specs if spec.world.criterion == UNDISTURBED]
    if performance is not None:
        plain = [_read_as(spec, performance) for spec in plain]
    if not plain:
        raise ConfigError(f"Expected runs of a world in which nothing is varied in {folder}, got none.")
    lengths = {(spec.scenario.horizon_s, spec.scenario.interval_s) for spec in plain}
    if len(lengths) > 1:
        told = ", ".join(
            f"{horizon_s:g} s in intervals of {interval_s:g} s" for horizon_s, interval_s in sorted(lengths)
        )
        raise ConfigError(f"Expected runs of one length in {folder}, got {told}; make folders of their own by --out.")
    conditions: list[Condition] = []
    for condition in map(_condition_of, plain):
        if condition not in conditions:  # wrappers of users may have no hash
            conditions.append(condition)
    plan = Plan(conditions=tuple(conditions), seeds=tuple(sorted({spec.seed for spec in plain})))
    chosen = {spec.run_id: records[spec.run_id] for spec in plain}
    return Table(plan=plan, records=chosen, n_stored=len(chosen), folder=Path(folder))


def _read_as(spec: RunSpec, performance: str) -> RunSpec:
    return replace(spec, world=replace(spec.world, scenario=replace(spec.scenario, performance=performance)))


def _condition_of(spec: RunSpec) -> Condition:
    """Return the condition that a run is of."""
    preset = preset_of(spec.scenario)
    own, caches = spec.scenario.caches, "none" if preset is None else preset.caches
    policy = PolicySpec(label=policy_label(spec.policy), policy=spec.policy, parameters=spec.parameters, caches=own)
    return Condition(policy, spec.world.with_caches(caches))
