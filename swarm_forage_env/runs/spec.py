"""What is run: a policy as it is run, and RunSpec, everything that determines a run, with its identity."""

import copy
import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from swarm_forage_env._internal.fields import ConfigError, checked, instance, known_keys, one_of, read, table, whole
from swarm_forage_env._internal.files import json_text
from swarm_forage_env.policies.registry import (
    from_callable,
    load_policy,
    named_interface,
    policy_class,
    policy_file,
    policy_label,
)
from swarm_forage_env.scenarios.config import CACHE_KINDS, ScenarioConfig, to_mapping, whole_intervals
from swarm_forage_env.wrappers.registry import wrapper_config_class, wrapper_configs
from swarm_forage_env.wrappers.world import UNDISTURBED, World, WorldLike, world_of

if TYPE_CHECKING:
    from swarm_forage_env.wrappers.base import WrapperConfig

RUN_ID_DIGITS = 16
"""Hexadecimal digits of a run_id: 64 bits, so that a million runs collide with probability 3e-8."""
_MAX_SEED = 2**63 - 1
_KEYS = ("scenario", "policy", "parameters", "wrappers", "criterion", "criterion_value", "seed")

PolicyLike: TypeAlias = Any
"""A registered name; the path of a trained policy (*.zip of stable-baselines3, *.npz); a policy object or class; a
function of observations (N, D) that returns actions (N, 3); a `PolicySpec`, of which only the label can be another."""


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
        instance("world", self.world, World, hint="; plan_run takes names, too")
        instance("policy", self.policy, str)
        table("parameters", self.parameters)
        whole_intervals(self.scenario)
        try:
            plain = json.loads(json_text("policy parameters", dict(self.parameters)))
        except ValueError as error:
            raise ConfigError(str(error)) from error
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
            "wrappers": [{"wrapper": config.name, **config.to_mapping()} for config in self.wrappers],
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
            read(ScenarioConfig, values.pop("scenario"), "scenario"),
            wrappers_from_list(values.pop("wrappers", ())),
            criterion=values.pop("criterion", UNDISTURBED),
            value=values.pop("criterion_value", 0.0),
        )
        return cls(world=world, **values)


def wrappers_from_list(entries: Any) -> "tuple[WrapperConfig, ...]":
    """Build wrapper configurations from a list of tables, each with its name as `wrapper`.

    Raises:
        ConfigError: no list of tables, or a table that describes no wrapper.
    """
    if not isinstance(entries, (list, tuple)):
        raise ConfigError(f"Expected wrappers as a list of tables, got {entries!r}.")
    configs: list[WrapperConfig] = []
    for entry in entries:
        values = dict(table("a wrapper", entry))
        name = values.pop("wrapper", None)
        if not isinstance(name, str):
            raise ConfigError(f"Missing key 'wrapper' (its name) in the wrapper {entry!r}.")
        configs.append(wrapper_config_class(name).from_mapping(values))
    return tuple(configs)


@lru_cache(maxsize=64)
def _identifying_fields(scenario: ScenarioConfig) -> dict[str, Any]:
    """What of a scenario is part of a run's identity, see `RunSpec.run_id`; all seeds of a study share it."""
    mapping = to_mapping(scenario)
    del mapping["performance"]
    return mapping


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


@dataclass(frozen=True, kw_only=True, slots=True)
class PolicySpec:
    """A policy as it is run."""

    label: str
    """Name in tables."""
    policy: str
    """Registered name, path of a policy file, or the name under which runs of an object are stored."""
    parameters: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """Keyword arguments of the policy; of a file with its digest."""
    caches: str | None = None
    """Which caches its runs have; None = those of the world."""
    factory: Callable[..., Any] | None = field(default=None, compare=False)
    """Builds the policy in this process; None if worker processes can load it by its name."""
    is_named: bool = field(default=True, compare=False)
    """Whether its runs may be stored: a name tells which policy a stored run belongs to."""

    def run_in(self, world: World, seed: int = 0) -> RunSpec:
        """Return a run of the policy in a world, with the caches of the policy."""
        return RunSpec(world=world.with_caches(self.caches), policy=self.policy, parameters=self.parameters, seed=seed)


def stated_caches(policy: object) -> str | None:
    """Return which caches a policy, or its class, states that it is made for (`caches`); None where it states nothing.

    Raises:
        ConfigError: it states caches that there are not.
    """
    stated = getattr(policy, "caches", None)
    if not isinstance(stated, str):  # on a class a property is no value
        return None
    one_of("caches of the policy", stated, CACHE_KINDS)
    return stated


