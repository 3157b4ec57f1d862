"""Compiled functions behind the wrappers."""
