"""Waveforms: conditions that change over the ticks of a run, as data.

A waveform drives how strongly robots are throttled or how noisy their sensors are (`Sigma`). The formulas are those of
the study's program, evaluated in double precision as written, with the period in ticks:

    constant    A
    sine        O + A sin(2 pi (t / period) + phase)
    square      O + A sign(sin(2 pi (t / period) + phase)),  sign(0) = +1
    sawtooth    O + 2 A (t / period - floor(t / period + 1/2) + phase)
    step        O before start_s, O + A from then on
    table       straight lines between given points, the first and last value beyond them

The last two are ours: the study's program makes a step from a square wave whose period is longer than the run.
"""

import math
from dataclasses import dataclass, fields
from typing import ClassVar, Literal, TypeAlias

import numpy as np

from swarm_forage_env._internal.fields import Amount, Checked, ConfigError, Number, Positive
from swarm_forage_env.contract.types import FloatArray

_CYCLE = ("amplitude", "offset", "period_s", "phase")
_USED = {
    "constant": ("amplitude",),
    "sine": _CYCLE,
    "square": _CYCLE,
    "sawtooth": _CYCLE,
    "step": ("amplitude", "offset", "start_s"),
    "table": ("times_s", "values"),
}
"""Kind of a waveform -> the fields that it has; all but the first two of a formula must be given."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Waveform(Checked):
    """One value per tick, as a formula or a table.

    Raises:
        ConfigError: an unknown kind, a field that the kind does not use, a missing field, or a wrong value.
    """

    called: ClassVar[str] = "waveform"

    kind: Literal["constant", "sine", "square", "sawtooth", "step", "table"]
    amplitude: Number = 0.0
    """A, in the unit of what the waveform drives."""
    offset: Number = 0.0
    """O, in the same unit."""
    period_s: Positive | None = None
    """Length of one cycle. The paper's frequency "f = 5000" is such a period in seconds."""
    phase: Number = 0.0
    """In radians; for the sawtooth in cycles, where it raises the whole signal, as in the study's program."""
    start_s: Amount | None = None
    """When a step happens."""
    times_s: tuple[Number, ...] = ()
    """Rising times of a table."""
    values: tuple[Number, ...] = ()
    """Values of a table, one per time."""

    def check(self) -> None:
        """Refuse fields that the kind does not have, and a table that is none."""
        used = _USED[self.kind]
        for item in fields(self):
            is_default = getattr(self, item.name) == item.default
            if item.name not in ("kind", *used) and not is_default:
                raise ConfigError(
                    f"Expected a {self.kind} waveform to be given by {', '.join(used)} only, got {item.name} as well."
                )
            if item.name in used and is_default and item.default in (None, ()):
                raise ConfigError(f"Expected {item.name} of a {self.kind} waveform, got none.")
        if len(self.times_s) != len(self.values) or (np.diff(self.times_s) <= 0.0).any():
            raise ConfigError(
                f"Expected times_s of a table waveform to rise, and as many values, got {self.times_s} and "
                f"{self.values}."
            )

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest value that the signal can take."""
        if self.kind == "constant":
            return self.amplitude, self.amplitude
        if self.kind == "table":
            return min(self.values), max(self.values)
        if self.kind == "step":
            return self.offset + min(0.0, self.amplitude), self.offset + max(0.0, self.amplitude)
        middle = self.offset + (2.0 * self.amplitude * self.phase if self.kind == "sawtooth" else 0.0)
        return middle - abs(self.amplitude), middle + abs(self.amplitude)

    def in_words(self, unit: str, *, factor: float = 1.0, floor: float = -math.inf) -> str:
        """Return how the value goes, for people: "0 to 40 % (sine, period 200 s)".

        Args:
            unit: Follows the last number, such as " %".
            factor: Values are shown times this.
            floor: Values below count as this one.
        """
        ends = (self.offset, self.offset + self.amplitude) if self.kind == "step" else self.ends
        low, high = (f"{factor * max(floor, value):,.4g}" for value in ends)
        if self.kind == "constant":
            return f"{low}{unit}"
        if self.kind == "step":
            return f"{low}, from {self.start_s:,g} s on {high}{unit}"
        manner = f"{self.kind}, period {self.period_s:,g} s" if self.period_s else f"table of {len(self.values)} values"
        return f"{low} to {high}{unit} ({manner})"

    def signal(self, dt_s: float, *, least: float = -math.inf) -> "Signal":
        """Return V, no value below `least`, as a function of the tick, for ticks of `dt_s` seconds."""
        return Signal(self, dt_s, least)

    def value_at(self, tick: int, dt_s: float) -> float:
        """Return V at a tick of a run with ticks of `dt_s` seconds."""
        if self.kind == "constant":
            return self.amplitude
        if self.kind == "table":
            return float(np.interp(tick, np.divide(self.times_s, dt_s), self.values))
        if self.start_s is not None:  # half a millionth of a tick absorbs the rounding of start_s / dt_s
            return self.offset + self.amplitude if tick >= self.start_s / dt_s - 5e-7 else self.offset
        assert self.period_s is not None, "all other kinds have one"
        cycles = tick / (self.period_s / dt_s)
        if self.kind == "sawtooth":
            return self.offset + 2.0 * self.amplitude * (cycles - math.floor(cycles + 0.5) + self.phase)
        sine = math.sin(2.0 * math.pi * cycles + self.phase)
        if self.kind == "sine":
            return self.offset + self.amplitude * sine
        return self.offset + (self.amplitude if sine >= 0.0 else -self.amplitude)


class Signal:
    """Values of a waveform by tick, none below `least`; the first tick of a run is 1."""

    _TICKS = 256
    """Values that `ahead` works out at a time."""

    def __init__(self, waveform: Waveform, dt_s: float, least: float) -> None:
        """Take the waveform, for ticks of `dt_s` seconds."""
        self._waveform, self._dt_s, self._least = waveform, dt_s, least
        self._first, self._values = 0, np.zeros(0)

    def __call__(self, tick: int) -> float:
        """Return the value at a tick."""
        return max(self._least, self._waveform.value_at(tick, self._dt_s))

    def ahead(self, tick: int) -> FloatArray:
        """Return the values (ticks,) of a tick and of those after it that are worked out already, at least one."""
        if not 0 <= tick - self._first < len(self._values):
            self._first = tick
            self._values = np.array([self(later) for later in range(tick, tick + self._TICKS)], float)
        return self._values[tick - self._first :]


Sigma: TypeAlias = Amount | Waveform
"""Standard deviation: constant, or by a waveform of time (no noise where it is below 0)."""


def wave_of(sigma: Sigma) -> Waveform:
    """Return a standard deviation as a waveform."""
    return sigma if isinstance(sigma, Waveform) else Waveform(kind="constant", amplitude=sigma)


def is_noisy(sigma: Sigma) -> bool:
    """Whether there can be any noise."""
    return isinstance(sigma, Waveform) or sigma > 0.0


def sigma_in_words(sigma: Sigma) -> str:
    """Return it for people."""
    return sigma.in_words("", floor=0.0) if isinstance(sigma, Waveform) else f"{sigma:g}"
