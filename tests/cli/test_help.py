"""Which commands there are, and what `--help` says of them; only the one that is asked for is imported."""

import subprocess
import sys
from importlib.metadata import version

import pytest

from swarm_forage_env.cli.app import loaded
from swarm_forage_env.cli.commands import COMMANDS

ALL = [command for group in COMMANDS.values() for command in group]
HEAVY = ("numba", "polars", "typer", "rich", "swarm_forage_env.world")
COLUMNS = 80


def imported(*words: str) -> set[str]:
    """Which heavy modules a command imports."""
    program = f"""
import atexit, sys
from swarm_forage_env.cli import main
atexit.register(lambda: print(*(name for name in {HEAVY} if name in sys.modules), file=sys.stderr))
main()
"""
    ended = subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True, check=True)
    return set(ended.stderr.split())


def test_version_and_help(command):
    assert command("--version") == (0, f"swarm-forage {version('swarm-forage-env')}\n", "")
    assert command() == command("--help")
    code, out, err = command("--help")
    assert (code, err) == (0, "")
    assert max(map(len, out.splitlines())) < COLUMNS
    for one in ALL:
        assert (one.about in out) == (" " not in one.words)


@pytest.mark.parametrize("one", [one for one in ALL if one.place], ids=lambda one: one.words)
def test_every_command_is_there(command, one):
    assert loaded(one).help
    code, out, err = command(*one.words.split(), "--help")
    assert (code, err) == (0, "")
    assert out.startswith(f"Usage: swarm-forage {one.words}")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("rnu",), "No such command 'rnu'. Did you mean 'run'?"),
        (("--verison",), "No such option: '--verison'. Did you mean '--version'?"),
        (("study", "rnu"), "No such command of study: 'rnu'. Did you mean 'run'?"),
        (("study", "--all"), "No such option: '--all'."),
    ],
)
def test_words_that_mean_nothing_are_answered_with_the_nearest(command, words, told):
    assert command(*words) == (2, "", f"swarm-forage: {told}\n")


def test_only_what_is_asked_for_is_imported():
    assert imported("--help") == imported("study") == set()
    assert imported("run", "--help") <= {"typer", "rich"}
