"""StudySpec: all runs of a study: its file, and the budget, seeds and rules that were chosen of it.

A condition is one policy under one of the rules at one value of every axis, and `Place` is its address. Each condition
runs once per seed, and all conditions share the seeds.
"""

import itertools
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import msgspec

from swarm_forage_env._internal.fields import ConfigError, FileName, checked, known_keys, known_name, table
from swarm_forage_env._internal.wording import suggestion
from swarm_forage_env.policies.registry import is_policy_file
from swarm_forage_env.runs.plan import Condition, Plan
from swarm_forage_env.runs.spec import PolicySpec, RunSpec, policy_spec, wrappers_from_list
from swarm_forage_env.scenarios.overrides import with_object_density
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario
from swarm_forage_env.scenarios.quirks import QUIRK_NAMES, RULES, Quirks
from swarm_forage_env.studies.ladders import CRITERIA, swarms_of_sizes, wrappers_at
from swarm_forage_env.studies.study_file import (
    NOTHING,
    OBJECT_DENSITY,
    OF_THE_STUDY,
    PAPER,
    QUIRK,
    RULES_NAMES,
    RUN,
    SCENARIO_FIELDS,
    SETS,
    Axis,
    BudgetTable,
    PolicyTable,
    RunTable,
    StudyFile,
    Value,
    axes_of,
    content_of,
    seeds_of,
    value_words,
)
from swarm_forage_env.wrappers.registry import wrappers_from_mapping
from swarm_forage_env.wrappers.world import SIZE, UNDISTURBED, World

if TYPE_CHECKING:
    from swarm_forage_env.scenarios.config import ScenarioConfig

MOST_CONDITIONS = 100_000
"""Largest number of rules times policies times values of all axes; our choice: 400 times that of the largest set."""


class Place(NamedTuple):
    """The address of a condition in a study: rules, policy, and a value on each axis."""

    rules: str
    """Key of `RULES_NAMES`."""
    policy: str
    """Label of a policy."""
    values: tuple[Value, ...]
    """One per axis."""


