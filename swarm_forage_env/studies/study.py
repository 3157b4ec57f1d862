"""StudySpec: all runs of a study as data: a scenario, policies, axes along which it varies, rules and seeds.

A condition is one policy under one of the rules at one value of every axis, and `Place` is its address. Each condition
runs once per seed, and all conditions share the seeds. The last axis is the x axis of figures; each condition has its
reference on this axis (`StudySpec.reference`).
"""

import json
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache, cached_property
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, get_origin

from swarm_forage_env._internal.fields import (
    ConfigError,
    as_tuples,
    check_file_name,
    known_keys,
    known_name,
    several,
    table,
    whole,
)
from swarm_forage_env._internal.typed import typed
from swarm_forage_env.runs.plan import Condition, Plan
from swarm_forage_env.runs.policy_spec import PolicySpec
from swarm_forage_env.runs.spec import RunSpec, identity_of, wrappers_from_list, wrappers_to_list
from swarm_forage_env.scenarios.overrides import field_sections, field_types, parse_tuple
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario
from swarm_forage_env.scenarios.quirks import QUIRK_NAMES, RULES, Quirks
from swarm_forage_env.studies.ladders import CRITERIA, swarms_of_sizes, wrappers_at
from swarm_forage_env.wrappers.registry import wrapper_config_class
from swarm_forage_env.wrappers.world import SIZE, UNDISTURBED, World

if TYPE_CHECKING:
    from swarm_forage_env.scenarios.config import ScenarioConfig
    from swarm_forage_env.wrappers.base import WrapperConfig

Value: TypeAlias = float | str | bool
"""Value on an axis."""

