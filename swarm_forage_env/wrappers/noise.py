"""Noise on what robots sense, and on what their wheels do."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Meta

from swarm_forage_env._internal.fields import known_name
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.types import ActionArray, BoolArray, CodeArray, FloatArray, ObsArray
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.world.kernels.disturbances import (
    NOT_NOISY,
    Noise,
    disturb,
    draw_bits,
    new_lanes,
    noisy_gain,
    room_for_draws,
)
from swarm_forage_env.wrappers.base import SwarmWrapper, WrapperConfig
from swarm_forage_env.wrappers.waveform import Sigma, Signal, Waveform, is_noisy, sigma_in_words, wave_of

NOISE_GROUPS = ("proximity", "light", "ground", "wheel_speed", "position", "heading")
"""Groups of sensors that can be noisy, in the order of their columns."""
POSE_GROUPS = NOISE_GROUPS[4:]
"""Groups that the authors' program leaves exact (quirk `pose_sensors_exact`); the paper speaks of all sensors."""
N_LEVELS = 8
"""Levels of noise in equal steps from 0, which is the ideal (study configuration)."""

_READINGS = ("proximity", "light", "ground")
"""Groups with values in [0, 1]; those of the others lie in [-1, 1]."""
_NATURAL_UNITS = {"wheel_speed": 0.01}
"""What sigma = 1 is in the natural unit of a group's columns: 1 cm/s in m/s; for the others 1 (reading, m, rad)."""


class SensorNoise(SwarmWrapper):
    """Perturbs what policies see. The rules of the arena and the measure of interference use exact readings.

    Unit of sigma: 1 for readings (proximity, light, ground; clamped to [0, 1]), 1 cm/s for wheel speeds and 1 m per
    axis for positions (both clamped to the ends of their range), 1 rad for the heading, whose angle is perturbed. All
    other columns stay exact, rows of robots that are not present stay zero.

    In every tick a number is drawn for each robot and noisy column, whether it is used or not. So a death, the policy's
    choice of slices and the size of sigma do not change the draws of other robots and columns.

    Adds a column to the run record: `believed_interference_fraction`, the obstacle rule on what robots see. The
    authors' program counts this as interference, false obstacles included; the measures count true ones only.
    """

    stack_position: ClassVar[int] = 1

    def __init__(self, env: ForageEnv | SwarmWrapper, config: "SensorNoiseConfig") -> None:
        """Wrap `env`."""
        super().__init__(env, config)
        self._proximity = self.unwrapped.layout.part("proximity").start
        self._behind_counts = self.unwrapped.scenario.quirks.obstacle_behind_counts
        self.reconfigure(config)

    def reconfigure(self, config: "SensorNoiseConfig") -> None:
        """Go on under another configuration from the next tick on; with other noisy groups, all draws are others."""
        self.made_from = config
        exact = POSE_GROUPS if self.unwrapped.scenario.quirks.pose_sensors_exact else ()
        sigmas = config.group_sigmas().items()
        noisy = {name: sigma for name, sigma in sigmas if is_noisy(sigma) and name not in exact}
        self._place_groups(noisy)
        self._draws = room_for_draws(self.unwrapped.scenario.robots.n_robots * len(self._units))

    def _place_groups(self, sigmas: dict[str, Sigma]) -> None:
        """Give each noisy group its columns of the draws, in a fixed order, and the factors from draws to noise."""
        env = self.unwrapped
        parts = {part.noise_group: part for part in env.layout if part.noise_group in sigmas}
        units: list[float] = []
        lows: list[float] = []
        spans: list[tuple[int, int, int, int]] = []
        self._varying: list[tuple[slice, Signal]] = []
        heading = 0, NOT_NOISY
        for name in (name for name in NOISE_GROUPS if name in sigmas):
            part, first = parts[name], len(units)
            units += [1.0] if name == "heading" else [_NATURAL_UNITS.get(name, 1.0) / scale for scale in part.scale]
            columns = slice(first, len(units))
            lows += [0.0 if name in _READINGS else -1.0] * (len(units) - first)
            self._varying.append((columns, wave_of(sigmas[name]).signal(env.scenario.dt_s, least=0.0)))
            # Other slices are not read, and the environment does not rewrite them: noise would add up there.
            if part.name not in env.arena.reads:
                continue
            if name == "heading":
                heading = part.start, first
                continue
            of_carriers = int(part.name == "light" and env.arena.light_of_carriers_only)
            start, begun, size, of_same = spans[-1] if spans else (0, 0, 0, 0)
            if size and (start + size, begun + size, of_same) == (part.start, first, of_carriers):
                spans[-1] = start, begun, size + part.size, of_same  # few long runs of columns are faster
            else:
                spans.append((part.start, first, part.size, of_carriers))
        self._units: ObsArray = np.array(units, np.float32)
        self._noise = Noise(np.array(spans, np.int32).reshape(-1, 4), np.array(lows, np.float32), heading)
        self._constant = None
        if not any(isinstance(sigma, Waveform) for sigma in sigmas.values()):
            self._constant = self._factors(0, 1)

    def _factors(self, tick: int, n_ticks: int) -> ObsArray:
        """Return the factors (n_ticks, C) from draws to noise of some ticks, or (1, C) where they do not change."""
        if self._constant is not None:
            return self._constant
        factors = np.empty((n_ticks, len(self._units)), np.float32)
        for columns, signal in self._varying:
            sigmas = signal.ahead(tick)[:n_ticks].astype(np.float32)
            factors[:, columns] = sigmas[:, None] * self._units[columns]
        return factors

    def on_reset(self, seed: int) -> None:
        """Start the random stream."""
        self._lanes = new_lanes(stream_rng(seed, Stream.SENSOR_NOISE))
        self._believing = np.zeros(2)

    def observe(self, obs: ObsArray) -> ObsArray:
        """Perturb `obs` in place."""
        env = self.unwrapped
        factors, swarm = self._factors(env.tick, 1)[0], env.swarm
        draw_bits(self._lanes, self._draws)
        self._share_that_believes = disturb(
            obs,
            swarm.present,
            swarm.active,
            swarm.carried_object,
            self._draws,
            factors,
            self._noise,
            self._proximity,
            self._behind_counts,
        )
        return obs

    def after_step(self, tasks: CodeArray | None, terminated: BoolArray, truncated: bool) -> None:
        """Count who believes in an obstacle."""
        self._believing += self._share_that_believes, 1.0

    def ahead(self, n_ticks: int) -> tuple[int, dict[str, Any]]:
        """Return what disturbs the observations after the coming ticks."""
        tick = self.unwrapped.tick + 1
        n_ticks = min([n_ticks, *(len(signal.ahead(tick)) for _, signal in self._varying)])
        return n_ticks, {
            "lanes": self._lanes,
            "draws": self._draws,
            "factors": self._factors(tick, n_ticks),
            "noise": self._noise,
            "believing": self._believing,
        }

    def interval_columns(self) -> dict[str, float]:
        """Return the mean over ticks of the share of active robots that believed in an obstacle."""
        believing, n_ticks = self._believing.tolist()
        self._believing[:] = 0.0
        return {"believed_interference_fraction": believing / n_ticks}


