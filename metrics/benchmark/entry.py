"""An entry of the benchmark: one JSON file with every number that the page needs.

    entry = read_entry("dpo.json")
    entry.performance("two sources, 8 robots")  # per 1,000 s, (policies, seeds)

`read_entry` accepts a file only if it is whole: it follows a known version of the protocol, has every run of every
world, and its digest matches. This finds mistakes, such as a broken copy or a slip of the hand. It does not find fraud:
anyone who alters numbers can also write a new digest. To be sure of an entry, run its command again.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import numpy as np

from swarm_forage_env._internal.fields import number, whole
from swarm_forage_env._internal.files import read_json, replacing
from swarm_forage_env._internal.typed import Amount, Count, Name, Within, typed

from ..curves import FloatArray
from .protocol import OPEN, BenchmarkError, Protocol, known_versions, load_protocol, protocol_versions

_WITHOUT_TRACKS = "leave out --track and --decisions, or say --version 2 or 3"
TRAINED_IN = ("given", "other", "nothing", "unknown")
"""Where a policy was trained: in the training worlds only, also elsewhere, not at all, or the author does not say."""
Rows: TypeAlias = tuple[tuple[float | None, ...], ...]
"""(policies, seeds); None where a run has no such value."""


@dataclass(frozen=True, kw_only=True)
class Training:
    """How the author says that the policies of an entry were made."""

    worlds: str = "unknown"
    """One of `TRAINED_IN`."""
    command: str = ""
    library: str = ""
    core_hours: Amount | None = None
    """Core-hours of all its trainings together."""
    track: str = ""
    """One of the protocol's tracks, or `OPEN`; empty if the protocol has no tracks."""
    decisions: Count | None = None
    """Decisions of its longest training, counted over all robots."""

    def __post_init__(self) -> None:
        if self.worlds not in TRAINED_IN:
            raise BenchmarkError(f"Expected training worlds to be one of {', '.join(TRAINED_IN)}, got {self.worlds!r}.")
        if self.core_hours is not None:
            number("core-hours of training", self.core_hours, at_least=0.0)
        whole("decisions of a training", self.decisions, at_least=0, or_none=True)

    def to_mapping(self) -> dict[str, Any]:
        """Return it as plain values; entries of version 1 have neither track nor decisions."""
        told = asdict(self)
        return told if self.track else {key: told[key] for key in told if key not in ("track", "decisions")}

    def check_track(self, protocol: Protocol, n_policies: int) -> None:
        """Refuse a training that does not fit its track.

        Args:
            protocol: That has the tracks.
            n_policies: How many trainings there are.

        Raises:
            BenchmarkError: an unknown track; or one with a budget for policies that trained elsewhere, too long or too
                seldom, or whose author does not say so.
        """
        tracks = (*protocol.tracks, OPEN) if protocol.tracks else ("",)
        if self.track not in tracks:
            if not protocol.tracks:
                raise BenchmarkError(f"Expected no track for {protocol.name}, got {self.track!r}; {_WITHOUT_TRACKS}.")
            raise BenchmarkError(
                f"Expected a track of the benchmark, {protocol.name} ({', '.join(tracks)}), got {self.track!r}; choose "
                "one with --track."
            )
        if self.decisions is not None and not self.track:
            raise BenchmarkError(
                f"Expected no decisions for {protocol.name}, got {self.decisions:,}; {_WITHOUT_TRACKS}."
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
                f"--policy for each, or choose --track {OPEN}."
            )


@dataclass(frozen=True, kw_only=True)
class EntryPolicy:
    """One policy of an entry: one training seed of a learner."""

    name: str
    """Name for people, see `swarm_forage_env.policies.registry.policy_label`; for a file without folder and ending."""
    digest: str = ""
    """Hash of the content of its file, or for a mixed swarm of all its files, joined by +. Empty without a file."""
    training_seed: Count | None = None


