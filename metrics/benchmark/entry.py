"""An entry of the benchmark: one JSON file with every number that its score needs.

    entry = run_benchmark(["dpo"], name="mine")
    entry.write("mine.json")
    read_entry("mine.json").performance("corridor, long")  # per 1,000 s, (policies, seeds)

`read_entry` accepts a file only if it is whole: it follows the protocol, has every run of every world, and its digest
matches. This finds mistakes, such as a broken copy or a slip of the hand. It does not find fraud: anyone who alters
numbers can also write a new digest. To be sure of an entry, verify it.
"""

import json
import math
import os
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from swarm_forage_env._internal.fields import Amount, Count, Name, Share, checked, read
from swarm_forage_env._internal.files import read_json, replacing
from swarm_forage_env.contract.policy import sees_world
from swarm_forage_env.policies.registry import file_of, is_policy_file, policy_class, policy_label
from swarm_forage_env.runs.plan import Plan, Table, run_plan
from swarm_forage_env.runs.record import Record
from swarm_forage_env.runs.spec import identity_of, policy_specs
from swarm_forage_env.runs.versions import software_versions

from ..controllers import PAPER_POLICIES
from ..curves import FloatArray
from .protocol import OPEN, BenchmarkError, Protocol, load_protocol

TRAINED_IN = ("given", "other", "nothing", "unknown")
"""Where a policy was trained: in the training worlds only, also elsewhere, not at all, or the author does not say."""


@dataclass(frozen=True, kw_only=True)
class Training:
    """How the author says that the policies of an entry were made."""

    worlds: str = "unknown"
    """One of `TRAINED_IN`."""
    command: str = ""
    track: str = OPEN
    """One of the protocol's tracks, or `OPEN`."""
    decisions: Count | None = None
    """Decisions of its longest training, counted over all robots."""

    def __post_init__(self) -> None:
        if self.worlds not in TRAINED_IN:
            raise BenchmarkError(f"Expected training worlds to be one of {', '.join(TRAINED_IN)}, got {self.worlds!r}.")
        checked("decisions of a training", self.decisions, Count | None)

    def check_track(self, protocol: Protocol, n_policies: int) -> None:
        """Refuse a training that does not fit its track.

        Args:
            protocol: That has the tracks.
            n_policies: How many trainings there are.

        Raises:
            BenchmarkError: an unknown track; or one with a budget for policies that trained elsewhere, too long or too
                seldom, or whose author does not say so.
        """
        if self.track not in (*protocol.tracks, OPEN):
            raise BenchmarkError(
                f"Expected a track of the benchmark ({', '.join((*protocol.tracks, OPEN))}), got {self.track!r}; "
                "choose one with --track."
            )
        budget = protocol.tracks.get(self.track)
        if budget is None:
            return
        if self.worlds != "given":
            raise BenchmarkError(
                f"Expected a training in the training worlds only (given) for the track {self.track}, got "
                f"{self.worlds!r}; say --trained-in given, or choose --track {OPEN}."
            )
        if self.decisions is None or self.decisions > budget:
            told = "none" if self.decisions is None else f"{self.decisions:,}"
            raise BenchmarkError(
                f"Expected at most {budget:,} decisions of a training for the track {self.track}, got {told}; say how "
                f"many with --decisions, or choose --track {OPEN}."
            )
        if n_policies < protocol.n_trainings:
            raise BenchmarkError(
                f"Expected {protocol.n_trainings} trainings for the track {self.track}, got {n_policies}; give one "
                f"a file for each, or choose --track {OPEN}."
            )


@dataclass(frozen=True, kw_only=True)
class EntryPolicy:
    """One policy of an entry: one training seed of a learner."""

    name: str
    """Name for people, see `swarm_forage_env.policies.registry.policy_label`; for a file without folder and ending."""
    digest: str = ""
    """Hash of the content of its file; empty without a file."""
    training_seed: Count | None = None


@dataclass(frozen=True, kw_only=True)
class WorldRuns:
    """The runs of a world; each array has shape (policies, seeds)."""

    performance: tuple[tuple[Amount, ...], ...]
    """Per 1,000 s."""
    interference: tuple[tuple[Share, ...], ...]
    """Share of robot time."""


