"""The robots of a scenario: how many, what they are built like, what they sense, and kinds of them that differ.

In swarms of several kinds some are slower, see less far, or lack sensors. Example: in a swarm of 50,

    scenario("warehouse_small", n_robots=50, robot_kinds=(
        RobotKind(name="scout", share=0.2),
        RobotKind(name="hauler", speed=0.5, window_cells=3, lacks=("light",)),
    ))

makes robots 0 to 9 scouts, which are as robots of one kind are, and all others haulers. A kind is a share of the swarm
and no number of robots, so that the same kinds fit every size of it, in a study of sizes as in worlds that are drawn.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from fractions import Fraction
from math import floor
from typing import Any, cast

from swarm_forage_env._internal.fields import (
    ConfigError,
    as_tuples,
    known_keys,
    known_name,
    number,
    one_of,
    unique_names,
    whole,
)
from swarm_forage_env._internal.wording import shown
from swarm_forage_env.scenarios.floor import EAST_WALL_M

WHEEL_SCALE_MPS = 0.20
"""Wheel speed that an action or an observation of 1.0 stands for."""
SENSORS = ("proximity", "light", "los_object", "los_cache", "neighbours", "messages")
"""Slices of the observation that a kind may lack, besides own sensors. Zero there means that nothing is seen or heard.
The floor is not among them: zero is an object there, and a robot that does not feel the nest never delivers."""
WINDOWS_CELLS = (1, 3, 5)
"""Sides of the line-of-sight window that a kind may have, in cells; the last is that of robots of one kind."""
MAX_NEIGHBOURS_SEEN = 64
"""Most neighbours in an observation (our choice: 256 columns, twice those of all other sensors)."""
MAX_MESSAGE_SIZE = 64
"""Most numbers in a message (our choice, as for neighbours)."""
MAX_KINDS = 16
"""Most kinds of a swarm (our choice: more than any swarm that we know of has)."""
_NO_NAME = "none"
"""On the axis of a study it stands for a swarm without kinds."""
_SUM_SLACK = 1e-9
"""Shares whose sum is this close to 1 are the whole swarm: thirds are not exact."""


@dataclass(frozen=True, kw_only=True, slots=True)
class RobotKind:
    """What the robots of one kind can do; defaults are those of robots of one kind.

    Raises:
        ConfigError: a value that no kind can have.
    """

    name: str
    """For people: letters, digits and _; not "none", which is a study's word for no kinds."""
    share: float | None = None
    """Of the swarm, 0 to 1; None, for one kind at most, is what the others leave."""
    speed: float = 1.0
    """Factor on both wheels' speeds and on their limits, above 0 and at most 1: it drives the same paths, slower."""
    window_cells: int = WINDOWS_CELLS[-1]
    """Side of the square in which it sees objects and caches, in cells: 1, 3 or 5."""
    lacks: tuple[str, ...] = ()
    """Slices of the observation that stay zero: some of `SENSORS`, or own sensors of the scenario."""

    def __post_init__(self) -> None:
        where = "the name of a robot kind"
        if not isinstance(self.name, str) or not self.name.isidentifier():  # pyright: ignore[reportUnnecessaryIsInstance] - files give anything
            raise ConfigError(f"Expected {where} to be made of letters, digits and _, got {shown(self.name)}.")
        if self.name == _NO_NAME:
            raise ConfigError(
                f"Expected {where} not to be {_NO_NAME!r}, which stands for a swarm without kinds on the axis of a "
                "study; give the kind another name, or leave robot_kinds out where all robots are alike."
            )
        of = f"of robot kind {self.name}"
        if self.share is not None:
            number(f"the share {of}", self.share, at_least=0.0, at_most=1.0)
        number(f"the speed {of}", self.speed, above=0.0)
        if self.speed > 1.0:
            raise ConfigError(
                f"Expected the speed {of} to be at most 1, got {self.speed:g}: it is a share of max_speed_mps, the "
                "fastest that contact is checked for; raise that, and lower the speed of the other kinds."
            )
        whole(f"the window_cells {of}", self.window_cells)
        if self.window_cells not in WINDOWS_CELLS:
            raise ConfigError(
                f"Expected the window_cells {of} to be one of {', '.join(map(str, WINDOWS_CELLS))}, the side of the "
                f"window in cells, got {shown(self.window_cells)}."
            )
        unique_names(f"what robot kind {self.name} lacks", self.lacks)


