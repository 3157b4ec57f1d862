"""ScenarioSampler: a distribution of worlds as data, one of which is drawn for each run of a learner.

Example, as a table of a TOML file and as `ScenarioSampler.from_mapping` takes it:

    [scenario]                                   # fields of all worlds
    n_robots = { log_uniform = [8, 512] }
    density = 0.05

    [wrappers.throttle]                          # what may disturb all of them
    probability = 0.25
    waveform = "constant"
    amplitude = { uniform = [0.1, 0.4] }

    [[worlds]]
    scenario = { preset = "warehouse_small", nest_progress = 0.05 }

    [[worlds]]
    scenario = { preset = "search_and_rescue" }
    weight = 2                                   # drawn twice as often as the other
"""

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain
from typing import Any, get_type_hints

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, as_whole, instance, known_keys, number, table
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.layout import BUILT_IN_SLICES, LayoutRow
from swarm_forage_env.contract.policy import layout_for
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.config import ScenarioConfig, from_mapping, to_mapping
from swarm_forage_env.scenarios.distributions import (
    KINDS,
    corners,
    draw_fields,
    drawn_names,
    plain_fields,
    read_fields,
)
from swarm_forage_env.scenarios.floor import CELL_M
from swarm_forage_env.scenarios.overrides import field_types
from swarm_forage_env.scenarios.presets import chosen_scenario
from swarm_forage_env.world.placement import static_cache_centres
from swarm_forage_env.wrappers.registry import wrapper_config_class, wrappers_from_mapping
from swarm_forage_env.wrappers.world import World

