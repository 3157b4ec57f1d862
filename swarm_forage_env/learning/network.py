"""Trained policies without torch: a small network in a file, evaluated by numpy.

A file is an `.npz` of plain arrays: the layers of the network ("weight_0", "bias_0", ...) and "about", the JSON text
of `NetworkAbout`. Nothing in it is executed, so that opening a file from a stranger is safe.
"""

import dataclasses
import itertools
import json
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from swarm_forage_env.config import ConfigError, suggestion
from swarm_forage_env.learning.interface import InterfaceConfig, LearnerInterface, interface_from_mapping
from swarm_forage_env.policy import SwarmTask
from swarm_forage_env.types import ActionArray, BoolArray, ObsArray

ACTIVATIONS = ("tanh", "relu")


class NetworkError(ValueError):
    """A file that holds no network, or a network that does not fit its interface."""


@dataclass(frozen=True, kw_only=True, slots=True)
class NetworkAbout:
    """What the weights alone do not say. Plain values."""

    interface: InterfaceConfig
    activation: str = "tanh"
    """After every layer but the last."""
    samples: bool = False
    """Whether discrete actions are drawn by their probabilities; else the likeliest is taken. Continuous actions are
    always the mean."""
    caches: str = "none"
    """World that the policy was trained in; what runs build when not told otherwise."""
    card: dict[str, Any] = field(default_factory=dict)
    """How the network came about, for people."""

    def __post_init__(self) -> None:
        if self.activation not in ACTIVATIONS:
            raise NetworkError(f"Expected an activation of {', '.join(ACTIVATIONS)}, got {self.activation!r}.")

    def to_json(self) -> str:
        """Return the text that files hold."""
        return json.dumps(dataclasses.asdict(self), sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> "NetworkAbout":
        """Read the text back.

        Raises:
            NetworkError: no JSON object, or unknown or missing keys.
        """
        try:
            mapping = json.loads(text)
            known = cls.__dataclass_fields__
            for key in mapping:
                if key not in known:
                    raise NetworkError(f"Unknown key {key!r} about a network.{suggestion(key, known)}")
            return cls(**{**mapping, "interface": interface_from_mapping(mapping["interface"])})
        except (json.JSONDecodeError, TypeError, KeyError, ConfigError) as error:
            raise NetworkError(f"Expected a description of a network as JSON, got {text[:80]!r}: {error}.") from error


@dataclass(frozen=True, slots=True)
class Network:
    """Layers of a perceptron with one hidden activation, and what it is about."""

    weights: tuple[np.ndarray, ...]
    """(in, out) float32 per layer."""
    biases: tuple[np.ndarray, ...]
    """(out,) float32 per layer."""
    about: NetworkAbout

    def __post_init__(self) -> None:
        sizes = [weight.shape for weight in self.weights]
        fits = len(self.weights) == len(self.biases) > 0 and all(
            weight.ndim == 2 and bias.shape == weight.shape[1:]
            for weight, bias in zip(self.weights, self.biases, strict=True)
        )
        if not fits or any(left[1] != right[0] for left, right in itertools.pairwise(sizes)):
            raise NetworkError(f"Expected layers that follow on each other, got weights {sizes}.")

    def outputs(self, rows: ObsArray) -> np.ndarray:
        """Return the last layer's values for observations (N, d), before any choice of actions."""
        value: np.ndarray = rows
        last = len(self.weights) - 1
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            value = value @ weight + bias
            if layer < last:
                value = np.tanh(value) if self.about.activation == "tanh" else np.maximum(value, 0.0)
        return value

    def save(self, path: str | Path) -> None:
        """Write the file; an existing one is replaced."""
        layers = {f"weight_{k}": weight for k, weight in enumerate(self.weights)}
        layers |= {f"bias_{k}": bias for k, bias in enumerate(self.biases)}
        with Path(path).open("wb") as file:
            np.savez_compressed(file, about=np.array(self.about.to_json()), **layers)  # type: ignore[arg-type]

    @classmethod
    def load(cls, path: str | Path) -> "Network":
        """Read a file.

        Raises:
            OSError: the file cannot be read.
            NetworkError: it holds no network.
        """
        try:
            with np.load(path, allow_pickle=False) as stored:
                n_layers = sum(name.startswith("weight_") for name in stored.files)
                weights = tuple(stored[f"weight_{k}"] for k in range(n_layers))
                biases = tuple(stored[f"bias_{k}"] for k in range(n_layers))
                about = NetworkAbout.from_json(str(stored["about"]))
        except (zipfile.BadZipFile, ValueError, KeyError) as error:
            raise NetworkError(f"Expected {path} to hold a network: {error}") from error
        return cls(weights, biases, about)


class NetworkPolicy:
    """A trained network that drives every robot alike. An instance drives one run."""

    def __init__(self, network: Network) -> None:
        """Take the network."""
        self._network = network
        self._config = network.about.interface

    @property
    def caches(self) -> str:
        """World that the policy was trained in."""
        return self._network.about.caches

    @property
    def reads(self) -> tuple[str, ...] | None:
        """Observation slices that are looked at."""
        return self._config.reads

    def reset(self, task: SwarmTask, rng: np.random.Generator) -> None:
        """Start a run.

        Raises:
            NetworkError: the network sees or does something else than its interface in this world.
        """
        self._rng = rng
        self._interface = LearnerInterface(self._config, task)
        seen, done = self._interface.layout.size, self._interface.action_space
        wanted = (seen, int(done.n) if self._is_discrete else done.shape[0])  # type: ignore[union-attr,index]
        found = (self._network.weights[0].shape[0], self._network.weights[-1].shape[1])
        if wanted != found:
            raise NetworkError(
                f"Expected a network from {wanted[0]} columns to {wanted[1]} actions in this world, got one from "
                f"{found[0]} to {found[1]}."
            )
        self._view = np.empty((task.n_robots, seen), np.float32)
        self._ticks_left = 0

    @property
    def _is_discrete(self) -> bool:
        return self._config.actions == "discrete"

    def act(self, obs: ObsArray, active: BoolArray) -> ActionArray:
        """Choose actions; see `Policy.act`. The returned (N, 3) array is reused by the next call."""
        if self._ticks_left == 0:
            self._actions = self._choose(self._network.outputs(self._interface.observe(obs, self._view)))
            self._ticks_left = self._config.decision_ticks
        self._ticks_left -= 1
        return self._interface.command(self._actions, obs)

    def _choose(self, outputs: np.ndarray) -> np.ndarray:
        if not self._is_discrete:
            return np.clip(outputs, -1.0, 1.0)
        if self._network.about.samples:
            # Gumbel's trick: the largest of logits plus such noise is a draw by their probabilities.
            outputs = outputs - np.log(-np.log(self._rng.uniform(1e-12, 1.0, outputs.shape)))
        return np.argmax(outputs, axis=1)
