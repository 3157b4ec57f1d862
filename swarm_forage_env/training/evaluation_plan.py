"""EvaluationPlan: how a training is judged, in one world or in several with a baseline each.

Deliveries of eight robots and of five hundred cannot be added up. So in each world the policy is compared with the
baseline: the ratio of both performances. What counts is the mean of the ratios, or the worst of them.

`scenario_of` and `tuples` read the tables of all parts of a training plan.
"""

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import (
    MOST_SEEDS,
    ConfigError,
    FileName,
    Name,
    checked,
    known_keys,
    number,
    one_of,
    read,
    table,
    whole,
)
from swarm_forage_env.policies.registry import policy_class
from swarm_forage_env.runs.plan import Plan
from swarm_forage_env.runs.spec import PolicySpec
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.scenarios.presets import scenario as preset
from swarm_forage_env.training.defaults import EVALUATE_EVERY
from swarm_forage_env.wrappers.registry import wrappers_from_mapping
from swarm_forage_env.wrappers.world import World

COUNTED = ("collected", "first_picked")
"""Performances by which a training can be followed: arenas for learners count these."""
BEST = "best"
"""As a baseline: the best of the scripted controllers in that world, each with the caches that it is made for."""
ALL_WORLDS = "all"
"""What stands for all worlds together where others have their names."""
CHOSEN_BY: dict[str, Callable[[Sequence[float]], Any]] = {"mean": np.mean, "worst": np.min}
"""Ways to make one number of the ratios of all worlds; the network with the highest is kept."""

_KEYS = ("name", "scenario", "wrappers", "baseline")


@dataclass(frozen=True, slots=True)
class EvaluationWorld(World):
    """A fixed world to judge a policy in.

    Its name is a short one for tables; default the scenario's with the number of robots, "warehouse_small_50".

    Raises:
        ConfigError: a name that cannot be, a baseline that is no policy, or a performance that arenas do not count.
    """

    baseline: str = field(default=BEST, kw_only=True)
    """Policy to compare with, or "best"."""

    def __post_init__(self) -> None:
        World.__post_init__(self)
        checked("evaluation.worlds.name", self.name, FileName)
        if self.name == ALL_WORLDS:
            raise ConfigError(f"Expected a name for an evaluation world, got {ALL_WORLDS!r}, which means all of them.")
        one_of("performance of a world to evaluate in", self.scenario.performance, COUNTED)
        if self.baseline != BEST:
            try:
                policy_class(self.baseline)
            except ValueError as error:
                raise ConfigError(f"Expected the baseline of {self.name} to be a controller: {error}") from error

    def _default_name(self) -> str:
        return f"{self.scenario.name}_{self.n_robots}"

    def to_mapping(self) -> dict[str, Any]:
        """Return the world as plain values; `from_mapping` reads them back."""
        return {
            "name": self.name,
            "scenario": dataclasses.asdict(self.scenario),
            "wrappers": {config.name: config.to_mapping() for config in self.wrappers},
            "baseline": self.baseline,
        }

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> "EvaluationWorld":
        """Build a world from nested plain values.

        Raises:
            ConfigError: unknown keys, or values that are refused.
        """
        values = dict(table("a world of evaluation.worlds", mapping))
        known_keys(values, _KEYS, prefix="evaluation.worlds.")
        values["scenario"] = scenario_of(values.get("scenario"))
        if "wrappers" in values:
            values["wrappers"] = wrappers_from_mapping(table("evaluation.worlds.wrappers", values["wrappers"]))
        return cls(**values)


