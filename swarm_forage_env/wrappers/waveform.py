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

import bisect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, known_keys, number, one_of, several
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.scenarios.config import from_mapping

Signal: TypeAlias = Callable[[int], float]
"""Value at a tick; the first tick of a run is 1."""

_CYCLE = ("amplitude", "offset", "period_s", "phase")
_USED = {
    "constant": ("amplitude",),
    "sine": _CYCLE,
    "square": _CYCLE,
    "sawtooth": _CYCLE,
    "step": ("amplitude", "offset", "start_s"),
    "table": ("times_s", "values"),
}
"""Kind of a waveform -> the fields that it has."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Waveform:
    """One value per tick, as a formula or a table.

    Raises:
        ConfigError: an unknown kind, a field that the kind does not use, a missing field, or a wrong value.
    """

    kind: str
    """constant, sine, square, sawtooth, step or table."""
    amplitude: float = 0.0
    """A, in the unit of what the waveform drives."""
    offset: float = 0.0
    """O, in the same unit."""
    period_s: float | None = None
    """Length of one cycle. The paper's frequency "f = 5000" is such a period in seconds."""
    phase: float = 0.0
    """In radians; for the sawtooth in cycles, where it raises the whole signal, as in the study's program."""
    start_s: float | None = None
    """When a step happens."""
    times_s: tuple[float, ...] = ()
    """Rising times of a table."""
    values: tuple[float, ...] = ()
    """Values of a table, one per time."""

    def __post_init__(self) -> None:
        one_of("the kind of a waveform", self.kind, tuple(_USED))
        used = _USED[self.kind]
        for item in fields(self):
            if item.name not in ("kind", *used) and getattr(self, item.name) != item.default:
                raise ConfigError(
                    f"Expected a {self.kind} waveform to be given by {', '.join(used)} only, got {item.name} as well."
                )
        for name in ("amplitude", "offset", "phase"):
            number(f"{name} of a waveform", getattr(self, name))
        if "period_s" in used:
            number(f"period_s of a {self.kind} waveform", self.period_s, above=0.0)
        if "start_s" in used:
            number("start_s of a step waveform", self.start_s, at_least=0.0)
        if self.kind == "table":
            for name in used:
                several(f"{name} of a table waveform", getattr(self, name), "numbers")
                for value in getattr(self, name):
                    number(f"every one of {name} of a table waveform", value)
            if len(self.times_s) != len(self.values) or (np.diff(self.times_s) <= 0.0).any():
                raise ConfigError(
                    f"Expected times_s of a table waveform to rise, and as many values, got {self.times_s} and "
                    f"{self.values}."
                )

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> "Waveform":
        """Build a waveform from plain values; raises ConfigError on unknown or missing keys and bad values."""
        return from_mapping(cls, mapping)

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

        def shown(value: float) -> str:
            return f"{factor * max(floor, value):,.4g}"

        if self.kind == "constant":
            return f"{shown(self.amplitude)}{unit}"
        if self.kind == "step":
            return f"{shown(self.offset)}, from {self.start_s:,g} s on {shown(self.offset + self.amplitude)}{unit}"
        low, high = map(shown, self.ends)
        manner = f"{self.kind}, period {self.period_s:,g} s" if self.period_s else f"table of {len(self.values)} values"
        return f"{low} to {high}{unit} ({manner})"

    def signal(self, dt_s: float) -> Signal:
        """Return V as a function of the tick, for ticks of `dt_s` seconds; it can be pickled."""
        return partial(self._at, dt_s)

    def _at(self, dt_s: float, tick: int) -> float:
        if self.kind == "constant":
            return self.amplitude
        if self.start_s is not None:  # half a millionth of a tick absorbs the rounding of start_s / dt_s
            return self.offset + self.amplitude if tick >= self.start_s / dt_s - 5e-7 else self.offset
        if self.period_s is None:
            return self._between_points(dt_s, tick)
        cycles = tick / (self.period_s / dt_s)
        if self.kind == "sawtooth":
            return self.offset + 2.0 * self.amplitude * (cycles - math.floor(cycles + 0.5) + self.phase)
        sine = math.sin(2.0 * math.pi * cycles + self.phase)
        if self.kind == "sine":
            return self.offset + self.amplitude * sine
        return self.offset + (self.amplitude if sine >= 0.0 else -self.amplitude)

    def _between_points(self, dt_s: float, tick: int) -> float:
        """The value of a table."""
        ticks = [time_s / dt_s for time_s in self.times_s]
        after = bisect.bisect_right(ticks, tick)
        if after in (0, len(ticks)):
            return self.values[0 if after == 0 else -1]
        share = (tick - ticks[after - 1]) / (ticks[after] - ticks[after - 1])
        return self.values[after - 1] + share * (self.values[after] - self.values[after - 1])


