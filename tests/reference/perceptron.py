"""A perceptron as numpy writes it, with sums and tanh in the order that `policies.kernels` promises."""

import numpy as np


def outputs(weights: list[np.ndarray], biases: list[np.ndarray], rows: np.ndarray, activation: str) -> np.ndarray:
    """Values of the last layer for rows (N, d), float32, bit for bit."""
    value = rows.astype(np.float32)
    for layer, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        total = np.tile(bias, (len(value), 1))
        for k in range(weight.shape[0]):  # from left to right, each product rounded before it is added
            total = total + value[:, k : k + 1] * weight[k]
        value = total
        if layer < len(weights) - 1:
            value = tanh(value) if activation == "tanh" else np.maximum(value, np.float32(0.0))
    return value


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
