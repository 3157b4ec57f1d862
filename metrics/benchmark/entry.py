"""An entry of the benchmark: one JSON file with every number that its score needs.

    entry = run_benchmark(["dpo"], name="mine")
    entry.write("mine.json")
    read_entry("mine.json").performance("corridor, long")  # per 1,000 s, (policies, seeds)

`read_entry` accepts a file only if it is whole: it follows the protocol, has every run of every world, and its digest
matches. This finds mistakes, such as a broken copy or a slip of the hand. It does not find fraud: anyone who alters
numbers can also write a new digest. To be sure of an entry, verify it.
"""

import json
import os
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta

from swarm_forage_env._internal.fields import Amount, Checked, Count, Name, Share, checked, read
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


@dataclass(frozen=True, kw_only=True)
class Training(Checked):
    """How the author says that the policies of an entry were made."""

    worlds: Literal["given", "other", "nothing", "unknown"] = "unknown"
    """Where a policy was trained: in the training worlds only, also elsewhere, not at all, or nobody says."""
    command: str = ""
    track: str = OPEN
    """One of the protocol's tracks, or `OPEN`."""
    decisions: Count | None = None
    """Decisions of its longest training, counted over all robots."""

    def check_track(self, protocol: Protocol, n_policies: int) -> None:
        """Refuse a training that does not fit its track.

        Args:
            protocol: That has the tracks.
            n_policies: How many trainings there are.

        Raises:
            BenchmarkError: an unknown track; or one with a budget for policies that trained elsewhere, too long or too
                seldom, or whose author does not say so.
        """
        if self.track == OPEN:
            return
        if self.track not in protocol.tracks:
            known = ", ".join((*protocol.tracks, OPEN))
            raise BenchmarkError(f"Expected --track to be one of {known}, got {self.track!r}.")
        budget, n_trainings = protocol.tracks[self.track], protocol.n_trainings
        decisions = "none" if self.decisions is None else f"{self.decisions:,}"
        is_short = self.decisions is not None and self.decisions <= budget
        for is_kept, wanted, got in (
            (self.worlds == "given", "a training in the training worlds only (--trained-in given)", repr(self.worlds)),
            (is_short, f"at most {budget:,} decisions of a training (--decisions)", decisions),
            (n_policies >= n_trainings, f"{n_trainings} trainings, a file each,", n_policies),
        ):
            if not is_kept:
                raise BenchmarkError(
                    f"Expected {wanted} for the track {self.track}, got {got}; or choose --track {OPEN}."
                )


@dataclass(frozen=True, kw_only=True)
class EntryPolicy:
    """One policy of an entry: one training seed of a learner."""

    name: str
    """Name for people, see `swarm_forage_env.policies.registry.policy_label`; for a file without folder and ending."""
    digest: str = ""
    """Hash of the content of its file; empty without a file."""


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
        """Refuse an entry of another protocol, or one that lacks runs; `where` names it in messages.

        Raises:
            BenchmarkError: see above.
        """
        if self.protocol != protocol.identity:
            raise BenchmarkError(
                f"Expected an entry of this benchmark, got one of other worlds or seeds in {where}; run swarm-forage "
                "benchmark again."
            )
        digests = [policy.digest for policy in self.policies if policy.digest]
        if self.training.track != OPEN and len({*digests}) < len(digests):
            raise BenchmarkError(f"Expected different trainings in {where}, got one file twice.")
        self.training.check_track(protocol, len(self.policies))
        odd = sorted({world.name for world in protocol.worlds}.symmetric_difference(self.runs))
        if odd:
            raise BenchmarkError(f"Expected runs of all worlds in {where} and of no other; see {odd[0]!r}.")
        shape = (len(self.policies), len(protocol.seeds))
        for world, runs in self.runs.items():
            for name, rows in vars(runs).items():
                if [len(row) for row in rows] != [shape[1]] * shape[0]:
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
    for first in table.failures.values():
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
    for spec in specs:
        if sees_world(policy_class(spec.policy)):
            raise BenchmarkError(
                f"Expected policies that decide by what robots observe, got {spec.label}, which reads the world. It is "
                "a yardstick and no contestant: swarm-forage run puts it beside others."
            )
    table = run_plan(
        Plan.product(specs, [each.world for each in chosen.worlds], chosen.seeds),
        out=out,
        jobs=jobs,
        progress=progress,
    )
    check_finished(table)
    return Entry(
        protocol=chosen.identity,
        name=name,
        command=entry_command([spec.policy for spec in specs], name, training=told),
        policies=tuple(EntryPolicy(name=policy_label(each.policy), digest=digest_of(each.policy)) for each in specs),
        runs={
            world.name: WorldRuns(
                performance=_of_all(table, world.name, lambda record: record.per_1000_s("performance")),
                interference=_of_all(table, world.name, lambda record: float(record["interference_fraction"].mean())),
            )
            for world in chosen.worlds
        },
        training=told,
        versions={package: version for package, version in software_versions().items() if version},
    )


def _of_all(table: Table, world: str, value: Callable[[Record], float]) -> tuple[tuple[float, ...], ...]:
    """A number of each run in a world, (policies, seeds)."""
    conditions = [condition for condition in table.plan.conditions if condition.world.name == world]
    return tuple(tuple(six_digits(value(record)) for record in table.of(one)) for one in conditions)


def six_digits(value: float) -> float:
    """Return a number as entry files hold it: further digits would only make files longer."""
    return float(f"{value:.6g}")


def entry_command(policies: Sequence[str], name: str, *, training: Training | None = None) -> str:
    """Return what makes an entry again from the current folder: policies as given, but files without whole paths.

    What a training was is among the words only where its track asks for it.
    """
    words: list[str] = []
    for policy in policies:
        file = file_of(policy)
        is_whole = is_policy_file(policy) and Path(file).is_absolute()
        words.append(Path(os.path.relpath(file)).as_posix() + policy.removeprefix(file) if is_whole else policy)
    words += ["--name", name]
    if training is not None and training.track != OPEN:
        words += ["--trained-in", training.worlds, "--track", training.track, "--decisions", str(training.decisions)]
    return shlex.join(["swarm-forage", "benchmark", *words])


def digest_of(policy: str) -> str:
    """Return the hash of the content of a policy's file; empty without a file."""
    from swarm_forage_env.policies.model_files import file_digest
    from swarm_forage_env.policies.pretrained import network_file

    file = Path(file_of(policy)) if is_policy_file(policy) else network_file(policy)
    return "" if file is None else file_digest(file)