MOST_CORNERS = 1024
"""Combinations of ends that a world may have. All are built when the sampler is made; our choice: about a second."""
_PRESET, _PROBABILITY = "preset", "probability"
_GRAINS = {"width_m": CELL_M, "height_m": CELL_M, "side_m": CELL_M, "horizon_s": 1.0, "interval_s": 1.0}
"""Fields that only take multiples of something; seconds are whole, and so a multiple of usual ticks (our choice)."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SampledWorld:
    """Worlds of one kind: a preset or a configuration, with fields that are fixed or drawn.

    Raises:
        ConfigError: no preset, a distribution that is none, or a weight that is not above 0.
    """

    scenario: str | ScenarioConfig | Mapping[str, Any] = field(hash=False)
    """Name of a preset, a complete configuration, or a table: `preset` (either of the two) and fields by name, each a
    value or a distribution (`scenarios.distributions`). It is kept as such a table."""
    wrappers: Mapping[str, Mapping[str, Any]] = field(default_factory=dict, hash=False)
    """What may disturb the swarm: tables of fields by the name of the wrapper, values or distributions, and in each the
    `probability` that it is there, 1 where nothing is said."""
    weight: float = 1.0
    """How often these worlds are drawn, relative to the others."""

    def __post_init__(self) -> None:
        number("the weight of a world", self.weight, above=0.0)
        object.__setattr__(self, "scenario", _scenario_table(self.scenario))
        object.__setattr__(self, "wrappers", _wrapper_tables(self.wrappers))

    def to_mapping(self) -> dict[str, Any]:
        """Return the world as plain values."""
        assert isinstance(self.scenario, Mapping), "the constructor made it one"
        plain = plain_fields({name: value for name, value in self.scenario.items() if name != _PRESET})
        preset = self.scenario[_PRESET]
        named = {_PRESET: to_mapping(preset) if isinstance(preset, ScenarioConfig) else preset}
        return {"scenario": named | plain, "wrappers": plain_fields(self.wrappers), "weight": self.weight}


def _scenario_table(given: Any) -> dict[str, Any]:
    if isinstance(given, str | ScenarioConfig):
        return {_PRESET: given}
    fields = dict(table("the scenario of a world", given))
    preset = fields.pop(_PRESET, None)
    if preset is None:
        return {_PRESET: from_mapping(ScenarioConfig, fields, where="scenario.")}
    if isinstance(preset, Mapping):
        preset = from_mapping(ScenarioConfig, preset, where="scenario.preset.")
    return {_PRESET: preset, **_scenario_fields(fields)}


def _scenario_fields(given: Mapping[str, Any]) -> dict[str, Any]:
    known_keys(given, _field_names(), "scenario field")
    fields = read_fields(given)
    for name, value in fields.items():
        if isinstance(value, Mapping):  # no field is a table, so this is a misspelt distribution
            known_keys(value, KINDS, "distribution", prefix=f"{name}.")
    return fields


def _wrapper_tables(given: Any) -> dict[str, dict[str, Any]]:
    tables = {name: read_fields(table(f"the settings of wrapper {name}", fields)) for name, fields in given.items()}
    for name, fields in tables.items():
        wrapper_config_class(name)  # refuses unknown names
        number(f"the probability of wrapper {name}", fields.get(_PROBABILITY, 1.0), at_least=0.0, at_most=1.0)
    return tables


@dataclass(frozen=True, kw_only=True)
class ScenarioSampler:
    """A distribution of worlds. Each reset of an environment that was made with it draws one, by the seed of the run.

    Worlds may differ in everything but the columns of an observation. Every combination of ends and choices is built
    when the sampler is made.

    Attributes:
        n_robots: Most robots of a world; batches have as many rows for each arena.
        n_objects: Most objects of a world.
        largest: A world with the most robots; it stands for all where spaces and layouts are asked for.

    Raises:
        ConfigError: no worlds, one that cannot be built, or worlds with different columns of observations.
    """

    worlds: tuple[SampledWorld, ...]
    scenario: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """Scenario fields of all worlds, values or distributions; those of a world go before them."""
    wrappers: Mapping[str, Mapping[str, Any]] = field(default_factory=dict, hash=False)
    """Wrappers of all worlds, as in `SampledWorld`; a world that names the same wrapper has its own instead."""

    def __post_init__(self) -> None:
        if not isinstance(self.worlds, tuple | list) or not self.worlds:  # pyright: ignore[reportUnnecessaryIsInstance] - from users
            raise ConfigError(f"Expected worlds to be one or more SampledWorld, got {self.worlds!r}.")
        for world in self.worlds:
            instance("each of worlds", world, SampledWorld)
        object.__setattr__(self, "worlds", tuple(self.worlds))
        object.__setattr__(self, "scenario", _scenario_fields(table("scenario", self.scenario)))
        object.__setattr__(self, "wrappers", _wrapper_tables(table("wrappers", self.wrappers)))
        built = list(chain.from_iterable(self._corners(number) for number in range(len(self.worlds))))
        largest = max(built, key=lambda config: config.robots.n_robots)
        _check_columns(built, largest)
        object.__setattr__(self, "largest", largest)
        object.__setattr__(self, "n_robots", largest.robots.n_robots)
        object.__setattr__(self, "n_objects", max(config.objects.n_objects for config in built))
        object.__setattr__(self, "corners", tuple(built))

    largest: ScenarioConfig = field(init=False, repr=False, compare=False)
    n_robots: int = field(init=False, repr=False, compare=False)
    n_objects: int = field(init=False, repr=False, compare=False)
    corners: tuple[ScenarioConfig, ...] = field(init=False, repr=False, compare=False)
    """The scenarios that bound the distribution: all combinations of the ends of ranges and of choices."""

    def draw(self, rng: np.random.Generator, share: float | None = None) -> World:
        """Return a world.

        Args:
            rng: Where chance comes from; `world_of` takes that of a run.
            share: Which of the worlds, as a place in [0, 1) among their weights; None = by chance, too.

        Raises:
            ConfigError: the values that were drawn do not fit together, although all combinations of ends do.
        """
        weights = np.cumsum([world.weight for world in self.worlds])
        by_chance = rng.random()
        chosen = int(np.searchsorted(weights, (by_chance if share is None else share) * weights[-1], side="right"))
        fields, wrappers = self._tables(chosen)
        values = draw_fields(fields, _grains(fields), rng)
        drawn: dict[str, Any] = {}
        for name, settings in sorted(wrappers.items()):  # a wrapper draws whether it is there or not
            probability = settings.get(_PROBABILITY, 1.0)
            is_there = rng.random() < probability
            filled = draw_fields(_settings(settings), _wrapper_grains(name), rng)
            if is_there:
                drawn[name] = filled
        try:
            return World(self._built(chosen, values), wrappers_from_mapping(drawn))
        except ConfigError as error:
            raise ConfigError(
                f"{self._title(chosen)} cannot be, as it was drawn with {_said(fields, values)}: {error}"
            ) from error

    def world_of(self, seed: int, share: float | None = None) -> World:
        """Return the world of the run with this seed; see `draw`.

        Raises:
            ConfigError: no whole number from 0 up as seed, a share outside of [0, 1), or see `draw`.
        """
        seed = as_whole("seed", seed, at_least=0)
        if share is not None:
            number("share", share, at_least=0.0, below=1.0)
        return self.draw(stream_rng(seed, Stream.SCENARIO), share)

    def shares(self, n_arenas: int) -> list[float | None]:
        """Return the `share` of `draw` for each arena of a batch, so that all kinds of worlds are there in every step.

        Each arena then keeps to one kind, and there are as many of a kind as its weight says. A few arenas that each
        draw any kind would often lack one for a whole long run, and a learner forgets (our choice). Where there are too
        few arenas for all kinds, each draws any.
        """
        places = (np.arange(n_arenas) + 0.5) / n_arenas
        weights = np.cumsum([world.weight for world in self.worlds])
        kinds = np.searchsorted(weights, places * weights[-1], side="right")
        if len(set(kinds.tolist())) < len(self.worlds) or len(self.worlds) == 1:
            return [None] * n_arenas
        return places.tolist()

    def to_mapping(self) -> dict[str, Any]:
        """Return the sampler as plain values, ready for JSON; `from_mapping` reads it back."""
        return {
            "scenario": plain_fields(self.scenario),
            "wrappers": plain_fields(self.wrappers),
            "worlds": [world.to_mapping() for world in self.worlds],
        }

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> "ScenarioSampler":
        """Build a sampler from nested plain values, as a TOML or JSON file has them.

        Raises:
            ConfigError: unknown keys, or what the constructors refuse.
        """
        values = dict(table("the sampler", mapping))
        known_keys(values, [item.name for item in dataclasses.fields(cls) if item.init], prefix="sampler.")
        worlds = values.get("worlds")
        if not isinstance(worlds, list | tuple):
            raise ConfigError(f"Expected the worlds of a sampler as a list of tables, [[worlds]], got {worlds!r}.")
        names = [item.name for item in dataclasses.fields(SampledWorld)]
        for world in worlds:
            known_keys(table("a world of the sampler", world), names, prefix="worlds.")
            if "scenario" not in world:
                raise ConfigError(f"Missing key 'scenario' in the world {world!r} of a sampler.")
        return cls(**{**values, "worlds": tuple(SampledWorld(**world) for world in worlds)})

    def _tables(self, number: int) -> tuple[dict[str, Any], dict[str, Mapping[str, Any]]]:
        """Return the fields of a world, its preset aside, and its wrappers, with what all worlds share."""
        world = self.worlds[number]
        assert isinstance(world.scenario, Mapping), "the constructor made it one"
        own = {name: value for name, value in world.scenario.items() if name != _PRESET}
        return {**self.scenario, **own}, {**self.wrappers, **world.wrappers}

    def _built(self, number: int, values: Mapping[str, Any]) -> ScenarioConfig:
        table = self.worlds[number].scenario
        assert isinstance(table, Mapping), "the constructor made it one"
        config = chosen_scenario(table[_PRESET], values)
        if config.caches == "static":
            static_cache_centres(config)  # an environment would refuse caches without room, but only once it is drawn
        return config

    def _title(self, number: int) -> str:
        table = self.worlds[number].scenario
        assert isinstance(table, Mapping), "the constructor made it one"
        preset = table[_PRESET]
        return f"World {number + 1} of the sampler ({preset.name if isinstance(preset, ScenarioConfig) else preset})"

    def _corners(self, number: int) -> Iterator[ScenarioConfig]:
        """Yield the scenarios that bound a world; raises ConfigError where one of them, or a wrapper, cannot be."""
        fields, wrappers = self._tables(number)
        title = self._title(number)
        try:
            bounds = list(corners(fields, _grains(fields), at_most=MOST_CORNERS))
        except ConfigError as error:
            raise ConfigError(f"{title} cannot be drawn: {error}") from error
        smallest: ScenarioConfig | None = None
        for values in bounds:
            try:
                config = self._built(number, values)
            except ConfigError as error:
                raise ConfigError(f"{title} cannot be with {_said(fields, values)}: {error}") from error
            if smallest is None or config.robots.n_robots < smallest.robots.n_robots:
                smallest = config
            yield config
        assert smallest is not None, "a product has a member"
        for name, settings in wrappers.items():
            if settings.get(_PROBABILITY, 1.0) > 0.0:
                _check_wrapper(title, name, _settings(settings), smallest)


def _check_wrapper(title: str, name: str, settings: Mapping[str, Any], smallest: ScenarioConfig) -> None:
    """Refuse a wrapper that cannot be, at one of its ends, in the world with the fewest robots."""
    try:
        bounds = list(corners(settings, _wrapper_grains(name), at_most=MOST_CORNERS))
    except ConfigError as error:
        raise ConfigError(f"The wrapper {name} of {title} cannot be drawn: {error}") from error
    env = ForageEnv(smallest)
    for values in bounds:
        try:
            (config,) = wrappers_from_mapping({name: values})
            config.wrap(env)
        except ConfigError as error:
            raise ConfigError(
                f"The wrapper {name} of {title} cannot be with {_said(settings, values)}: {error}"
            ) from error


def _check_columns(built: list[ScenarioConfig], largest: ScenarioConfig) -> None:
    """Refuse worlds whose observations have other columns than those of the largest."""
    expected = columns_of(largest)
    for config in built:
        if columns_of(config) != expected:
            raise ConfigError(
                f"Expected worlds with the same columns of observations, got {_said_columns(expected)} in "
                f"{largest.name} and {_said_columns(columns_of(config))} in {config.name}; give all worlds the same "
                "neighbours_seen, neighbour_range_m and message_size."
            )


def columns_of(config: ScenarioConfig) -> tuple[LayoutRow, ...]:
    """Return the slices that a scenario adds to every observation: what worlds of one policy have in common.

    The slices that all scenarios have differ in scale only, by the size of the arena and the number of objects.
    """
    return tuple(part.row for part in layout_for(config) if part.name not in BUILT_IN_SLICES)


def _said_columns(rows: tuple[LayoutRow, ...]) -> str:
    return "; ".join(f"{name} ({meaning})" for name, _, _, meaning in rows) or "those of every scenario"


def _field_names() -> tuple[str, ...]:
    return (*field_types(), "density", "side_m", "quirks")


def _grains(fields: Mapping[str, Any]) -> dict[str, float]:
    types = field_types()
    whole = {name: 1 for name in fields if types.get(name) is int}
    return {**whole, **{name: _GRAINS[name] for name in fields if name in _GRAINS}}


def _wrapper_grains(name: str) -> dict[str, float]:
    """Return the grains of a wrapper's fields: 1 for whole numbers."""
    return {key: 1 for key, kind in get_type_hints(wrapper_config_class(name)).items() if kind in (int, int | None)}


def _settings(wrapper: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in wrapper.items() if name != _PROBABILITY}


def _said(fields: Mapping[str, Any], values: Mapping[str, Any]) -> str:
    """Say the values of the fields that are drawn, for messages."""
    said: list[str] = []
    for name in drawn_names(fields):
        value: Any = values
        for key in name.split("."):
            value = value[int(key)] if isinstance(value, tuple) else value[key]
        said.append(f"{name} = {value}")
    return ", ".join(said) or "these values"