class ActuatorNoise(SwarmWrapper):
    """Multiplies each wheel's speed by its own factor in every tick, with mean 1 and standard deviation sigma."""

    stack_position: ClassVar[int] = 4

    def __init__(self, env: ForageEnv | SwarmWrapper, config: "ActuatorNoiseConfig") -> None:
        """Wrap `env`."""
        super().__init__(env, config)
        scenario = self.unwrapped.scenario
        self.reconfigure(config)
        self._unit_gain: FloatArray = np.ones((scenario.robots.n_robots, 2))
        self._gain: FloatArray = np.ones((scenario.robots.n_robots, 2))
        self._draws = room_for_draws(2 * scenario.robots.n_robots)

    def reconfigure(self, config: "ActuatorNoiseConfig") -> None:
        """Go on under another configuration from the next tick on."""
        self.made_from = config
        self._is_noisy = is_noisy(config.sigma)
        self._factors = wave_of(config.sigma).signal(self.unwrapped.scenario.dt_s, least=0.0)

    def on_reset(self, seed: int) -> None:
        """Start the random stream."""
        self._lanes = new_lanes(stream_rng(seed, Stream.ACTUATOR_NOISE))

    def gain(self, actions: ActionArray, wheel_gain: FloatArray | None) -> FloatArray | None:
        """Multiply this tick's factors into the gains."""
        if not self._is_noisy:
            return wheel_gain
        outer_gain = self._unit_gain if wheel_gain is None else wheel_gain
        draw_bits(self._lanes, self._draws)
        factor = self._factors(self.unwrapped.tick + 1)
        noisy_gain(self._draws, factor, outer_gain, self._gain)
        return self._gain

    def ahead(self, n_ticks: int) -> tuple[int, dict[str, Any]]:
        """Return the noise on wheels in the coming ticks."""
        if not self._is_noisy:
            return n_ticks, {}
        factors = self._factors.ahead(self.unwrapped.tick + 1)
        return min(n_ticks, len(factors)), {
            "wheel_lanes": self._lanes,
            "wheel_draws": self._draws,
            "wheel_factors": factors,
            "gain": self._gain,
        }


