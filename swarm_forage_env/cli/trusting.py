"""Which models a command may open: those that its user typed."""

from collections.abc import Generator, Sequence
from contextlib import contextmanager

from swarm_forage_env.cli.options import complain


@contextmanager
def trust_of(words: Sequence[str]) -> Generator[None]:
    """While the context lasts, only models among the words of a command are opened, and stderr says which."""
    from swarm_forage_env.policies.mixture import policies_in_mixtures
    from swarm_forage_env.policies.registry import file_of
    from swarm_forage_env.policies.trust import of_a_command

    pieces = (piece.strip() for word in words for piece in (word, *word.split(","), *word.partition("=")[2].split(",")))
    parts = [part for word in words for part in policies_in_mixtures(word)]
    typed = [name for piece in (*pieces, *parts) for name in (piece, file_of(piece))]
    with of_a_command(filter(None, typed), looks_only="--dry-run" in words, tell=_note):
        yield


def _note(line: str) -> None:
    complain(line, 0)
