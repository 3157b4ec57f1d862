"""What the experiments are that claims speak of, and the levels that the claims name."""

import numpy as np

EXPERIMENTS: dict[str, str] = {
    "S1a": "small warehouse, 1 to 128 robots",
    "S1b": "medium warehouse, 1 to 512 robots",
    "S1c": "small warehouse, 50 robots, throttled while carrying",
    "S1d": "medium warehouse, 200 robots, throttled while carrying",
    "S1e": "small warehouse, 50 robots, noise",
    "S1f": "medium warehouse, 200 robots, noise",
    "S1g": "small warehouse, 50 robots, malfunctions and repairs",
    "S1h": "medium warehouse, 200 robots, malfunctions and repairs",
    "S2a still": "search and rescue, 12 to 819 robots, objects at rest",
    "S2a slow": "search and rescue, 12 to 819 robots, objects that move with the smallest probability",
    "S2a fast": "search and rescue, 12 to 819 robots, objects that move with the largest probability",
    "S2b 12": "search and rescue, 12 robots, throttled motion",
    "S2b 115": "search and rescue, 115 robots, throttled motion",
    "S2b 320": "search and rescue, 320 robots, throttled motion",
    "S2c 320": "search and rescue, 320 robots, noise",
    "S2d 115": "search and rescue, 115 robots, deaths",
    "S2d 320": "search and rescue, 320 robots, deaths",
}
"""Experiments whose scores the claims speak of. In S1a, S1b and S2a the levels are swarm sizes, in S1c, S1d and S2b
distances from ideal conditions, in the others the disturbance; the undisturbed level is left out."""

SIGMAS = 0.03 / 7.0 * np.arange(8)
"""Standard deviations of noise in the warehouses, from none to the largest."""
ONSET = (float(SIGMAS[3]), float(SIGMAS[5]))
"""About 0.017, the fifth of them: from the one below it to the one above."""
LARGER = (0.01, 0.05)
"""Where noise changes behaviour in search and rescue."""
