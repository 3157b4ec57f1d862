"""Plans of arenas: one list of options for all environments of this folder."""

import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Concatenate, ParamSpec, TypeVar

from swarm_forage_env._internal.fields import ConfigError, instance
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.extras import ExtraFunction, extra_columns
from swarm_forage_env.policies.interface import GivenInterface, InterfaceConfig, chosen_interface
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.overrides import scenario_of_same_size
from swarm_forage_env.views.sampler import ScenarioSampler
from swarm_forage_env.wrappers.base import SwarmWrapper, WrapperConfig, wrap_in_order
from swarm_forage_env.wrappers.registry import wrapper_configs
from swarm_forage_env.wrappers.world import World, WorldLike, changed_world

Options = ParamSpec("Options")
Result = TypeVar("Result")


@dataclass(frozen=True, kw_only=True, slots=True)
class ArenaPlan:
    """Everything that an arena is made from; picklable."""

    world: World
    """With a sampler its largest one, undisturbed, which says how many rows and which columns there are."""
    sampler: ScenarioSampler | None = None
    """Where the world of each run comes from; None = it is always `world`."""
    interface: InterfaceConfig = field(default_factory=InterfaceConfig)
    """What a learner sees and does."""
    max_cycles: int | None = None
    """Ticks until truncation; default the scenario's horizon."""
    render_mode: str | None = None
    extra_reward: ExtraFunction | None = None
    extra_observation: ExtraFunction | None = None
    """What the user adds, see `policies.extras`; `interface` says how many columns."""

    def build(self, overrides: Mapping[str, Any], world: World | None = None) -> ForageEnv | SwarmWrapper:
        """Build the environment with its wrappers.

        Args:
            overrides: Scenario fields by name.
            world: What the sampler has drawn; None = that of the plan.

        Raises:
            ConfigError: unknown fields, values that do not fit together, another number of robots, or more objects than
                the worlds of the sampler have.
        """
        given = world or self.world
        scenario = scenario_of_same_size(given.scenario, overrides)
        if self.sampler is not None and scenario.objects.n_objects > self.sampler.n_objects:
            raise ConfigError(
                f"Expected n_objects of at most {self.sampler.n_objects}, for which spaces have room, got "
                f"{scenario.objects.n_objects}; give the sampler a world with as many."
            )
        shown = {"max_cycles": self.max_cycles, "render_mode": self.render_mode, "reads": self.interface.reads}
        return wrap_in_order(ForageEnv(scenario, **shown), given.wrappers)


DEFAULT_SCENARIO = "warehouse_small"
"""The world of environments that are told nothing about it."""
SAMPLED = "sampled"
"""Stands for the scenario in the id swarm_forage/sampled-v0, whose worlds a sampler draws."""