@dataclass(frozen=True, kw_only=True)
class StudySpec:
    """A study: its file, and what was chosen of it.

    Raises:
        ConfigError: unknown names, values that scenarios or wrappers refuse, or equal labels.
    """

    text: str
    """Of the file, without the table `[run]`."""
    run: RunTable

    def __post_init__(self) -> None:
        checked("name of a study", self.name, FileName)
        checked("budget", self.budget, FileName)  # the folder of the study is named by both
        known_name("scenario", self.file.scenario, SCENARIO_NAMES)
        for name in self.file.set:
            if name in OF_THE_STUDY:
                raise ConfigError(f"Expected no {name} in set: {OF_THE_STUDY[name]}.")
        known_keys(self.file.set, SCENARIO_FIELDS, "scenario field")
        for rules in self.rules:
            known_name("rules", rules, RULES_NAMES)
        labels, varied = [policy.label for policy in self.policies], [axis.name for axis in self.axes]
        for what, names in (("rules", self.rules), ("policies", labels), ("axes", varied)):
            if len({*names}) < len(names) or not (names or what == "axes"):
                raise ConfigError(f"Expected different {what}, one or more, in study {self.name}, got {[*names]!r}.")
        names = {*self.file.set, *varied}
        if {SIZE, "n_robots"} <= {*varied}:
            raise ConfigError(f"Expected one axis for the swarm size, got {SIZE} and n_robots.")
        if QUIRK in names and names & {*QUIRK_NAMES}:
            raise ConfigError(f"Expected quirks from one place, got the axis {QUIRK} and a quirk of its own.")
        n_conditions = len(self.rules) * len(self.policies) * math.prod(len(axis.values) for axis in self.axes)
        if n_conditions > MOST_CONDITIONS:
            raise ConfigError(
                f"Expected at most {MOST_CONDITIONS:,} conditions of study {self.name}, got {n_conditions:,}; leave "
                "out values of its axes, or policies."
            )
        _ = self.plan  # refuses what scenarios, wrappers and runs refuse

    @cached_property
    def file(self) -> StudyFile:
        """What the file says."""
        return content_of(self.text)

    @property
    def name(self) -> str:
        """Name of the study."""
        return self.file.name

    @property
    def budget(self) -> str:
        """Name of the budget."""
        return self.run.budget

    @property
    def seeds(self) -> tuple[int, ...]:
        """Seeds of each condition."""
        return self.run.seeds

    @property
    def rules(self) -> tuple[str, ...]:
        """Some of `RULES_NAMES`."""
        return self.run.rules

    @property
    def length(self) -> BudgetTable:
        """What the budget says."""
        return self.file.budget.get(self.budget, BudgetTable())

    @cached_property
    def policies(self) -> tuple[PolicySpec, ...]:
        """Policies that run; files are as they were when the runs were planned, and are not opened again."""
        kept = tuple(PolicySpec(**msgspec.structs.asdict(one)) for one in self.run.policies)
        return kept or tuple(_found(one) for one in self.file.policies)

    @property
    def axes(self) -> tuple[Axis, ...]:
        """The axes with the values of the budget."""
        return self._axes[0]

    @property
    def reference(self) -> Value | None:
        """Value of the reference conditions on the last axis, which every budget runs; None = no reference.

        Default: for swarm sizes the smallest; for quirks "none", the rules as they are; for other criteria 0, the ideal
        conditions; for a field, none.
        """
        return self._axes[1]

    @cached_property
    def _axes(self) -> tuple[tuple[Axis, ...], Value | None]:
        return axes_of(self.file, self.length.values)

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """All conditions: rules by rules, policy by policy, the last axis fastest."""
        labels = [policy.label for policy in self.policies]
        values = product(*(axis.values for axis in self.axes))
        return tuple(itertools.starmap(Place, product(self.rules, labels, values)))

    def reference_of(self, place: Place) -> Place | None:
        """Return the reference of a condition, which differs from it on the last axis only; None = no reference."""
        if self.reference is None:
            return None
        # The value of the axis, not an equal one of another kind: 1 and 1.0 are the same.
        value = self.axes[-1].values[self.axes[-1].values.index(self.reference)]
        return place._replace(values=(*place.values[:-1], value))

    def world(self, place: Place) -> World:
        """Return the world of a condition, with the criterion that labels its runs."""
        return self.conditions[place].world

    @cached_property
    def plan(self) -> Plan:
        """All runs, in the order of the conditions."""
        return Plan(conditions=tuple(self.conditions.values()), seeds=self.seeds)

    def specs_of(self, place: Place) -> tuple[RunSpec, ...]:
        """Return the runs of a condition, one per seed."""
        return self.plan.specs_of(self.conditions[place])

    def with_run(self, **changes: Any) -> "StudySpec":
        """Return the study with other choices: seeds, rules, ..."""
        return StudySpec(text=self.text, run=msgspec.structs.replace(self.run, **changes))

    def to_toml(self) -> str:
        """Return the file, with what was chosen at its end."""
        lines = [f"{name} = {_toml(value)}" for name, value in msgspec.to_builtins(self.run).items() if value]
        return self.text + RUN + "\n".join(lines) + "\n"

    @cached_property
    def conditions(self) -> dict[Place, Condition]:
        """Address -> policy and world."""
        has_caches = "caches" in (*self.file.set, *(axis.name for axis in self.axes))
        policies = {policy.label: policy for policy in self.policies}
        if has_caches:
            policies = {label: replace(policy, caches=None) for label, policy in policies.items()}
        worlds = {
            (rules, values): self._world(values, sized)
            for rules in self.rules
            for values, sized in self._scenarios(rules).items()
        }
        return {place: Condition(policies[place.policy], worlds[place.rules, place.values]) for place in self.places}

    def _scenarios(self, rules: str) -> "dict[tuple[Value, ...], ScenarioConfig]":
        """Every combination of values with its scenario: fields first, then the size of the swarm."""
        length = {"horizon_s": self.length.horizon_s, "interval_s": self.length.interval_s}
        names = [axis.name for axis in self.axes]
        at = names.index(SIZE) if SIZE in names else None
        found: dict[tuple[Value, ...], ScenarioConfig] = {}
        for values in product(*(axis.values for axis in self.axes if axis.name != SIZE)):
            here: dict[str, Any] = dict(zip((name for name in names if name != SIZE), values, strict=True))
            overrides: dict[str, Any] = {**length, **self.file.set} | {
                name: value for name, value in here.items() if name in SCENARIO_FIELDS
            }
            per_m2 = overrides.pop(OBJECT_DENSITY, None)
            density = None if at is None else overrides.pop("density", None)
            quirks = _switched(RULES[RULES_NAMES[rules]], here.get(QUIRK))
            world = scenario(self.file.scenario, quirks=quirks, **overrides)
            sized: dict[tuple[Value, ...], ScenarioConfig] = {values: world}
            if at is not None:
                sizes: Any = self.axes[at].values
                swarms = swarms_of_sizes(world, sizes, density)
                sized = {(*values[:at], size, *values[at:]): swarm for size, swarm in swarms.items()}
            if per_m2 is not None:
                sized = {place: with_object_density(one, per_m2) for place, one in sized.items()}
            found |= sized
        return found

    def _world(self, values: tuple[Value, ...], sized: "ScenarioConfig") -> World:
        """Add what disturbs the swarm to its scenario, and name the criterion."""
        configs = {config.name: config.to_mapping() for config in wrappers_from_mapping(self.file.wrappers)}
        criterion, criterion_value = UNDISTURBED, 0.0
        here = {axis.name: value for axis, value in zip(self.axes, values, strict=True)}
        for name, value in here.items():
            wrapper, *path = name.split(".")
            if path:
                configs[wrapper] = _with_value(configs.get(wrapper, {}), path, value)
        adversities = {name: value for name, value in here.items() if name in CRITERIA and name != SIZE}
        for name, value in adversities.items():
            made = wrappers_at(sized, name, _as_number(name, value))
            taken = sorted(configs.keys() & {config.name for config in made})
            if taken:
                raise ConfigError(f"Expected {taken[0]} from one place, got it from axis {name} and another.")
            configs |= {config.name: config.to_mapping() for config in made}
            if made:
                criterion, criterion_value = name, _as_number(name, value)
        if not adversities and SIZE in here:
            criterion, criterion_value = SIZE, float(sized.robots.n_robots)
        wrappers = wrappers_from_list([{"wrapper": name, **values} for name, values in configs.items()])
        return World(sized, wrappers, criterion=criterion, value=criterion_value)


