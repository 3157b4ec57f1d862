"""Levels of adversity that a person changes while a run goes on: which there are, and what a step changes."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.wrappers.base import SwarmWrapper, WrapperConfig
from swarm_forage_env.wrappers.handling import IDEAL_COST, HandlingCost, HandlingCostConfig
from swarm_forage_env.wrappers.noise import ActuatorNoise, ActuatorNoiseConfig, SensorNoise, SensorNoiseConfig
from swarm_forage_env.wrappers.population import PopulationConfig, PopulationDynamics
from swarm_forage_env.wrappers.throttle import Throttle, ThrottleConfig
from swarm_forage_env.wrappers.waveform import Waveform

_NOTHING = Waveform(kind="constant", amplitude=0.0)
_IDLE: tuple[WrapperConfig, ...] = (
    SensorNoiseConfig(),
    PopulationConfig(),
    ThrottleConfig(waveform=_NOTHING),
    ActuatorNoiseConfig(sigma=0.0),
    HandlingCostConfig(waveform=Waveform(kind="constant", amplitude=IDEAL_COST)),
)
"""One of each kind, which changes nothing until somebody raises its level."""


@dataclass(frozen=True, slots=True)
class LevelKind:
    """A level that can be changed."""

    name: str
    """For people."""
    wrapper: type[SwarmWrapper]
    field: str
    """Of the wrapper's configuration: a number or a `Waveform`, whose amplitude is the level."""
    step: float
    lowest: float


LEVELS = {
    "t": LevelKind("throttle", Throttle, "waveform", 0.05, 0.0),
    "s": LevelKind("sensor noise", SensorNoise, "sigma", 0.01, 0.0),
    "w": LevelKind("wheel noise", ActuatorNoise, "sigma", 0.01, 0.0),
    "h": LevelKind("handling ticks", HandlingCost, "waveform", 10.0, IDEAL_COST),
}
"""Key -> level. The steps are our choice, of the size of those between the paper's levels."""


def with_idle(wrappers: Iterable[WrapperConfig]) -> tuple[WrapperConfig, ...]:
    """Return the wrappers with one of each other kind that changes nothing for now: the run stays what it was."""
    given = tuple(wrappers)
    return (*given, *(idle for idle in _IDLE if idle.name not in {config.name for config in given}))


class Levels:
    """The wrappers of a stack that was made `with_idle`, and what was changed by hand.

    Attributes:
        changes: What was changed by hand, in words, the latest last; empty for a run as planned.
    """

    def __init__(self, stack: ForageEnv | SwarmWrapper) -> None:
        """Find the wrappers of a stack."""
        self._wrappers: dict[type, Any] = {}
        while isinstance(stack, SwarmWrapper):
            self._wrappers[type(stack)] = stack
            stack = stack.env  # type: ignore[assignment] - PettingZoo types it as any parallel environment
        self.changes: list[str] = []

    def level(self, key: str) -> float | None:
        """Return the level now; None for a table of values, which has no amplitude."""
        kind = LEVELS[key]
        value = getattr(self._wrappers[kind.wrapper].made_from, kind.field)
        if not isinstance(value, Waveform):
            return value
        return None if value.kind == "table" else value.amplitude

    def change(self, key: str, *, up: bool) -> str:
        """Change a level by one step; returns one line about what has become of it."""
        kind, now = LEVELS[key], self.level(key)
        if now is None:
            return f"{kind.name} follows a table, which has no amplitude to change"
        # Rounding keeps 0.05 + 0.05 + 0.05 at 0.15.
        wanted = max(kind.lowest, round(now + (kind.step if up else -kind.step), 9))
        if wanted == now:
            return f"{kind.name} is {now:g}, the lowest level"
        wrapper = self._wrappers[kind.wrapper]
        value = getattr(wrapper.made_from, kind.field)
        try:
            changed = replace(value, amplitude=wanted) if isinstance(value, Waveform) else wanted
            wrapper.reconfigure(replace(wrapper.made_from, **{kind.field: changed}))
        except ConfigError:
            return f"{kind.name} is {now:g}, the highest level"
        self._note(kind.name, f"{kind.name} {wanted:g}")
        return f"{kind.name} is {wanted:g}"

    def kill(self, robot: int) -> str:
        """Let a robot die; returns one line about it."""
        if not self._wrappers[PopulationDynamics].kill(robot):
            return f"robot {robot} is not alive"
        self._note("", f"robot {robot} killed")
        return f"robot {robot} was killed"

    def _note(self, same: str, change: str) -> None:
        """Keep a change; a later one of the same level replaces the earlier."""
        self.changes = [old for old in self.changes if not (same and old.startswith(f"{same} "))]
        self.changes.append(change)
