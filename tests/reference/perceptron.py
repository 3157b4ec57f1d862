"""A network as numpy writes it, with sums and tanh in the order that `policies.kernels.network` promises."""

import math

import numpy as np

from swarm_forage_env.policies.network import Network


def outputs(weights: list[np.ndarray], biases: list[np.ndarray], rows: np.ndarray, activation: str) -> np.ndarray:
    """Values of the last layer for rows (N, d), float32, bit for bit."""
    value = rows.astype(np.float32)
    for layer, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        value = summed(value, weight, bias)
        if layer < len(weights) - 1:
            value = tanh(value) if activation == "tanh" else np.maximum(value, np.float32(0.0))
    return value


def summed(value: np.ndarray, weight: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """Sums of a layer: from left to right, each product rounded before it is added."""
    total = np.tile(bias, (len(value), 1))
    for k in range(weight.shape[0]):
        total = total + value[:, k : k + 1] * weight[k]
    return total


def tanh(value: np.ndarray) -> np.ndarray:
    """Lambert's fraction at a quarter of the number, doubled twice; float32 throughout."""
    x = np.float32(0.25) * np.clip(value, np.float32(-9.0), np.float32(9.0))
    s = x * x
    odd, even = np.float32([1.0, 378.0, 17325.0, 135135.0]), np.float32([28.0, 3150.0, 62370.0, 135135.0])
    n = x * (((odd[0] * s + odd[1]) * s + odd[2]) * s + odd[3])
    d = ((even[0] * s + even[1]) * s + even[2]) * s + even[3]
    for _ in range(2):
        n, d = np.float32(2.0) * n * d, d * d + n * n
    return n / d


def probabilities(logits: np.ndarray) -> list[float]:
    """Softmax of one row."""
    powers = [math.exp(float(logit) - float(max(logits))) for logit in logits]
    return [one / sum(powers) for one in powers]


class SlowNetwork:
    """A network as a controller of `LearnedPolicy`, with the draws of a policy that had the generator."""

    def __init__(self, network: Network, n_robots: int, rng: np.random.Generator) -> None:
        """Take the network, and the generator that belongs to nobody else."""
        self.network, self.n_robots, self.rng = network, n_robots, rng

    def __call__(self, rows: np.ndarray, _rng: np.random.Generator) -> np.ndarray:
        """Return the actions of a decision; robots that are away, whose rows are zeros, do nothing."""
        here = rows.any(axis=1)
        network, about = self.network, self.network.about
        values = outputs(list(network.weights), list(network.biases), rows, about.activation)
        if about.interface.actions != "discrete":
            return np.where(here[:, None], np.clip(values, np.float32(-1.0), np.float32(1.0)), np.float32(0.0))
        if not about.samples:
            return np.where(here, values.argmax(axis=1), 0)
        chances = self.rng.random((about.interface.decision_ticks, self.n_robots))[0]  # those of other ticks are unused
        drawn = [
            int(np.searchsorted(np.cumsum(probabilities(row)), chance, side="right"))
            for row, chance in zip(values, chances, strict=True)
        ]
        return np.where(here, drawn, 0)
