"""Which class carries out a plan, and what it is made with."""

from typing import Any

from stable_baselines3 import A2C, DQN, SAC
from stable_baselines3.common.base_class import BaseAlgorithm

from swarm_forage_env._internal.wording import install_command
from swarm_forage_env.training.plan import TrainingPlan
from swarm_forage_env.training.sb3.buffers import ActiveRolloutBuffer, PresentReplayBuffer
from swarm_forage_env.training.sb3.export import ACTIVATION_CLASSES
from swarm_forage_env.training.sb3.ppo import SwarmPPO
from swarm_forage_env.views.stable_baselines3 import SwarmVecEnv

ALGORITHM_CLASSES: dict[str, type[BaseAlgorithm]] = {"ppo": SwarmPPO, "a2c": A2C, "dqn": DQN, "sac": SAC}
"""Classes of networks without a memory. `SwarmRecurrentPPO` has the options of the first one."""
_ON_POLICY = ("ppo", "a2c")


def class_of(plan: TrainingPlan) -> type[BaseAlgorithm]:
    """Return the class that carries out a plan.

    Raises:
        ImportError: the plan has an LSTM, and sb3-contrib is not installed.
    """
    if not plan.lstm:
        return ALGORITHM_CLASSES[plan.algorithm]
    try:
        from swarm_forage_env.training.sb3.recurrent import SwarmRecurrentPPO
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "sb3_contrib":
            raise
        raise ImportError(f"Training with an LSTM needs sb3-contrib ({error}): {install_command('train')}.") from error
    return SwarmRecurrentPPO


def arguments_of(plan: TrainingPlan, env: SwarmVecEnv) -> dict[str, Any]:
    """Return what a new model of a plan is made with besides its options: policy, network and buffer."""
    network: dict[str, Any] = {"net_arch": list(plan.hidden), "activation_fn": ACTIVATION_CLASSES[plan.activation]}
    if plan.lstm:
        # One memory for actor and critic takes half the time of two; our choice.
        network |= {"lstm_hidden_size": plan.lstm, "shared_lstm": True, "enable_critic_lstm": False}
        buffer: dict[str, Any] = {"rollout_buffer_kwargs": env.rollout_buffer_kwargs}
        return {"policy": "MlpLstmPolicy", "policy_kwargs": network, **buffer}
    buffer = {"replay_buffer_class": PresentReplayBuffer}
    if plan.algorithm in _ON_POLICY:
        buffer = {
            "rollout_buffer_class": ActiveRolloutBuffer,
            "rollout_buffer_kwargs": env.rollout_buffer_kwargs,
        }
    return {"policy": "MlpPolicy", "policy_kwargs": network, **buffer}