RULES_NAMES = {"described": "DESCRIBED", "program": "AUTHORS_PROGRAM"}
"""Word of studies -> name of the rules in `scenarios.quirks.RULES`."""
SCENARIO_FIELDS = (*field_sections(), "density", "side_m")
"""Scenario fields that a study may set and vary: all arguments that `scenarios.presets.scenario` takes by name."""
OF_THE_STUDY = {
    "horizon_s": "the budget of a study sets it",
    "interval_s": "the budget of a study sets it",
    "quirks": "the rules of a study set them",
}
"""Scenario field that a study must not set -> what decides it instead."""
MOST_CONDITIONS = 100_000
"""Largest number of rules times policies times values of all axes; our choice: 400 times that of the largest set."""
NOTHING = "none"
"""Name of the empty list on an axis of lists, and of no switched quirk."""
QUIRK = "quirk"
"""Axis of an ablation: its values are `NOTHING` and names of quirks, each of which is switched alone: on under the
described rules, off under the program's."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Axis:
    """What a study varies, and its values.

    Raises:
        ConfigError: an unknown name, no values, equal values, or values of several kinds.
    """

    name: str
    """A criterion (`ladders.CRITERIA`), a scenario field, a field of a wrapper ("sensor_noise.sigma",
    "throttle.waveform.amplitude"), or `QUIRK`, which switches one quirk of the rules at a time."""
    values: tuple[Value, ...]
    """Numbers, texts or truth values. For a field that holds a list, texts with its entries between commas
    (`list_word`)."""

    def __post_init__(self) -> None:
        wrapper, dot, _ = self.name.partition(".")
        if dot:
            wrapper_config_class(wrapper)  # refuses unknown names; the field is checked with its values
        else:
            allowed = (*CRITERIA, QUIRK, *(name for name in SCENARIO_FIELDS if name not in OF_THE_STUDY))
            others = ", ".join((*CRITERIA, QUIRK))
            shown_by = f"{others}, and the fields that swarm-forage info warehouse_small lists"
            known_name("axis", self.name, allowed, all_by=shown_by)
        several(f"the values of axis {self.name}", self.values, "values")
        for value in self.values if self.name == QUIRK else ():
            known_name("quirk", value, (NOTHING, *QUIRK_NAMES))
        kinds = {_kind(value) for value in self.values}
        if len(kinds) > 1 or "" in kinds or len(set(self.values)) < len(self.values):
            raise ConfigError(
                f"Expected different numbers, texts or truth values on axis {self.name}, got {list(self.values)!r}."
            )
        if self.name in _list_fields() and kinds != {"text"}:
            raise ConfigError(
                f"Expected lists on axis {self.name}, such as values = [[], [...]], got {list(self.values)!r}."
            )

    @property
    def is_criterion(self) -> bool:
        """Whether it varies a criterion, not a single field."""
        return self.name in CRITERIA


def _kind(value: Any) -> str:
    if isinstance(value, bool):
        return "truth value"
    return "number" if isinstance(value, int | float) else "text" if isinstance(value, str) else ""


def list_word(entries: Sequence[Any]) -> str:
    """Return a list as a value on an axis: ["nest_distance", "x"] is "nest_distance,x", [] is "none".

    Plus signs join lists within it: [[1, 2], [3, 4]] is "1,2+3,4".
    """
    if any(isinstance(entry, list | tuple) for entry in entries):
        return "+".join(map(list_word, entries))
    return ",".join(map(str, entries)) or NOTHING


@cache
def _list_fields() -> dict[str, Any]:
    """Scenario fields that hold a list -> their type."""
    return {name: kind for name, kind in field_types().items() if get_origin(kind) is tuple}


def _field_value(name: str, value: Value) -> Any:
    """The value that a scenario takes for a value on the axis of a field."""
    kind = _list_fields().get(name)
    if kind is None:
        return value
    try:
        return parse_tuple("" if value == NOTHING else str(value), kind)
    except ConfigError:
        raise
    except ValueError as error:
        raise ConfigError(f"Expected lists of numbers on axis {name}, got {value!r}.") from error


class Place(NamedTuple):
    """The address of a condition in a study: rules, policy, and a value on each axis."""

    rules: str
    """Key of `RULES_NAMES`."""
    policy: str
    """Label of a policy."""
    values: tuple[Value, ...]
    """One per axis."""


@dataclass(frozen=True, kw_only=True)
class StoredPolicy:
    """A policy as study files store it, see `PolicySpec`."""

    label: str
    policy: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    caches: str | None = None


POLICY_KEYS = tuple(StoredPolicy.__dataclass_fields__)
"""The keys of `StoredPolicy`."""


@dataclass(frozen=True, kw_only=True)
class StudySpec:
    """A study as frozen data, with all values that its budget chose.

    Raises:
        ConfigError: unknown names, values that scenarios or wrappers refuse, or equal labels.
    """

    name: str
    title: str = ""
    scenario: str
    """Name of a preset."""
    settings: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """Scenario fields that differ from the preset, by name."""
    wrappers: "tuple[WrapperConfig, ...]" = ()
    """Wrappers of all runs; an axis may vary one of their fields."""
    policies: tuple[PolicySpec, ...]
    axes: tuple[Axis, ...]
    reference: Value | None = None
    """Value of the reference conditions on the last axis; None = the study does not have a reference."""
    rules: tuple[str, ...] = tuple(RULES_NAMES)
    budget: str = ""
    """Name of the budget that chose the values; empty = none."""
    seeds: tuple[int, ...]
    horizon_s: float
    interval_s: float
    file: str = field(default="", compare=False)
    """Path of the study file as the user gave it; empty for the paper's sets, and for studies made in Python."""
    looks: tuple[int, ...] = ()
    """Numbers of runs of a condition after which claims were judged, and conditions left as they were where all was
    decided; empty: once, at the end. Judgements correct for several looks."""

    def __post_init__(self) -> None:
        check_file_name("name of a study", self.name)
        if self.budget:  # the folder of the study is named by both
            check_file_name("budget", self.budget)
        for what in ("title", "budget", "file"):
            typed(str, getattr(self, what), what)
        known_name("scenario", self.scenario, SCENARIO_NAMES)
        for name in table("set", self.settings):
            if name in OF_THE_STUDY:
                raise ConfigError(f"Expected no {name} in set: {OF_THE_STUDY[name]}.")
        known_keys(self.settings, SCENARIO_FIELDS, "scenario field")
        several("rules", self.rules, f"of {', '.join(RULES_NAMES)}")
        for rules in self.rules:
            known_name("rules", rules, RULES_NAMES)
        several("policies", self.policies, "policies")
        several("seeds", self.seeds, "seeds")
        for seed in self.seeds:
            whole("a seed", seed, at_least=0)
        for what, names in (
            ("policies", [policy.label for policy in self.policies]),
            ("axes", [axis.name for axis in self.axes]),
            ("seeds", list(self.seeds)),
        ):
            if len(set(names)) < len(names):
                raise ConfigError(f"Expected different {what} in study {self.name}, got {', '.join(map(str, names))}.")
        for looked in self.looks:
            whole("looks", looked, at_least=1)
        if list(self.looks) != sorted(set(self.looks)):
            raise ConfigError(f"Expected looks as rising numbers of runs, got {list(self.looks)}.")
        if {SIZE, "n_robots"} <= {axis.name for axis in self.axes}:
            raise ConfigError(f"Expected one axis for the swarm size, got {SIZE} and n_robots.")
        names = {*self.settings, *(axis.name for axis in self.axes)}
        if QUIRK in names and names & {*QUIRK_NAMES}:
            raise ConfigError(f"Expected quirks from one place, got the axis {QUIRK} and a quirk of its own.")
        if self.reference is not None and (not self.axes or self.reference not in self.axes[-1].values):
            raise ConfigError(f"Expected the reference among the values of the last axis, got {self.reference!r}.")
        n_conditions = len(self.rules) * len(self.policies) * math.prod(len(axis.values) for axis in self.axes)
        if n_conditions > MOST_CONDITIONS:
            raise ConfigError(
                f"Expected at most {MOST_CONDITIONS:,} conditions of study {self.name}, got {n_conditions:,}; leave "
                "out values of its axes, or policies."
            )
        _ = self.plan  # refuses what scenarios, wrappers and runs refuse

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """All conditions: rules by rules, policy by policy, the last axis fastest."""
        labels = [policy.label for policy in self.policies]
        addresses = product(self.rules, labels, product(*(axis.values for axis in self.axes)))
        return tuple(Place(*address) for address in addresses)

    def place_words(self) -> dict[Place, tuple[str, ...]]:
        """Return conditions as shown to people: rules, policy, values."""
        words = [value_words(axis.values) for axis in self.axes]
        return {
            place: (place.rules, place.policy, *(of[value] for of, value in zip(words, place.values, strict=True)))
            for place in self.places
        }

    @property
    def n_runs(self) -> int:
        """Number of runs."""
        return len(self.places) * len(self.seeds)

    @property
    def n_experiments(self) -> int:
        """Number of combinations of values; each policy runs all of them under each of the rules."""
        return len(self.places) // (len(self.policies) * len(self.rules))

    @property
    def robot_ticks(self) -> int:
        """Robots times ticks of all runs."""
        return self.plan.robot_ticks

    def reference_of(self, place: Place) -> Place | None:
        """Return the reference of a condition, which differs from it on the last axis only; None = no reference."""
        if self.reference is None:
            return None
        # The value of the axis, not an equal one of another kind: 1 and 1.0 are the same.
        value = self.axes[-1].values[self.axes[-1].values.index(self.reference)]
        return place._replace(values=(*place.values[:-1], value))

    def world(self, place: Place) -> World:
        """Return the world of a condition, with the criterion that labels its runs."""
        return self._worlds[place.rules, place.values]

    def condition(self, place: Place) -> Condition:
        """Return the policy and the world of a condition."""
        return self._conditions[place]

    @cached_property
    def plan(self) -> Plan:
        """All runs, in the order of the conditions."""
        return Plan(conditions=tuple(self._conditions.values()), seeds=self.seeds)

    def specs_of(self, place: Place) -> tuple[RunSpec, ...]:
        """Return the runs of a condition, one per seed."""
        return self.plan.specs_of(self.condition(place))

    @property
    def study_id(self) -> str:
        """Short hexadecimal hash of everything that decides which runs the study has, and their addresses."""
        mapping = self.to_mapping()
        for told in ("title", "budget", "file", "looks"):
            mapping.pop(told, None)
        return identity_of(mapping)

    def to_mapping(self) -> dict[str, Any]:
        """Return the study as nested plain values, ready for JSON."""
        return {
            "name": self.name,
            "title": self.title,
            "scenario": self.scenario,
            "settings": dict(self.settings),
            "wrappers": wrappers_to_list(self.wrappers),
            "policies": [_plain(policy) for policy in self.policies],
            "axes": [{"name": axis.name, "values": list(axis.values)} for axis in self.axes],
            "reference": self.reference,
            "rules": list(self.rules),
            "budget": self.budget,
            "seeds": list(self.seeds),
            "horizon_s": self.horizon_s,
            "interval_s": self.interval_s,
            **({"file": self.file} if self.file else {}),
            **({"looks": list(self.looks)} if self.looks else {}),
        }

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> "StudySpec":
        """Build a study back from `to_mapping`.

        Raises:
            ConfigError: unknown or missing keys, or values that do not describe a study.
        """
        own = [item.name for item in fields(cls)]
        known_keys(table("a study", mapping), own, "key of a study")
        missing = [key for key in own if key not in mapping and key not in ("file", "looks")]
        if missing:
            raise ConfigError(f"Missing key {missing[0]!r} of a study.")
        values: dict[str, Any] = dict(mapping)
        values["policies"] = tuple(
            PolicySpec(**vars(policy)) for policy in typed(tuple[StoredPolicy, ...], values["policies"], "policies")
        )
        values["axes"] = typed(tuple[Axis, ...], values["axes"], "axes")
        values["wrappers"] = wrappers_from_list(values["wrappers"])
        values["settings"] = plain_settings(table("settings", values["settings"]))
        values["seeds"] = typed(tuple[int, ...], values["seeds"], "seeds")
        values["looks"] = typed(tuple[int, ...], values.get("looks", ()), "looks")
        values["rules"] = typed(tuple[str, ...], values["rules"], "rules")
        return cls(**values)

    def to_json(self) -> str:
        """Return the study as one line of JSON."""
        return json.dumps(self.to_mapping(), sort_keys=True)

    @cached_property
    def _policies(self) -> dict[str, PolicySpec]:
        return {policy.label: policy for policy in self.policies}

    @cached_property
    def _conditions(self) -> dict[Place, Condition]:
        has_caches = "caches" in (*self.settings, *(axis.name for axis in self.axes))
        found: dict[Place, Condition] = {}
        for place in self.places:
            policy = self._policies[place.policy]
            if has_caches:
                policy = replace(policy, caches=None)
            found[place] = Condition(policy, self.world(place))
        return found

    @cached_property
    def _worlds(self) -> dict[tuple[str, tuple[Value, ...]], World]:
        return {
            (rules, values): self._world(values, sized)
            for rules in self.rules
            for values, sized in self._scenarios(rules)
        }

    def _scenarios(self, rules: str) -> "Iterator[tuple[tuple[Value, ...], ScenarioConfig]]":
        """Every combination of values with its scenario: fields first, then the size of the swarm."""
        fixed: dict[str, Any] = {"horizon_s": self.horizon_s, "interval_s": self.interval_s, **self.settings}
        names = [axis.name for axis in self.axes]
        at = names.index(SIZE) if SIZE in names else None
        for values in product(*(axis.values for axis in self.axes if axis.name != SIZE)):
            here: dict[str, Any] = dict(zip((name for name in names if name != SIZE), values, strict=True))
            overrides: dict[str, Any] = fixed | {
                name: _field_value(name, value) for name, value in here.items() if name in SCENARIO_FIELDS
            }
            density = None if at is None else overrides.pop("density", None)
            world = scenario(self.scenario, quirks=_switched(RULES[RULES_NAMES[rules]], here.get(QUIRK)), **overrides)
            if at is None:
                yield values, world
                continue
            sizes: Any = self.axes[at].values
            for size, sized in swarms_of_sizes(world, sizes, density).items():
                yield (*values[:at], size, *values[at:]), sized

    def _world(self, values: tuple[Value, ...], sized: "ScenarioConfig") -> World:
        """Add what disturbs the swarm to its scenario, and name the criterion."""
        configs = {config.name: config.to_mapping() for config in self.wrappers}
        criterion, criterion_value = UNDISTURBED, 0.0
        here = [
            (axis, value) for axis, value in zip(self.axes, values, strict=True) if axis.name not in SCENARIO_FIELDS
        ]
        for axis, value in here:
            wrapper, *path = axis.name.split(".")
            if path:
                configs[wrapper] = _with_value(configs.get(wrapper, {}), path, value)
        adversities = [(axis.name, value) for axis, value in here if axis.is_criterion and axis.name != SIZE]
        for name, value in adversities:
            made = wrappers_at(sized, name, _as_number(name, value))
            taken = sorted(configs.keys() & {config.name for config in made})
            if taken:
                raise ConfigError(f"Expected {taken[0]} from one place, got it from axis {name} and another.")
            configs |= {config.name: config.to_mapping() for config in made}
            if made:
                criterion, criterion_value = name, _as_number(name, value)
        if not adversities and any(axis.name == SIZE for axis, _ in here):
            criterion, criterion_value = SIZE, float(sized.robots.n_robots)
        wrappers = wrappers_from_list([{"wrapper": name, **values} for name, values in configs.items()])
        return World(sized, wrappers, criterion=criterion, value=criterion_value)


def value_words(values: Iterable[Value]) -> dict[Value, str]:
    """Return the values of an axis in words: 2/7 as 0.285714, but with all digits if two values would look alike."""
    short = {value: _short(value) for value in values}
    shown = Counter(short.values())
    return {value: word if shown[word] == 1 else str(value) for value, word in short.items()}


def _short(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


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


def plain_settings(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return scenario fields as scenarios take them: lists of a file become tuples."""
    return {name: as_tuples(value) for name, value in settings.items()}


def _plain(policy: PolicySpec) -> dict[str, Any]:
    return {name: getattr(policy, name) for name in POLICY_KEYS} | {"parameters": dict(policy.parameters)}


def _as_number(name: str, value: Value) -> float:
    if isinstance(value, str | bool):
        raise ConfigError(f"Expected numbers on axis {name}, got {value!r}.")
    return float(value)
