"""Networks of models of stable-baselines3 as files: they choose as the model does, and say what it saw and did."""

import dataclasses

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")

import torch
from stable_baselines3 import DQN, PPO, SAC

from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.network import Network, NetworkError
from swarm_forage_env.training.sb3 import SwarmVecEnv
from swarm_forage_env.training.sb3.export import export_network, note_interface

NUMBERED = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5)
DRIVEN = InterfaceConfig(observation="compact", automatic_gripper=True)


@pytest.mark.parametrize(
    ("algorithm", "interface", "fields"),
    [
        (PPO, NUMBERED, {}),
        (PPO, DRIVEN, {}),
        (PPO, DRIVEN, {"neighbours_seen": 3, "neighbour_range_m": 1.5, "message_size": 2}),
        (DQN, NUMBERED, {}),
    ],
)
def test_exported_networks_choose_as_the_model_does(algorithm, interface, fields, tmp_path):
    env = SwarmVecEnv("warehouse_small", n_robots=30, n_objects=100, interface=interface, **fields)
    interface = env.interface.config
    size = {"buffer_size": 100} if algorithm is DQN else {"n_steps": 8, "batch_size": 240}
    model = algorithm("MlpPolicy", env, seed=3, device="cpu", **size)
    network = export_network(model, interface)
    network.save(tmp_path / "network.npz")
    network = Network.load(tmp_path / "network.npz")
    env.seed(0)
    obs = env.reset()
    for _ in range(20):
        expected, _ = model.predict(obs, deterministic=True)
        outputs = network.outputs(obs)
        chosen = outputs.argmax(axis=1) if interface.actions == "discrete" else np.clip(outputs, -1.0, 1.0)
        np.testing.assert_allclose(chosen, expected, atol=1e-5)
        obs, *_ = env.step(expected)


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        (
            {"observation": "full"},
            r"Expected a model from Box\(\d+\) to Box\(2\) .*, got one from Box\(23\) to Box\(2\)",
        ),
        ({"actions": "discrete"}, r"to Discrete\(6\) .* to Box\(2\)"),
    ],
)
def test_the_interface_of_an_export_is_that_of_the_model(wrong, reason):
    env = SwarmVecEnv("warehouse_small", n_robots=2, n_objects=20, interface=DRIVEN)
    model = PPO("MlpPolicy", env, n_steps=8, batch_size=16, device="cpu")
    other = dataclasses.replace(DRIVEN, **wrong)
    with pytest.raises(NetworkError, match=reason):
        export_network(model, other)
    with pytest.raises(NetworkError, match=reason):
        note_interface(model, other)
    note_interface(model, DRIVEN)
    with pytest.raises(NetworkError, match=r"Expected the interface that the model was trained with, .*decision_ticks"):
        export_network(model, dataclasses.replace(DRIVEN, decision_ticks=4))


def test_models_that_a_network_file_cannot_hold_are_refused():
    env = SwarmVecEnv("warehouse_small", n_robots=2, n_objects=20, interface=DRIVEN)
    with pytest.raises(NetworkError, match="PPO, A2C or DQN"):
        export_network(SAC("MlpPolicy", env, buffer_size=10, device="cpu"), DRIVEN)
    odd = {"net_arch": [8], "activation_fn": torch.nn.ELU}
    with pytest.raises(NetworkError, match="tanh and ReLU"):
        export_network(PPO("MlpPolicy", env, n_steps=8, batch_size=16, policy_kwargs=odd, device="cpu"), DRIVEN)
