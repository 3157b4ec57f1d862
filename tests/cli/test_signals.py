"""Ctrl-C and SIGTERM end a command in one line, whatever it is doing when they come."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress

import pytest

from swarm_forage_env.cli import signals
from tests.support.console import answer, heard

TOLD = "swarm-forage: Interrupted. Unfinished work is not kept; run the same command to start again.\n"
RUN = ("run", "--policy", "crw", "--robots", "2", "--objects", "10", "--horizon", "4", "--set", "interval_s=2")
HEARS = """
import sys
from swarm_forage_env import cli
from swarm_forage_env.cli import signals

def hear():
    usual()
    print("heard", file=sys.stderr, flush=True)

usual, signals.hear = signals.hear, hear
cli.main()
"""
"""Says when the command has begun to hear: before, Python itself answers."""


COMMANDS = (RUN, ("list",), ("study", "list"))
DELAYS_S = (0.0, 0.05, 0.4)
SIGNALS = (signal.SIGINT, signal.SIGTERM)
GIVEN = [
    pytest.param(words, after_s, SIGNALS[(i + j) % 2], id=f"{words[0]}-{after_s}-{SIGNALS[(i + j) % 2].name}")
    for i, words in enumerate(COMMANDS)
    for j, after_s in enumerate(DELAYS_S)
]
"""Each command and each delay meets both signals; `scripts/fuzz signals` gives as many as fit into a time."""


@pytest.mark.parametrize(("words", "after_s", "sent"), GIVEN)
def test_a_signal_ends_a_command_in_one_line(tmp_path, words, after_s, sent):
    with subprocess.Popen([sys.executable, "-c", HEARS, *words], cwd=tmp_path, text=True, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE) as started:  # fmt: skip
        try:
            assert started.stderr.readline() == "heard\n"
            time.sleep(after_s)
            started.send_signal(sent)
            out, err = started.communicate(timeout=60)
        finally:
            started.kill()
    assert "Traceback" not in err
    if started.returncode != 0 or not out:  # else it was faster
        assert started.returncode == 128 + sent
        assert [line[:25] for line in err.splitlines() if "nterrupt" in line] == ["swarm-forage: Interrupted"], err


def test_what_a_library_swallows_is_raised_again(monkeypatch, capsys):
    def careless(_):
        with suppress(BaseException):  # as some libraries do around imports
            os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(60)

    monkeypatch.setattr("swarm_forage_env.cli.app.carry_out", careless)
    assert answer("list") == signals.EXIT_TERMINATED
    assert capsys.readouterr().err == TOLD


def test_what_an_interrupt_breaks_is_no_error_of_ours(monkeypatch, capsys):
    def broken(_):
        try:
            os.kill(os.getpid(), signal.SIGINT)
        except KeyboardInterrupt:
            raise ImportError("half a module") from None

    monkeypatch.setattr("swarm_forage_env.cli.app.carry_out", broken)
    assert answer("list") == signals.EXIT_INTERRUPTED
    assert capsys.readouterr().err == TOLD


class HalfMade:
    def __del__(self):
        raise AttributeError("something that it never had")


def test_what_an_interrupt_leaves_half_made_goes_without_a_word(monkeypatch):
    shown = []
    monkeypatch.setattr(sys, "unraisablehook", shown.append)
    with heard():
        HalfMade()
        with suppress(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
        HalfMade()
    assert len(shown) == 1


def test_whoever_keeps_something_is_left_in_peace():
    with heard():
        try:
            os.kill(os.getpid(), signal.SIGINT)
        except KeyboardInterrupt:
            try:
                raise ValueError("another error, while the interrupt is handled")
            except ValueError:
                time.sleep(3 * signals.AGAIN_S)
        assert signals.came == [signal.SIGINT]
