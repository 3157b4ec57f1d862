"""Ctrl-C and SIGTERM end a command in one line, whatever it is doing when they come."""

import http.client
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from urllib.parse import urlsplit

import pytest

from swarm_forage_env import cli
from tests.support.console import answer

TOLD = "swarm-forage: Interrupted. Unfinished work is not kept; run the same command to start again.\n"
RUN = ("run", "crw", "--robots", "2", "--set", "n_objects=10", "--horizon", "4", "--set", "interval_s=2")
HEARS = """
import sys
from swarm_forage_env import cli

def hear():
    usual()
    print("heard", file=sys.stderr, flush=True)

usual, cli.hear = cli.hear, hear
cli.main()
"""
"""Says when the command has begun to hear: before, Python itself answers."""


@pytest.fixture
def heard():
    """Signals are heard as the command hears them."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    hook = sys.unraisablehook
    for number in handlers:  # it may be ignored here, where tests run in the background
        signal.signal(number, signal.default_int_handler)
    cli.hear()
    yield
    cli.came.clear()
    for number, handler in handlers.items():
        signal.signal(number, handler)
    sys.unraisablehook = hook


@pytest.mark.slow
@pytest.mark.parametrize(("words", "after_s", "sent"), [
    (RUN, 0.0, signal.SIGINT), (RUN, 0.4, signal.SIGTERM), (("list",), 0.05, signal.SIGTERM),
    (("study", "list"), 0.4, signal.SIGINT),
])  # fmt: skip
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
        assert started.returncode == -sent, "the process dies of the signal, so that a shell's loop ends"
        assert [line[:25] for line in err.splitlines() if "nterrupt" in line] == ["swarm-forage: Interrupted"], err


@pytest.mark.slow
def test_ctrl_c_before_the_command_hears_is_quiet(tmp_path):
    (tmp_path / "gymnasium.py").write_text("import time; print('asked', flush=True); time.sleep(60)")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    command = [sys.executable, "-m", "swarm_forage_env.cli", "list"]
    with subprocess.Popen(
        command, text=True, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as started:
        assert started.stdout.readline() == "asked\n"
        started.send_signal(signal.SIGINT)
        assert started.communicate(timeout=60) == ("", "")
    assert started.returncode == -signal.SIGINT


def test_what_a_library_swallows_is_raised_again(heard, monkeypatch, capsys):
    def careless(_):
        with suppress(BaseException):  # as some libraries do around imports
            os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(60)

    monkeypatch.setattr("swarm_forage_env.cli.app.carry_out", careless)
    assert answer("list") == cli.EXIT_TERMINATED
    assert capsys.readouterr().err == TOLD


def test_what_an_interrupt_breaks_is_no_error_of_ours(heard, monkeypatch, capsys):
    def broken(_):
        try:
            os.kill(os.getpid(), signal.SIGINT)
        except KeyboardInterrupt:
            raise ImportError("half a module") from None

    monkeypatch.setattr("swarm_forage_env.cli.app.carry_out", broken)
    assert answer("list") == cli.EXIT_INTERRUPTED
    assert capsys.readouterr().err == TOLD


def test_whoever_keeps_something_is_left_in_peace(heard):
    try:
        os.kill(os.getpid(), signal.SIGINT)
    except KeyboardInterrupt:
        try:
            raise ValueError("another error, while the interrupt is handled")
        except ValueError:
            time.sleep(3 * cli.AGAIN_S)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    assert cli.came == [signal.SIGINT]


WORDS = ("play", "random", "--robots", "3", "--set", "n_objects=20")
MAIN = "from swarm_forage_env.cli import main; main()"


@pytest.mark.slow
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_it_serves_the_page_until_it_is_interrupted(tmp_path, sent):
    command = [sys.executable, "-c", MAIN, *WORDS, "--no-browser"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as started:
        try:
            said, _, address = started.stdout.readline().strip().partition(" at ")
            place = urlsplit(address)
            assert (said, place.hostname) == ("play", "127.0.0.1")
            connection = http.client.HTTPConnection(place.hostname, place.port, timeout=60)
            connection.request("GET", place.path)
            assert connection.getresponse().read().startswith(b"<!doctype html>")
            connection.close()
            started.send_signal(sent)
            out, err = started.communicate(timeout=60)
        finally:
            started.kill()
    assert (started.returncode, out) == (-sent, "")
    assert err.splitlines()[-1] == "swarm-forage: Interrupted. The page has ended; random: 0 s, 0 delivered."
    assert err.count("swarm-forage: Interrupted") == 1
