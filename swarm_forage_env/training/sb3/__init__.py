"""stable-baselines3: the swarm as its vector environment, buffers that leave absent robots out, training.

It needs stable_baselines3 and torch; install them with the `train` extra.
"""

from swarm_forage_env._internal.wording import install_command

try:
    from swarm_forage_env.training.sb3.buffers import ActiveRolloutBuffer, PresentReplayBuffer
    from swarm_forage_env.training.sb3.ppo import SwarmPPO
    from swarm_forage_env.views.stable_baselines3 import SwarmVecEnv
except ModuleNotFoundError as error:
    if (error.name or "").partition(".")[0] not in ("stable_baselines3", "torch"):
        raise
    raise ImportError(f"Training needs stable-baselines3 and torch ({error}): {install_command('train')}.") from error

__all__ = ["ActiveRolloutBuffer", "PresentReplayBuffer", "SwarmPPO", "SwarmVecEnv"]