class WaveformAhead:
    """Values of a signal, worked out for many ticks at a time."""

    _TICKS = 256

    def __init__(self, signal: Signal) -> None:
        """Take the signal."""
        self._signal = signal
        self._first, self._values = 0, np.zeros(0)

    def of(self, tick: int) -> FloatArray:
        """Return the values (ticks,) of a tick and of those after it that are worked out already, at least one."""
        if not 0 <= tick - self._first < len(self._values):
            self._first = tick
            self._values = np.array([self._signal(later) for later in range(tick, tick + self._TICKS)], float)
        return self._values[tick - self._first :]


def gather_waveform(mapping: Mapping[str, Any], key: str, owner: type) -> dict[str, Any]:
    """Return `mapping` with the waveform under `key` built.

    Two forms are read: a table of its fields under `key` (as `to_mapping` writes it), and the name of its kind under
    `key` with its fields beside it, which is shorter: `{"waveform": "square", "amplitude": 0.2, "period_s": 5000}`.

    Args:
        mapping: Fields of a configuration.
        key: Field that may hold a waveform.
        owner: Dataclass of the configuration, for its other fields.

    Raises:
        ConfigError: values that describe no waveform, unknown keys beside its kind, or its fields without its kind.
    """
    values = dict(mapping)
    given = values.get(key)
    if isinstance(given, Mapping):
        values[key] = Waveform.from_mapping(given)
    wave_fields = [item.name for item in fields(Waveform) if item.name != "kind"]
    if isinstance(given, str):
        known_keys(values, [*(item.name for item in fields(owner)), *wave_fields])
        beside = {name: values.pop(name) for name in wave_fields if name in values}
        values[key] = Waveform.from_mapping({"kind": given, **beside})
    elif key not in values and not values.keys().isdisjoint(wave_fields):
        raise ConfigError(f"Missing key {key!r}, the kind of the waveform: one of {', '.join(_USED)}.")
    return values


Sigma: TypeAlias = float | Waveform
"""Standard deviation: constant, or by a waveform of time (no noise where it is below 0)."""


def check_sigma(where: str, sigma: Any) -> None:
    """Raise ConfigError unless `sigma` is a waveform, or a number of at least 0; `where` names its field."""
    if not isinstance(sigma, Waveform):
        number(where, sigma, at_least=0.0)


def is_noisy(sigma: Sigma) -> bool:
    """Whether there can be any noise."""
    return isinstance(sigma, Waveform) or sigma > 0.0


def sigma_signal(sigma: Sigma, dt_s: float) -> Signal:
    """Return the standard deviation as a function of the tick, `dt_s` long; it may fall below 0."""
    wave = sigma if isinstance(sigma, Waveform) else Waveform(kind="constant", amplitude=sigma)
    return wave.signal(dt_s)


def sigma_in_words(sigma: Sigma) -> str:
    """Return it for people."""
    return sigma.in_words("", floor=0.0) if isinstance(sigma, Waveform) else f"{sigma:g}"
