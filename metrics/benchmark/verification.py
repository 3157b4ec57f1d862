"""Whether an entry's numbers can be reproduced: its runs, or a sample of its worlds, made again and compared.

    print(verify_entry("docs/benchmark/generalist.json", ["generalist", "seed_1.npz", "seed_2.npz"]))

Scripted controllers and network files give the same bits everywhere with the same versions, so their numbers must be
the same. Any other policy may round differently on another machine. Its runs then differ like runs with other seeds,
so its numbers must agree within chance.
"""

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from scipy.special import stdtr  # pyright: ignore[reportMissingTypeStubs]  (scipy ships none)

from swarm_forage_env._internal.wording import counted, number, plain
from swarm_forage_env.policies.mixture import is_mixture, mixture_parts
from swarm_forage_env.policies.registry import file_of, is_policy_file, policy_class, policy_names
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.runs.plan import Condition, Plan
from swarm_forage_env.runs.policy_spec import PolicySpec, policy_specs
from swarm_forage_env.runs.table import Table
from swarm_forage_env.runs.versions import software_versions

from ..curves import FloatArray
from ..scoring.question import Question, ask
from ..statistics import Summary, aggregate
from .entry import Entry, EntryPolicy, read_entry, six_digits
from .protocol import BenchmarkError, Protocol, load_protocol
from .running import check_finished, policy_origin

Verdict: TypeAlias = Literal["same", "within chance", "differs"]
N_WORLDS = 8
"""Worlds per policy in the default sample: a few minutes on two cores (our choice)."""


_FEWEST = 3
"""Worlds that a verdict on policies without promised bits needs (our choice)."""
_ERROR = 0.05
_OURS = ("swarm_forage_env", "baselines")
"""Packages whose policies have the same bits everywhere."""