@dataclass(frozen=True, kw_only=True)
class Entry:
    """What an entry file holds, its digest aside."""

    protocol: str
    """Identity of the protocol, see `Protocol.identity`."""
    name: Name
    command: str
    """What makes it again."""
    policies: Annotated[tuple[EntryPolicy, ...], Meta(min_length=1)]
    runs: Mapping[str, WorldRuns]
    """World -> its runs."""
    training: Training = field(default_factory=Training)
    core_hours: Amount | None = None
    """Core-hours that the runs of the entry took, as far as their records say; None if no record says it."""
    versions: Mapping[str, str] = field(default_factory=dict[str, str])

    def performance(self, world: str) -> FloatArray:
        """Return the performance of all runs of a world, per 1,000 s, (policies, seeds)."""
        return np.asarray(self.runs[world].performance, dtype=np.float64)

    def interference(self, world: str) -> FloatArray:
        """Return the share of robot time lost to interference, (policies, seeds)."""
        return np.asarray(self.runs[world].interference, dtype=np.float64)

    @property
    def is_scripted(self) -> bool:
        """Whether the entry is that of an installed policy, under the name of that policy."""
        return [(policy.name, policy.digest) for policy in self.policies] == [(self.name, "")]

    @property
    def is_trained(self) -> bool:
        """Whether its policies are trained, according to its author: trainings of one plan may differ."""
        return self.training.worlds != "nothing"

    @property
    def digest(self) -> str:
        """Hash of everything that the entry holds."""
        return identity_of(json.loads(json.dumps(asdict(self))))

    def write(self, path: str | Path) -> None:
        """Write the entry to a file, whole or not at all: a line per world, so that people can compare them."""
        content: dict[str, Any] = {**asdict(self), "digest": self.digest}
        runs = ",\n".join(f"  {json.dumps(name)}: {json.dumps(rows)}" for name, rows in content["runs"].items())
        lines = [
            f' "runs": {{\n{runs}\n }}' if key == "runs" else f" {json.dumps(key)}: {json.dumps(value)}"
            for key, value in content.items()
        ]
        with replacing(Path(path)) as draft:
            draft.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")

    def check(self, protocol: Protocol, where: str) -> None:
        """Refuse an entry of another protocol, or one that lacks runs.

        Args:
            protocol: The protocol that it must belong to.
            where: Name of the entry in messages.

        Raises:
            BenchmarkError: see above.
        """
        if self.protocol != protocol.identity:
            raise BenchmarkError(
                f"Expected an entry of this benchmark, got one of other worlds or seeds in {where}; run swarm-forage "
                "benchmark again."
            )
        digests = [policy.digest for policy in self.policies if policy.digest]
        if self.training.track in protocol.tracks and len({*digests}) < len(digests):
            raise BenchmarkError(f"Expected different trainings in {where}, got one file twice.")
        worlds = {world.name for world in protocol.worlds}
        if worlds != {*self.runs}:
            odd = sorted(worlds.symmetric_difference(self.runs))
            raise BenchmarkError(
                f"Expected runs of all {len(worlds)} worlds in {where} and of no other; see {odd[0]!r}."
            )
        self.training.check_track(protocol, len(self.policies))
        shape = (len(self.policies), len(protocol.seeds))
        for world, runs in self.runs.items():
            for name, rows in vars(runs).items():
                if {len(row) for row in rows} != {shape[1]} or len(rows) != shape[0]:
                    raise BenchmarkError(
                        f"Expected {name} in the world {world!r} of {where} as lists of numbers, one for each of "
                        f"{shape[0]} policies and {shape[1]} seeds."
                    )


def read_entry(path: str | Path, protocol: Protocol | None = None) -> Entry:
    """Read an entry file.

    Args:
        path: The file.
        protocol: What it must be an entry of; default that of the package.

    Raises:
        BenchmarkError: the file cannot be read, its entry of the protocol is not whole, or its digest does not match.
    """
    content = dict(read_json(Path(path), BenchmarkError))
    digest = content.pop("digest", None)
    try:
        entry: Entry = read(Entry, content)
    except ValueError as error:
        raise BenchmarkError(f"Cannot use the entry {path}: {error}") from error
    entry.check(protocol or load_protocol(), str(path))
    if entry.digest != digest:
        raise BenchmarkError(
            f"Expected the numbers of {path} as swarm-forage benchmark wrote them, got others: the digest does not "
            "fit. Make the entry again."
        )
    return entry


