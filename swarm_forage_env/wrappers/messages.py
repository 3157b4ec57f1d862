"""Noise on what robots hear from each other, and loss of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, number
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.layout import MESSAGES
from swarm_forage_env.contract.types import FloatArray, ObsArray
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.config import from_mapping
from swarm_forage_env.wrappers.base import SwarmWrapper, WrapperConfig
from swarm_forage_env.wrappers.kernels import garble, to_normal
from swarm_forage_env.wrappers.waveform import Sigma, check_sigma, gather_waveform, sigma_in_words, sigma_signal


class MessageNoise(SwarmWrapper):
    """Disturbs the slice `messages`: in each tick a robot hears nothing with some probability, else Gaussian noise.

    Both happen where a message is heard, so two robots may hear the same one differently. In every tick numbers are
    drawn for all robots, whether they are used or not.
    """

    stack_position: ClassVar[int] = 6

    def __init__(self, env: ForageEnv | SwarmWrapper, config: "MessageNoiseConfig") -> None:
        """Wrap `env`.

        Raises:
            ConfigError: a scenario without messages.
        """
        super().__init__(env, config)
        robots = self.unwrapped.scenario.robots
        if not robots.message_size:
            raise ConfigError("Expected a scenario with messages for message_noise; give it message_size.")
        self._size = robots.message_size
        self._start = self.unwrapped.layout.part(MESSAGES).start
        # A slice that is not read is not rewritten either: noise would add up there.
        self._is_read = MESSAGES in self.unwrapped.arena.reads
        self._draws: ObsArray = np.zeros((robots.n_robots, self._size), np.float32)
        self._lost: FloatArray = np.zeros(robots.n_robots)
        self.reconfigure(config)

    def reconfigure(self, config: "MessageNoiseConfig") -> None:
        """Go on under another configuration from the next tick on."""
        self.made_from = config
        self._signal = sigma_signal(config.sigma, self.unwrapped.scenario.dt_s)
        self._loss = config.loss

    def on_reset(self, seed: int) -> None:
        """Start the random stream."""
        self._rng = stream_rng(seed, Stream.MESSAGE_NOISE)

    def observe(self, obs: ObsArray) -> ObsArray:
        """Disturb `obs` in place."""
        self._rng.random(out=self._draws, dtype=np.float32)
        to_normal(self._draws)
        self._rng.random(out=self._lost)
        if self._is_read:
            sigma = max(0.0, self._signal(self.unwrapped.tick))
            garble(obs, self._draws, self._lost, self._start, sigma, self._loss, self._size)
        return obs


@dataclass(frozen=True, kw_only=True, slots=True)
class MessageNoiseConfig(WrapperConfig):
    """A `MessageNoise` as data.

    Raises:
        ConfigError: a sigma that is negative or no number, or a loss that is no probability.
    """

    name: ClassVar[str] = "message_noise"
    stack_position: ClassVar[int] = MessageNoise.stack_position

    sigma: Sigma = 0.0
    """Standard deviation of what is added to each number heard."""
    loss: float = 0.0
    """Probability, per robot and tick, that it hears nothing at all."""
    example: ClassVar[str] = "sigma=0.1"

    def __post_init__(self) -> None:
        check_sigma("message_noise.sigma", self.sigma)
        number("message_noise.loss", self.loss, at_least=0.0, at_most=1.0)

    def wrap(self, env: ForageEnv | SwarmWrapper) -> MessageNoise:
        """Build the wrapper around `env`."""
        return MessageNoise(env, self)

    def in_words(self, dt_s: float) -> str:
        """Return how noisy messages are, and how many are lost; see `WrapperConfig.in_words`."""
        return f"message noise: sigma {sigma_in_words(self.sigma)}, {100 * self.loss:g} % lost"

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> "MessageNoiseConfig":
        """Build the configuration from plain values; a waveform as `waveform.gather_waveform` reads it."""
        return from_mapping(cls, gather_waveform(mapping, "sigma", cls))
