"""stable-baselines3: the swarm as its vector environment, buffers that leave absent robots out, training.

Only this package imports stable_baselines3 and torch; install them with the `train` extra.
"""

from swarm_forage_env.learning.sb3.buffers import ActiveRolloutBuffer, PresentReplayBuffer
from swarm_forage_env.learning.sb3.vec_env import SwarmVecEnv

__all__ = ["ActiveRolloutBuffer", "PresentReplayBuffer", "SwarmVecEnv"]
