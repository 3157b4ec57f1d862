"""Whether an entry's numbers come out again: runs of a sample of its worlds, made again and compared bit by bit."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from swarm_forage_env.policies.registry import POLICIES
from swarm_forage_env.runs.plan import Condition, Plan, run_plan
from swarm_forage_env.runs.spec import policy_specs
from swarm_forage_env.sheet import Sheet

from .entry import check_finished, digest_of, read_entry, six_digits
from .protocol import BenchmarkError, load_protocol

SAME = "same"


def verify_entry(
    file: str | Path,
    policies: Sequence[str] = (),
    *,
    n_worlds: int = 8,
    seed: int = 0,
    jobs: int | None = None,
    progress: bool = True,
) -> Sheet:
    """Return one row per policy and world: its performance per 1,000 s, stored and again, and in the end `SAME` or not.

    Args:
        file: The entry.
        policies: Names or files of its policies, in their order; default: the installed policies with these names.
        n_worlds: How many worlds are drawn at most, counted for each policy.
        seed: Of this draw.
        jobs: As in `swarm_forage_env.runs.plan.run_plan`.
        progress: The same.

    Raises:
        BenchmarkError: no such entry, its policies are missing or others are given, or runs failed.
    """
    entry, protocol = read_entry(file), load_protocol()
    names = [policy.name for policy in entry.policies]
    if not policies and not set(names) <= set(POLICIES):
        raise BenchmarkError(f"Expected --policy FILE,... for each of {', '.join(names)}, in this order, got none.")
    specs = policy_specs(policies or names)
    if [digest_of(spec.policy) for spec in specs] != [policy.digest for policy in entry.policies]:
        raise BenchmarkError(f"Expected the policies of {file} in their order ({', '.join(names)}), got others.")
    pairs = [(k, world) for k in range(len(specs)) for world in protocol.worlds]
    drawn: list[int] = sorted(np.random.default_rng(seed).permutation(len(pairs))[:n_worlds].tolist())
    chosen = [(k, Condition(specs[k], world.world)) for k, world in (pairs[which] for which in drawn)]
    plan = Plan(conditions=tuple(condition for _, condition in chosen), seeds=protocol.seeds)
    table = run_plan(plan, jobs=jobs, progress=progress)
    check_finished(table)
    rows: list[Sequence[str]] = []
    for k, condition in chosen:
        name = condition.world.name
        stored = entry.performance(name)[k].tolist()
        again = [six_digits(record.per_1000_s("performance")) for record in table.of(condition)]
        numbers = (", ".join(f"{value:g}" for value in values) for values in (stored, again))
        rows.append((condition.policy.label, name, *numbers, SAME if stored == again else "differs"))
    return Sheet.of(header=("policy", "world", "stored per 1,000 s", "again", "answer"), rows=rows)