def plan_arena(
    scenario: WorldLike | None = None,
    *,
    sampler: ScenarioSampler | None = None,
    interface: GivenInterface = None,
    wrappers: Iterable[WrapperConfig | str] = (),
    max_cycles: int | None = None,
    render_mode: str | None = None,
    extra_reward: ExtraFunction | None = None,
    extra_observation: ExtraFunction | None = None,
    **overrides: Any,
) -> ArenaPlan:
    """Plan an arena.

    Args:
        scenario: Name of a preset, a complete configuration, a `World` or the file of one; default warehouse_small.
        sampler: Draws the world of each run, instead of `scenario`, `wrappers` and `overrides`.
        interface: What a learner sees and does, an `InterfaceConfig` or its fields by name; default full observations
            and continuous actions.
        wrappers: What disturbs the swarm, in any order: configurations, or words as on the command line
            ("population:death_per_tick=0.01").
        max_cycles: Ticks, not steps, until truncation; a step takes `decision_ticks` of the interface. Default the
            scenario's horizon.
        render_mode: None, "rgb_array" or "human"; see `ForageEnv`.
        extra_reward: Function of the world, called after each decision; returns (N,) in [-1, 1], what is added to the
            reward of each robot at work.
        extra_observation: Function of the world, called for each observation; returns (N, K) in [-1, 1], the columns
            of the last slice, "extra". It is called once in a first run to know K.
        overrides: Scenario fields by name (`n_robots=20`, `n_objects=100`, `caches="static"`).

    Raises:
        ConfigError: unknown preset, field, wrapper or choice of the interface, values that do not fit together, or a
            sampler beside what it decides.
        ExtraFunctionError: `extra_observation` failed, or returned something else.
    """
    disturbing = wrapper_configs(wrappers)
    if sampler is None:
        if scenario == SAMPLED:
            raise ConfigError(
                "Expected a sampler for swarm_forage/sampled-v0, got none; give sampler=ScenarioSampler(...)."
            )
        world = changed_world(scenario or DEFAULT_SCENARIO, overrides, disturbing)
    else:
        instance("sampler", sampler, ScenarioSampler, hint="; ScenarioSampler takes a table")
        given = ["scenario"] * (scenario not in (None, SAMPLED)) + ["wrappers"] * bool(disturbing) + list(overrides)
        if given:
            raise ConfigError(
                f"Expected either a sampler, which decides on the worlds, or {', '.join(given)}; got both. Write it "
                "into the sampler, where all worlds can share it. By id, make swarm_forage/sampled-v0."
            )
        world = World(sampler.largest)
    for name, function in (("extra_reward", extra_reward), ("extra_observation", extra_observation)):
        if function is not None and not callable(function):
            raise ConfigError(f"Expected {name} to be a function of the world, got {function!r}.")
    chosen = chosen_interface(interface).for_scenario(world.scenario)
    return ArenaPlan(
        world=world,
        sampler=sampler,
        interface=_with_extra_columns(chosen, world.scenario, extra_observation),
        max_cycles=max_cycles,
        render_mode=render_mode,
        extra_reward=extra_reward,
        extra_observation=extra_observation,
    )


def _with_extra_columns(
    interface: InterfaceConfig, scenario: ScenarioConfig, function: ExtraFunction | None
) -> InterfaceConfig:
    """Return the interface with as many extra columns as the function returns in a first run."""
    told = interface.extra_columns
    if function is None:
        if told:
            raise ConfigError(
                f"Expected the extra_observation of the {told} columns of the interface, got none; give the function "
                "again, in Python as extra_observation=..."
            )
        return interface
    env = ForageEnv(scenario)
    env.reset_batch(seed=0)
    n_columns = extra_columns(function, env.arena).shape[1]
    if told not in (0, n_columns):
        raise ConfigError(f"Expected extra_observation with {told} columns, as the interface says, got {n_columns}.")
    return replace(interface, extra_columns=n_columns)


def takes(make: Callable[Options, Any]) -> Callable[[Callable[..., Result]], Callable[Options, Result]]:
    """Let users see a function that hands all its arguments to `make` with the parameters of `make` and their meaning.

    So every option is listed and described in one place, whatever takes it.

    Example:
        @takes(plan_arena)
        def parallel_env(*args, **options): ...  # inspect.signature and help tell of `scenario`, `sampler` and so on
    """
    return partial(_told_as, make)


def constructor_takes(
    make: Callable[Options, Any],
) -> Callable[[Callable[..., None]], Callable[Concatenate[Any, Options], None]]:
    """Do what `takes` does for an `__init__`."""
    return partial(_told_as, make)


def _told_as(make: Callable[..., Any], function: Any) -> Any:
    own, made = inspect.signature(function), inspect.signature(make)
    first = [parameter for parameter in own.parameters.values() if parameter.name == "self"]
    further = [parameter for parameter in own.parameters.values() if parameter.kind is parameter.KEYWORD_ONLY]
    *shared, overrides = made.parameters.values()
    function.__signature__ = own.replace(parameters=[*first, *shared, *further, overrides])
    if function.__doc__ and make.__doc__:  # python -OO leaves them out
        _, _, meaning = inspect.cleandoc(make.__doc__).partition("\n\n")
        function.__doc__ = f"{inspect.cleandoc(function.__doc__)}\n\n{meaning}"
    return function
