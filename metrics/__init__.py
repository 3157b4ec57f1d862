"""Measures of swarm behaviour: arrays in, numbers out."""
