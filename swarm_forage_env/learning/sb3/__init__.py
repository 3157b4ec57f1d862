"""stable-baselines3: the swarm as its vector environment, buffers that leave absent robots out, training.

Only this package imports stable_baselines3 and torch; install them with the `train` extra.
"""

try:
    import stable_baselines3  # noqa: F401 - asked for here, where the answer can say what to do
except ImportError as error:
    raise ImportError(
        f"Training needs stable-baselines3 and torch ({error}): pip install 'swarm-forage-env[train]' 'torch==2.13.0'"
    ) from error

from swarm_forage_env.learning.sb3.buffers import ActiveRolloutBuffer, PresentReplayBuffer
from swarm_forage_env.learning.sb3.vec_env import SwarmVecEnv

__all__ = ["ActiveRolloutBuffer", "PresentReplayBuffer", "SwarmVecEnv"]
