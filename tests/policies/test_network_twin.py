"""Policies of networks against a slow twin, tick by tick: all ways to see and to act, while robots come and go."""

import itertools

import numpy as np
import pytest

from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.policies.learned import LearnedPolicy
from swarm_forage_env.policies.network import Network, NetworkAbout, NetworkPolicy
from swarm_forage_env.scenarios.presets import scenario
from tests.reference.perceptron import SlowNetwork
from tests.support.busy import change_population

N_ROBOTS = 9  # no multiple of the rows that go through the layers together
DISCRETE = {"actions": "discrete", "automatic_gripper": True}
COMPACT = {"observation": "compact", "decision_ticks": 3, "site_memory": True}


def random_network(interface: InterfaceConfig, env: ForageEnv, **about) -> Network:
    """One with layers of 5 and 13 that wants to do everything now and then."""
    shape, rng = LearnerInterface(interface, env.swarm_spec), np.random.default_rng(3)
    space = shape.action_space
    sizes = [shape.layout.size, 5, 13, int(space.n) if hasattr(space, "n") else space.shape[0]]
    weights = tuple(rng.normal(size=size).astype(np.float32) for size in itertools.pairwise(sizes))
    biases = tuple(rng.normal(size=size).astype(np.float32) for size in sizes[1:])
    return Network(
        weights, biases, NetworkAbout(interface=interface, **{"activation": "tanh", "samples": False} | about)
    )


@pytest.mark.parametrize(
    ("choices", "about", "fields"),
    [
        (DISCRETE | COMPACT, {"samples": True}, {}),
        (DISCRETE | COMPACT, {"activation": "relu"}, {}),
        (DISCRETE | COMPACT | {"frame_decisions": 4}, {"samples": True}, {}),
        ({"frame_decisions": 5}, {}, {}),
        ({"actions": "discrete", "decision_ticks": 2}, {"samples": True}, {"caches": "dynamic"}),
        ({"site_memory": True}, {}, {}),
        ({"automatic_gripper": True, "neighbours_seen": 2}, {"activation": "relu"}, {"neighbours_seen": 2}),
        ({"observation": "compact", "message_size": 2}, {}, {"message_size": 2}),
        ({"automatic_gripper": True}, {}, {"message_size": 2}),
    ],
)
def test_a_network_acts_as_its_slow_twin(choices, about, fields):
    env = ForageEnv(scenario("warehouse_small", n_robots=N_ROBOTS, n_objects=200, **fields))
    interface = InterfaceConfig(**choices)
    network = random_network(interface, env, **about)
    policy, spec, crowd = NetworkPolicy(network), env.swarm_spec, np.random.default_rng(5)
    twin = LearnedPolicy(interface, choose=SlowNetwork(network, N_ROBOTS, stream_rng(2, Stream.POLICY)))
    for one in (policy, twin):
        one.reset(spec, stream_rng(2, Stream.POLICY))
    obs = env.reset_batch(2)
    for tick in range(120):
        actions = policy.act(obs, env.active)
        expected = twin.act(obs, env.active)
        assert actions.tobytes() == expected.tobytes(), f"tick {tick}"
        assert policy.chosen.tolist() == twin.chosen.tolist()
        obs, *_ = env.step_batch(actions)
        if tick % 7 == 0:
            change_population(env, crowd)
