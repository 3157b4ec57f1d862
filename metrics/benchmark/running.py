"""From policies to an entry: the runs of the protocol, and the measures that they allow."""

import math
import os
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import text
from swarm_forage_env.contract.policy import sees_world
from swarm_forage_env.policies.registry import file_of, is_policy_file, policy_class, policy_label
from swarm_forage_env.runs.plan import Plan
from swarm_forage_env.runs.policy_spec import policy_specs
from swarm_forage_env.runs.record import RunRecord
from swarm_forage_env.runs.table import Table
from swarm_forage_env.runs.versions import software_versions
from swarm_forage_env.scenarios.performance import performance_of

from ..controllers import PAPER_POLICIES
from ..scoring.measures import score_study
from ..scoring.question import Question, ask
from ..scoring.run_curves import INTERVAL_COLUMNS, StudyCurves, curves_in_worlds
from ..scoring.scores import Score
from .entry import Entry, EntryMeasure, EntryPolicy, Training, rounded, six_digits
from .protocol import OPEN, USUAL, BenchmarkError, Group, Protocol, load_protocol


@dataclass(frozen=True, kw_only=True, eq=False)
class BenchmarkQuestion(Question[Entry]):
    """Runs of some policies in all worlds of a protocol; several are training seeds of one method, and one entry."""

    name: str
    """Name of the entry in tables."""
    protocol: Protocol
    command: str = ""
    """What the page tells people to type to make the entry again."""
    training: Training = field(default_factory=Training)
    training_seeds: tuple[int, ...] = ()
    """One per policy; empty = what network files tell."""

    def answer(self, table: Table) -> Entry:
        """Return the entry.

        Raises:
            BenchmarkError: runs failed.
        """
        check_finished(table)
        policies = self.plan.policies
        told = [policy_origin(policy.policy) for policy in policies]
        return Entry(
            version=self.protocol.version,
            identity=self.protocol.identity,
            is_quick=self.protocol.is_quick,
            name=self.name,
            command=self.command,
            policies=tuple(
                EntryPolicy(
                    name=policy_label(policy.policy),
                    digest=about["digest"],
                    training_seed=self.training_seeds[k] if self.training_seeds else about["seed"],
                )
                for k, (policy, about) in enumerate(zip(policies, told, strict=True))
            ),
            runs=_runs(self.protocol, table),
            measures=_measures(self.protocol, table),
            training=self.training,
            core_hours=_core_hours(table.records.values()),
            versions={package: version for package, version in software_versions().items() if version},
        )


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


def benchmark_question(
    policies: Sequence[str],
    *,
    name: str,
    protocol: Protocol | None = None,
    command: str = "",
    training: Training | None = None,
    training_seeds: Sequence[int] = (),
) -> BenchmarkQuestion:
    """Return what `run_benchmark` asks; arguments and errors as there."""
    text("the name of an entry", name)
    chosen = protocol or load_protocol()
    is_shipped = tuple(policies) == (name,) and not chosen.is_quick  # made again
    if name in PAPER_POLICIES and not is_shipped:
        raise BenchmarkError(
            f"Expected another name than {name!r}, which is that of an entry that comes with the package; choose one "
            "with --name."
        )
    if training_seeds and len(training_seeds) != len(policies):
        raise BenchmarkError(
            f"Expected one training seed per policy, got {len(training_seeds)} for {len(policies)} policies."
        )
    told = training or Training()
    if chosen.tracks and not told.track:
        told = replace(told, track=OPEN)
    if not chosen.is_quick:
        told.check_track(chosen, len(policies))
    specs = policy_specs(policies)
    omniscient = [spec.label for spec in specs if sees_world(policy_class(spec.policy))]
    if omniscient:
        raise BenchmarkError(
            f"Expected policies that decide by what robots observe, got {omniscient[0]}, which reads the world. It is "
            "a yardstick and no contestant: swarm-forage run puts it beside others."
        )
    return BenchmarkQuestion(
        plan=Plan.product(specs, [each.world for each in chosen.worlds], chosen.seeds),
        name=name,
        protocol=chosen,
        command=command or entry_command(policies, name, version=chosen.version, training=told),
        training=told,
        training_seeds=tuple(training_seeds),
    )


def run_benchmark(
    policies: Sequence[str],
    *,
    name: str,
    protocol: Protocol | None = None,
    command: str = "",
    training: Training | None = None,
    training_seeds: Sequence[int] = (),
    out: str | Path | None = None,
    jobs: int | None = None,
    executor: Executor | None = None,
    progress: bool = True,
) -> Entry:
    """Run policies in all worlds of a protocol and return the entry.

    Args:
        policies: Registered names or policy files; several are training seeds of one method, and one entry.
        name: Name of the entry in tables.
        protocol: Default that of version 1; `load_protocol` has the others.
        command: What the page tells people to type to make the entry again; default `entry_command`.
        training: How the policies were made; what a network file tells of it is added.
        training_seeds: One per policy; default what network files tell.
        out: Folder for run records. Runs that it already holds are not repeated, so you can repeat an interrupted call.
        jobs: Processes; default one per core.
        executor: Runs the work instead, for example Dask's `client.get_executor()`.
        progress: Show progress and an estimate on stderr.

    Raises:
        BenchmarkError: runs failed, there is not one training seed per policy, or the name is that of a scripted
            controller, or the training does not fit its track.
        ConfigError: a name without characters, or with some that no terminal shows.
        ValueError: an unknown policy, or a file that cannot be opened.
        swarm_forage_env.runs.runner.RunsInterrupted: Ctrl-C; finished runs are in `out`.
    """
    question = benchmark_question(
        policies,
        name=name,
        protocol=protocol,
        command=command,
        training=training,
        training_seeds=training_seeds,
    )
    return ask(question, out=out, jobs=jobs, executor=executor, progress=progress)