@dataclass(frozen=True, kw_only=True)
class EntryMeasure:
    """One measure of swarm engineering at one level, for all policies and seeds."""

    group: str
    label: str
    at: str
    """The level in words."""
    n_robots: tuple[Annotated[int, Within(at_least=1)], ...]
    unit: str
    higher_is_better: bool
    values: Rows
    relative: Rows = ()
    """`values` divided by the performance that they are compared with; empty for measures that are relative already."""

    @property
    def key(self) -> tuple[str, str, str]:
        """What it measures: equal keys of two entries can be compared."""
        return self.group, self.label, self.at


@dataclass(frozen=True, kw_only=True)
class WorldRuns:
    """The runs of a world in an entry file; each array has shape (policies, seeds)."""

    performance: tuple[tuple[Amount, ...], ...]
    """Per 1,000 s."""
    interference: tuple[tuple[Annotated[float, Within(at_least=0, at_most=1)], ...], ...]
    """Share of robot time."""


@dataclass(frozen=True, kw_only=True)
class Edition:
    """The edition of the benchmark that an entry file belongs to."""

    version: int
    identity: str
    quick: bool


@dataclass(frozen=True, kw_only=True)
class EntryFile:
    """The content of an entry file; the schema of entries follows from this class."""

    benchmark: Edition
    name: Name
    command: str
    training: Training
    policies: Annotated[tuple[EntryPolicy, ...], Within(at_least=1)]
    core_hours: Amount | None
    versions: Mapping[str, str]
    runs: Mapping[str, WorldRuns]
    """World -> its runs."""
    measures: tuple[EntryMeasure, ...]
    digest: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Entry:
    """What an entry file holds."""

    version: int
    identity: str
    """Identity of the protocol, see `Protocol.identity`."""
    is_quick: bool
    name: str
    command: str
    policies: tuple[EntryPolicy, ...]
    runs: Mapping[str, Mapping[str, Sequence[Sequence[float]]]]
    """World -> "performance" (per 1,000 s) and "interference" (share of robot time), (policies, seeds) each."""
    measures: tuple[EntryMeasure, ...] = ()
    training: Training = field(default_factory=Training)
    core_hours: float | None = 0.0
    """Core-hours that the runs of the entry took, as far as their records say; None if no record says it."""
    versions: Mapping[str, str] = field(default_factory=dict[str, str])

    def performance(self, world: str) -> FloatArray:
        """Return the performance of all runs of a world, per 1,000 s, (policies, seeds)."""
        return np.asarray(self.runs[world]["performance"], dtype=np.float64)

    def interference(self, world: str) -> FloatArray:
        """Return the share of robot time lost to interference, (policies, seeds)."""
        return np.asarray(self.runs[world]["interference"], dtype=np.float64)

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
        return self.to_mapping()["digest"]

    def to_mapping(self) -> dict[str, Any]:
        """Return the entry as plain values, its digest last."""
        content: dict[str, Any] = {
            "benchmark": {"version": self.version, "identity": self.identity, "quick": self.is_quick},
            "name": self.name,
            "command": self.command,
            "training": self.training.to_mapping(),
            "policies": [asdict(policy) for policy in self.policies],
            "core_hours": self.core_hours,
            "versions": dict(self.versions),
            "runs": {
                world: {name: _lists(rows) for name, rows in of_world.items()} for world, of_world in self.runs.items()
            },
            "measures": [asdict(measure) for measure in self.measures],
        }
        return {**content, "digest": _digest(content)}

    def write(self, path: str | Path) -> None:
        """Write the entry to a file, whole or not at all."""
        with replacing(Path(path)) as draft:
            draft.write_text(_text(self.to_mapping()), encoding="utf-8")

    def check(self, protocol: Protocol, where: str) -> None:
        """Refuse an entry of another protocol, or one that lacks runs.

        Args:
            protocol: The protocol that it must belong to.
            where: Name of the entry in messages.

        Raises:
            BenchmarkError: see above.
        """
        if self.version != protocol.version:
            raise BenchmarkError(
                f"Expected an entry of version {protocol.version} of the benchmark, got one of version {self.version} "
                f"in {where}; run swarm-forage benchmark again."
            )
        if self.identity != protocol.identity:
            told = "a quick look, which is no entry" if self.is_quick else "other worlds or seeds"
            raise BenchmarkError(
                f"Expected an entry of the benchmark, {protocol.name}, got {told} in {where}; run swarm-forage "
                "benchmark again, without --quick and with this version of the package."
            )
        digests = [policy.digest for policy in self.policies if policy.digest]
        if self.training.track in protocol.tracks and len({*digests}) < len(digests):
            raise BenchmarkError(f"Expected different trainings in {where}, got one file twice.")
        worlds = [world.name for world in protocol.worlds]
        for world in worlds:
            if world not in self.runs:
                raise BenchmarkError(f"Expected runs of the world {world!r} in {where}, found none.")
        for world, of_world in self.runs.items():
            if world not in worlds:
                raise BenchmarkError(f"Expected runs of the worlds of the benchmark in {where}, got {world!r}, too.")
            for name, rows in of_world.items():
                self._check_rows(f"{name} in the world {world!r} of {where}", rows, protocol)
        self.training.check_track(protocol, len(self.policies))
        for measure in self.measures:
            for name in ("values", "relative") if measure.relative else ("values",):
                self._check_rows(f"{name} of {', '.join(measure.key)} in {where}", getattr(measure, name), protocol)

    def _check_rows(self, where: str, rows: Sequence[Sequence[Any]], protocol: Protocol) -> None:
        if [len(row) for row in rows] != [len(protocol.seeds)] * len(self.policies):
            raise BenchmarkError(
                f"Expected {where} as lists of numbers, one for each of {len(self.policies)} policies and "
                f"{len(protocol.seeds)} seeds."
            )