def check_finished(table: Table) -> None:
    """Refuse a table in which runs are missing.

    Raises:
        BenchmarkError: runs failed.
    """
    if table.failures:
        first = next(iter(table.failures.values()))
        raise BenchmarkError(
            f"Expected all {len(table.plan.specs)} runs to finish, {len(table.failures)} failed; the first, "
            f"{first.spec.describe()}: {first.error}"
        )


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
        policies: Registered names or policy files; several are training seeds of one method, and one entry.
        name: Name of the entry in tables.
        protocol: Default that of the package.
        training: How the policies were made.
        out: Folder for run records. Runs that it already holds are not repeated, so you can repeat an interrupted call.
        jobs: Processes; default one per core.
        progress: Show progress and an estimate on stderr.

    Raises:
        BenchmarkError: runs failed, the name is that of a scripted controller, or the training does not fit its track.
        ConfigError: a name without characters, or with some that no terminal shows.
        ValueError: an unknown policy, or a file that cannot be opened.
        KeyboardInterrupt: Ctrl-C; finished runs are in `out`.
    """
    checked("the name of an entry", name, Name)
    chosen, told = protocol or load_protocol(), training or Training()
    if name in PAPER_POLICIES and (tuple(policies) != (name,) or chosen.is_quick):
        raise BenchmarkError(
            f"Expected another name than {name!r}, which is that of an entry that comes with the package; choose one "
            "with --name."
        )
    if not chosen.is_quick:
        told.check_track(chosen, len(policies))
    specs = policy_specs(policies)
    omniscient = [spec.label for spec in specs if sees_world(policy_class(spec.policy))]
    if omniscient:
        raise BenchmarkError(
            f"Expected policies that decide by what robots observe, got {omniscient[0]}, which reads the world. It is "
            "a yardstick and no contestant: swarm-forage run puts it beside others."
        )
    plan = Plan.product(specs, [each.world for each in chosen.worlds], chosen.seeds)
    table = run_plan(plan, out=out, jobs=jobs, progress=progress)
    check_finished(table)
    return Entry(
        protocol=chosen.identity,
        name=name,
        command=entry_command([spec.policy for spec in specs], name, training=told),
        policies=tuple(
            EntryPolicy(name=policy_label(spec.policy), digest=digest, training_seed=seed)
            for spec in specs
            for digest, seed in [policy_origin(spec.policy)]
        ),
        runs=_runs(chosen, table),
        training=told,
        core_hours=_core_hours(table.records.values()),
        versions={package: version for package, version in software_versions().items() if version},
    )


def entry_command(policies: Sequence[str], name: str, *, training: Training | None = None) -> str:
    """Return what makes an entry again from the current folder: policies as given, but files without whole paths.

    What a training was is among the words only where its track asks for it.
    """
    words = map(_from_here, policies)
    budget: list[str] = []
    if training is not None and training.track != OPEN:
        budget = ["--trained-in", training.worlds, "--track", training.track, "--decisions", str(training.decisions)]
    return shlex.join(["swarm-forage", "benchmark", *words, "--name", name, *budget])


def _from_here(policy: str) -> str:
    """A policy with the path of its file from the current folder, where the whole path was given."""
    file = file_of(policy)
    if not (is_policy_file(policy) and Path(file).is_absolute()):
        return policy
    return Path(os.path.relpath(file)).as_posix() + policy.removeprefix(file)


def policy_origin(policy: str) -> tuple[str, int | None]:
    """Return the digest of a policy's file, and the seed of its training as far as the file tells it."""
    from swarm_forage_env.policies.model_files import file_digest
    from swarm_forage_env.policies.network import Network
    from swarm_forage_env.policies.pretrained import network_file

    file = Path(file_of(policy)) if is_policy_file(policy) else network_file(policy)
    if file is None:
        return "", None
    card: dict[str, Any] = Network.load(file).about.card if file.suffix == ".npz" else {}
    plan: Any = card.get("plan")
    seed = dict[str, Any](plan).get("seed") if isinstance(plan, dict) else None  # pyright: ignore[reportUnknownArgumentType] - a card holds anything
    return file_digest(file), seed if isinstance(seed, int) else None


def _core_hours(records: Iterable[Record]) -> float | None:
    """What runs took, of those whose records tell it; three digits, as time is never the same twice."""
    known = [record.cpu_time_s for record in records if math.isfinite(record.cpu_time_s)]
    return float(f"{sum(known) / 3600.0:.3g}") if known else None


def _runs(protocol: Protocol, table: Table) -> dict[str, WorldRuns]:
    """World -> performance and interference of all policies and seeds."""

    def of_all(world: str, value: Callable[[Record], float]) -> tuple[tuple[float, ...], ...]:
        conditions = [condition for condition in table.plan.conditions if condition.world.name == world]
        return tuple(tuple(six_digits(value(record)) for record in table.of(one)) for one in conditions)

    return {
        world.name: WorldRuns(
            performance=of_all(world.name, lambda record: record.per_1000_s("performance")),
            interference=of_all(world.name, lambda record: float(record["interference_fraction"].mean())),
        )
        for world in protocol.worlds
    }


def six_digits(value: float) -> float:
    """Return a number as entry files hold it: further digits would only make files longer."""
    return float(f"{value:.6g}")
