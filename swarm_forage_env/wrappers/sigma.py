"""How strong a noise is: a standard deviation, constant or by a waveform of time; all noise wrappers take one."""

from typing import Any, TypeAlias

from swarm_forage_env._internal.fields import number
from swarm_forage_env.wrappers.waveform import Signal, Waveform

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
