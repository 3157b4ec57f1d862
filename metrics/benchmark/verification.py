"""Whether an entry's numbers come out again: runs of a sample of its worlds, made again and compared bit by bit.

Scripted controllers and network files give the same bits everywhere with the same versions. Other policies may round
differently on another machine.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from swarm_forage_env.policies.registry import policy_names
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.runs.plan import Condition, Plan
from swarm_forage_env.runs.policy_spec import policy_specs
from swarm_forage_env.runs.table import Table

from ..scoring.question import Question
from .entry import Entry, check_finished, policy_origin, read_entry, six_digits
from .protocol import BenchmarkError, load_protocol

N_WORLDS = 8
"""Worlds in the default sample, counted for each policy: a few minutes on two cores (our choice)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Verification(Answer):
    """Runs of an entry, stored and made again."""

    rows: tuple[tuple[str, str, str, str, str], ...]
    """Policy, world, stored and new performance per 1,000 s, and whether all runs are the same."""
    is_same: bool

    def sheets(self) -> tuple[Sheet, ...]:
        """Return one row per policy and world."""
        header = ("policy", "world", "stored per 1,000 s", "again", "answer")
        told = "All runs give the stored numbers." if self.is_same else "Not all runs give the stored numbers."
        return (Sheet(header=header, rows=self.rows, notes=[told]),)

    def to_mapping(self) -> dict[str, Any]:
        """Return it as plain values."""
        return {"is_same": self.is_same, "rows": [list(row) for row in self.rows]}


@dataclass(frozen=True, kw_only=True, eq=False)
class VerificationQuestion(Question[Verification]):
    """The runs of an entry again, in a sample of its worlds."""

    entry: Entry

    def answer(self, table: Table) -> Verification:
        """Compare the new runs with the runs of the entry; raises BenchmarkError if runs failed."""
        check_finished(table)
        labels = list(dict.fromkeys(policy.label for policy in self.plan.policies))
        rows: list[tuple[str, str, str, str, str]] = []
        for condition in self.plan.conditions:
            stored = self.entry.performance(condition.world.name)[labels.index(condition.policy.label)].tolist()
            again = [six_digits(record.rate_per_1000_s("performance")) for record in table.of(condition)]
            before, now = (", ".join(f"{value:g}" for value in values) for values in (stored, again))
            answer = "same" if stored == again else "differs"
            rows.append((condition.policy.label, condition.world.name, before, now, answer))
        return Verification(rows=tuple(rows), is_same=all(row[-1] == "same" for row in rows))


def verification_question(
    file: str | Path, policies: Sequence[str] = (), *, n_worlds: int | None = N_WORLDS, seed: int = 0
) -> VerificationQuestion:
    """Return which runs verify an entry.

    Args:
        file: The entry.
        policies: Names or files of its policies, in their order; default: the installed policies with these names.
        n_worlds: Size of the random sample of its worlds, counted for each policy; None = all.
        seed: Of this sample.

    Raises:
        BenchmarkError: no such entry, or its policies are missing or others are given.
    """
    entry, protocol = read_entry(file), load_protocol()
    names = [policy.name for policy in entry.policies]
    if not policies and not set(names) <= set(policy_names()):
        raise BenchmarkError(f"Expected --policy FILE for each of {', '.join(names)}, in this order, got none.")
    specs = policy_specs(policies or names)
    if [policy_origin(spec.policy)[0] for spec in specs] != [policy.digest for policy in entry.policies]:
        raise BenchmarkError(f"Expected the policies of {file} in their order ({', '.join(names)}), got others.")
    conditions = [Condition(spec, each.world) for spec in specs for each in protocol.worlds]
    if n_worlds is not None and n_worlds < len(conditions):
        drawn: list[int] = np.random.default_rng(seed).choice(len(conditions), n_worlds, replace=False).tolist()
        conditions = [conditions[k] for k in sorted(drawn)]
    return VerificationQuestion(plan=Plan(conditions=tuple(conditions), seeds=protocol.seeds), entry=entry)
