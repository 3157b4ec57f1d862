"""ScenarioSampler: a distribution of worlds as data, one of which is drawn for each run of a learner.

As a table of a TOML file:

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
    scenario = "search_and_rescue"               # as { preset = "search_and_rescue" }
    weight = 2                                   # drawn twice as often as the other
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, cast, get_type_hints

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, known_keys, number, read, table
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.layout import BUILT_IN_SLICES, LayoutRow
from swarm_forage_env.contract.policy import layout_for
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M
from swarm_forage_env.scenarios.overrides import field_types
from swarm_forage_env.scenarios.presets import chosen_scenario
from swarm_forage_env.world.placement import static_cache_centres
from swarm_forage_env.wrappers.base import wrap_in_order
from swarm_forage_env.wrappers.registry import wrapper_config_class, wrappers_from_mapping
from swarm_forage_env.wrappers.world import World

_KINDS = ("uniform", "log_uniform", "choice")
_GRAINS = dict.fromkeys(("width_m", "height_m", "side_m"), CELL_M) | dict.fromkeys(("horizon_s", "interval_s"), 1.0)
"""Fields that only take multiples of something; seconds are whole, and so a multiple of usual ticks (our choice)."""
_Draw = Callable[[], float]
"""Returns the next share of the draws, in [0, 1]."""


@dataclass(frozen=True)
class ScenarioSampler:
    """A distribution of worlds. Each reset of an environment that was made with it draws one, by the seed of the run.

    A field is a value, or `{uniform = [low, high]}`, `{log_uniform = [low, high]}` (ends included, whole numbers stay
    whole) or `{choice = [value, ...]}`. What a world says goes before what all share. `preset` is a name, or a complete
    configuration as a table; `probability` says how often a wrapper is there, 1 where nothing is said. Worlds may
    differ in everything but the columns of an observation.

    Attributes:
        table: As above.
        ends: Each world with the low and with the high ends of its ranges, and the first and the last of its choices.
        largest: A world with the most robots; it stands for all where spaces and layouts are asked for.
        n_robots: Most robots of a world; batches have as many rows for each arena.
        n_objects: Most objects of a world.

    Raises:
        ConfigError: unknown keys, a distribution that is none, one of `ends` that cannot be built, or worlds with
            different columns of observations. What lies between may still be refused when it is drawn.
    """

    table: Mapping[str, Any] = field(hash=False)
    ends: tuple[ScenarioConfig, ...] = field(init=False, repr=False, compare=False)
    largest: ScenarioConfig = field(init=False, repr=False, compare=False)
    n_robots: int = field(init=False, repr=False, compare=False)
    n_objects: int = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        known_keys(table("the sampler", self.table), ("scenario", "wrappers", "worlds"), prefix="sampler.")
        worlds = self.table.get("worlds")
        if not isinstance(worlds, list | tuple) or not worlds:
            raise ConfigError(f"Expected the worlds of a sampler as a list of tables, [[worlds]], got {worlds!r}.")
        for world in cast("list[Any]", worlds):
            known_keys(table("a world of the sampler", world), ("scenario", "wrappers", "weight"), prefix="worlds.")
            number("the weight of a world", world.get("weight", 1.0), above=0.0)
        ends: list[ScenarioConfig] = []
        for n in range(len(self._worlds)):
            for share in (0.0, 1.0):
                world = self._world(n, lambda share=share: share, everything=True)
                wrap_in_order(ForageEnv(world.scenario), world.wrappers)  # refuses wrappers that do not fit
                ends.append(world.scenario)
        largest = max(ends, key=lambda scenario: scenario.robots.n_robots)
        for scenario in ends:
            if columns_of(scenario) != columns_of(largest):
                raise ConfigError(
                    f"Expected worlds with the same columns of observations, but {scenario.name} and {largest.name} "
                    "have others; give all worlds the same neighbours_seen, neighbour_range_m and message_size."
                )
        n_objects = max(scenario.objects.n_objects for scenario in ends)
        found = {"ends": tuple(ends), "largest": largest, "n_robots": largest.robots.n_robots, "n_objects": n_objects}
        for name, value in found.items():
            object.__setattr__(self, name, value)

    @property
    def _worlds(self) -> list[dict[str, Any]]:
        return self.table["worlds"]

    @property
    def _bounds(self) -> np.ndarray:
        """Where each world ends in [0, 1], as wide as its weight says."""
        weights = np.cumsum([world.get("weight", 1.0) for world in self._worlds])
        return weights / weights[-1]

    def world_of(self, seed: int, share: float | None = None) -> World:
        """Return the world of the run with this seed.

        Args:
            seed: Of the run.
            share: Which of the worlds, as a place in [0, 1) among their weights; None = by chance, too.

        Raises:
            ConfigError: values that do not fit together.
        """
        rng = stream_rng(seed, Stream.SCENARIO)
        by_chance = rng.random()
        n = int(np.searchsorted(self._bounds, by_chance if share is None else share, side="right"))
        return self._world(n, rng.random)

    def _world(self, n: int, draw: _Draw, *, everything: bool = False) -> World:
        """Return world number `n`, with values drawn in the order of the tables; `everything` = with all wrappers."""
        own = self._worlds[n].get("scenario")
        fields = {**self.table.get("scenario", {}), **(own if isinstance(own, Mapping) else {"preset": own})}
        preset = fields.pop("preset", None)
        values: dict[str, Any] = {}
        try:
            if isinstance(preset, Mapping):
                preset = read(ScenarioConfig, preset, "scenario.preset")
            if preset is None:
                raise ConfigError("Expected a scenario with a preset, got none.")
            values = _values(fields, draw)
            scenario = chosen_scenario(preset, values)
            if scenario.caches == "static":
                static_cache_centres(scenario)  # an environment would refuse caches without room
            drawn: dict[str, Any] = {}
            tables = {**self.table.get("wrappers", {}), **self._worlds[n].get("wrappers", {})}
            for name, settings in sorted(tables.items()):  # a wrapper draws whether it is there or not
                probability = table(f"the settings of wrapper {name}", settings).get("probability", 1.0)
                number(f"the probability of wrapper {name}", probability, at_least=0.0, at_most=1.0)
                is_there = draw() < probability
                filled = _values({key: settings[key] for key in settings if key != "probability"}, draw, name)
                if is_there or (everything and probability > 0.0):
                    drawn[name] = filled
            return World(scenario, wrappers_from_mapping(drawn))
        except ConfigError as error:
            said = ", ".join(f"{name} = {value}" for name, value in values.items()) or "what it says"
            raise ConfigError(f"World {n + 1} of the sampler cannot be with {said}: {error}") from error

    def shares(self, n_arenas: int) -> list[float | None]:
        """Return the `share` of `world_of` for each arena of a batch, so that all kinds of worlds are in every step.

        Each arena then keeps to one kind, and there are as many of a kind as its weight says. A few arenas that each
        draw any kind would often lack one for a whole long run, and a learner forgets (our choice). Where there are too
        few arenas for all kinds, each draws any.
        """
        places = (np.arange(n_arenas) + 0.5) / n_arenas
        kinds = np.unique(np.searchsorted(self._bounds, places, side="right"))
        return [None] * n_arenas if len(kinds) < len(self._worlds) or len(kinds) == 1 else places.tolist()


def columns_of(config: ScenarioConfig) -> tuple[LayoutRow, ...]:
    """Return the slices that a scenario adds to every observation: what worlds of one policy have in common.

    The slices that all scenarios have differ in scale only, by the size of the arena and the number of objects.
    """
    return tuple(part.row for part in layout_for(config) if part.name not in BUILT_IN_SLICES)


def _values(fields: Mapping[str, Any], draw: _Draw, wrapper: str | None = None) -> dict[str, Any]:
    """Return fields of the scenario or of a wrapper with values for their distributions, drawn in this order."""
    types = field_types() if wrapper is None else get_type_hints(wrapper_config_class(wrapper))
    grains = {name: 1.0 for name in fields if types.get(name) in (int, int | None)} | _GRAINS
    return {
        name: _tupled(_at(name, value, draw(), grains.get(name)) if _is_drawn(value) else value)
        for name, value in fields.items()
    }


def _is_drawn(value: Any) -> bool:
    return isinstance(value, Mapping) and len(value) == 1 and next(iter(cast("dict[str, Any]", value))) in _KINDS


def _at(name: str, drawn: Mapping[str, Any], share: float, grain: float | None) -> Any:
    """Return the value below which a share of the draws lies, a multiple of `grain` (None = any number)."""
    ((kind, values),) = drawn.items()
    if not isinstance(values, list | tuple) or not values:
        raise ConfigError(f"Expected {name} with a list for {kind}, got {values!r}.")
    values = cast("list[Any]", values)
    if kind == "choice":
        return values[min(int(share * len(values)), len(values) - 1)]
    low, high = _range(name, kind, values, grain)
    if grain is None:
        value = low * (high / low) ** share if kind == "log_uniform" else low + share * (high - low)
        return min(max(value, low), high)
    first, last = round(low / grain), round(high / grain)
    if kind == "log_uniform":  # each whole number stands for the range from it to the next
        step = math.floor(first * ((last + 1) / first) ** share)
    else:
        step = first + math.floor(share * (last + 1 - first))
    step = min(max(step, first), last)
    return step if grain == 1.0 else round(step * grain, 9)


def _range(name: str, kind: str, values: list[Any], grain: float | None) -> tuple[float, float]:
    """Return both ends of a range, of whole multiples of `grain`."""
    for value in values:
        number(f"both ends of {name}", value, **({"above": 0.0} if kind == "log_uniform" else {}))
        if grain is not None and abs(value / grain - round(value / grain)) > 1e-9:
            raise ConfigError(f"Expected both ends of {name} to be multiples of {grain:g}, got {values}.")
    if len(values) != 2 or values[0] > values[1]:
        raise ConfigError(f"Expected {name} as {kind} = [low, high], got {values}.")
    return float(values[0]), float(values[1])


def _tupled(value: Any) -> Any:
    return tuple(map(_tupled, cast("list[Any]", value))) if isinstance(value, list) else value
