"""Whether an entry's numbers come out again: runs of a sample of its worlds, made again and compared bit by bit."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs.plan import Condition, Plan, finished_runs
from swarm_forage_env.runs.spec import policy_specs
from swarm_forage_env.sheet import Sheet

from .entry import EntryPolicy, rate_of, read_entry
from .protocol import load_protocol

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
        policies: Names or files of its policies, in their order; default: those installed under their names.
        n_worlds: How many worlds are drawn at most, counted for each policy.
        seed: Of this draw.
        jobs: As in `swarm_forage_env.runs.plan.run_plan`.
        progress: The same.

    Raises:
        ConfigError: no such entry, its policies are missing or others are given, or runs failed.
    """
    entry, protocol = read_entry(file), load_protocol()
    specs = policy_specs(policies or [policy.name for policy in entry.policies])
    given, wanted = map(EntryPolicy.of, specs), entry.policies
    if [one.digest or one.name for one in given] != [one.digest or one.name for one in wanted]:
        names = ", ".join(policy.name for policy in wanted)
        raise ConfigError(f"Expected --policy with the policies of {file} in their order ({names}), got others.")
    pairs = [(k, world) for k in range(len(specs)) for world in protocol.worlds]
    drawn: list[int] = sorted(np.random.default_rng(seed).permutation(len(pairs))[:n_worlds].tolist())
    chosen = [pairs[which] for which in drawn]
    conditions = tuple(Condition(specs[k], world) for k, world in chosen)
    table = finished_runs(Plan(conditions=conditions, seeds=protocol.seeds), jobs=jobs, progress=progress)
    rows: list[Sequence[str]] = []
    for (k, world), condition in zip(chosen, conditions, strict=True):
        stored, again = entry.runs[world.name][k], tuple(rate_of(record) for record in table.of(condition))
        numbers = (", ".join(f"{value:g}" for value in values) for values in (stored, again))
        rows.append((specs[k].label, world.name, *numbers, SAME if stored == again else "differs"))
    return Sheet.of(header=("policy", "world", "stored per 1,000 s", "again", "answer"), rows=rows)