def set_names() -> tuple[str, ...]:
    """Return the names of the paper's sets."""
    return tuple(sorted(file.stem for file in SETS.glob("*.toml")))


def load_study(
    name: str | Path,
    budget: str | None = None,
    *,
    seeds: int | Sequence[int] | None = None,
    rules: str | Sequence[str] | None = None,
) -> StudySpec:
    """Read a study file and return the study with one of its budgets.

    Args:
        name: Name of one of the paper's sets, or path of a file.
        budget: Name of a budget; default the first of the file.
        seeds: Number of seeds, from the first of the budget on, or the seeds, in place of those of the budget.
        rules: Rules in place of those in the file.

    Raises:
        ConfigError: the file is missing, is not TOML, or does not describe a study; the message names the file.
    """
    checked("name", name, str | Path)
    file = SETS / f"{name}.toml" if str(name) in set_names() else Path(name)
    if not file.is_file():
        raise ConfigError(
            f"Expected a study file that exists, or one of {', '.join(set_names())}, got {str(name)!r}."
            f"{suggestion(str(name), set_names())}"
        )
    try:
        folder = "" if file.parent == SETS else str(file.parent)
        return study_of(file.read_text(encoding="utf-8"), budget, seeds=seeds, rules=rules, folder=folder)
    except OSError as error:
        raise ConfigError(f"Cannot use {file}: {error.strerror or error}.") from error
    except ValueError as error:
        raise error if str(file) in str(error) else ConfigError(f"Cannot use {file}: {error}") from error


