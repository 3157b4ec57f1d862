"""Wrappers around the foraging environment."""
