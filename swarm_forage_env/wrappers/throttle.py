"""Throttle: robots lose part of their speed, by a waveform of time."""

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.types import ActionArray, FloatArray
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.world.kernels.disturbances import throttle
from swarm_forage_env.world.motion import drive_limits
from swarm_forage_env.wrappers.base import SwarmWrapper, WrapperConfig
from swarm_forage_env.wrappers.waveform import Waveform

IDEAL_THROTTLE = 0.10
"""Constant throttle that the paper's flexibility studies take as ideal conditions."""


class Throttle(SwarmWrapper):
    """Slows robots down: both wheels of a limited command (l, r) get the factor 1 - a |l + r| / (|l| + |r|).

    a = max(0, V(t)), with t the tick that is executed (the first is 1) and V the waveform. A robot that drives straight
    loses the share a of its speed, one that turns on the spot loses nothing, and in between the loss is continuous: the
    study throttles the steering force, which does not slow turns on the spot. Robots do not sense the throttle.

    Records `throttle`, V at the last tick of an interval, and `throttle_mean`.
    """

    stack_position: ClassVar[int] = 3

    def __init__(self, env: ForageEnv | SwarmWrapper, config: "ThrottleConfig") -> None:
        """Wrap `env`."""
        super().__init__(env, config)
        scenario = self.unwrapped.scenario
        self.reconfigure(config)
        self._limits = drive_limits(scenario)
        self._unit_gain: FloatArray = np.ones((scenario.robots.n_robots, 2))
        self._gain: FloatArray = np.ones((scenario.robots.n_robots, 2))

    def reconfigure(self, config: "ThrottleConfig") -> None:
        """Go on under another configuration from the next tick on."""
        self.made_from = config
        self._only_carriers = config.carriers
        self._signal = config.waveform.signal(self.unwrapped.scenario.dt_s)

    def on_reset(self, seed: int) -> None:
        """Start the waveform."""
        self._value = self._sum = 0.0
        self._ticks = 0

    def gain(self, actions: ActionArray, wheel_gain: FloatArray | None) -> FloatArray | None:
        """Multiply the throttle of the coming tick into the gains."""
        self._value = value = self._signal(self.unwrapped.tick + 1)
        self._sum += value
        self._ticks += 1
        if value <= 0.0:
            return wheel_gain
        carried_object = self.unwrapped.swarm.carried_object
        outer_gain = self._unit_gain if wheel_gain is None else wheel_gain
        throttle(actions, value, self._only_carriers, carried_object, self._limits, outer_gain, self._gain)
        return self._gain

    def ahead(self, n_ticks: int) -> tuple[int, dict[str, Any]]:
        """Return the throttle of the coming ticks."""
        values = self._signal.ahead(self.unwrapped.tick + 1)
        return min(n_ticks, len(values)), {
            "throttles": values,
            "only_carriers": self._only_carriers,
            "gain": self._gain,
        }

    def count_ticks(self, n_ticks: int) -> None:
        """Add up the throttle of these ticks."""
        for value in self._signal.ahead(self.unwrapped.tick + 1 - n_ticks)[:n_ticks].tolist():
            self._value = value
            self._sum += value
        self._ticks += n_ticks

    def interval_columns(self) -> dict[str, float]:
        """Return V at the last tick, and its mean over the ticks since the last call."""
        mean = self._sum / self._ticks
        self._sum, self._ticks = 0.0, 0
        return {"throttle": self._value, "throttle_mean": mean}


@dataclass(frozen=True, kw_only=True, slots=True)
class ThrottleConfig(WrapperConfig):
    """A `Throttle` as data.

    Raises:
        ConfigError: a waveform that exceeds 1, at which robots stand still.
    """

    name: ClassVar[str] = "throttle"
    wrapper: ClassVar[type[SwarmWrapper]] = Throttle
    waveform_field: ClassVar[str] = "waveform"

    waveform: Waveform
    """Share of speed lost; negative values throttle nothing."""
    carriers: bool = False
    """Whether only robots that carry an object at the start of the step are throttled."""
    example: ClassVar[str] = "waveform=constant,amplitude=0.2"

    def check(self) -> None:
        """Refuse a loss of more than all speed."""
        if self.waveform.ends[1] > 1.0:
            raise ConfigError(
                f"Expected a throttle of at most 1 (robots stand still), got a waveform that reaches "
                f"{self.waveform.ends[1]:g}; lower its amplitude or its offset."
            )

    def in_words(self, dt_s: float) -> str:
        """Return who loses which share of its speed; see `WrapperConfig.in_words`."""
        who = "carrying robots" if self.carriers else "robots"
        return f"throttle: {who} lose {self.waveform.in_words(' % of their speed', factor=100.0, floor=0.0)}"


def square_throttles() -> tuple[ThrottleConfig, ...]:
    """Throttles of scenario 1: carriers lose speed by a square wave, two cycles in a run; the first is the ideal.

    Amplitude = offset = 0.15, 0.20, ..., 0.40, so that speed is full in one half of a cycle and falls by twice the
    amplitude in the other (study configuration BCSquare; the paper prints 0 to 0.40). Ideal: constant 0.10.
    """
    return _throttles("square", 7, 5_000.0, carriers=True)


def sine_throttles() -> tuple[ThrottleConfig, ...]:
    """Throttles of scenario 2: all robots lose speed by a sine, one cycle in a run; the first is the ideal.

    Amplitude = offset = 0.15, 0.20, ..., 0.45 (study configuration MSine; the paper prints 0 to 0.40). Ideal: constant
    0.10.
    """
    return _throttles("sine", 8, 10_000.0, carriers=False)


def _throttles(
    kind: Literal["square", "sine"], n_levels: int, period_s: float, *, carriers: bool
) -> tuple[ThrottleConfig, ...]:
    ideal = Waveform(kind="constant", amplitude=IDEAL_THROTTLE)
    # Hundredths are exact as whole numbers: 0.10 + 0.05 + ... would not be.
    levels = [(10 + 5 * level) / 100 for level in range(1, n_levels)]
    waves = [Waveform(kind=kind, amplitude=level, offset=level, period_s=period_s) for level in levels]
    return tuple(ThrottleConfig(waveform=waveform, carriers=carriers) for waveform in (ideal, *waves))
