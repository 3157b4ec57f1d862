"""Worlds that a training is judged in, where one is not enough: each with a baseline of its own.

Deliveries of eight robots and of five hundred cannot be added up. So in each world the policy is compared with the
baseline: the ratio of both performances. What counts is the mean of the ratios, or the worst of them.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, as_tuples, check_file_name, known_keys, one_of, table
from swarm_forage_env.policies.registry import policy_class
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.config import from_mapping as config_from_mapping
from swarm_forage_env.scenarios.presets import scenario as preset
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
        check_file_name("evaluation.worlds.name", self.name)
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


def scenario_of(given: Any) -> ScenarioConfig:
    """Return the scenario of a table: complete, or the `preset` it starts from and fields by name.

    Raises:
        ConfigError: no table, or one that describes no scenario.
    """
    fields = dict(table("scenario", given))
    if "preset" in fields:
        return preset(fields.pop("preset"), **tuples(fields))
    return config_from_mapping(ScenarioConfig, fields, where="scenario.")


def tuples(mapping: Mapping[str, Any]) -> dict[str, Any]:
    """Turn lists, the only sequences of TOML and JSON, into the tuples of configurations."""
    return {key: as_tuples(value) for key, value in mapping.items()}