@dataclass(frozen=True, kw_only=True, slots=True)
class SensorNoiseConfig(WrapperConfig):
    """A `SensorNoise` as data.

    Raises:
        ConfigError: an unknown group, or a sigma that is negative or no number.
    """

    name: ClassVar[str] = "sensor_noise"
    wrapper: ClassVar[type[SwarmWrapper]] = SensorNoise
    waveform_field: ClassVar[str] = "sigma"

    sigma: Sigma = 0.0
    """Standard deviation for all of `groups`, in the unit of each."""
    groups: Annotated[tuple[str, ...], Meta(min_length=1)] = NOISE_GROUPS
    """Which of `NOISE_GROUPS` are noisy; kept in that order."""
    sigmas: Mapping[str, Sigma] = field(default_factory=dict, hash=False)
    """Group -> its own standard deviation, instead of `sigma`; the group need not be among `groups`."""
    example: ClassVar[str] = "sigma=0.03"

    def check(self) -> None:
        """Refuse unknown groups, and put the others in order."""
        for name in (*self.groups, *self.sigmas):
            known_name("group of sensors", name, NOISE_GROUPS)
        object.__setattr__(self, "groups", tuple(name for name in NOISE_GROUPS if name in self.groups))

    def group_sigmas(self) -> dict[str, Sigma]:
        """Return the standard deviation of each group that is named."""
        return {**dict.fromkeys(self.groups, self.sigma), **self.sigmas}

    def in_words(self, dt_s: float) -> str:
        """Return which sensors are how noisy; see `WrapperConfig.in_words`."""
        by_sigma: dict[str, list[str]] = {}
        for group, sigma in self.group_sigmas().items():
            by_sigma.setdefault(sigma_in_words(sigma), []).append(group.replace("_", " "))
        parts = [
            f"sigma {sigma} ({'all sensors' if len(groups) == len(NOISE_GROUPS) else ', '.join(groups)})"
            for sigma, groups in by_sigma.items()
        ]
        return f"sensor noise: {'; '.join(parts)}"

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> WrapperConfig:
        """Build the configuration from plain values; groups may be one text, joined by "+"."""
        values = dict(mapping)
        if isinstance(values.get("groups"), str):
            values["groups"] = values["groups"].split("+")
        return super(SensorNoiseConfig, cls).from_mapping(values)


@dataclass(frozen=True, kw_only=True, slots=True)
class ActuatorNoiseConfig(WrapperConfig):
    """An `ActuatorNoise` as data.

    Raises:
        ConfigError: a sigma that is negative or no number.
    """

    name: ClassVar[str] = "actuator_noise"
    wrapper: ClassVar[type[SwarmWrapper]] = ActuatorNoise
    waveform_field: ClassVar[str] = "sigma"

    sigma: Sigma
    """Standard deviation of the factor on a wheel's speed."""
    example: ClassVar[str] = "sigma=0.1"

    def in_words(self, dt_s: float) -> str:
        """Return how noisy wheels are; see `WrapperConfig.in_words`."""
        return f"wheel noise: sigma {sigma_in_words(self.sigma)}"


def noise_levels(sigma_max: float = 0.03) -> tuple[tuple[SensorNoiseConfig, ActuatorNoiseConfig], ...]:
    """Return the noise of the paper's robustness studies: Gaussian, one sigma for all sensors and the wheels.

    Args:
        sigma_max: Highest sigma: 0.03 in the warehouses and 0.10 in search and rescue (paper; the study configuration
            of search and rescue has 0.05).
    """
    return tuple(
        (SensorNoiseConfig(sigma=sigma), ActuatorNoiseConfig(sigma=sigma))
        for sigma in np.linspace(0.0, sigma_max, N_LEVELS).tolist()
    )
