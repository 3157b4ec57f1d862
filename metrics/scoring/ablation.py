"""Which quirk has which effect: each is switched on in the rules as described, and off in those of the program.

print(ablate_quirks(["warehouse_small"], ["crw", "dpo"], quirks=["explore_double_start"]).markdown())

If the first run with a quirk equals that without it, bit for bit, we take the quirk to have no effect in this world,
and its other seeds do not run.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, known_name
from swarm_forage_env.contract.codes import Task
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.runs.plan import Condition, Plan
from swarm_forage_env.runs.policy_spec import PolicyLike, policy_specs
from swarm_forage_env.runs.record import RunRecord
from swarm_forage_env.runs.runner import run_plan
from swarm_forage_env.runs.store import RunFailure, RunStore, failure_lines
from swarm_forage_env.runs.table import Table
from swarm_forage_env.scenarios.performance import Performance, performance_of
from swarm_forage_env.scenarios.quirks import QUIRK_NAMES, RULES
from swarm_forage_env.wrappers.world import WorldLike, world_of

from ..significance import SIGNIFICANT, holm, pooled_p
from ..statistics import aggregate
from .question import Question, ask
from .scores import bounds
from .summary import performance_number, span

if TYPE_CHECKING:
    from concurrent.futures import Executor

TASK_COLUMNS = tuple(f"task_share_{task.name.lower()}" for task in Task)
CLOSE = 0.05
"""Policies whose means differ by a smaller share count as equal in an order (our choice)."""
_SWITCHED = {"DESCRIBED": "switched on in the description", "AUTHORS_PROGRAM": "switched off in the authors' program"}
_RULES_HEADER = (
    "world",
    "robots",
    "policy",
    "described: performance",
    "program",
    "described: interference",
    "program",
)
NOTES = (
    "`=`: the first run is the same, bit for bit, and no other was made. `*`: significant at 5 % by Student's t, with "
    "the scatter pooled over the quirks of a column and Holm's correction over the table. `~`: means closer than 5 %. "
    "Quirks that change no first run in a world are left out of its tables."
)


class Switch(NamedTuple):
    """One condition of an ablation: a policy in a world, under one of the two rules, with one quirk switched."""

    scenario: str
    n_robots: int
    policy: str
    rules: str
    """Key of `swarm_forage_env.scenarios.quirks.RULES`."""
    quirk: str
    """The quirk that differs from the rules; empty = none."""

    @property
    def base(self) -> "Switch":
        """The rules without a switched quirk."""
        return self._replace(quirk="")


@dataclass(frozen=True, kw_only=True, eq=False)
class Effect:
    """What one switched quirk changed, seed by seed against its rules."""

    switch: Switch
    is_same: bool
    """Whether the first run equals that of the unchanged rules bit for bit. Then no other was made, and R = 1."""
    performance: FloatArray
    """(R,) difference as a share of the unchanged rules' mean performance; NaN if that is 0."""
    interference: FloatArray
    """(R,) difference of the share of robot time in interference."""
    task_shares: FloatArray | None
    """(R, 8) differences of the mean share of robots in each task; None if the policy has no tasks."""

    def to_mapping(self) -> dict[str, Any]:
        """Return the effect as plain values; a quirk that changed nothing in its first run has no intervals."""
        rows: dict[str, FloatArray] = {"performance": self.performance, "interference": self.interference}
        if self.task_shares is not None:
            rows |= {name: self.task_shares[:, column] for column, name in enumerate(TASK_COLUMNS)}
        numbers = {
            name: dict(zip(("mean", "lower", "upper"), bounds(aggregate(values)) or (), strict=True))
            for name, values in rows.items()
        }
        return {**self.switch._asdict(), "is_same": self.is_same, "n_runs": len(self.performance), **numbers}

    def task_text(self) -> str:
        """Return the task whose mean share moved most, and by how much."""
        if self.task_shares is None or self.is_same:
            return "-" if self.task_shares is None else "="
        shifts = self.task_shares.mean(axis=0)
        most = int(np.argmax(np.abs(shifts)))
        return f"{TASK_COLUMNS[most].removeprefix('task_share_').replace('_', ' ')} {100.0 * shifts[most]:+.1f}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Ablation(Answer):
    """Records by switch, and what failed."""

    records: Mapping[Switch, tuple[RunRecord, ...]]
    failures: tuple[RunFailure, ...]
    performance: Performance
    """What performance is."""

    def effects(self) -> tuple[Effect, ...]:
        """Return one effect per switched quirk; switches whose runs failed are left out."""
        return tuple(
            _effect(switch, self.records[switch.base], records)
            for switch, records in self.records.items()
            if switch.quirk and switch.base in self.records
        )

    def means(self, switch: Switch) -> dict[str, float]:
        """Return the mean performance of each policy in a switch's world under its rules, best first.

        A policy whose runs failed is left out. One that the quirk does not touch has the runs of its rules.
        """
        found: dict[str, float] = {}
        for policy in dict.fromkeys(other.policy for other in self.records):
            own = self.records.get(switch._replace(policy=policy))
            if own is not None:
                found[policy] = _mean_performance(own)
        return dict(sorted(found.items(), key=lambda item: -item[1]))

    def to_mapping(self) -> dict[str, Any]:
        """Return rules, effects and failures as plain values."""
        return {
            "performance": f"{self.performance.title} {span(self.performance)}",
            "rules": [
                {
                    **switch._asdict(),
                    "n_runs": len(records),
                    **dict(zip(("performance", "interference"), self._numbers(records), strict=True)),
                }
                for switch, records in self.records.items()
                if not switch.quirk
            ],
            "effects": [effect.to_mapping() for effect in self.effects()],
            "failures": [{"run": failure.spec.describe(), "error": failure.error} for failure in self.failures],
        }

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the two rules side by side, then what each quirk moves, then runs that failed."""
        effects = self.effects()
        parts = [self._both_rules(), *([Sheet(notes=(NOTES,))] if effects else [])]
        for scenario in dict.fromkeys(switch.scenario for switch in self.records):
            for rules, switched in _SWITCHED.items():
                own = [e for e in effects if (e.switch.scenario, e.switch.rules) == (scenario, rules)]
                moving = {effect.switch.quirk for effect in own if not effect.is_same}
                if own and not moving:
                    title = f"{scenario}: each quirk {switched}"
                    parts.append(Sheet(title=title, notes=("None changes a first run.",)))
                if moving:
                    parts += self._moved([effect for effect in own if effect.switch.quirk in moving])
        failures = [f"failed: {line}" for line in failure_lines(self.failures)]
        return *parts, Sheet(notes=failures)

    def _numbers(self, records: Sequence[RunRecord]) -> tuple[float, float]:
        """Mean performance, and mean interference."""
        done = float(np.mean([performance_number(record, self.performance) for record in records]))
        return done, float(np.mean([record.interference_fraction.mean() for record in records]))

    def _both_rules(self) -> Sheet:
        """Performance and interference under both rules."""
        rows: list[tuple[str, ...]] = []
        for switch, records in self.records.items():
            twin = self.records.get(switch._replace(rules="AUTHORS_PROGRAM"))
            if switch.quirk or switch.rules != "DESCRIBED" or twin is None:
                continue
            (done, lost), (done_there, lost_there) = (self._numbers(own) for own in (records, twin))
            numbers = (f"{done:.1f}", f"{done_there:.1f}", f"{lost:.3f}", f"{lost_there:.3f}")
            rows.append((switch.scenario, str(switch.n_robots), switch.policy, *numbers))
        counted = f"{self.performance.title} {span(self.performance)}"
        title = f"Both rules: {counted}, share of robot time in interference"
        return Sheet(title=title, header=_RULES_HEADER, rows=rows)

    def _moved(self, effects: Sequence[Effect]) -> list[Sheet]:
        """Tables of one world and rules: performance with orders, interference, tasks."""
        some = effects[0].switch
        quirks = list(dict.fromkeys(effect.switch.quirk for effect in effects))
        sizes = sorted({effect.switch.n_robots for effect in effects})
        at = {size: some._replace(n_robots=size) for size in sizes}
        order = "; ".join(f"order at {size}: {self._order(switch.base)}" for size, switch in at.items())
        orders = {
            f"order at {size}": [self._changed_order(switch._replace(quirk=quirk)) for quirk in quirks]
            for size, switch in at.items()
        }
        head = f"{some.scenario}, each quirk {_SWITCHED[some.rules]}"
        performance, interference = (_starred(effects, quantity) for quantity in ("performance", "interference"))
        sheets = [
            _sheet(f"{head}: performance, % of the unchanged rules ({order})", effects, performance, orders),
            _sheet(f"{head}: interference, points of % of robot time", effects, interference, {}),
        ]
        if any(effect.task_shares is not None for effect in effects):
            title = f"{head}: task whose share moved most, points of %"
            sheets.append(_sheet(title, effects, Effect.task_text, {}))
        return sheets

    def _order(self, switch: Switch) -> str:
        """Policies, best first; those with close means are joined by "~"."""
        means = self.means(switch)
        joints = [" ~ " if worse >= (1.0 - CLOSE) * better else " > " for better, worse in pairwise(means.values())]
        return "".join(name + joint for name, joint in zip(means, [*joints, ""], strict=True))

    def _changed_order(self, switch: Switch) -> str:
        order = self._order(switch)
        return "as before" if order == self._order(switch.base) else order


@dataclass(frozen=True, kw_only=True, eq=False)
class AblationQuestion(Question[Ablation]):
    """The question what each quirk does. Its plan contains all runs, also those of quirks without effect."""

    switches: tuple[Switch, ...]
    """One per condition of the plan, in its order."""

    @property
    def conditions(self) -> dict[Switch, Condition]:
        """Switch -> condition."""
        return dict(zip(self.switches, self.plan.conditions, strict=True))

    @property
    def remarks(self) -> tuple[str, ...]:
        """That not all runs may be needed."""
        if len(self.plan.seeds) == 1 or not any(switch.quirk for switch in self.switches):
            return ()
        return (f"A quirk that changes nothing needs one run instead of {len(self.plan.seeds)}.",)

    def make_runs(
        self,
        *,
        store: RunStore | None = None,
        executor: "Executor | None" = None,
        jobs: int | None = None,
        progress: bool = False,
    ) -> Table:
        """Make the runs; arguments and errors as in `swarm_forage_env.runs.runner.run_plan`.

        First both rules and the first seed of each quirk; then the other seeds of the quirks that changed something.
        """
        conditions, seeds = self.conditions, self.plan.seeds
        tables: list[Table] = []

        def make(switches: Sequence[Switch], seeds: Sequence[int]) -> None:
            if switches and seeds:
                plan = Plan(conditions=tuple(conditions[switch] for switch in switches), seeds=tuple(seeds))
                tables.append(run_plan(plan, store=store, executor=executor, jobs=jobs, progress=progress))

        quirks = [switch for switch in self.switches if switch.quirk]
        make([switch for switch in self.switches if not switch.quirk], seeds)
        make(quirks, seeds[:1])
        first = self._joined(tables)
        make([switch for switch in quirks if not self._is_same(first, switch)], seeds[1:])
        return self._joined(tables)

    def answer(self, table: Table) -> Ablation:
        """Return the records of all switches; one that changed nothing has those of its rules."""
        records: dict[Switch, tuple[RunRecord, ...]] = {}
        for switch, condition in self.conditions.items():
            own = table.of(self.conditions[switch.base] if self._is_same(table, switch) else condition)
            if len(own) == len(self.plan.seeds):
                records[switch] = own
        return Ablation(
            records=records,
            failures=tuple(table.failures.values()),
            performance=performance_of(self.plan.conditions[0].world.scenario.performance),
        )

    def _joined(self, tables: Sequence[Table]) -> Table:
        """One table of all runs that were made."""
        return Table(
            plan=self.plan,
            records={run_id: record for table in tables for run_id, record in table.records.items()},
            failures={run_id: failure for table in tables for run_id, failure in table.failures.items()},
            n_stored=sum(table.n_stored for table in tables),
            folder=tables[0].folder,
        )

    def _is_same(self, table: Table, switch: Switch) -> bool:
        """Whether the first run of a switched quirk was made and equals that of its rules."""
        if not switch.quirk:
            return False
        conditions, seed = self.conditions, self.plan.seeds[0]
        firsts = [table.of(conditions[one])[:1] for one in (switch, switch.base)]
        (switched, base) = ([record for record in found if record.seed == seed] for found in firsts)
        return bool(switched and base) and switched[0].same_columns(base[0])


def ablate_quirks(
    worlds: Sequence[WorldLike],
    policies: Sequence[PolicyLike] | Mapping[str, PolicyLike],
    *,
    quirks: Sequence[str] = QUIRK_NAMES,
    seeds: int | Sequence[int] = 3,
    caches: str | None = None,
    out: str | Path | None = None,
    jobs: int | None = None,
    executor: "Executor | None" = None,
    progress: bool = True,
) -> Ablation:
    """Switch one quirk at a time, on in the rules as described and off in those of the program, and show its effect.

    Args:
        worlds: The worlds, with their numbers of robots; their own quirks are replaced.
        policies: As in `compare_policies`.
        quirks: Names of the quirks to switch; without names, only the two sets of rules are compared.
        seeds: Their number, or a list; differences are computed seed by seed.
        caches: Kind of caches; default those of each policy.
        out: As in `score_policy`, and so are all further arguments.
        jobs: Processes; default one per core.
        executor: Makes the runs in place of the processes.
        progress: Show progress and an estimate on stderr.

    Raises:
        ConfigError: an unknown quirk or policy, an empty list of policies or seeds, or two worlds of one name and size.
        swarm_forage_env.runs.runner.RunsInterrupted: Ctrl-C; finished runs are in `out`.
    """
    question = ablation_question(worlds, policies, quirks=quirks, seeds=seeds, caches=caches)
    return ask(question, out=out, jobs=jobs, executor=executor, progress=progress)


def ablation_question(
    worlds: Sequence[WorldLike],
    policies: Sequence[PolicyLike] | Mapping[str, PolicyLike],
    *,
    quirks: Sequence[str] = QUIRK_NAMES,
    seeds: int | Sequence[int] = 3,
    caches: str | None = None,
) -> AblationQuestion:
    """Return the question of `ablate_quirks`; arguments and errors as there."""
    for name in quirks:
        known_name("quirk", name, QUIRK_NAMES)
    chosen_seeds = tuple(range(seeds) if isinstance(seeds, int) else seeds)
    if not policies or not chosen_seeds:
        raise ConfigError(f"Expected one or more policies and seeds, got {len(policies)} and {len(chosen_seeds)}.")
    chosen = policy_specs(policies, caches=caches)
    conditions: dict[Switch, Condition] = {}
    for world, (rules, unchanged), quirk, policy in product(
        map(world_of, worlds), RULES.items(), ("", *quirks), chosen
    ):
        switched = replace(unchanged, **{quirk: not getattr(unchanged, quirk)}) if quirk else unchanged
        switch = Switch(world.scenario.name, world.n_robots, policy.label, rules, quirk)
        if switch in conditions:
            raise ConfigError(
                f"Expected worlds that differ in name or number of robots, got {switch.scenario} with "
                f"{switch.n_robots} robots twice."
            )
        conditions[switch] = Condition(policy, replace(world, scenario=replace(world.scenario, quirks=switched)))
    plan = Plan(conditions=tuple(conditions.values()), seeds=chosen_seeds)
    return AblationQuestion(plan=plan, switches=tuple(conditions))


def _mean_performance(records: Sequence[RunRecord]) -> float:
    return float(np.mean([record.performance.sum() for record in records]))


def _effect(switch: Switch, base: Sequence[RunRecord], switched: Sequence[RunRecord]) -> Effect:
    is_same = switched[0].same_columns(base[0])
    pairs = list(zip(base, switched, strict=True))[: 1 if is_same else None]
    whole = _mean_performance(base)
    gains = np.array([after.performance.sum() - before.performance.sum() for before, after in pairs])
    shares = [
        [after.contributed[name].mean() - before.contributed[name].mean() for name in TASK_COLUMNS]
        for before, after in pairs
        if TASK_COLUMNS[0] in before.contributed
    ]
    return Effect(
        switch=switch,
        is_same=is_same,
        performance=gains / whole if whole else np.full(len(pairs), np.nan),
        interference=np.array(
            [after.interference_fraction.mean() - before.interference_fraction.mean() for before, after in pairs]
        ),
        task_shares=np.array(shares) if shares else None,
    )


def _sheet(
    title: str, effects: Sequence[Effect], text: Callable[[Effect], str], more: Mapping[str, Sequence[str]]
) -> Sheet:
    """One row per quirk, one column per size and policy, and further columns with a text per quirk."""
    policies = list(dict.fromkeys(e.switch.policy for e in effects))
    columns = [(size, policy) for size in sorted({e.switch.n_robots for e in effects}) for policy in policies]
    texts = {(e.switch.quirk, e.switch.n_robots, e.switch.policy): text(e) for e in effects}
    rows: list[tuple[str, ...]] = []
    for row, quirk in enumerate(dict.fromkeys(e.switch.quirk for e in effects)):
        cells = (texts.get((quirk, *column), "-") for column in columns)
        rows.append((f"`{quirk}`", *cells, *(column[row] for column in more.values())))
    header = ("quirk", *(f"{policy} {size}" for size, policy in columns), *more)
    return Sheet(title=title, header=header, rows=rows)


def _starred(effects: Sequence[Effect], quantity: str) -> Callable[[Effect], str]:
    """Return what writes the mean of a quantity, with a star where it is significant."""
    columns: dict[tuple[int, str], list[Effect]] = {}
    for effect in effects:
        if not effect.is_same:
            columns.setdefault((effect.switch.n_robots, effect.switch.policy), []).append(effect)
    cells = [effect.switch for column in columns.values() for effect in column]
    p_values = [pooled_p(np.array([getattr(effect, quantity) for effect in column])) for column in columns.values()]
    adjusted = dict(zip(cells, holm(np.concatenate(p_values)) if p_values else (), strict=True))

    def text(effect: Effect) -> str:
        mean = float(getattr(effect, quantity).mean())
        if effect.is_same or np.isnan(mean):
            return "=" if effect.is_same else "-"
        return f"{100.0 * mean:+.1f}" + ("*" if adjusted[effect.switch] <= SIGNIFICANT else "")

    return text
