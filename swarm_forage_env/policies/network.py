"""Trained policies without torch: a small network in a file, evaluated by a kernel.

A file is an `.npz` of plain arrays: the layers of the network ("weight_0", "bias_0", ...) and "about", the JSON text of
`NetworkAbout`. Nothing in it is executed, so it is safe to open a file from an unknown source.
"""

import dataclasses
import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from swarm_forage_env._internal.archives import ArchiveError, read_arrays
from swarm_forage_env._internal.fields import Checked, ConfigError, number, one_of, read
from swarm_forage_env._internal.files import json_text, parse_json, replacing
from swarm_forage_env.contract.kernel_policy import KernelPolicy
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.contract.types import ObsArray
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface, any_swarm
from swarm_forage_env.policies.kernels.network import Choice, Layers, forward, step_network
from swarm_forage_env.policies.kernels.products import LANES, ROWS
from swarm_forage_env.policies.learned import InterfacePolicy, check_extra
from swarm_forage_env.scenarios.config import CACHE_KINDS

TEMPERATURES = (0.0001, 100.0)
"""Least and largest temperature; our choice: further out, actions are drawn as by the likeliest or by chance. Values of
actions (DQN) lie closer together than logits, and need a lower one."""
_LAYER_PARTS = ("weight", "bias")


class NetworkError(ConfigError):
    """A file that does not hold a network, or a network that does not fit its interface."""


