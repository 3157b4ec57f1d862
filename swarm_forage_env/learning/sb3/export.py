"""From a trained stable-baselines3 model to a network file that runs without torch."""

from typing import Any

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import FlattenExtractor
from stable_baselines3.dqn.policies import DQNPolicy
from torch import nn

from swarm_forage_env.learning.interface import InterfaceConfig
from swarm_forage_env.learning.network import Network, NetworkAbout, NetworkError

_ACTIVATIONS: dict[type[nn.Module], str] = {nn.Tanh: "tanh", nn.ReLU: "relu"}


def export_network(
    model: BaseAlgorithm,
    interface: InterfaceConfig,
    *,
    samples: bool = False,
    caches: str = "none",
    card: dict[str, Any] | None = None,
) -> Network:
    """Return the acting part of a PPO, A2C or DQN model with an `MlpPolicy`.

    Args:
        model: The trained model.
        interface: What it saw and did in training, `SwarmVecEnv.interface.config`.
        samples: Draw discrete actions by their probabilities (PPO, A2C) instead of taking the likeliest.
        caches: World that it was trained in.
        card: How it came about, plain values.

    Raises:
        NetworkError: a model of another kind (SAC and TD3 among them), or layers that a network file cannot hold.
    """
    layers = _acting_layers(model)
    linear = [layer for layer in layers if isinstance(layer, nn.Linear)]
    between = {type(layer) for layer in layers if not isinstance(layer, nn.Linear)}
    alternates = all(isinstance(layer, nn.Linear) == (k % 2 == 0) for k, layer in enumerate(layers))
    if not alternates or len(between) > 1 or not between <= _ACTIVATIONS.keys():
        raise NetworkError(
            "Expected linear layers with one of the activations tanh and ReLU between them, got "
            f"{[type(layer).__name__ for layer in layers]}."
        )
    weights = tuple(_array(layer.weight.T) for layer in linear)
    biases = tuple(_array(layer.bias) for layer in linear)
    about = NetworkAbout(
        interface=interface,
        activation=_ACTIVATIONS[between.pop()] if between else "tanh",
        samples=samples,
        caches=caches,
        card=card or {},
    )
    return Network(weights, biases, about)


def _acting_layers(model: BaseAlgorithm) -> list[nn.Module]:
    policy = model.policy
    if isinstance(policy, ActorCriticPolicy) and isinstance(policy.features_extractor, FlattenExtractor):
        return [*policy.mlp_extractor.policy_net, policy.action_net]
    if isinstance(policy, DQNPolicy) and isinstance(policy.q_net.features_extractor, FlattenExtractor):
        return [*policy.q_net.q_net]
    raise NetworkError(
        f"Expected a PPO, A2C or DQN model with an MlpPolicy, got {type(model).__name__} with "
        f"{type(policy).__name__}; run it from its zip file instead."
    )


def _array(tensor: Any) -> np.ndarray:
    return np.ascontiguousarray(tensor.detach().cpu().numpy(), np.float32)
