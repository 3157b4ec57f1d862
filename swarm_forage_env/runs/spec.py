"""RunSpec: everything that determines a run, as frozen data with an identity."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarm_forage_env._internal.fields import ConfigError, instance, known_keys, table, text, whole
from swarm_forage_env._internal.files import parse_json
from swarm_forage_env.policies.registry import (
    file_of,
    is_policy_file,
    load_policy,
    named_interface,
    policy_class,
    whole_path,
)
from swarm_forage_env.scenarios.config import ScenarioConfig, from_mapping, to_mapping, whole_intervals
from swarm_forage_env.wrappers.registry import wrapper_config_class
from swarm_forage_env.wrappers.world import UNDISTURBED, World, WorldLike, world_of

if TYPE_CHECKING:
    from swarm_forage_env.wrappers.base import WrapperConfig

RUN_ID_DIGITS = 16
"""Hexadecimal digits of a run_id: 64 bits, so that a million runs collide with probability 3e-8."""
_MAX_SEED = 2**63 - 1
_KEYS = ("scenario", "policy", "parameters", "wrappers", "criterion", "criterion_value", "seed")


@dataclass(frozen=True, kw_only=True, slots=True)
class RunSpec:
    """One run as data: the world, who controls the swarm, and the seed.

    The world is taken as it is; `plan_run` also looks at the caches that the policy states.

    Raises:
        ConfigError: `world` is no World, parameters that JSON cannot hold, a bad seed, or a horizon
            that is not a whole number of recording intervals.
    """

    world: World
    policy: str
    """Registered name, path of a policy file, or the name under which the runs of a policy object are stored."""
    parameters: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """Keyword arguments of the policy, plain JSON values; tuples become lists."""
    seed: int = 0

    def __post_init__(self) -> None:
        whole("seed", self.seed, at_least=0, at_most=_MAX_SEED)
        instance("world", self.world, World)
        text("policy", self.policy)
        table("parameters", self.parameters)
        whole_intervals(self.scenario)
        try:
            plain = json.loads(json.dumps(dict(self.parameters), allow_nan=False))
        except (TypeError, ValueError) as error:
            raise ConfigError(f"Expected policy parameters to be plain JSON values: {error}.") from error
        object.__setattr__(self, "parameters", plain)

    @property
    def scenario(self) -> ScenarioConfig:
        """The scenario of the world."""
        return self.world.scenario

    @property
    def wrappers(self) -> "tuple[WrapperConfig, ...]":
        """What disturbs the swarm."""
        return self.world.wrappers

    @property
    def run_id(self) -> str:
        """Short hexadecimal hash of all that can change a run; equal specifications have equal ids.

        `performance` of the scenario is left out: it says how the run is read. So another one finds the stored run.
        """
        return identity_of({**self._others(), "scenario": _identifying_fields(self.scenario)})

    @property
    def robot_ticks(self) -> int:
        """Robots times ticks: how much there is to simulate."""
        return self.scenario.robots.n_robots * self.scenario.horizon_ticks

    def describe(self) -> str:
        """Return one line for people."""
        world = self.world
        varied = "" if world.criterion == UNDISTURBED else f", {world.criterion} = {world.value:g}"
        return (
            f"{self.run_id}: {self.policy} in {self.scenario.name}, {world.n_robots} robots, seed {self.seed}{varied}"
        )

    def to_mapping(self) -> dict[str, Any]:
        """Return the specification as nested plain values."""
        return {"scenario": to_mapping(self.scenario), **self._others()}

    def _others(self) -> dict[str, Any]:
        """All but the scenario as nested plain values."""
        return {
            "policy": self.policy,
            "parameters": dict(self.parameters),
            "wrappers": wrappers_to_list(self.wrappers),
            "criterion": self.world.criterion,
            "criterion_value": self.world.value,
            "seed": self.seed,
        }

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> "RunSpec":
        """Build a specification back from `to_mapping`.

        Raises:
            ConfigError: unknown or missing keys, or values that describe no run.
        """
        known_keys(table("a run specification", mapping), _KEYS, "key of a run specification")
        missing = [key for key in ("scenario", "policy") if key not in mapping]
        if missing:
            raise ConfigError(f"Missing key {missing[0]!r} in a run specification.")
        values = dict(mapping)
        world = World(
            from_mapping(ScenarioConfig, values.pop("scenario"), where="scenario."),
            wrappers_from_list(values.pop("wrappers", ())),
            criterion=values.pop("criterion", UNDISTURBED),
            value=values.pop("criterion_value", 0.0),
        )
        return cls(world=world, **values)

    def to_json(self) -> str:
        """Return the specification as one line of JSON."""
        return json.dumps(self.to_mapping(), sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> "RunSpec":
        """Build a specification back from `to_json`.

        Raises:
            ConfigError: no JSON object, or one that describes no run.
        """
        try:
            mapping = parse_json(text)
        except ValueError as error:
            raise ConfigError(f"Expected a run specification as JSON: {error}.") from error
        if not isinstance(mapping, dict):
            raise ConfigError(f"Expected a run specification as a JSON object, got {type(mapping).__name__}.")
        return cls.from_mapping(mapping)


@lru_cache(maxsize=64)
def _identifying_fields(scenario: ScenarioConfig) -> dict[str, Any]:
    """What of a scenario is part of a run's identity, see `RunSpec.run_id`; all seeds of a study share it."""
    mapping = to_mapping(scenario)
    del mapping["performance"]
    return mapping