@dataclass(frozen=True, kw_only=True, slots=True)
class NetworkAbout(Checked):
    """What is needed besides the weights, as plain values.

    Raises:
        ConfigError: an unknown word, or a choice that is neither True nor False.
    """

    interface: InterfaceConfig
    activation: str
    """"tanh" or "relu", what follows on every layer except the last. The weights do not tell it."""
    samples: bool
    """Whether discrete actions are drawn by the softmax of the outputs, as the logits of PPO and A2C want it; if not,
    the one with the largest output is taken. Continuous actions are always the mean."""
    caches: str = "none"
    """Kind of caches that the policy was trained with; the default for its runs."""
    card: dict[str, Any] = field(default_factory=dict)
    """How the network was made, as a text for readers."""

    def check(self) -> None:
        """Refuse other activations and caches than there are."""
        one_of("activation", self.activation, ("tanh", "relu"))
        one_of("caches", self.caches, CACHE_KINDS)

    def to_json(self) -> str:
        """Return the text that files hold."""
        return json_text("what a network says of itself", dataclasses.asdict(self), sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> "NetworkAbout":
        """Read the text back; raises NetworkError where it says something else."""
        try:
            return read(cls, parse_json(text))
        except ValueError as error:
            raise NetworkError(f"Expected a description of a network, got {text[:80]!r}: {error}") from error


@dataclass(frozen=True, slots=True)
class Network:
    """Layers of a perceptron with one kind of activation, and what is needed besides."""

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
        if not all(array.dtype.kind == "f" and _is_finite(array) for array in (*self.weights, *self.biases)):
            raise NetworkError("Expected weights and biases that are finite numbers; did the training diverge?")
        if self.about.interface.without:
            first = self.weights[0].copy()
            first[any_swarm(self.about.interface).hidden] = 0.0  # it weighs nothing unseen
            object.__setattr__(self, "weights", (first, *self.weights[1:]))

    def check_fits(self, interface: LearnerInterface) -> None:
        """Refuse an interface with other columns or actions than the network takes and gives; raises NetworkError."""
        wanted, found = interface.widths, (self.n_columns, len(self.biases[-1]))
        if wanted != found:
            raise NetworkError(
                f"Expected a network from {wanted[0]} columns to {wanted[1]} actions, as its interface says, got one "
                f"from {found[0]} to {found[1]}; give the interface that it was trained with."
            )

    @property
    def n_columns(self) -> int:
        """How many columns a robot sees."""
        return len(self.weights[0])

    def outputs(self, rows: ObsArray) -> np.ndarray:
        """Return the last layer's values for observations (N, d), (N, m) float32, before any choice of actions.

        A row has the same bits on every machine, and whatever other rows there are (`policies.kernels.network`).

        Raises:
            NetworkError: rows of another number of columns than the network takes.
        """
        if rows.ndim != 2 or rows.shape[1] != self.n_columns:
            raise NetworkError(f"Expected observations (N, {self.n_columns}), as the network takes, got {rows.shape}.")
        n_rows = len(rows)
        values = np.empty((n_rows, len(self.biases[-1])), np.float32)
        forward(np.ascontiguousarray(rows, np.float32), self.layers(), np.ones(n_rows, np.bool_), values)
        return values

    def choose(self, rows: ObsArray, rng: np.random.Generator) -> np.ndarray:
        """Return an action for each row (N, d) of what the network sees, as `LearnerInterface` takes them."""
        outputs = self.outputs(rows)
        if self.about.interface.actions != "discrete":
            return np.clip(outputs, -1.0, 1.0)
        if self.about.samples:
            outputs = outputs + rng.gumbel(size=outputs.shape)  # the largest is a draw by the softmax
        return outputs.argmax(axis=1)

    def at_temperature(self, temperature: float) -> "Network":
        """Return a network that draws discrete actions by probabilities to the power of 1 / temperature.

        Its last layer is divided by the temperature: below 1, likely actions become likelier. The likeliest action
        stays the likeliest.

        Raises:
            ConfigError: a temperature out of `TEMPERATURES`, or a network that does not draw discrete actions.
        """
        if temperature == 1.0:
            return self
        number("temperature", temperature, at_least=TEMPERATURES[0], at_most=TEMPERATURES[1])
        if self.about.interface.actions != "discrete" or not self.about.samples:
            raise NetworkError(
                "Expected a network that draws discrete actions, got one that takes the likeliest or the mean."
            )
        divisor = np.float32(temperature)
        return dataclasses.replace(
            self,
            weights=(*self.weights[:-1], self.weights[-1] / divisor),
            biases=(*self.biases[:-1], self.biases[-1] / divisor),
        )

    def layers(self) -> Layers:
        """Return the layers as kernels take them, with room of their own to work in."""
        widest = max(size for weight in self.weights for size in weight.shape)
        width = -(-widest // LANES) * LANES
        numbers = np.zeros((sum(len(weight) + 1 for weight in self.weights), width), np.float32)
        row = 0
        for weight, bias in zip(self.weights, self.biases, strict=True):
            numbers[row, : len(bias)] = bias
            numbers[row + 1 : row + 1 + len(weight), : len(bias)] = weight
            row += len(weight) + 1
        sizes = np.array([len(self.weights[0]), *(len(bias) for bias in self.biases)], np.int32)
        return Layers(
            sizes=sizes,
            numbers=numbers,
            is_tanh=self.about.activation == "tanh",
            samples=self.about.samples,
            before=np.zeros((ROWS, width), np.float32),
            after=np.zeros((ROWS, width), np.float32),
            places=np.zeros(ROWS, np.int32),
            powers=np.zeros(len(self.biases[-1])),
        )

    @classmethod
    def from_state_dict(cls, state: Mapping[str, Any], about: NetworkAbout) -> "Network":
        """Take the layers of a perceptron from the state dict of a torch module.

        Args:
            state: Tensors by name, in the order of the layers: (out, in) under names that end in "weight", (out,) under
                names that end in "bias". Others are left out.
            about: What is needed besides the weights.

        Raises:
            NetworkError: the layers do not follow on each other, or do not fit the interface.
        """
        weights, biases = (
            tuple(_array(tensor) for name, tensor in state.items() if name.endswith(end)) for end in _LAYER_PARTS
        )
        network = cls(tuple(np.ascontiguousarray(array.T) for array in weights), biases, about)
        network.check_fits(any_swarm(about.interface))
        return network

    def save(self, path: str | Path) -> None:
        """Write the file; an existing one is replaced.

        Raises:
            NetworkError: the layers do not fit the interface.
        """
        self.check_fits(any_swarm(self.about.interface))
        layers = {f"weight_{k}": weight for k, weight in enumerate(self.weights)}
        layers |= {f"bias_{k}": bias for k, bias in enumerate(self.biases)}
        with replacing(Path(path)) as draft, draft.open("wb") as file:
            np.savez_compressed(file, about=np.array(self.about.to_json()), **layers)  # type: ignore[arg-type] - no name of a layer is "allow_pickle"

    @classmethod
    def load(cls, path: str | Path) -> "Network":
        """Read a file.

        Raises:
            OSError: the file cannot be read.
            NetworkError: it does not hold a network.
        """
        try:
            stored = read_arrays(Path(path))
            n_layers = sum(name.startswith("weight_") for name in stored)
            names = [f"{part}_{k}" for part in _LAYER_PARTS for k in range(n_layers)]
            if {*stored} != {"about", *names}:
                raise NetworkError(f"Expected the arrays {', '.join(['about', *names])}, got {', '.join(stored)}.")
            weights, biases = ([stored[f"{part}_{k}"] for k in range(n_layers)] for part in _LAYER_PARTS)
            return cls(tuple(weights), tuple(biases), NetworkAbout.from_json(str(stored["about"])))
        except (ArchiveError, NetworkError) as error:
            raise NetworkError(f"Expected {path} to hold a network: {error}") from error


def _is_finite(layer: np.ndarray) -> bool:
    """Whether a layer is finite as kernels take it, float32."""
    with np.errstate(over="ignore"):
        return bool(np.isfinite(layer.astype(np.float32)).all())


def _array(tensor: Any) -> np.ndarray:
    on_host = tensor.detach().cpu() if hasattr(tensor, "detach") else tensor
    return np.asarray(on_host, np.float32)


class NetworkPolicy(KernelPolicy, InterfacePolicy):
    """A network file as a policy.

    Robots decide for themselves also while they are in repair. One that is not in the world decides nothing.
    """

    _kernel = staticmethod(step_network)

    def __init__(self, network: Network) -> None:
        """Take the network; `reset` checks that it fits its interface."""
        super().__init__(network.about.interface, caches=network.about.caches)
        self._network = network
        self.decision_ticks = network.about.interface.decision_ticks

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Start a run.

        Raises:
            NetworkError: the network has another number of columns or actions than its interface.
            ExtraFunctionError: it was trained with `extra_observation`.
        """
        check_extra(self._config, None)
        self._bind(spec)
        self._network.check_fits(self.interface)
        layers, n_robots = self._network.layers(), spec.n_robots
        n_columns, n_actions = self.interface.widths
        self._choice = Choice(
            seen=np.zeros((n_robots, n_columns), np.float32),
            outputs=np.zeros((n_robots, n_actions), np.float32),
            number=np.zeros(n_robots, np.int32),
            is_made=np.zeros(n_robots, np.bool_),
        )
        n_draws = 1 if layers.samples and self.interface.translation.is_discrete else 0
        actions = np.zeros((n_robots, spec.action_size), np.float32)
        self._start(spec, rng, n_draws, self.interface.translation, layers, self._choice, actions)

    @property
    def seen(self) -> ObsArray:
        """(N, d) what robots saw in the last decision; the array is reused by the next one."""
        return self._choice.seen

    @property
    def chosen(self) -> np.ndarray:
        """Actions of the last decision, one row per robot; see `LearnerInterface`."""
        return self._choice.number if self.interface.translation.is_discrete else self._choice.outputs
