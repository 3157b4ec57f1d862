"""An entry of the benchmark: one JSON file with every number that its score needs.

entry = run_benchmark(["dpo"], name="mine")
entry.write("mine.json")
read_entry("mine.json").performance(load_protocol().held_out)  # per 1,000 s, (policies, worlds, seeds)
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import numpy as np
from msgspec import Meta

from swarm_forage_env._internal.fields import Amount, Checked, ConfigError, Count, Name, checked, read
from swarm_forage_env._internal.files import read_json, replacing
from swarm_forage_env.contract.policy import sees_world
from swarm_forage_env.policies.registry import policy_class
from swarm_forage_env.runs.plan import Plan, finished_runs
from swarm_forage_env.runs.record import Record
from swarm_forage_env.runs.spec import PolicySpec, policy_specs
from swarm_forage_env.runs.versions import software_versions
from swarm_forage_env.wrappers.world import World

from ..controllers import PAPER_POLICIES
from ..curves import FloatArray
from .protocol import Protocol, load_protocol

TrainedIn: TypeAlias = Literal["given", "other", "held-out", "nothing", "unknown"]


@dataclass(frozen=True, kw_only=True)
class Training(Checked):
    """How the author says that the policies of an entry were made."""

    worlds: TrainedIn = "unknown"
    """Where: in the training worlds only, also elsewhere, also in held-out worlds, not at all, or nobody says."""
    command: str = ""
    decisions: Count | None = None
    """Decisions of the longest training, counted over all robots."""


@dataclass(frozen=True, kw_only=True)
class EntryPolicy:
    """One policy of an entry: one training of a method."""

    name: str
    """A registered name, or what of its path tells a file from others."""
    digest: str = ""
    """Hash of the content of its file; empty without a file."""

    @classmethod
    def of(cls, spec: PolicySpec) -> "EntryPolicy":
        """Return what an entry says of a policy."""
        return cls(name=spec.label, digest=spec.parameters.get("digest", ""))


@dataclass(frozen=True, kw_only=True)
class Entry:
    """What an entry file holds."""

    protocol: str
    """Identity of the protocol, see `Protocol.identity`."""
    name: Name
    policies: Annotated[tuple[EntryPolicy, ...], Meta(min_length=1)]
    runs: Mapping[str, tuple[tuple[Amount, ...], ...]]
    """World -> performance of its runs per 1,000 s, (policies, seeds)."""
    training: Training = field(default_factory=Training)
    versions: Mapping[str, str] = field(default_factory=dict[str, str])

    def performance(self, worlds: Sequence[World]) -> FloatArray:
        """Return the performance of all runs in some worlds, per 1,000 s, (policies, worlds, seeds)."""
        return np.stack([np.asarray(self.runs[world.name]) for world in worlds], axis=1)

    def write(self, path: str | Path) -> None:
        """Write the entry to a file, whole or not at all: a line per world, so that people can compare them."""
        content = asdict(self)
        runs = ",\n".join(f"  {json.dumps(name)}: {json.dumps(rows)}" for name, rows in content.pop("runs").items())
        others = "".join(f" {json.dumps(key)}: {json.dumps(value)},\n" for key, value in content.items())
        with replacing(Path(path)) as draft:
            draft.write_text(f'{{\n{others} "runs": {{\n{runs}\n }}\n}}\n', encoding="utf-8")


def read_entry(path: str | Path, protocol: Protocol | None = None) -> Entry:
    """Read an entry file; it must have all runs of the protocol, by default that of the package.

    This does not find fraud. To be sure of an entry, verify it.

    Raises:
        ConfigError: the file cannot be read, is an entry of another protocol, or lacks runs.
    """
    asked = protocol or load_protocol()
    content = read_json(Path(path), ConfigError)
    try:
        entry: Entry = read(Entry, content)
    except ConfigError as error:
        raise ConfigError(f"Cannot use the entry {path}: {error}") from error
    if entry.protocol != asked.identity:
        raise ConfigError(
            f"Expected an entry of this benchmark, got one of other worlds or seeds in {path}; run swarm-forage "
            "benchmark again."
        )
    rows = [len(asked.seeds)] * len(entry.policies)
    for world in asked.worlds:
        if [len(row) for row in entry.runs.get(world.name, ())] != rows:
            raise ConfigError(
                f"Expected in {path} the runs of {len(rows)} policies with {len(asked.seeds)} seeds in the world "
                f"{world.name!r}."
            )
    return entry


def run_benchmark(
    policies: Sequence[str],
    *,
    name: str,
    protocol: Protocol | None = None,
    training: Training | None = None,
    out: str | Path | None = None,
    jobs: int | None = None,
    progress: bool = True,
) -> Entry:
    """Run policies in all worlds of a protocol and return the entry.

    Args:
        policies: Registered names or policy files; several are trainings of one method, and one entry.
        name: Name of the entry in tables.
        protocol: Default that of the package.
        training: How the policies were made.
        out: Folder for run records. Runs that it already holds are not repeated, so you can repeat an interrupted call.
        jobs: Processes; default one per core.
        progress: Show progress and an estimate on stderr.

    Raises:
        ConfigError: runs failed, a policy that sees the world, the name of an entry of the package, or one without
            characters.
        ValueError: an unknown policy, or a file that cannot be opened.
        KeyboardInterrupt: Ctrl-C; finished runs are in `out`.
    """
    checked("the name of an entry", name, Name)
    if name in PAPER_POLICIES and tuple(policies) != (name,):
        raise ConfigError(
            f"Expected another name than {name!r}, which is that of an entry that comes with the package; choose one "
            "with --name."
        )
    chosen, specs = protocol or load_protocol(), policy_specs(policies)
    for spec in specs:
        if sees_world(policy_class(spec.policy)):
            raise ConfigError(
                f"Expected policies that decide by what robots observe, got {spec.label}, which reads the world. It is "
                "a yardstick and no contestant: swarm-forage run puts it beside others."
            )
    table = finished_runs(Plan.product(specs, chosen.worlds, chosen.seeds), out=out, jobs=jobs, progress=progress)
    runs: dict[str, list[tuple[float, ...]]] = {world.name: [] for world in chosen.worlds}
    for condition in table.plan.conditions:
        runs[condition.world.name].append(tuple(rate_of(record) for record in table.of(condition)))
    return Entry(
        protocol=chosen.identity,
        name=name,
        policies=tuple(map(EntryPolicy.of, specs)),
        runs={world: tuple(rows) for world, rows in runs.items()},
        training=training or Training(),
        versions={package: version for package, version in software_versions().items() if version},
    )


def rate_of(record: Record) -> float:
    """Return the performance of a run per 1,000 s, with six digits: further ones would only make files longer."""
    return float(f"{record.per_1000_s('performance'):.6g}")