def chosen_caches(asked: str | None, policy: object, scenario: ScenarioConfig) -> str:
    """Return which caches a run has: what was asked for, else what the policy states, else what the scenario has.

    `plan_run`, and by it scores and the command line, and `record_run` ask here. `RunSpec` takes its scenario as it is.

    Args:
        asked: "none", "static" or "dynamic" if the user asked for it, else None.
        policy: A policy, or its class. It may state the caches that it is made for in the attribute `caches`.
        scenario: The scenario that the run was given.
    """
    if asked is not None:
        return asked
    return stated_caches(policy) or scenario.caches


def stated_caches(policy: object) -> str | None:
    """Return which caches a policy, or its class, states that it is made for; None where it states nothing."""
    stated = getattr(policy, "caches", None)
    # On a class, a property is not a value; it has one only on an object.
    return stated if isinstance(stated, str) else None


def plan_run(
    world: WorldLike,
    policy: str,
    *,
    wrappers: "Iterable[WrapperConfig]" = (),
    parameters: Mapping[str, Any] | None = None,
    caches: str | None = None,
    seed: int = 0,
) -> RunSpec:
    """Plan a run of a policy.

    Args:
        world: The world, or a scenario; its caches are those of `chosen_caches`.
        policy: Registered name, or path of a policy file.
        wrappers: What disturbs the swarm besides the wrappers of the world.
        parameters: Keyword arguments of the policy, plain values. A "digest" says that a file was checked before.
        caches: Which caches there are; default see `chosen_caches`.
        seed: Seed of the run.

    Raises:
        ConfigError: see `RunSpec` and `World`.
        ValueError: no installed policy has that name, or a file that cannot be opened.
    """
    given = world_of(world)
    chosen = dict(parameters or {})
    stating: object = None
    # A study plans thousands of runs of a policy that was looked up before, so it is not looked up again.
    if caches is None or (is_policy_file(policy) and "digest" not in chosen):
        policy, chosen, stating = pin_policy(policy, chosen)
    more = tuple(wrappers)
    disturbed = replace(given, wrappers=(*given.wrappers, *more), name="") if more else given
    planned = disturbed.with_caches(chosen_caches(caches, stating, given.scenario))
    return RunSpec(world=planned, policy=policy, parameters=chosen, seed=seed)


def pin_policy(policy: str | Path, parameters: Mapping[str, Any]) -> tuple[str, dict[str, Any], object]:
    """Return a policy as specifications name it; the content of a file becomes part of its runs' identity.

    Args:
        policy: Registered name, or path of a policy file, with or without its interface (`split_interface`). A file is
            opened once, before anything is run.
        parameters: Keyword arguments of the policy; a "digest" of a file is kept, and the file checked against it.

    Returns:
        The registered name, or the whole path of the file; the parameters, with the file's digest; and the class of the
        name or the opened policy, which may state `caches`.

    Raises:
        ValueError: no installed policy has that name, the file cannot be opened, or an interface is given twice.
    """
    name, pinned = named_interface(str(policy), parameters)
    if not is_policy_file(name):
        return name, pinned, policy_class(name)
    from swarm_forage_env.policies.model_files import file_digest  # late: most runs open no model

    file = whole_path(name)
    planned = pinned if "digest" in pinned else {"digest": file_digest(file_of(file)), **pinned}
    # Without a digest it says what it guesses, which runs do not repeat.
    return file, planned, load_policy(file, pinned)


def wrappers_to_list(wrappers: "Iterable[WrapperConfig]") -> list[dict[str, Any]]:
    """Return wrapper configurations as plain values; `wrappers_from_list` reads them back."""
    return [{"wrapper": config.name, **config.to_mapping()} for config in wrappers]


def wrappers_from_list(entries: Any) -> "tuple[WrapperConfig, ...]":
    """Build wrapper configurations back from `wrappers_to_list`.

    Raises:
        ConfigError: no list of tables, or a table that describes no wrapper.
    """
    if not isinstance(entries, (list, tuple)):
        raise ConfigError(f"Expected wrappers as a list of tables, got {entries!r}.")
    return tuple(_wrapper_from_mapping(entry) for entry in entries)


def _wrapper_from_mapping(entry: Mapping[str, Any]) -> "WrapperConfig":
    values = dict(entry) if isinstance(entry, Mapping) else {}
    name = values.pop("wrapper", None)
    if not isinstance(name, str):
        raise ConfigError(f"Missing key 'wrapper' (its name) in the wrapper {entry!r}.")
    return wrapper_config_class(name).from_mapping(values)


def identity_of(mapping: Mapping[str, Any]) -> str:
    """Return a short hexadecimal hash of nested plain values; 2 and 2.0 count as equal."""
    canonical = json.dumps(_canonical(mapping), sort_keys=True, separators=(",", ":"))
    return hashlib.blake2b(canonical.encode(), digest_size=RUN_ID_DIGITS // 2).hexdigest()


def _canonical(value: Any) -> Any:
    """Write equal numbers in the same way (2000.0 as 2000), so that they have the same hash."""
    if isinstance(value, Mapping):
        return {key: _canonical(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_canonical(item) for item in value]
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return value
