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

_FIELDS_OF_KIND: dict[str, tuple[str, ...]] = {
    "constant": ("amplitude",),
    "sine": ("amplitude", "offset", "period_s", "phase"),
    "square": ("amplitude", "offset", "period_s", "phase"),
    "sawtooth": ("amplitude", "offset", "period_s", "phase"),
    "step": ("amplitude", "offset", "start_s"),
    "table": ("times_s", "values"),
}
WAVEFORM_KINDS = tuple(_FIELDS_OF_KIND)
"""Names of the waveforms."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Waveform:
    """One value per tick, as a formula or a table.

    Raises:
        ConfigError: an unknown kind, a field that the kind does not use, a missing field, or a wrong value.
    """

    kind: str
    """One of `WAVEFORM_KINDS`."""
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
        one_of("the kind of a waveform", self.kind, WAVEFORM_KINDS)
        used = ("kind", *_FIELDS_OF_KIND[self.kind])
        for item in fields(self):
            if item.name not in used and getattr(self, item.name) != item.default:
                raise ConfigError(
                    f"Expected a {self.kind} waveform to be given by {', '.join(used[1:])} only, "
                    f"got {item.name} as well."
                )
        for name in ("amplitude", "offset", "phase"):
            number(f"{name} of a waveform", getattr(self, name))
        if "period_s" in used:
            number(f"period_s of a {self.kind} waveform", self.period_s, above=0.0)
        if "start_s" in used:
            number("start_s of a step waveform", self.start_s, at_least=0.0)
        if self.kind == "table":
            self._check_table()

    def _check_table(self) -> None:
        for name in ("times_s", "values"):
            several(f"{name} of a table waveform", getattr(self, name), "numbers")
            for value in getattr(self, name):
                number(f"every one of {name} of a table waveform", value)
        if len(self.times_s) != len(self.values):
            raise ConfigError(
                f"Expected as many values as times_s in a table waveform, got {len(self.values)} values at "
                f"{len(self.times_s)} times."
            )
        if any(later <= earlier for earlier, later in zip(self.times_s, self.times_s[1:], strict=False)):
            raise ConfigError(f"Expected times_s of a table waveform to rise strictly, got {self.times_s}.")

    @classmethod
    def sampled(cls, function: Callable[[float], float], *, until_s: float, every_s: float) -> "Waveform":
        """Tabulate a function of time, so that it can be stored with a run.

        Args:
            function: Takes a time in seconds.
            until_s: Last time that is sampled, if it is a multiple of `every_s`.
            every_s: Distance of the samples.
        """
        number("until_s", until_s, at_least=0.0)
        number("every_s", every_s, above=0.0)
        times = tuple(index * every_s for index in range(math.floor(until_s / every_s + 1e-9) + 1))
        return cls(kind="table", times_s=times, values=tuple(float(function(time_s)) for time_s in times))

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> "Waveform":
        """Build a waveform from plain values; raises ConfigError on unknown or missing keys and bad values."""
        return from_mapping(cls, mapping)

    @property
    def peak(self) -> float:
        """Largest value that the signal can take."""
        return self._ends[1]

    @property
    def trough(self) -> float:
        """Smallest value that the signal can take."""
        return self._ends[0]

    @property
    def _ends(self) -> tuple[float, float]:
        if self.kind == "constant":
            return self.amplitude, self.amplitude
        if self.kind == "table":
            return min(self.values), max(self.values)
        if self.kind == "step":
            return self.offset + min(0.0, self.amplitude), self.offset + max(0.0, self.amplitude)
        shift = 2.0 * self.amplitude * self.phase if self.kind == "sawtooth" else 0.0
        peak = self.offset + shift + abs(self.amplitude)
        return peak - 2.0 * abs(self.amplitude), peak

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
        manner = f"table of {len(self.values)} values" if self.kind == "table" else f"period {self.period_s:,g} s"
        kind = "" if self.kind == "table" else f"{self.kind}, "
        return f"{shown(self.trough)} to {shown(self.peak)}{unit} ({kind}{manner})"

    def signal(self, dt_s: float) -> Signal:
        """Return V as a function of the tick, for ticks of `dt_s` seconds; it can be pickled."""
        amplitude, offset, phase = self.amplitude, self.offset, self.phase
        if self.kind == "constant":
            return partial(_constant, amplitude)
        if self.kind == "table":
            return partial(_table, [time_s / dt_s for time_s in self.times_s], self.values)
        if self.kind == "step":
            assert self.start_s is not None, "checked at construction"
            # Half a millionth of a tick absorbs the rounding of start_s / dt_s.
            return partial(_step, self.start_s / dt_s - 5e-7, amplitude, offset)
        assert self.period_s is not None, "checked at construction"
        function = {"sine": _sine, "square": _square, "sawtooth": _sawtooth}[self.kind]
        return partial(function, self.period_s / dt_s, amplitude, offset, phase)


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


def _constant(amplitude: float, _tick: int) -> float:
    return amplitude


def _sine(period: float, amplitude: float, offset: float, phase: float, tick: int) -> float:
    return offset + amplitude * math.sin(2.0 * math.pi * (tick / period) + phase)


def _square(period: float, amplitude: float, offset: float, phase: float, tick: int) -> float:
    return offset + (amplitude if math.sin(2.0 * math.pi * (tick / period) + phase) >= 0.0 else -amplitude)


def _sawtooth(period: float, amplitude: float, offset: float, phase: float, tick: int) -> float:
    return offset + 2.0 * amplitude * (tick / period - math.floor(tick / period + 0.5) + phase)


def _step(start: float, amplitude: float, offset: float, tick: int) -> float:
    return offset + amplitude if tick >= start else offset


def _table(ticks: list[float], values: tuple[float, ...], tick: int) -> float:
    after = bisect.bisect_right(ticks, tick)
    if after == 0:
        return values[0]
    if after == len(ticks):
        return values[-1]
    share = (tick - ticks[after - 1]) / (ticks[after] - ticks[after - 1])
    return values[after - 1] + share * (values[after] - values[after - 1])


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
        raise ConfigError(f"Missing key {key!r}, the kind of the waveform: one of {', '.join(WAVEFORM_KINDS)}.")
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
