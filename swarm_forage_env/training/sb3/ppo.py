"""SwarmPPO: PPO of stable-baselines3 without work on rows where no robot is at work, and without loops over rows."""

from stable_baselines3 import PPO

from swarm_forage_env.training.sb3.rollouts import ActiveRollouts


class SwarmPPO(ActiveRollouts, PPO):
    """PPO with another way to fill its rollouts; it takes the arguments of `PPO` and learns as it does.

    The network is asked for robots at work only, where the buffer is an `ActiveRolloutBuffer`: the actions of others
    are ignored by the environment, and are zeros here. It writes files that `PPO.load` opens, too.
    """
