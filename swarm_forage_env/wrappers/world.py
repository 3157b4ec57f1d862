"""World: a scenario, what disturbs the swarm in it, and a name that tells both."""

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, TypeAlias

from swarm_forage_env._internal.fields import ConfigError, instance, number, text
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.presets import scenario

if TYPE_CHECKING:
    from swarm_forage_env.wrappers.base import WrapperConfig
    from swarm_forage_env.wrappers.population import PopulationConfig

UNDISTURBED = "none"
"""Criterion of a world in which nothing is varied."""
SIZE = "population_size"
"""Criterion of worlds that differ in the number of robots."""


@dataclass(frozen=True, slots=True)
class World:
    """Where a policy acts.

    Example: `World(scenario("warehouse_small"), (parse_wrapper("throttle:waveform=constant,amplitude=0.2"),))`.

    Raises:
        ConfigError: `scenario` is no ScenarioConfig, two wrappers of one kind, or a value that is no number.
    """

    scenario: ScenarioConfig
    wrappers: "tuple[WrapperConfig, ...]" = ()
    """Wrappers between recorder and environment, given in any order and kept in the documented stack order."""
    criterion: str = field(default=UNDISTURBED, kw_only=True)
    """What is varied from world to world; `UNDISTURBED` where this is the only one."""
    value: float = field(default=0.0, kw_only=True)
    """Place of this world on that axis."""
    name: str = field(default="", kw_only=True, compare=False)
    """Name for people; default made of scenario, number of robots and what is varied."""

    def __post_init__(self) -> None:
        instance("scenario", self.scenario, ScenarioConfig)
        text("criterion", self.criterion)
        number("criterion_value", self.value)
        object.__setattr__(self, "value", float(self.value))
        ordered = tuple(sorted(self.wrappers, key=lambda config: config.stack_position))
        positions = [config.stack_position for config in ordered]
        if len(set(positions)) < len(positions):
            names = ", ".join(config.name for config in ordered)
            raise ConfigError(f"Expected each wrapper at most once, got {names}.")
        object.__setattr__(self, "wrappers", ordered)
        if not self.name:
            object.__setattr__(self, "name", self._default_name())

    @property
    def n_robots(self) -> int:
        """Swarm size N."""
        return self.scenario.robots.n_robots

    @property
    def population(self) -> "PopulationConfig | None":
        """Rates at which robots come and go, None where nobody does."""
        from swarm_forage_env.wrappers.population import PopulationConfig  # late: it loads the environment

        return next((config for config in self.wrappers if isinstance(config, PopulationConfig)), None)

    def with_caches(self, caches: str | None) -> "World":
        """Return the world with such caches; None leaves it as it is."""
        if caches is None or caches == self.scenario.caches:
            return self
        return replace(self, scenario=replace(self.scenario, caches=caches))

    def _default_name(self) -> str:
        """Scenario and robots, and what is varied, else what disturbs the swarm."""
        words = [f"{self.scenario.name}, {self.n_robots} robot{'s' if self.n_robots != 1 else ''}"]
        if self.criterion not in (UNDISTURBED, SIZE):
            words.append(f"{self.criterion} {self.value:g}")
        else:
            words += [config.name for config in self.wrappers]
        return ", ".join(words)


WorldLike: TypeAlias = World | ScenarioConfig | str
"""A world; the configuration of a scenario or the name of a preset is one without wrappers."""


def world_of(given: WorldLike) -> World:
    """Return what was given as a world.

    Raises:
        ConfigError: an unknown preset, or neither a world, a configuration nor a name.
    """
    if isinstance(given, World):
        return given
    return World(scenario(given) if isinstance(given, str) else given)
