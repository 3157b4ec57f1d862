"""Trajectories of policies as files: for offline reinforcement learning and imitation."""
