"""Entries of the benchmark without runs: a tiny protocol, and numbers that a test chooses."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from metrics.benchmark import Entry, Protocol, Training
from metrics.benchmark.entry import EntryPolicy, WorldRuns

TINY = Path(__file__).with_name("tiny_benchmark.toml")
"""Two worlds of three or four robots in a small room; see the file."""


def made_up_entry(
    protocol: Protocol, name: str, performance: Callable[[int], float], *, n_policies: int = 1, **fields: Any
) -> Entry:
    """Return an entry whose performance in the k-th world is `performance(k)`, one more per policy, two per seed."""
    n_seeds = len(protocol.seeds)
    runs = {
        world.name: WorldRuns(
            performance=tuple(tuple(performance(k) + j + 2.0 * s for s in range(n_seeds)) for j in range(n_policies)),
            interference=((0.1,) * n_seeds,) * n_policies,
        )
        for k, world in enumerate(protocol.worlds)
    }
    given: dict[str, Any] = {
        "command": f"swarm-forage benchmark --policy {name}",
        "training": Training(worlds="nothing"),
        "versions": {"numpy": "2.0"},
        **fields,
    }
    return Entry(
        protocol=protocol.identity,
        name=name,
        policies=tuple(EntryPolicy(name=f"{name}_{k}.npz") for k in range(n_policies)),
        runs=runs,
        **given,
    )