def study_of(
    text: str,
    budget: str | None = None,
    *,
    seeds: int | Sequence[int] | None = None,
    rules: str | Sequence[str] | None = None,
    folder: str = "",
) -> StudySpec:
    """Return a study from the text of its file; see `load_study`.

    Args:
        text: TOML. What its table `[run]` says is chosen, if it has one and no budget is named.
        budget: See `load_study`.
        seeds: See `load_study`.
        rules: See `load_study`.
        folder: Where paths of policies begin.

    Raises:
        ConfigError: see `load_study`; errors do not name a file.
    """
    content, plain = content_of(text), text.partition(RUN)[0].rstrip("\n") + "\n"
    run = content.run
    if run is None or budget is not None:
        chosen = budget or next(iter({**content.budget, PAPER: 0}))
        known_name("budget", chosen, {**content.budget, PAPER: 0})
        given = content.budget.get(chosen, BudgetTable())
        run = RunTable(budget=chosen, seeds=seeds_of(given.seeds, given.first_seed), rules=content.rules)
        if any(is_policy_file(_as_table(one).policy) for one in content.policies):
            run = msgspec.structs.replace(run, policies=tuple(_kept(_found(one, folder)) for one in content.policies))
    if seeds is not None:
        first = content.budget.get(run.budget, BudgetTable()).first_seed
        run = msgspec.structs.replace(run, seeds=seeds_of(seeds, first))
    if rules is not None:
        run = msgspec.structs.replace(run, rules=(rules,) if isinstance(rules, str) else tuple(rules))
    return StudySpec(text=plain, run=run)


def is_set_of_paper(spec: StudySpec) -> bool:
    """Return whether a study is a set of the paper, with any choices, not only by its name."""
    return spec.name in set_names() and _question(spec.file) == _question(load_study(spec.name).file)


def _question(file: StudyFile) -> StudyFile:
    """Return a file without what says how much of it to run."""
    return msgspec.structs.replace(file, budget={}, run=None)


def left_out(spec: StudySpec) -> dict[str, tuple[str, ...]]:
    """Return which of the paper's values a set leaves out: axis -> values as they are shown.

        left_out(load_study("S2a", "reduced"))["walk_probability"]  # ("0.026",)

    The mapping is empty for a set with all values, and for any other study.
    """
    if not is_set_of_paper(spec):
        return {}
    lacking: dict[str, tuple[str, ...]] = {}
    for axis, planned in zip(spec.axes, load_study(spec.name, PAPER).axes, strict=True):
        words = value_words(planned.values)
        absent = tuple(words[value] for value in planned.values if value not in axis.values)
        if absent:
            lacking[axis.name] = absent
    return lacking


def _as_table(policy: str | PolicyTable) -> PolicyTable:
    return PolicyTable(policy=policy) if isinstance(policy, str) else policy


def _found(policy: str | PolicyTable, folder: str = "") -> PolicySpec:
    """Return a policy of a study file as it is run; paths begin at a folder."""
    asked = _as_table(policy)
    place = str(Path(folder, asked.policy)) if is_policy_file(asked.policy) else asked.policy
    return policy_spec(place, label=asked.label, parameters=asked.parameters, caches=asked.caches)


def _kept(policy: PolicySpec) -> PolicyTable:
    """Return a policy with its whole path, digest and caches."""
    return PolicyTable(policy.policy, policy.label, dict(policy.parameters), policy.caches)


def _toml(value: Any) -> str:
    """Return plain values in a line of TOML."""
    if isinstance(value, dict):
        entries = cast("dict[str, Any]", value).items()
        return f"{{ {', '.join(f'{_toml(name)} = {_toml(one)}' for name, one in entries if one is not None)} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml, cast('Sequence[Any]', value)))}]"
    return json.dumps(value, ensure_ascii=False)


def _switched(quirks: Quirks, name: str | None) -> Quirks:
    """Return the quirks with one of them the other way round; `NOTHING` and None switch none."""
    if name is None or name == NOTHING:
        return quirks
    changes: dict[str, Any] = {name: not getattr(quirks, name)}
    return replace(quirks, **changes)


def _with_value(mapping: Mapping[str, Any], path: Sequence[str], value: Value) -> dict[str, Any]:
    """Return nested tables in which the value at the end of a path of keys is replaced."""
    first, *others = path
    inner = mapping.get(first, {})
    return {**mapping, first: _with_value(table(first, inner), others, value) if others else value}


def _as_number(name: str, value: Value) -> float:
    if isinstance(value, str | bool | tuple):
        raise ConfigError(f"Expected numbers on axis {name}, got {value!r}.")
    return float(value)
