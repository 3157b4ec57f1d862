"""A world that a reset can change: the environment, its wrappers, its seeds, and fields overridden for a curriculum."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarm_forage_env.config import ConfigError, ScenarioConfig, with_overrides
from swarm_forage_env.env import BatchStep, ForageEnv
from swarm_forage_env.scenarios import scenario as preset
from swarm_forage_env.spelling import suggestion
from swarm_forage_env.types import ActionArray, ObsArray
from swarm_forage_env.wrappers.base import SwarmWrapper, WrapperConfig

SCENARIO_OPTION = "scenario"
"""Key of the options of a reset that is read here. Others are left to those who put them there: both Gymnasium and
PettingZoo hand options on to everything in the stack."""


def configured(scenario: str | ScenarioConfig, overrides: Mapping[str, Any]) -> ScenarioConfig:
    """Return a preset by name, or a complete configuration, with fields overridden by name.

    Raises:
        ConfigError: unknown preset or field, or values that describe no world.
    """
    if isinstance(scenario, ScenarioConfig):
        return with_overrides(scenario, **overrides)
    return preset(scenario, **overrides)


def same_robots(scenario: ScenarioConfig, overrides: Mapping[str, Any]) -> ScenarioConfig:
    """Return the scenario with fields overridden by name, but for the number of robots.

    Raises:
        ConfigError: unknown fields, values that describe no world, or another number of robots.
    """
    changed = with_overrides(scenario, **overrides)
    n_robots = scenario.robots.n_robots
    if changed.robots.n_robots != n_robots:
        raise ConfigError(
            f"Expected n_robots to stay {n_robots}, the number of rows that spaces promise, got "
            f"{changed.robots.n_robots}; make another environment, or let robots be born during the run (the "
            "population wrapper with initial_robots)."
        )
    return changed


@dataclass(frozen=True, kw_only=True, slots=True)
class WorldPlan:
    """What a world is made from; picklable."""

    scenario: ScenarioConfig
    wrappers: tuple[WrapperConfig, ...] = ()
    """What disturbs the swarm, in any order."""
    max_cycles: int | None = None
    """Ticks until truncation; default the scenario's horizon."""
    render_mode: str | None = None
    reads: tuple[str, ...] | None = None
    """Observation slices that are looked at; None = all."""

    def build(self, overrides: Mapping[str, Any]) -> ForageEnv | SwarmWrapper:
        """Build the environment in its wrappers, scenario fields overridden by name.

        Raises:
            ConfigError: unknown fields, values that describe no world, or another number of robots.
        """
        scenario = same_robots(self.scenario, overrides)
        env: ForageEnv | SwarmWrapper = ForageEnv(
            scenario, max_cycles=self.max_cycles, render_mode=self.render_mode, reads=self.reads
        )
        for config in sorted(self.wrappers, key=lambda config: config.stack_position, reverse=True):
            env = config.wrap(env)
        return env


class World:
    """One world and the sequence of its runs.

    Attributes:
        env: Environment and wrappers as one stack.
        base: The ForageEnv at its bottom.
        is_new: Whether the last reset rebuilt the stack, so that what was derived from `base.task` is stale.
    """

    def __init__(self, plan: WorldPlan) -> None:
        """Build the world of `plan`; raises ConfigError where it cannot be."""
        self._plan = plan
        self._overrides: dict[str, Any] = {}
        self._seeds = np.random.default_rng()
        self.is_new = True
        self._adopt(plan.build({}))

    def _adopt(self, env: ForageEnv | SwarmWrapper) -> None:
        self.env = env
        self.base: ForageEnv = env.world if isinstance(env, SwarmWrapper) else env

    def reset(self, seed: int | None = None, options: Mapping[str, Any] | None = None) -> ObsArray:
        """Start a run and return observations (N, D).

        Args:
            seed: Seed of the run and of those that follow it; None continues the sequence of the last seed given.
            options: `{"scenario": {field: value}}` overrides fields of the scenario that the world was planned with,
                in this run and all later ones; `{"scenario": {}}` goes back to the plan. Without that key nothing
                changes.

        Raises:
            ConfigError: an option that is nearly `scenario`, an unknown field, or another number of robots; the world
                stays as it was.
        """
        overrides = _scenario_overrides(options)
        self.is_new = overrides is not None and overrides != self._overrides
        if overrides is not None and self.is_new:
            self._adopt(self._plan.build(overrides))
            self._overrides = overrides
        if seed is None:
            seed = int(self._seeds.integers(2**31))
        else:
            self._seeds = np.random.default_rng(seed)
        return self.env.reset_batch(seed)

    def step(self, commands: ActionArray) -> BatchStep:
        """Advance one tick; see `ForageEnv.step_batch`."""
        return self.env.step_batch(commands)


def _scenario_overrides(options: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Return the overridden fields that `options` asks for, None when it does not speak of them."""
    if not options:
        return None
    if SCENARIO_OPTION not in options:
        for key in options:
            if suggestion(key, (SCENARIO_OPTION,)):
                raise ConfigError(f"Unknown reset option {key!r}.{suggestion(key, (SCENARIO_OPTION,))}")
        return None
    fields = options[SCENARIO_OPTION]
    if not isinstance(fields, Mapping):
        raise ConfigError(f"Expected the reset option 'scenario' as fields by name, got {fields!r}.")
    return dict(fields)