def read_kinds(kinds: Any, own_sensors: Iterable[str]) -> tuple[RobotKind, ...]:
    """Return kinds that can be together; tables of values by name, as files have them, become kinds.

    Args:
        kinds: A tuple of kinds or tables.
        own_sensors: Names of the own sensors of the scenario, which kinds may lack, too.

    Raises:
        ConfigError: no tuple of kinds, too many, equal names, an unknown sensor, or shares that are not a swarm.
    """
    if not isinstance(kinds, tuple):
        raise ConfigError(
            "Expected robots.robot_kinds to be a tuple of kinds, such as (RobotKind(name='scout', share=0.2), "
            f"RobotKind(name='hauler', speed=0.5)), got {shown(kinds)}."
        )
    read = tuple(_read_kind(kind) for kind in cast("tuple[Any, ...]", kinds))
    if len(read) > MAX_KINDS:
        raise ConfigError(f"Expected at most {MAX_KINDS} robot kinds, got {len(read)}.")
    unique_names("the names of robot kinds", tuple(kind.name for kind in read))
    for kind in read:
        for sensor in kind.lacks:
            one_of(f"what robot kind {kind.name} lacks", sensor, (*SENSORS, *own_sensors))
    if read:
        _check_shares(read)
    return read


def _read_kind(kind: Any) -> RobotKind:
    if isinstance(kind, RobotKind):
        return kind
    if not isinstance(kind, Mapping):
        raise ConfigError(
            "Expected each of robots.robot_kinds to be a RobotKind or a table such as {name = 'scout', share = 0.2}, "
            f"got {shown(kind)}."
        )
    values = {key: as_tuples(value) for key, value in cast("Mapping[str, Any]", kind).items()}
    known_keys(values, (item.name for item in fields(RobotKind)), "field of a robot kind")
    if "name" not in values:
        raise ConfigError(f"Missing name of the robot kind {values!r}.")
    return RobotKind(**values)


def _check_shares(kinds: Sequence[RobotKind]) -> None:
    total = sum(kind.share for kind in kinds if kind.share is not None)
    n_open = sum(kind.share is None for kind in kinds)
    told = ", ".join(f"{kind.name}: {'the rest' if kind.share is None else f'{kind.share:g}'}" for kind in kinds)
    if n_open > 1:
        raise ConfigError(f"Expected one robot kind at most without a share, which gets the rest, got {told}.")
    if total > 1.0 + _SUM_SLACK or (not n_open and total < 1.0 - _SUM_SLACK):
        hint = "" if total > 1.0 else "; leave one share out, and that kind gets the rest"
        raise ConfigError(f"Expected shares of robot kinds that add up to 1, got {told}{hint}.")


def kind_sizes(kinds: Sequence[RobotKind], n_robots: int) -> tuple[int, ...]:
    """Return how many robots each kind has, in order: by largest remainder, of equal ones the earlier kind first.

    Example: shares of 0.5, 0.3 and 0.2 are 5, 3 and 2 of 10 robots, and 3, 2 and 1 of 6 (3, 1.8 and 1.2).
    """
    told = [Fraction(0) if kind.share is None else Fraction(str(kind.share)) for kind in kinds]
    rest = max(Fraction(0), 1 - sum(told))
    shares = [rest if kind.share is None else share for kind, share in zip(kinds, told, strict=True)]
    quotas = [share * n_robots / sum(shares) for share in shares]
    sizes = [floor(quota) for quota in quotas]
    # Sorting is stable: of equal remainders the earlier kind comes first.
    in_turn = sorted(range(len(kinds)), key=lambda place: sizes[place] - quotas[place])
    for place in in_turn[: n_robots - sum(sizes)]:
        sizes[place] += 1
    return tuple(sizes)


def kind_rows(kinds: Sequence[RobotKind], n_robots: int) -> tuple[slice, ...]:
    """Return the rows of the robots of each kind: the first kind has the first rows, for the whole run."""
    rows: list[slice] = []
    start = 0
    for size in kind_sizes(kinds, n_robots):
        rows.append(slice(start, start + size))
        start += size
    return tuple(rows)


def kind_from_words(word: str) -> RobotKind:
    """Return the kind that a word of the command line stands for.

    Example: "hauler:share=0.8,speed=0.5,lacks=light/proximity"; "scout" alone is a kind that gets the rest.

    Raises:
        ConfigError: unknown fields, one given twice, or values of another type or out of range.
    """
    name, _, settings = word.strip().partition(":")
    values: dict[str, Any] = {"name": name.strip()}
    for setting in filter(None, settings.split(",")):
        key, equals, text = (part.strip() for part in setting.partition("="))
        if not equals:
            raise ConfigError(
                f"Expected a robot kind as NAME:key=value,key=value with the keys {', '.join(_FROM_TEXT)}, several "
                f"sensors as lacks=light/proximity, and a + between kinds, got {word!r}."
            )
        known_name("key of a robot kind", key, _FROM_TEXT)
        if key in values:
            raise ConfigError(f"Expected each key of robot kind {values['name']} once, got {key} twice in {word!r}.")
        read, what = _FROM_TEXT[key]
        try:
            values[key] = read(text)
        except ValueError as error:
            raise ConfigError(f"Expected {key} of robot kind {values['name']} to be {what}, got {text!r}.") from error
    return RobotKind(**values)


