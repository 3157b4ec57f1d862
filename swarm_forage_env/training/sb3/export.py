"""From a trained stable-baselines3 model to a network file that runs without torch, or a zip file that tells more."""

from dataclasses import asdict

from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import FlattenExtractor
from stable_baselines3.dqn.policies import DQNPolicy
from torch import nn

from swarm_forage_env.policies.interface import InterfaceConfig, any_swarm, chosen_interface
from swarm_forage_env.policies.model_files import MODEL_NOTE, describe_spaces, has_probabilities
from swarm_forage_env.policies.network import Network, NetworkAbout, NetworkError

ACTIVATION_CLASSES: dict[str, type[nn.Module]] = {"tanh": nn.Tanh, "relu": nn.ReLU}
"""Layers of torch, by the names that plans and network files have for them."""
_NAMES = {layer: name for name, layer in ACTIVATION_CLASSES.items()}


def export_network(
    model: BaseAlgorithm,
    interface: InterfaceConfig,
    *,
    samples: bool | None = None,
    caches: str = "none",
) -> Network:
    """Return the acting part of a PPO, A2C or DQN with an `MlpPolicy`.

    Args:
        model: The trained model.
        interface: What it saw and did in training, `SwarmVecEnv.interface.config`.
        samples: Whether discrete actions are drawn by their probabilities; default where the model has some (PPO, A2C),
            as in its training. Those of a DQN need a temperature, see `Network.at_temperature`.
        caches: Kind of caches that it was trained with.

    Raises:
        NetworkError: a model of another kind (SAC and TD3 among them), layers that a network file cannot hold, or an
            interface that is not the model's.
    """
    _check_spaces(model, interface)
    note = getattr(model, MODEL_NOTE, None)
    if note is not None and chosen_interface(note["interface"]) != interface:
        raise NetworkError(
            f"Expected the interface that the model was trained with, {note['interface']}, got {interface}."
        )
    layers = _acting_layers(model)
    between = {type(layer) for layer in layers if not isinstance(layer, nn.Linear)}
    alternates = all(isinstance(layer, nn.Linear) == (k % 2 == 0) for k, layer in enumerate(layers))
    if not alternates or len(between) > 1 or not between <= _NAMES.keys():
        raise NetworkError(
            "Expected linear layers with one of the activations tanh and ReLU between them, got "
            f"{[type(layer).__name__ for layer in layers]}."
        )
    about = NetworkAbout(
        interface=interface,
        activation=_NAMES[between.pop()] if between else "tanh",
        samples=has_probabilities(model.policy) if samples is None else samples,
        caches=caches,
    )
    return Network.from_state_dict(nn.Sequential(*layers).state_dict(), about)


def note_interface(
    model: BaseAlgorithm, interface: InterfaceConfig, *, caches: str = "none", samples: bool | None = None
) -> None:
    """Note on a model what its spaces do not tell; saved with it, so that its zip file runs as it was trained.

    Args:
        model: Any model of one robot, before it is saved.
        interface: What it sees and does in training, `SwarmVecEnv.interface.config`.
        caches: Kind of caches that it is trained with.
        samples: As in `export_network`.

    Raises:
        NetworkError: an interface that is not the model's.
    """
    _check_spaces(model, interface)
    draws = has_probabilities(model.policy) if samples is None else samples
    setattr(model, MODEL_NOTE, {"interface": asdict(interface), "caches": caches, "samples": draws})


def _check_spaces(model: BaseAlgorithm, interface: InterfaceConfig) -> None:
    """Refuse an interface with other observations or actions than the model has."""
    wanted, found = describe_spaces(any_swarm(interface)), describe_spaces(model)
    if wanted != found:
        raise NetworkError(
            f"Expected a model from {' to '.join(wanted)} for this interface, got one from {' to '.join(found)}; give "
            f"the interface that it was trained with (env.interface.config), not {interface}."
        )


def _acting_layers(model: BaseAlgorithm) -> list[nn.Module]:
    policy = model.policy
    if (
        isinstance(policy, ActorCriticPolicy)
        and isinstance(policy.features_extractor, FlattenExtractor)
        and getattr(policy, "lstm_actor", None) is None  # as RecurrentPPO of sb3-contrib has it
    ):
        return [*policy.mlp_extractor.policy_net, policy.action_net]
    if isinstance(policy, DQNPolicy) and isinstance(policy.q_net.features_extractor, FlattenExtractor):
        return [*policy.q_net.q_net]
    raise NetworkError(
        f"Expected a PPO, A2C or DQN model with an MlpPolicy, got {type(model).__name__} with "
        f"{type(policy).__name__}; run it from its zip file instead."
    )
