"""The command `play`."""

import http.client
import signal
import subprocess
import sys
from urllib.parse import urlsplit

import pytest

from swarm_forage_env.inspect.play.server import PlayServer

WORDS = ("play", "random", "--robots", "3", "--objects", "20")
MAIN = "from swarm_forage_env.cli import main; main()"


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_it_serves_the_page_until_it_is_interrupted(tmp_path, sent, code):
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
    assert (started.returncode, out) == (code, "")
    assert err.splitlines()[-1] == "swarm-forage: Interrupted. The page has ended; random: 0 s, 0 delivered."
    assert err.count("swarm-forage: Interrupted") == 1


def test_it_opens_the_browser_unless_it_is_told_not_to(command, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr(PlayServer, "serve_forever", lambda *_, **__: None)
    code, out, err = command(*WORDS)
    assert (code, err) == (0, "Ctrl-C ends it.\n")
    assert [f"play at {address}\n" for address in opened] == [out]
    assert command(*WORDS, "--no-browser")[0] == 0
    assert len(opened) == 1


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("play", "nobody", "--no-browser"), "nobody"),
        (("play", "crw", "dpo", "--no-browser"), "Expected one policy, got crw, dpo."),
        ((*WORDS, "--port", "99999"), "--port"),
        ((*WORDS, "--scenario", "moon"), "moon"),
    ],
)
def test_it_complains_in_one_line(command, words, told):
    code, out, err = command(*words)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert told in err


def test_a_port_that_is_taken_is_told_of(command, monkeypatch):
    monkeypatch.setattr(PlayServer, "serve_forever", lambda *_, **__: None)

    def taken(*_):
        raise OSError(98, "Address already in use")

    monkeypatch.setattr(PlayServer, "__init__", taken)
    code, out, err = command(*WORDS, "--port", "8080", "--no-browser")
    assert (code, out) == (1, "")
    assert err == "swarm-forage: Address already in use: port 8080; leave out --port to get one that is free.\n"
