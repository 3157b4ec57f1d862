"""Numba kernels: arrays and scalars in, preallocated arrays out; no domain objects, no randomness, no errors."""