def policy_spec(
    policy: PolicyLike, *, label: str = "", parameters: Mapping[str, Any] | None = None, caches: str | None = None
) -> PolicySpec:
    """Look a policy up and return it as it is run.

    A file is opened once, before anything is run, and its content becomes part of its runs' identity (`digest`).

    Args:
        policy: See `PolicyLike`.
        label: Name in tables; default the registered name, of a file its name without the ending.
        parameters: Keyword arguments of a registered policy, a file or a class. A "digest" that is given says that a
            file was checked before.
        caches: Which caches its runs have; default those that it states, else those of the world.

    Raises:
        ConfigError: there is no such policy, its file cannot be opened, there are no such caches, or parameters where
            none can be given.
        TypeError: something that is no policy.
    """
    if isinstance(policy, PolicySpec):
        if parameters or caches is not None:
            raise ConfigError(
                f"Expected a name, a file or an object for parameters or caches, got the policy {policy.label!r} that "
                "was looked up before; give them to that policy_spec."
            )
        return replace(policy, label=label or policy.label)
    table("parameters", parameters or {})
    checked("label", label, str)
    if caches is not None:
        one_of("caches", caches, CACHE_KINDS)
    if not isinstance(policy, str | Path):
        return _built_here(policy, label, parameters or {}, caches)
    found, pinned = named_interface(str(policy), parameters or {})
    file = policy_file(found)
    if file is None:
        stating: object = policy_class(found)
    else:
        from swarm_forage_env.policies.model_files import file_digest  # late: most runs open no model

        found, chosen = file.whole, pinned
        try:
            if "digest" not in chosen:
                pinned = {"digest": file_digest(file.path), **chosen}
            stating = load_policy(found, chosen)  # without a digest it says what it guesses, which runs do not repeat
        except ConfigError:
            raise
        except ValueError as error:
            raise ConfigError(str(error)) from error
    return PolicySpec(
        label=label or policy_label(found), policy=found, parameters=pinned, caches=caches or stated_caches(stating)
    )


def policy_specs(
    policies: Iterable[PolicyLike] | Mapping[str, PolicyLike] | PolicyLike,
    *,
    parameters: Mapping[str, Any] | None = None,
    caches: str | None = None,
) -> tuple[PolicySpec, ...]:
    """Return several policies as they are run, each with a name of its own; files of one name go by folder or path.

    Args:
        policies: One policy or several, or a mapping from names to policies.
        parameters: As in `policy_spec`, the same for all.
        caches: As in `policy_spec`.

    Raises:
        ConfigError: equal names; for the rest see `policy_spec`.
    """
    several: Any = policies if isinstance(policies, Iterable) and not isinstance(policies, str) else [policies]
    named = several.items() if isinstance(several, Mapping) else [("", policy) for policy in several]
    specs = [policy_spec(policy, label=name, parameters=parameters, caches=caches) for name, policy in named]
    for parts in (slice(-2, None), slice(None)):
        labels = [spec.label for spec in specs]
        names = [str(Path(*Path(spec.policy).parts[parts])) for spec in specs]
        specs = [
            replace(spec, label=name) if labels.count(spec.label) > 1 else spec
            for spec, name in zip(specs, names, strict=True)
        ]
    labels = [spec.label for spec in specs]
    if len({spec.label for spec in specs}) < len(specs):
        raise ConfigError(f"Expected policies of different names, got {', '.join(labels)}; give a mapping from names.")
    return tuple(specs)


def _built_here(given: Any, label: str, parameters: Mapping[str, Any], caches: str | None) -> PolicySpec:
    """A policy object, a class or a function, which only this process can make."""
    is_policy = all(callable(getattr(given, name, None)) for name in ("reset", "act"))
    if not callable(given) and not is_policy:
        raise TypeError(
            "Expected a policy as a registered name, the path of a trained one, an object or class with reset and act, "
            f"or a function of observations, got {given!r}."
        )
    name: str = label or getattr(given, "__name__", type(given).__name__)
    if isinstance(given, type):
        factory: Any = given
    elif parameters:
        raise ConfigError(f"Expected parameters with a name, a file or a class only, got them with {given!r}.")
    else:
        acts: Any = given
        factory = partial(copy.deepcopy, given) if is_policy else partial(from_callable, acts, name=name)
    return PolicySpec(
        label=name,
        policy=name,
        parameters=parameters,
        caches=caches or stated_caches(given),
        factory=factory,
        is_named=bool(label),
    )


def plan_run(
    world: WorldLike,
    policy: str | Path,
    *,
    wrappers: "Iterable[WrapperConfig | str]" = (),
    parameters: Mapping[str, Any] | None = None,
    caches: str | None = None,
    seed: int = 0,
) -> RunSpec:
    """Plan a run of a policy.

    Args:
        world: The world, or a scenario.
        policy: Registered name, or path of a policy file.
        wrappers: What disturbs the swarm besides the wrappers of the world; words such as "sensor_noise:sigma=0.1" are
            read by `parse_wrapper`.
        parameters: Keyword arguments of the policy, plain values.
        caches: Which caches there are; default those that the policy states, else those of the scenario.
        seed: Seed of the run.

    Raises:
        ConfigError: no installed policy has that name, a file cannot be opened, or see `RunSpec` and `World`.
    """
    given, more = world_of(world), wrapper_configs(wrappers)
    disturbed = replace(given, wrappers=(*given.wrappers, *more), name="") if more else given
    return policy_spec(policy, parameters=parameters, caches=caches).run_in(disturbed, seed)
