"""Compiled functions behind what a learned policy sees and does."""