def entry_name(policy: str, *, quick: bool = False) -> str:
    """Return the name of an entry of one policy; that of a quick look says so, because its runs are shorter."""
    label = policy_label(policy)
    return f"{label}, quick" if quick else label


def entry_command(policies: Sequence[str], name: str, *, version: int = USUAL, training: Training | None = None) -> str:
    """Return what makes an entry again from the current folder: policies as given, but files without whole paths.

    What a training was is among the words only where its track asks for it.
    """
    words = [word for policy in policies for word in ("--policy", _from_here(policy))]
    edition = [] if version == USUAL else ["--version", str(version)]
    budget: list[str] = []
    if training is not None and training.track not in ("", OPEN):
        budget = ["--trained-in", training.worlds, "--track", training.track, "--decisions", str(training.decisions)]
    return shlex.join(["swarm-forage", "benchmark", *words, "--name", name, *edition, *budget])


def _from_here(policy: str) -> str:
    """A policy with the path of each of its files from the current folder, where the whole path was given."""
    from swarm_forage_env.policies.mixture import is_mixture, mixture_of, mixture_parts

    if is_mixture(policy):
        parts = mixture_parts(policy)
        told = [replace(part, policy=_from_here(part.policy)) for part in parts]
        return policy if told == list(parts) else mixture_of(told)  # as given: 20% stays 20%
    file = file_of(policy)
    if not (is_policy_file(policy) and Path(file).is_absolute()):
        return policy
    return Path(os.path.relpath(file)).as_posix() + policy.removeprefix(file)


def _core_hours(records: Iterable[RunRecord]) -> float | None:
    """What runs took, of those whose records tell it; three digits, as time is never the same twice."""
    known = [record.cpu_time_s for record in records if math.isfinite(record.cpu_time_s)]
    return float(f"{sum(known) / 3600.0:.3g}") if known else None


def policy_origin(policy: str) -> dict[str, Any]:
    """Return what the files of a policy tell: `digest` of their contents, and the `seed` of its training."""
    from swarm_forage_env.policies.mixture import is_mixture, mixture_parts
    from swarm_forage_env.policies.model_files import file_digest
    from swarm_forage_env.policies.network import Network
    from swarm_forage_env.policies.pretrained import network_file

    if is_mixture(policy):
        digests = [policy_origin(part.policy)["digest"] for part in mixture_parts(policy)]
        return {"digest": "+".join(filter(None, digests)), "seed": None}
    file = Path(file_of(policy)) if is_policy_file(policy) else network_file(policy)
    if file is None:
        return {"digest": "", "seed": None}
    card: dict[str, Any] = Network.load(file).about.card if file.suffix == ".npz" else {}
    plan: Any = card.get("plan")
    seed = dict[str, Any](plan).get("seed") if isinstance(plan, dict) else None  # pyright: ignore[reportUnknownArgumentType] - a card holds anything
    return {"digest": file_digest(file), "seed": seed if isinstance(seed, int) else None}


def _runs(protocol: Protocol, table: Table) -> dict[str, dict[str, tuple[tuple[float, ...], ...]]]:
    """World -> performance and interference of all policies and seeds."""

    def of_all(world: str, value: Callable[[RunRecord], float]) -> tuple[tuple[float, ...], ...]:
        conditions = [condition for condition in table.plan.conditions if condition.world.name == world]
        return tuple(tuple(six_digits(value(record)) for record in table.of(one)) for one in conditions)

    def performance(record: RunRecord) -> float:
        return record.rate_per_1000_s("performance")

    def interference(record: RunRecord) -> float:
        return float(record.interference_fraction.mean())

    return {
        world.name: {"performance": of_all(world.name, performance), "interference": of_all(world.name, interference)}
        for world in protocol.worlds
    }


def _measures(protocol: Protocol, table: Table) -> tuple[EntryMeasure, ...]:
    """All measures of all groups; a measure for which a group has no runs is left out."""
    found: list[EntryMeasure] = []
    for group in filter(lambda group: group.roles, protocol.groups):
        scores = [score_study(_study(group, table, policy.label))[0] for policy in table.plan.policies]
        found += [_measure(group, of_all, protocol.seeds) for of_all in zip(*scores, strict=True)]
    return tuple(measure for measure in found if any(value is not None for row in measure.values for value in row))


def _study(group: Group, table: Table, policy: str) -> StudyCurves:
    """The runs of a group as measures take them."""
    conditions = {condition.world.name: condition for condition in table.plan.of_policy(policy)}
    return curves_in_worlds(
        [(role, table.curves(conditions[name], *INTERVAL_COLUMNS)) for name, role in group.roles],
        len(table.plan.seeds),
        controller=policy,
        read_as=performance_of(group.roles[0][1].scenario.performance),
        where=f"the group {group.name}",
    )


def _measure(group: Group, scores: Sequence[Score], seeds: Sequence[int]) -> EntryMeasure:
    """One measure at one level, of all policies."""

    def rows(values: Sequence[Mapping[int, float]]) -> tuple[tuple[float | None, ...], ...]:
        return tuple(tuple(rounded(of_policy.get(seed, np.nan)) for seed in seeds) for of_policy in values)

    first = scores[0]
    return EntryMeasure(
        group=group.name,
        label=first.label,
        at=first.at,
        n_robots=first.n_robots,
        unit=first.unit,
        higher_is_better=first.higher_is_better,
        values=rows([score.per_seed for score in scores]),
        relative=rows([score.relative_per_seed for score in scores]) if first.relative_per_seed else (),
    )