@dataclass(frozen=True, kw_only=True, eq=False)
class VerifiedWorld:
    """The runs of one policy in one world, stored and made again."""

    policy: EntryPolicy
    world: str
    stored: FloatArray
    """Performance per 1,000 s, (seeds,)."""
    again: FloatArray
    """Performance per 1,000 s of the new runs, (seeds,)."""
    is_exact: bool
    """Whether the same bits are promised."""

    @property
    def is_same(self) -> bool:
        """Whether all runs have the stored performance."""
        return bool(np.array_equal(self.stored, self.again))

    @property
    def shift(self) -> float:
        """Change of the mean, divided by the stored mean, or by 1 per 1,000 s where the stored mean is smaller."""
        return float((self.again.mean() - self.stored.mean()) / max(abs(self.stored.mean()), 1.0))

    @property
    def chance(self) -> float:
        """Probability that two samples of runs of one policy differ this much in their means: Welch's t-test."""
        if self.is_same:
            return 1.0
        variances = [float(runs.var(ddof=1)) / runs.size for runs in (self.stored, self.again)]
        scatter = sum(variances)
        if scatter <= 0.0:
            return 0.0
        freedom = scatter**2 / sum(each**2 / (self.stored.size - 1) for each in variances)
        return 2.0 * float(stdtr(freedom, -abs(self.again.mean() - self.stored.mean()) / math.sqrt(scatter)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Verification(Answer):
    """An entry and its runs, made again."""

    entry: Entry
    worlds: tuple[VerifiedWorld, ...]
    n_worlds: int
    """Number of the entry's policies times worlds."""
    other_versions: tuple[str, ...]
    """Packages that had another version when the entry was made, each in words."""
    n_stored: int = 0
    """Number of runs that the folder of records held already."""

    @property
    def verdict(self) -> Verdict:
        """The verdict on all runs together.

        Runs without promised bits may differ only by chance, both in the mean shift over worlds and in each single
        world: at 5 % for all worlds together (Bonferroni).
        """
        if all(world.is_same for world in self.worlds):
            return "same"
        others = [world for world in self.worlds if not world.is_exact]
        if len(others) < _FEWEST or any(world.is_exact and not world.is_same for world in self.worlds):
            return "differs"
        if min(world.chance for world in others) < _ERROR / len(others):
            return "differs"
        return "within chance" if self.shift.lower <= 0.0 <= self.shift.upper else "differs"

    @property
    def shift(self) -> Summary:
        """Mean of `VerifiedWorld.shift` where no bits are promised, with Student's 95 % interval over worlds."""
        shifts = [world.shift for world in self.worlds if not world.is_exact]
        return aggregate(shifts) if shifts else Summary.without_interval()

    def sheets(self) -> tuple[Sheet, ...]:
        """Return one row per policy and world, and what they say together."""
        rows = [
            (
                world.policy.name,
                world.world,
                str(world.stored.size),
                number(float(world.stored.mean())),
                number(float(world.again.mean())),
                "same" if world.is_same else "differs",
            )
            for world in self.worlds
        ]
        header = ("policy", "world", "runs", "stored per 1,000 s", "again", "answer")
        return (Sheet(header=header, rows=rows, notes=self._notes()),)

    def _notes(self) -> list[str]:
        n_runs = sum(world.stored.size for world in self.worlds)
        made = f"{counted(n_runs, 'run')} in {len(self.worlds)} of {self.n_worlds} worlds"
        made += f" ({self.n_stored} of them stored earlier)" if self.n_stored else ""
        said = {
            "same": f"The entry {self.entry.name} is verified: {made} give the stored numbers.",
            "within chance": f"The entry {self.entry.name} is verified within chance: {made} shift the performance by "
            f"{self.shift.mean:+.1%} ({self.shift.lower:+.1%} to {self.shift.upper:+.1%}).",
            "differs": f"The entry {self.entry.name} is not verified: of {made}, not all give the stored numbers.",
        }
        versions = f"Other versions made the entry, and can change bits: {', '.join(self.other_versions)}."
        return [said[self.verdict], *([versions] if self.other_versions and self.verdict != "same" else [])]

    def to_mapping(self) -> dict[str, Any]:
        """Return the verdict and all numbers as plain values."""
        return {
            "entry": self.entry.name,
            "verdict": self.verdict,
            "worlds": [
                {
                    "policy": world.policy.name,
                    "world": world.world,
                    "stored": [plain(value) for value in world.stored],
                    "again": [plain(value) for value in world.again],
                    "same": world.is_same,
                }
                for world in self.worlds
            ],
            "of_worlds": self.n_worlds,
            "other_versions": list(self.other_versions),
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class VerificationQuestion(Question[Verification]):
    """The runs of an entry again, in all its worlds or a sample of them."""

    entry: Entry
    protocol: Protocol
    policies: tuple[PolicySpec, ...]
    """The policies of the entry, in its order."""

    def answer(self, table: Table) -> Verification:
        """Compare the new runs with the runs of the entry.

        Raises:
            BenchmarkError: runs failed.
        """
        check_finished(table)
        place = {policy.label: k for k, policy in enumerate(self.policies)}
        made = {package: version for package, version in software_versions().items() if version}
        return Verification(
            entry=self.entry,
            worlds=tuple(
                self._verified(condition, place[condition.policy.label], table) for condition in self.plan.conditions
            ),
            n_worlds=len(self.protocol.worlds) * len(self.entry.policies),
            n_stored=table.n_stored,
            other_versions=tuple(
                f"{package} {version}, here {made.get(package, 'none')}"
                for package, version in self.entry.versions.items()
                if made.get(package) != version
            ),
        )

    def _verified(self, condition: Condition, place: int, table: Table) -> VerifiedWorld:
        again = [six_digits(record.rate_per_1000_s("performance")) for record in table.of(condition)]
        return VerifiedWorld(
            policy=self.entry.policies[place],
            world=condition.world.name,
            stored=self.entry.performance(condition.world.name)[place],
            again=np.array(again),
            is_exact=_has_same_bits(condition.policy.policy),
        )


def verification_question(
    file: str | Path,
    policies: Sequence[str] = (),
    *,
    n_worlds: int | None = N_WORLDS,
    seed: int = 0,
    protocol: Protocol | None = None,
) -> VerificationQuestion:
    """Return the question of `verify_entry`, which explains arguments and errors."""
    entry = read_entry(file, protocol)
    chosen = protocol or load_protocol(version=entry.version)
    specs = policy_specs(policies or _installed_policies(entry))
    if len(specs) != len(entry.policies):
        raise BenchmarkError(
            f"Expected the {len(entry.policies)} policies of {file} in their order "
            f"({', '.join(policy.name for policy in entry.policies)}), got {len(specs)}."
        )
    for spec, policy in zip(specs, entry.policies, strict=True):
        if policy_origin(spec.policy)["digest"] != policy.digest:
            raise BenchmarkError(
                f"Expected the policy {policy.name} of {file}, got another one in {spec.policy}: its content differs."
            )
    if n_worlds is not None and n_worlds < _FEWEST and not all(_has_same_bits(spec.policy) for spec in specs):
        raise BenchmarkError(
            f"Expected at least {_FEWEST} worlds for policies whose bits may differ between machines, got {n_worlds}."
        )
    conditions = [Condition(spec, each.world) for spec in specs for each in chosen.worlds]
    if n_worlds is not None and n_worlds < len(conditions):
        drawn: list[int] = np.random.default_rng(seed).choice(len(conditions), n_worlds, replace=False).tolist()
        conditions = [conditions[k] for k in sorted(drawn)]
    return VerificationQuestion(
        plan=Plan(conditions=tuple(conditions), seeds=chosen.seeds), entry=entry, protocol=chosen, policies=specs
    )


def verify_entry(
    file: str | Path,
    policies: Sequence[str] = (),
    *,
    n_worlds: int | None = N_WORLDS,
    seed: int = 0,
    protocol: Protocol | None = None,
    out: str | Path | None = None,
    jobs: int | None = None,
    executor: Executor | None = None,
    progress: bool = True,
) -> Verification:
    """Make runs of an entry again and say whether they give its numbers.

    Args:
        file: The entry.
        policies: Names or files of its policies, in their order; default: the installed policies with these names.
        n_worlds: Size of the random sample of its worlds, counted for each policy; None = all.
        seed: Seed of this sample.
        protocol: The protocol of the entry; default that of the version which it names.
        out: Folder for run records. Give a folder of your own: runs that it already holds are not made again.
        jobs: Processes; default one per core.
        executor: Runs the work instead, for example Dask's `client.get_executor()`.
        progress: Show progress and an estimate on stderr.

    Raises:
        BenchmarkError: no such entry, its policies are missing or others are given, or runs failed.
        ValueError: an unknown policy, or a file that cannot be opened.
        swarm_forage_env.runs.runner.RunsInterrupted: Ctrl-C; finished runs are in `out`.
    """
    question = verification_question(file, policies, n_worlds=n_worlds, seed=seed, protocol=protocol)
    return ask(question, out=out, jobs=jobs, executor=executor, progress=progress)


def _has_same_bits(policy: str) -> bool:
    """Whether runs of a policy, or of all parts of a mixed swarm, are promised to be the same: docs/promises.md."""
    parts = [part.policy for part in mixture_parts(policy)] if is_mixture(policy) else [policy]
    return all(
        file_of(part).endswith(".npz") if is_policy_file(part) else policy_class(part).__module__.split(".")[0] in _OURS
        for part in parts
    )


def _installed_policies(entry: Entry) -> tuple[str, ...]:
    installed = policy_names()
    missing = [policy.name for policy in entry.policies if policy.name not in installed]
    if missing:
        raise BenchmarkError(
            f"Expected --policy FILE for each of the {len(entry.policies)} policies of the entry {entry.name}, in "
            f"their order: {missing[0]} is not installed under this name."
        )
    return tuple(policy.name for policy in entry.policies)
