"""From policies to an entry: the runs of the protocol, and the measures that they allow."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from metrics.scoring.contestants import Contestant, contestants_of
from metrics.scoring.runs import rates_of
from metrics.scoring.studies import RunCurves, StudyCurves
from metrics.scoring.study_scores import score_study
from metrics.scoring.table import Score

from .entry import Entry, EntryMeasure, EntryPolicy, Training, rounded, six_digits
from .protocol import BenchmarkError, Group, Protocol, load_protocol

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from swarm_forage_env.runs.record import RunRecord
    from swarm_forage_env.runs.spec import RunSpec

_Records = Mapping[tuple[str, int], "RunRecord"]
"""World and seed -> the run."""


def benchmark_specs(policy: str, protocol: Protocol) -> "tuple[RunSpec, ...]":
    """Return the runs of one policy, seed by seed, in each the worlds in their order.

    Args:
        policy: Registered name, or path of a policy file.
        protocol: What is run.

    Raises:
        ValueError: no installed policy has that name, or a file that cannot be opened.
    """
    return tuple(_planned(_contestants([policy], protocol)[0], protocol).values())


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
    executor: "Executor | None" = None,
    progress: bool = True,
) -> Entry:
    """Run policies in all worlds of a protocol and return the entry.

    Args:
        policies: Registered names or policy files; several are training seeds of one method, and one entry.
        name: Name of the entry in tables.
        protocol: Default the latest version.
        command: What the page tells people to type to make the entry again.
        training: How the policies were made; what a network file tells of it is added.
        training_seeds: One per policy; default what network files tell.
        out: Folder for run records. Runs that it already holds are not repeated, so you can repeat an interrupted call.
        jobs: Processes; default one per core.
        executor: Runs the work instead, for example Dask's `client.get_executor()`.
        progress: Show progress and an estimate on stderr.

    Raises:
        BenchmarkError: runs failed, or there is not one training seed per policy.
        ValueError: an unknown policy, or a file that cannot be opened.
        swarm_forage_env.runs.runner.StudyInterrupted: Ctrl-C; finished runs are in `out`.
    """
    from swarm_forage_env.policies.registry import policy_label
    from swarm_forage_env.runs.record import software_versions
    from swarm_forage_env.runs.runner import run_all
    from swarm_forage_env.runs.store import RunStore

    chosen = protocol or load_protocol()
    if training_seeds and len(training_seeds) != len(policies):
        raise BenchmarkError(
            f"Expected one training seed per policy, got {len(training_seeds)} for {len(policies)} policies."
        )
    contestants = _contestants(policies, chosen)
    planned = [_planned(contestant, chosen) for contestant in contestants]
    specs = [spec for of_policy in planned for spec in of_policy.values()]
    store = None if out is None else RunStore(out)
    result = run_all(specs, store=store, jobs=jobs, executor=executor, progress=progress)
    if result.failures:
        first = result.failures[0]
        raise BenchmarkError(
            f"Expected all {len(specs)} runs to finish, {len(result.failures)} failed; the first, "
            f"{first.spec.describe()}: {first.error}"
        )
    found = {record.run_id: record for record in result.records}
    records = [{place: found[spec.run_id] for place, spec in of_policy.items()} for of_policy in planned]
    told = [_told_by_file(policy) for policy in policies]
    return Entry(
        version=chosen.version,
        identity=chosen.identity,
        is_quick=chosen.is_quick,
        name=name,
        command=command,
        policies=tuple(
            EntryPolicy(
                name=policy_label(policy),
                digest=about["digest"],
                training_seed=training_seeds[k] if training_seeds else about["seed"],
            )
            for k, (policy, about) in enumerate(zip(policies, told, strict=True))
        ),
        runs=_runs(chosen, records),
        measures=_measures(chosen, [contestant.label for contestant in contestants], records),
        training=training or Training(),
        core_hours=_core_hours(result.records),
        versions={package: version for package, version in software_versions().items() if version},
    )


def _contestants(policies: Sequence[str], protocol: Protocol) -> tuple[Contestant, ...]:
    return contestants_of(list(policies), {}, protocol.worlds[0].scenario, None)


def _planned(contestant: Contestant, protocol: Protocol) -> "dict[tuple[str, int], RunSpec]":
    """World and seed -> the run."""
    from swarm_forage_env.runs.spec import plan_run

    return {
        (world.name, seed): plan_run(
            world.scenario,
            contestant.policy,
            caches=contestant.caches,
            parameters=contestant.parameters,
            wrappers=world.wrappers,
            seed=seed,
        )
        for seed in protocol.seeds
        for world in protocol.worlds
    }


def _core_hours(records: "Sequence[RunRecord]") -> float | None:
    """What runs took, of those whose records tell it; three digits, as time is never the same twice."""
    known = [record.cpu_time_s for record in records if math.isfinite(record.cpu_time_s)]
    return float(f"{sum(known) / 3600.0:.3g}") if known else None


def _told_by_file(policy: str) -> dict[str, Any]:
    """What the files of a policy tell: the hashes of their contents, and the seed of its training."""
    from swarm_forage_env.policies.mixture import is_mixture, mixture_parts
    from swarm_forage_env.policies.model_files import file_digest
    from swarm_forage_env.policies.network import Network
    from swarm_forage_env.policies.pretrained import network_file
    from swarm_forage_env.policies.registry import file_of, is_policy_file

    if is_mixture(policy):
        digests = [_told_by_file(part.policy)["digest"] for part in mixture_parts(policy)]
        return {"digest": "+".join(filter(None, digests)), "seed": None}
    file = Path(file_of(policy)) if is_policy_file(policy) else network_file(policy)
    if file is None:
        return {"digest": "", "seed": None}
    card: dict[str, Any] = Network.load(file).about.card if file.suffix == ".npz" else {}
    plan: Any = card.get("plan")
    seed = dict[str, Any](plan).get("seed") if isinstance(plan, dict) else None  # pyright: ignore[reportUnknownArgumentType] - a card holds anything
    return {"digest": file_digest(file), "seed": seed if isinstance(seed, int) else None}


def _runs(protocol: Protocol, records: Sequence[_Records]) -> dict[str, dict[str, list[list[float]]]]:
    """World -> performance and interference of all policies and seeds."""

    def of_all(world: str, value: "Callable[[RunRecord], float]") -> list[list[float]]:
        return [[six_digits(value(of_policy[world, seed])) for seed in protocol.seeds] for of_policy in records]

    def performance(record: "RunRecord") -> float:
        return record.rate_per_1000_s("performance")

    def interference(record: "RunRecord") -> float:
        return float(record.interference_fraction.mean())

    return {
        world.name: {"performance": of_all(world.name, performance), "interference": of_all(world.name, interference)}
        for world in protocol.worlds
    }


def _measures(protocol: Protocol, labels: Sequence[str], records: Sequence[_Records]) -> tuple[EntryMeasure, ...]:
    """All measures of all groups; a measure for which a group has no runs is left out."""
    found: list[EntryMeasure] = []
    for group in protocol.groups:
        scores = [
            score_study(_study(protocol, group, label, of_policy))[0]
            for label, of_policy in zip(labels, records, strict=True)
        ]
        found += [_measure(group, of_all, protocol.seeds) for of_all in zip(*scores, strict=True)]
    return tuple(measure for measure in found if any(value is not None for row in measure.values for value in row))


def _study(protocol: Protocol, group: Group, label: str, records: _Records) -> StudyCurves:
    """The runs of a group as measures take them."""
    from swarm_forage_env.scenarios.performance import quantity

    experiments: list[RunCurves] = []
    for world, role in group.roles:
        columns = [records[world, seed].columns() for seed in protocol.seeds]
        names = columns[0].keys() - {"interval"}
        experiments.append(
            RunCurves(
                criterion=role.criterion,
                value=role.value,
                n_robots=role.scenario.robots.n_robots,
                seeds=protocol.seeds,
                curves={name: np.stack([run[name] for run in columns]).astype(np.float64) for name in names},
                rates=rates_of(role),
                n_planned=len(protocol.seeds),
            )
        )
    read_as = quantity(group.roles[0][1].scenario.performance)
    n_intervals = round(protocol.horizon_s / protocol.interval_s)
    return StudyCurves(
        controller=label,
        experiments=tuple(experiments),
        t_end_s=protocol.interval_s * np.arange(1.0, n_intervals + 1.0),
        amount=read_as.amount,
        is_total=read_as.is_total,
        adds_up=read_as.adds_up,
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