def read_entry(path: str | Path, protocol: Protocol | None = None) -> Entry:
    """Read an entry file.

    Args:
        path: The file.
        protocol: What it must be an entry of; default that of the version which it names.

    Raises:
        BenchmarkError: the file cannot be read, its entry of the protocol is not whole, or its digest does not match.
    """
    content = read_json(Path(path), BenchmarkError)
    try:
        stored: EntryFile = typed(EntryFile, content, "")
    except ValueError as error:
        raise BenchmarkError(f"Cannot use the entry {path}: {error}") from error
    entry = _entry(stored)
    if protocol is None and entry.version not in protocol_versions():
        raise BenchmarkError(
            f"Expected an entry of version {known_versions()} of the benchmark, got {entry.version} in {path}."
        )
    entry.check(protocol or load_protocol(version=entry.version), str(path))
    if entry.digest != stored.digest:
        raise BenchmarkError(
            f"Expected the numbers of {path} as swarm-forage benchmark wrote them, got others: the digest does not "
            "fit. Make the entry again."
        )
    return entry


def _entry(stored: EntryFile) -> Entry:
    about = stored.benchmark
    return Entry(
        version=about.version,
        identity=about.identity,
        is_quick=about.quick,
        name=stored.name,
        command=stored.command,
        training=stored.training,
        policies=stored.policies,
        core_hours=stored.core_hours,
        versions=stored.versions,
        runs={world: vars(runs) for world, runs in stored.runs.items()},
        measures=stored.measures,
    )


def _lists(rows: Sequence[Sequence[float]]) -> list[list[float]]:
    return [list(row) for row in rows]


def _digest(content: Mapping[str, Any]) -> str:
    from swarm_forage_env.runs.spec import identity_of

    return identity_of(json.loads(json.dumps(content)))


def _text(content: Mapping[str, Any]) -> str:
    """JSON with one line per world and measure: files that people can compare line by line."""
    lines: list[str] = []
    for key, value in content.items():
        if key == "runs":
            inner = ",\n".join(f"  {json.dumps(name)}: {json.dumps(rows)}" for name, rows in value.items())
            lines.append(f' "runs": {{\n{inner}\n }}')
        elif key == "measures":
            inner = ",\n".join(f"  {json.dumps(measure)}" for measure in value)
            lines.append(f' "measures": [\n{inner}\n ]')
        else:
            lines.append(f" {json.dumps(key)}: {json.dumps(value)}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def six_digits(value: float) -> float:
    """Return a number as entry files hold it: further digits would only make files longer."""
    return float(f"{value:.6g}")


def rounded(value: float) -> float | None:
    """Return a number with six digits, None for NaN and infinity."""
    return six_digits(value) if math.isfinite(value) else None
