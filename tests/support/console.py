"""The console command in this process."""

from swarm_forage_env import cli


def answer(*words: str) -> int:
    """Give words to the command; returns its exit code."""
    cli.came.clear()
    return cli.answer(words)
