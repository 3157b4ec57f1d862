"""Which commands there are, and what help says of them; only the one that is asked for is imported."""

import subprocess
import sys
from importlib.metadata import version

from swarm_forage_env.cli.app import COMMANDS, made

ALL = {name: line for group in COMMANDS.values() for name, (_, line) in group.items()}
BELOW = {"study": ("list", "run", "status", "plot", "verdict"), "train": ("curves",), "benchmark": ("show", "verify")}
HEAVY = ("numba", "polars", "matplotlib", "swarm_forage_env.world", "swarm_forage_env.runs", "metrics")


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
    assert command() == command("--help") == command("-h")
    code, out, err = command("--help")
    assert (code, err) == (0, "")
    for name, line in ALL.items():
        assert f"{name} " in out
        assert line in out


def test_every_command_tells_of_itself_and_of_each_option():
    for words in [*ALL, *(f"{first} {second}" for first, those in BELOW.items() for second in those)]:
        _, apps, _ = made(words.split()).parse_commands(words.split())
        assert apps[-1].help, words
        if apps[-1].default_command is not None:
            arguments = apps[-1].assemble_argument_collection(parse_docstring=True)
            assert all(argument.parameter.help for argument in arguments if not argument.children), words


def test_only_what_is_asked_for_is_imported():
    assert imported("--help") == imported("study", "-h") == imported("run", "--help") == set()
