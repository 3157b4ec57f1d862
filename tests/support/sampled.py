"""A sampler of small worlds that tests share."""

from typing import Any

from swarm_forage_env.views.sampler import ScenarioSampler

TWO_WORLDS: dict[str, Any] = {
    "scenario": {"horizon_s": 200.0, "physics": "compiled"},
    "wrappers": {
        "sensor_noise": {"probability": 0.5, "sigma": {"uniform": [0.0, 0.1]}},
        "throttle": {"probability": 0.5, "waveform": "constant", "amplitude": {"uniform": [0.1, 0.4]}},
    },
    "worlds": [
        {
            "scenario": {
                "preset": "warehouse_small",
                "n_robots": {"uniform": [2, 6]},
                "n_objects": {"choice": [10, 20]},
                "nest_progress": 0.1,
            },
            "weight": 3,
        },
        {"scenario": {"preset": "search_and_rescue", "n_robots": {"log_uniform": [2, 4]}, "side_m": 16.0}},
    ],
}
"""Two kinds of worlds, of two to six robots."""


def sampler() -> ScenarioSampler:
    """Return the sampler of `TWO_WORLDS`."""
    return ScenarioSampler(TWO_WORLDS)
