"""The robots of a scenario: how many, what they are built like, and what they sense besides the paper's sensors."""

from dataclasses import dataclass

from swarm_forage_env._internal import fields
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.scenarios.kinds import RobotKind, kind_rows, read_kinds
from swarm_forage_env.scenarios.sensors import WINDOWS_CELLS
from swarm_forage_env.scenarios.units import EAST_WALL_M

MAX_NEIGHBOURS_SEEN = 64
"""Most neighbours in an observation (our choice: 256 columns, twice those of all other sensors)."""
MAX_MESSAGE_SIZE = 64
"""Most numbers in a message (our choice, as for neighbours)."""


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
    """Kinds of robots, in the order of their rows (`scenarios.kinds`); () = all are alike, as in the paper."""

    def __post_init__(self) -> None:
        fields.whole("robots.n_robots", self.n_robots, at_least=1)
        for name in ("radius_m", "wheel_base_m", "max_speed_mps", "max_wheel_difference_mps", "start_margin_m"):
            fields.number(f"robots.{name}", getattr(self, name), above=0.0)
        least = EAST_WALL_M + self.radius_m
        if self.start_margin_m < least:
            raise ConfigError(
                f"Expected robots.start_margin_m >= {least:.3f} (wall plus radius), got {self.start_margin_m}."
            )
        fields.unique_names("robots.own_sensors", self.own_sensors)
        fields.whole("robots.neighbours_seen", self.neighbours_seen, at_least=0, at_most=MAX_NEIGHBOURS_SEEN)
        fields.whole("robots.message_size", self.message_size, at_least=0, at_most=MAX_MESSAGE_SIZE)
        for name in ("neighbour_range_m", "message_range_m"):
            fields.number(f"robots.{name}", getattr(self, name), above=0.0)
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
