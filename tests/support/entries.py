"""Entries of the benchmark without runs: a tiny protocol, and numbers that a test chooses."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from metrics import PAPER_POLICIES
from metrics.benchmark import Entry, Protocol, Training, load_protocol
from metrics.benchmark.entry import EntryPolicy

TINY = Path(__file__).with_name("tiny_benchmark.toml")
"""Two worlds of three or four robots in a small room; see the file."""


def made_up_entry(
    protocol: Protocol, name: str, performance: Callable[[int], float], *, n_policies: int = 1, **fields: Any
) -> Entry:
    """Return an entry whose performance in the k-th world is `performance(k)`, one more per policy, two per seed."""
    n_seeds = len(protocol.seeds)
    runs = {
        world.name: tuple(tuple(performance(k) + j + 2.0 * s for s in range(n_seeds)) for j in range(n_policies))
        for k, world in enumerate(protocol.worlds)
    }
    given: dict[str, Any] = {
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


def write_package(folder: Path, performances: Sequence[Callable[[int], float]]) -> None:
    """Write the tiny protocol, and entries of the scripted controllers, as a benchmark of its own."""
    (folder / "scripted").mkdir(parents=True)
    (folder / "benchmark.toml").write_text(TINY.read_text())
    for name, performance in zip(PAPER_POLICIES, performances, strict=True):
        made_up_entry(load_protocol(TINY), name, performance).write(folder / "scripted" / f"{name}.json")