@dataclass(frozen=True, kw_only=True, slots=True)
class EvaluationPlan:
    """How the policy is judged meanwhile: whole runs of the plan's scenario, beside a scripted controller.

    With `worlds`, there are runs in each of them instead, beside its own baseline.
    """

    every_steps: int = EVALUATE_EVERY
    """Decisions between two evaluations; there is one more at the end of each stage."""
    horizon_s: float | None = None
    """Length of a run, s; None = that of the plan's scenario. Jams build up, so that short runs promise too much."""
    n_runs: int = 1
    first_seed: int = 1_000_000
    """Seeds are counted up from here, away from those of training."""
    baseline: str = "crw"
    """Controller to compare with, run once under the same seeds; worlds have their own."""
    worlds: tuple[EvaluationWorld, ...] = ()
    """Worlds to judge the policy in; none = the plan's scenario and wrappers."""
    chosen_by: str = "mean"
    """By which ratio to the baselines of all worlds the network is chosen: their "mean" or the "worst"."""

    def __post_init__(self) -> None:
        one_of("evaluation.chosen_by", self.chosen_by, CHOSEN_BY)
        names = [world.name for world in self.worlds]
        if len(set(names)) < len(names):
            raise ConfigError(f"Expected evaluation.worlds with different names, got {', '.join(names)}; give names.")
        whole("evaluation.every_steps", self.every_steps, at_least=1)
        whole("evaluation.n_runs", self.n_runs, at_least=1, at_most=MOST_SEEDS)
        whole("evaluation.first_seed", self.first_seed, at_least=0)
        if self.horizon_s is not None:
            number("evaluation.horizon_s", self.horizon_s, above=0.0)
        checked("evaluation.baseline", self.baseline, Name)
        try:
            policy_class(self.baseline)
        except ValueError as error:
            raise ConfigError(f"Expected evaluation.baseline to be a controller: {error}") from error

    @property
    def seeds(self) -> tuple[int, ...]:
        """Seeds of the runs in each world."""
        return tuple(range(self.first_seed, self.first_seed + self.n_runs))

    def runs(self, worlds: Iterable[World], *policies: PolicySpec) -> Plan:
        """Return the runs of policies in worlds, of another horizon where the plan has one.

        Raises:
            ConfigError: a horizon that is not a whole number of recording intervals.
        """
        return Plan.product(policies, [self.timed(world) for world in worlds], self.seeds)

    def timed(self, world: World) -> World:
        """Return a world with runs as long as the plan says."""
        if self.horizon_s is None:
            return world
        return dataclasses.replace(world, scenario=with_overrides(world.scenario, horizon_s=self.horizon_s))

    def to_mapping(self) -> dict[str, Any]:
        """Return the plan as plain values, with what is about worlds only where there are some."""
        plain = {item.name: getattr(self, item.name) for item in dataclasses.fields(self)}
        if not self.worlds:
            return {name: value for name, value in plain.items() if name not in ("worlds", "chosen_by")}
        return {**plain, "worlds": [world.to_mapping() for world in self.worlds]}

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> "EvaluationPlan":
        """Build a plan from nested plain values; raises ConfigError where one cannot be."""
        values = dict(table("evaluation", mapping))
        known_keys(values, [item.name for item in dataclasses.fields(cls)], prefix="evaluation.")
        if "worlds" in values:
            if not isinstance(values["worlds"], list):
                raise ConfigError(
                    "Expected evaluation.worlds to be a list of tables, [[evaluation.worlds]], got "
                    f"{values['worlds']!r}."
                )
            values["worlds"] = tuple(EvaluationWorld.from_mapping(world) for world in values["worlds"])
        return cls(**values)


def scenario_of(given: Any) -> ScenarioConfig:
    """Return the scenario of a table: complete, or the `preset` it starts from and fields by name.

    Raises:
        ConfigError: no table, or one that describes no scenario.
    """
    fields = dict(table("scenario", given))
    if "preset" in fields:
        return preset(fields.pop("preset"), **tuples(fields))
    return read(ScenarioConfig, fields, "scenario")


def tuples(mapping: Mapping[str, Any]) -> dict[str, Any]:
    """Turn lists, the only sequences of TOML and JSON, into the tuples of configurations."""
    return {key: tuple(value) if isinstance(value, list) else value for key, value in mapping.items()}
