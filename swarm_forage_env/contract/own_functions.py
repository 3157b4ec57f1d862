"""Sensors and rewards of users: functions of the world's arrays, found by name.

    def nest_distance(world):
        return np.linalg.norm(world.swarm.position - world.config.arena.nest_centre_m, axis=1) / 50.0

    register_sensor("nest_distance", nest_distance, meaning="distance to the nest / 50 m")
    env = parallel_env("warehouse_small", own_sensors=("nest_distance",))

A scenario names them, so that every view, stored run and trained policy tells which it is about. Other processes find a
name by the entry point of an installed package, as they find a policy. So a file can name nothing but what is installed
or registered.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeAlias

import numpy as np

from swarm_forage_env._internal.faults import in_words
from swarm_forage_env._internal.fields import ConfigError, instance, text, whole
from swarm_forage_env._internal.wording import suggestion
from swarm_forage_env.contract.layout import BUILT_IN_SLICES, OPTIONAL_SLICES, LayoutRow

SENSOR_ENTRY_POINTS = "swarm_forage_env.sensors"
"""Entry-point group under which installed packages offer objects of the class `OwnSensor`."""
REWARD_ENTRY_POINTS = "swarm_forage_env.rewards"
"""Entry-point group under which installed packages offer functions for `own_reward`."""
MAX_COLUMNS = 1024
"""Most columns of one sensor (our choice: an observation of the package itself has about 140)."""

OwnReward: TypeAlias = Callable[[Any], np.ndarray]
"""Takes the world (`world.arena.ForagingArena`), returns (N,) one number per robot."""


class OwnFunctionError(ValueError):
    """A function of the user that cannot be loaded, failed, or returned what no observation or reward can be."""


@dataclass(frozen=True, kw_only=True, slots=True)
class OwnSensor:
    """Further columns of an observation.

    Raises:
        ConfigError: a name that a slice of the package has, or a number of columns out of range.
    """

    name: str
    """Name of the slice in the layout."""
    function: Callable[[Any], np.ndarray]
    """Takes the world (`world.arena.ForagingArena`: `swarm`, `objects`, `caches`, `events`, `config`, `tick`), returns
    (N, n_columns) or, with one column, (N,), all in [-1, 1]. It only reads. Rows of absent robots are not used."""
    n_columns: int = 1
    meaning: str = ""
    """What the columns hold, for people."""

    def __post_init__(self) -> None:
        text("the name of a sensor", self.name)
        if not self.name.isidentifier() or self.name in (*BUILT_IN_SLICES, *OPTIONAL_SLICES):
            raise ConfigError(
                f"Expected a name of its own for a sensor, made of letters, digits and _, got {self.name!r}."
            )
        whole("n_columns", self.n_columns, at_least=1, at_most=MAX_COLUMNS)
        instance("meaning", self.meaning, str)
        if not callable(self.function):
            raise ConfigError(f"Expected a function of the world for sensor {self.name!r}, got {self.function!r}.")

    @property
    def row(self) -> LayoutRow:
        """Its line in the table of a layout."""
        return self.name, (1.0,) * self.n_columns, "", self.meaning or f"own sensor {self.name}"

    def read(self, world: Any) -> np.ndarray:
        """Return the readings, (N, n_columns).

        Raises:
            OwnFunctionError: the function failed, or returned another shape or a value that is not in [-1, 1].
        """
        n_robots = len(world.swarm.active)
        values = called(self.function, world, f"sensor {self.name!r}")
        if values.shape not in {(n_robots, self.n_columns), (n_robots,) if self.n_columns == 1 else ()}:
            raise OwnFunctionError(
                f"Expected sensor {self.name!r} to return shape (n_robots, n_columns) = {n_robots, self.n_columns}, "
                f"got {values.shape}."
            )
        values = values.reshape(n_robots, self.n_columns)
        of_present = values[world.swarm.present]
        if not (np.abs(of_present) <= 1.0).all():
            wrong = of_present[~(np.abs(of_present) <= 1.0)]
            raise OwnFunctionError(
                f"Expected sensor {self.name!r} to return numbers in [-1, 1], got {wrong[0]}; divide by the largest "
                "value that can occur, or clip."
            )
        return values


def called(function: Callable[[Any], Any], world: Any, what: str) -> np.ndarray:
    """Return the numbers that a function of the user says of the world; `what` names it in errors.

    Raises:
        OwnFunctionError: it failed, or returned no real numbers.
    """
    try:
        values = np.asarray(function(world))
    except Exception as error:
        raise OwnFunctionError(f"The function of {what} failed with {in_words(error)}") from error
    if values.dtype.kind not in "biuf":
        raise OwnFunctionError(f"Expected {what} to return real numbers, got an array of {values.dtype}.")
    return values


_SENSORS: dict[str, OwnSensor] = {}
_REWARDS: dict[str, OwnReward] = {}
"""What was registered in this process."""


def register_sensor(
    name: str, function: Callable[[Any], np.ndarray], *, n_columns: int = 1, meaning: str = ""
) -> OwnSensor:
    """Make further columns of observations known under a name, in this process; the name may be given anew.

    Scenarios then take it: `own_sensors=(name,)`. An environment looks the name up at each reset. Worker processes
    start afresh and know only entry points (`SENSOR_ENTRY_POINTS`).

    Args:
        name: Name of the new slice.
        function: See `OwnSensor`.
        n_columns: Columns that it returns.
        meaning: What they hold.

    Raises:
        ConfigError: see `OwnSensor`.
    """
    sensor = OwnSensor(name=name, function=function, n_columns=n_columns, meaning=meaning)
    _SENSORS[name] = sensor
    return sensor


def register_reward(name: str, function: OwnReward) -> None:
    """Make a reward known under a name, in this process; the name may be given anew. See `register_sensor`.

    Scenarios then take it: `own_reward=name`. What the function returns, (N,), is added to the terms of the scenario's
    other weights; robots that are not at work get nothing.

    Raises:
        ConfigError: an empty name, or no function.
    """
    text("the name of a reward", name)
    if not callable(function):
        raise ConfigError(f"Expected a function of the world for reward {name!r}, got {function!r}.")
    _REWARDS[name] = function


def own_sensor(name: str) -> OwnSensor:
    """Return the sensor of that name, registered or installed.

    Raises:
        ConfigError: there is none.
        OwnFunctionError: its module cannot be imported.
    """
    if name in _SENSORS:
        return _SENSORS[name]
    found = _load("sensor", SENSOR_ENTRY_POINTS, name, _SENSORS)
    if not isinstance(found, OwnSensor) or found.name != name:
        raise ConfigError(f"Expected the entry point {name!r} to be an OwnSensor of that name, got {found!r}.")
    return found


def is_own_sensor(name: str) -> bool:
    """Return whether a sensor of that name is registered or installed; nothing is imported for it."""
    return name in _SENSORS or name in {point.name for point in _installed(SENSOR_ENTRY_POINTS)}


def own_reward(name: str) -> OwnReward:
    """Return the reward function of that name, registered or installed.

    Raises:
        ConfigError: there is none.
        OwnFunctionError: its module cannot be imported.
    """
    return _REWARDS[name] if name in _REWARDS else _load("reward", REWARD_ENTRY_POINTS, name, _REWARDS)


def _load(kind: str, group: str, name: str, local: dict[str, Any]) -> Any:
    for point in _installed(group):
        if point.name == name:
            try:
                return point.load()
            except Exception as error:  # code of the user, which may raise anything
                raise OwnFunctionError(
                    f"Cannot load own {kind} {name!r} from {point.value}: {in_words(error)}"
                ) from error
    known = sorted({*local, *(point.name for point in _installed(group))})
    raise ConfigError(
        f"Unknown own {kind} {name!r}.{suggestion(name, known)} Known here: {', '.join(known) or 'none'}. "
        f"Call `register_{kind}` first, in every process, or offer it as an entry point in the group {group!r}."
    )


@cache  # every run asks
def _installed(group: str) -> tuple[EntryPoint, ...]:
    return tuple(entry_points(group=group))
