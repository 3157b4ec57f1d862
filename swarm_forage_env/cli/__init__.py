"""The console command `swarm-forage`. It may import everything; nothing imports it."""

from swarm_forage_env.cli.app import main

__all__ = ["main"]
