"""Heaps of robots that touch each other."""

import math

import numpy as np

RADIUS_M = 0.085036758
DIAMETER_M = 2 * RADIUS_M


def heap(rng: np.random.Generator, n_robots: int) -> np.ndarray:
    """Places (N, 2) in m around the origin, of robots that touch and overlap a little."""
    side = math.sqrt(n_robots) * DIAMETER_M * 0.95
    while True:
        places = rng.uniform(-side / 2, side / 2, (n_robots, 2))
        for _ in range(400):  # pushed apart, not quite
            away = places[:, None] - places[None]
            distance = np.hypot(away[..., 0], away[..., 1]) + np.eye(n_robots)
            overlap = np.clip(0.99 * DIAMETER_M - distance, 0.0, None) * (1 - np.eye(n_robots))
            places = places + 0.25 * np.sum(overlap[..., None] * away / distance[..., None], axis=1)
        if distance[~np.eye(n_robots, dtype=bool)].min() > 0.9 * DIAMETER_M:
            return places
