"""Levels of adversity that a person changes while a run goes on: and which there are."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from swarm_forage_env._internal.fields import ConfigError, number
from swarm_forage_env.wrappers.base import SwarmWrapper, WrapperConfig
from swarm_forage_env.wrappers.noise import ActuatorNoise, ActuatorNoiseConfig, SensorNoise, SensorNoiseConfig
from swarm_forage_env.wrappers.population import PopulationConfig, PopulationDynamics
from swarm_forage_env.wrappers.throttle import Throttle, ThrottleConfig
from swarm_forage_env.wrappers.waveform import Waveform

_IDLE: tuple[WrapperConfig, ...] = (
    SensorNoiseConfig(),
    PopulationConfig(),
    ThrottleConfig(waveform=Waveform(kind="constant", amplitude=0.0)),
    ActuatorNoiseConfig(sigma=0.0),
)
"""One of each kind, which changes nothing until somebody raises its level."""


@dataclass(frozen=True, slots=True)
class LevelKind:
    """A level that can be changed, from 0 on; the page has a slider for it."""

    title: str
    """For people, with its unit."""
    wrapper: type[SwarmWrapper]
    field: str
    """Of the wrapper's configuration: a number or a `Waveform`, whose amplitude is the level."""
    most: float
    """Where the slider ends."""
    step: float
    per_1000_s: bool = False
    """Whether people give it per 1,000 s, where the field has it per tick."""


LEVELS = {
    "sensor_noise": LevelKind("sensor noise (sigma, of a range of 1)", SensorNoise, "sigma", 0.1, 0.005),
    "wheel_noise": LevelKind("wheel noise (sigma, of full speed)", ActuatorNoise, "sigma", 0.5, 0.01),
    "throttle": LevelKind("throttle (share of speed lost)", Throttle, "waveform", 0.9, 0.05),
    "failures": LevelKind("failures per 1,000 s", PopulationDynamics, "malfunction_per_tick", 20.0, 0.5, True),
    "repairs": LevelKind("repairs per 1,000 s", PopulationDynamics, "repair_per_tick", 20.0, 0.5, True),
    "deaths": LevelKind("deaths per 1,000 s", PopulationDynamics, "death_per_tick", 20.0, 0.5, True),
}
"""Name in commands -> level. Where sliders end is our choice: by then, every policy of ours has lost most of its
deliveries."""
_DEEDS = {
    "kill": (PopulationDynamics.kill, "is not alive", "was killed", "killed"),
    "break": (PopulationDynamics.break_down, "is not at work", "broke down and waits for repair", "broken"),
    "repair": (PopulationDynamics.repair, "is not in repair", "is at work again", "repaired"),
}
"""What can be done to a robot -> how, what is told where it cannot be and where it was, and the change."""
_MOST_CHANGES = 20
"""Changes that are told in one line; our choice: more than anybody reads."""


def with_idle(wrappers: Iterable[WrapperConfig]) -> tuple[WrapperConfig, ...]:
    """Return the wrappers with one of each other kind that changes nothing for now: the run stays what it was."""
    given = tuple(wrappers)
    return (*given, *(idle for idle in _IDLE if idle.name not in {config.name for config in given}))


class Levels:
    """The wrappers of a stack that was made `with_idle`, and what was changed by hand.

    Attributes:
        changes: What was changed by hand, in words, the latest last; empty for a run as planned.
    """

    def __init__(self, stack: Any) -> None:
        """Find the wrappers of a stack."""
        self._wrappers: dict[type, Any] = {type(one): one for one in stack.stack}
        self.changes: list[str] = []
        self._per_1000_s = 1000.0 / stack.unwrapped.scenario.dt_s

    @property
    def changes_in_words(self) -> str:
        """The last changes, and how many there were before them; empty where nothing was changed."""
        n_before = max(0, len(self.changes) - _MOST_CHANGES)
        return ", ".join([*([f"{n_before} more before"] if n_before else []), *self.changes[n_before:]])

    @property
    def all_configs(self) -> tuple[WrapperConfig, ...]:
        """The wrappers as they are now."""
        return tuple(one.made_from for one in self._wrappers.values())

    @property
    def configs(self) -> tuple[WrapperConfig, ...]:
        """What disturbs the swarm now, as a run could have it from its start; without what changes nothing."""
        return tuple(config for config in self.all_configs if config not in _IDLE)

    def level(self, name: str) -> float | None:
        """Return the level now; None for a table of values, which has no amplitude."""
        kind = LEVELS[name]
        value = getattr(self._wrappers[kind.wrapper].made_from, kind.field)
        if isinstance(value, Waveform):
            return None if value.kind == "table" else value.amplitude
        return round(value * self._per_1000_s, 9) if kind.per_1000_s else value

    def set(self, name: str, wanted: float) -> str:
        """Change a level to a value; returns one line about it.

        Raises:
            ConfigError: the level cannot be that, or it follows a table; it stays what it was.
        """
        kind, wrapper = LEVELS[name], self._wrappers[LEVELS[name].wrapper]
        title = kind.title.partition(" (")[0]
        number(title, wanted, at_least=0.0)
        if self.level(name) is None:
            raise ConfigError(f"Expected {title} with an amplitude, got a table of values; it stays as it is.")
        if wanted != self.level(name):
            value = getattr(wrapper.made_from, kind.field)
            changed = wanted / self._per_1000_s if kind.per_1000_s else wanted
            if isinstance(value, Waveform):
                changed = replace(value, amplitude=wanted)
            wrapper.reconfigure(replace(wrapper.made_from, **{kind.field: changed}))
            self.changes = [old for old in self.changes if not old.startswith(f"{title} ")]
            self.changes.append(f"{title} {wanted:g}")
        return f"{title} is {wanted:g}"

    def treat(self, deed: str, robot: int) -> str:
        """Kill, break or repair a robot; returns one line about it."""
        act, refusal, done, change = _DEEDS[deed]
        if not act(self._wrappers[PopulationDynamics], robot):
            return f"robot {robot} {refusal}"
        self.changes.append(f"robot {robot} {change}")
        return f"robot {robot} {done}"