def words_of_kind(kind: RobotKind | Mapping[str, Any]) -> str:
    """Return the word of which `kind_from_words` makes this kind; defaults are left out."""
    values = asdict(kind) if isinstance(kind, RobotKind) else dict(kind)
    default = asdict(RobotKind(name="kind"))
    said = [
        f"{key}={'/'.join(value) if key == 'lacks' else value}"
        for key, value in values.items()
        if key != "name" and as_tuples(value) != default.get(key)
    ]
    return ":".join(filter(None, (str(values.get("name", "")), ",".join(said))))


def _names(text: str) -> tuple[str, ...]:
    names = tuple(name.strip() for name in text.split("/"))
    if not all(names):
        raise ValueError("an empty name")
    return names


_FROM_TEXT: dict[str, tuple[Callable[[str], Any], str]] = {
    "share": (float, "a number"),
    "speed": (float, "a number"),
    "window_cells": (int, "a whole number"),
    "lacks": (_names, "sensors, such as light or light/proximity (leave lacks out for a kind that has all)"),
}
"""Key -> how its text is read, and what the text should be, for messages."""


@dataclass(frozen=True, kw_only=True, slots=True)
class RobotConfig:
    """Differential-drive robots; defaults are those of the foot-bot used by the paper."""

    n_robots: int
    radius_m: float = 0.085036758
    wheel_base_m: float = 0.14
    max_speed_mps: float = 0.10
    """Limit of the centre speed."""
    max_wheel_difference_mps: float = 0.20
    """Limit of right minus left wheel speed."""
    start_margin_m: float = 2.8
    """Robots start at uniform positions at least this far from the arena border."""
    own_sensors: tuple[str, ...] = ()
    """Names of further slices of an observation, registered by `contract.own_functions.register_sensor`."""
    neighbours_seen: int = 0
    """How many of the nearest robots a robot observes; 0 = none, as in the paper."""
    neighbour_range_m: float = 2.0
    """How far it sees them, between centres (our choice: twice the side of its window on the floor)."""
    message_size: int = 0
    """Numbers that a robot may broadcast in every tick; 0 = robots say nothing, as in the paper."""
    message_range_m: float = 2.0
    """How far a message is heard, between centres (our choice, as for neighbours)."""
    robot_kinds: tuple[RobotKind, ...] = ()
    """Kinds of robots, in the order of their rows ; () = all are alike, as in the paper."""

    def __post_init__(self) -> None:
        whole("robots.n_robots", self.n_robots, at_least=1)
        for name in ("radius_m", "wheel_base_m", "max_speed_mps", "max_wheel_difference_mps", "start_margin_m"):
            number(f"robots.{name}", getattr(self, name), above=0.0)
        least = EAST_WALL_M + self.radius_m
        if self.start_margin_m < least:
            raise ConfigError(
                f"Expected robots.start_margin_m >= {least:.3f} (wall plus radius), got {self.start_margin_m}."
            )
        unique_names("robots.own_sensors", self.own_sensors)
        whole("robots.neighbours_seen", self.neighbours_seen, at_least=0, at_most=MAX_NEIGHBOURS_SEEN)
        whole("robots.message_size", self.message_size, at_least=0, at_most=MAX_MESSAGE_SIZE)
        for name in ("neighbour_range_m", "message_range_m"):
            number(f"robots.{name}", getattr(self, name), above=0.0)
        object.__setattr__(self, "robot_kinds", read_kinds(self.robot_kinds, self.own_sensors))

    @property
    def tells_kinds(self) -> bool:
        """Whether robots differ, so that each observes its own kind and records tell kinds apart."""
        return len(self.robot_kinds) > 1

    @property
    def kind_rows(self) -> tuple[slice, ...]:
        """Rows of each of the `robot_kinds`."""
        return kind_rows(self.robot_kinds, self.n_robots)

    def reach_cells(self, sensor: str) -> tuple[int, ...]:
        """Return how many cells each robot sees on either side of its own, by "los_object" or "los_cache".

        -1 is for robots that lack the sensor.
        """
        found = [WINDOWS_CELLS[-1] // 2] * self.n_robots
        for kind, rows in zip(self.robot_kinds, self.kind_rows, strict=True):
            reach = -1 if sensor in kind.lacks else kind.window_cells // 2
            found[rows] = [reach] * (rows.stop - rows.start)
        return tuple(found)

    def kind_of(self, robot: int) -> str | None:
        """Return the name of a robot's kind; None where there are no kinds."""
        named = zip(self.robot_kinds, self.kind_rows, strict=True)
        return next((kind.name for kind, rows in named if rows.start <= robot < rows.stop), None)
