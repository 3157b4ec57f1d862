"""Swarm foraging as a PettingZoo environment."""
