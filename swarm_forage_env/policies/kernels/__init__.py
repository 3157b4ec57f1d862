"""Compiled functions of learned policies: what they see and do, and networks."""
