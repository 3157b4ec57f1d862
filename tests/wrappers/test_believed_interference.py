"""Who believes in an obstacle under sensor noise, beside who has one."""

import numpy as np
import pytest

from swarm_forage_env.contract.detection import sees_obstacle
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.noise import SensorNoise, SensorNoiseConfig
from tests.reference.sensing import interferes


def test_the_believed_share_of_interference_counts_false_obstacles():
    env = ForageEnv(scenario("warehouse_small", n_robots=40, n_objects=5, start_margin_m=6.5, interval_s=2.0))
    stack = SensorNoise(env, SensorNoiseConfig(sigma=0.03, groups=("proximity",)))
    stack.reset_batch(0)
    believed, true = [], []
    for _ in range(10):
        obs, *_ = stack.step_batch(np.zeros((40, 3), np.float32))
        rings = obs[:, env.layout["proximity"]]
        believed.append(np.mean([sees_obstacle(ring, False) for ring in rings]))
        true.append(np.mean([interferes(env, robot) for robot in range(40)]))
    assert stack.interval_columns() == {"believed_interference_fraction": pytest.approx(np.mean(believed))}
    assert np.mean(believed) > np.mean(true) + 0.1
    # The next interval starts anew, and robots in repair do not count.
    env.set_population(active=np.arange(40) < 10, present=np.ones(40, bool))
    obs, *_ = stack.step_batch(np.zeros((40, 3), np.float32))
    expected = np.mean([sees_obstacle(ring, False) for ring in obs[:10, env.layout["proximity"]]])
    assert stack.interval_columns()["believed_interference_fraction"] == pytest.approx(expected)
