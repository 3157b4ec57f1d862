"""World: a scenario, what disturbs the swarm in it, and a name that tells both. It may stand in a file.

scenario = "warehouse_small"           # the preset; this one if it is left out

[set]                                  # any scenario field
n_robots = 30

[wrappers.sensor_noise]
sigma = 0.03
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from swarm_forage_env._internal.fields import ConfigError, Name, Number, checked, instance, known_keys, table
from swarm_forage_env._internal.files import as_file_name, parse_toml
from swarm_forage_env._internal.wording import counted
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.differences import difference_words, differences, digest_of, is_resized
from swarm_forage_env.scenarios.overrides import field_sections
from swarm_forage_env.scenarios.presets import chosen_scenario, scenario
from swarm_forage_env.wrappers.registry import wrapper_configs, wrappers_from_mapping

if TYPE_CHECKING:
    from swarm_forage_env.wrappers.base import WrapperConfig
    from swarm_forage_env.wrappers.population import PopulationConfig

UNDISTURBED = "none"
"""Criterion of a world in which nothing is varied."""
SIZE = "population_size"
"""Criterion of worlds that differ in the number of robots."""
FILE = ".toml"
"""Ending of files of worlds."""
_DIGITS = 6
"""Hexadecimal digits in names of files; our choice: of a hundred worlds, two share theirs once in 3,000 times."""
_PRESET = "warehouse_small"
"""What a file without a preset changes."""
_SETTABLE = (*field_sections(), "density", "side_m")
"""What may stand under [set]."""


class _DefaultName(str):
    """A name that a world has made of what it is; a changed copy makes its own."""

    __slots__ = ()


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
    """Name for people; default made of scenario, number of robots and what is varied or differs from the preset."""

    def __post_init__(self) -> None:
        instance("scenario", self.scenario, ScenarioConfig, hint="; scenario(name) makes one")
        checked("criterion", self.criterion, Name)
        object.__setattr__(self, "value", checked("criterion_value", self.value, Number))
        ordered = tuple(sorted(wrapper_configs(self.wrappers), key=lambda config: config.stack_position))
        positions = [config.stack_position for config in ordered]
        if len(set(positions)) < len(positions):
            names = ", ".join(config.name for config in ordered)
            raise ConfigError(f"Expected each wrapper at most once, got {names}.")
        object.__setattr__(self, "wrappers", ordered)
        if not self._own_name:
            object.__setattr__(self, "name", _DefaultName(self._default_name()))

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

    @property
    def place(self) -> str:
        """Name of the scenario; of a world with a name of its own, such as that of its file, that with the scenario."""
        own = self._own_name
        return f"{own} ({self.scenario.name})" if own and own != self.scenario.name else self.scenario.name

    @property
    def changes(self) -> tuple[str, ...]:
        """What differs from the preset, the engine where it is another one, and disturbances with their levels."""
        disturbances = (config.in_words(self.scenario.dt_s) for config in self.wrappers)
        return (*difference_words(self.scenario), *disturbances)

    def title(self, *facts: str) -> str:
        """Name the world for people: "warehouse_small: 50 robots, with 3 objects, throttle: robots lose 20 % ...".

        Titles, tables and legends use this, so that no two worlds are called the same. `facts` are what a title says of
        the runs, such as how many robots there are; changes among them appear once.
        """
        changes = [words for words in self.changes if words not in facts]
        words = f"{self.place}: {', '.join(facts)}," if facts else self.place
        return f"{words} with {', '.join(changes)}" if changes else words.removesuffix(",")

    @property
    def file_name(self) -> str:
        """Name the world for files and folders: `warehouse_small`, `warehouse_small_20_robots`, `mine_100_s_3fd21a`.

        Sizes of swarms and lengths of runs other than the preset's are readable; six digits stand for all other
        differences and disturbances. Worlds of one name are equal, or differ only in what is read of their runs.
        """
        scenario = self.scenario
        found = differences(scenario)
        words = [as_file_name(self._own_name or scenario.name)]
        if is_resized(scenario):
            words.append(f"{self.n_robots}_robots")
        if "horizon_s" in found:
            words.append(f"{found.pop('horizon_s'):g}_s")
        found.pop("n_robots", None)
        wrappers = [{"wrapper": config.name, **config.to_mapping()} for config in self.wrappers]
        if found or wrappers:
            words.append(digest_of([found, wrappers], _DIGITS))
        return "_".join(words)

    @property
    def _own_name(self) -> str:
        """The name that was given; empty where it is the default."""
        return "" if isinstance(self.name, _DefaultName) else self.name

    def _default_name(self) -> str:
        """Scenario and robots, and what is varied, else what differs from the preset and disturbs the swarm."""
        words = [f"{self.scenario.name}, {counted(self.n_robots, 'robot')}"]
        if self.criterion not in (UNDISTURBED, SIZE):
            words.append(f"{self.criterion} {self.value:g}")
        elif self.criterion == SIZE:
            words += [config.in_words(self.scenario.dt_s) for config in self.wrappers]
        else:
            words += self.changes
        return ", ".join(words)


@dataclass(frozen=True, kw_only=True, slots=True)
class WorldDescription:
    """A preset, and what is other than in it: what a file or a command line says of a world."""

    preset: str
    fields: dict[str, Any] = field(default_factory=dict)
    """Scenario fields by name."""
    wrappers: "tuple[WrapperConfig, ...]" = ()
    name: str = ""
    """Of the file without its ending; empty for a preset."""

    def changed(self, fields: Mapping[str, Any], wrappers: "Iterable[WrapperConfig]") -> "WorldDescription":
        """Return it with other fields, and with wrappers in place of those of their kinds."""
        given = tuple(wrappers)
        left = (wrapper for wrapper in self.wrappers if wrapper.name not in {one.name for one in given})
        return replace(self, fields={**self.fields, **fields}, wrappers=(*given, *left))

    def world(self) -> World:
        """Return the world; raises ConfigError where it cannot be."""
        return World(scenario(self.preset, **self.fields), self.wrappers, name=self.name)


def described(name: str | Path) -> WorldDescription:
    """Return what a file says of a world, or the preset of that name, and look at no values of scenario fields.

    Raises:
        ConfigError: a file that is not readable, no TOML, has an unknown field, or tables that no wrapper takes;
            names the file.
    """
    path = Path(name)
    if path.suffix != FILE:
        return WorldDescription(preset=str(name))
    try:
        tables = parse_toml(path.read_text(encoding="utf-8"))
        outside = [name for name in tables if name in _SETTABLE]
        if outside:
            raise ConfigError(f"Expected {', '.join(outside)} under [set], where scenario fields go, got it above.")
        known_keys(tables, ("scenario", "set", "wrappers"), "key of a world")
        preset = checked("scenario", tables.get("scenario", _PRESET), Name)
        wrappers = wrappers_from_mapping(table("wrappers", tables.get("wrappers", {})))
        given = dict(table("set", tables.get("set", {})))
        known_keys(given, (*_SETTABLE, "quirks"), "scenario field")
    except OSError as error:
        raise ConfigError(f"Cannot use {path}: {error.strerror or error}.") from error
    except ValueError as error:
        raise ConfigError(f"Cannot use {path}: {error}") from error
    return WorldDescription(preset=preset, fields=given, wrappers=wrappers, name=path.stem)


def read_world(file: str | Path) -> World:
    """Read a world from its file, as `--scenario FILE.toml` does.

    Raises:
        ConfigError: as `described`, or the scenario cannot be; names the file.
    """
    if Path(file).suffix != FILE:
        raise ConfigError(f"Expected the file of a world, which ends with {FILE}, got {file}.")
    told = described(file)
    try:
        return told.world()
    except ConfigError as error:
        raise ConfigError(f"Cannot use {file}: {error}") from error


WorldLike: TypeAlias = World | ScenarioConfig | str | Path
"""A world, or a file of one (.toml); a scenario's configuration or the name of a preset is one without wrappers."""


def world_of(given: WorldLike) -> World:
    """Return what was given as a world.

    Raises:
        ConfigError: an unknown preset, a file that cannot be used, or neither a world, a configuration nor a name.
    """
    if isinstance(given, World):
        return given
    if isinstance(given, Path) or (isinstance(given, str) and given.endswith(FILE)):
        return read_world(given)
    return World(scenario(given) if isinstance(given, str) else given)


def changed_world(given: WorldLike, fields: Mapping[str, Any], wrappers: "Iterable[WrapperConfig]") -> World:
    """Return a world with fields of its scenario overridden, and further wrappers; of a file or preset as `changed`.

    Raises:
        ConfigError: as `world_of`, an unknown field, or values or wrappers that do not fit together.
    """
    if isinstance(given, str | Path):
        return described(given).changed(fields, wrappers).world()
    world = world_of(given)
    return replace(world, scenario=chosen_scenario(world.scenario, fields), wrappers=(*world.wrappers, *wrappers))
