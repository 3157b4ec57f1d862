"""Which class carries out a plan, and what it is made with."""

from typing import Any

from stable_baselines3 import A2C, DQN, SAC
from stable_baselines3.common.base_class import BaseAlgorithm

from swarm_forage_env.training.plan import TrainingPlan
from swarm_forage_env.training.sb3.buffers import ActiveRolloutBuffer, PresentReplayBuffer
from swarm_forage_env.training.sb3.export import ACTIVATION_CLASSES
from swarm_forage_env.training.sb3.ppo import SwarmPPO
from swarm_forage_env.views.stable_baselines3 import SwarmVecEnv

ALGORITHM_CLASSES: dict[str, type[BaseAlgorithm]] = {"ppo": SwarmPPO, "a2c": A2C, "dqn": DQN, "sac": SAC}
"""The class that carries out a plan, by the plan's word."""
_ON_POLICY = ("ppo", "a2c")


def arguments_of(plan: TrainingPlan, env: SwarmVecEnv) -> dict[str, Any]:
    """Return what a new model of a plan is made with besides its options: policy, network and buffer."""
    network: dict[str, Any] = {"net_arch": list(plan.hidden), "activation_fn": ACTIVATION_CLASSES[plan.activation]}
    buffer: dict[str, Any] = {"replay_buffer_class": PresentReplayBuffer}
    if plan.algorithm in _ON_POLICY:
        buffer = {
            "rollout_buffer_class": ActiveRolloutBuffer,
            "rollout_buffer_kwargs": env.rollout_buffer_kwargs,
        }
    return {"policy": "MlpPolicy", "policy_kwargs": network, **buffer}
