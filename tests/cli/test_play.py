"""The command `play`."""

import http.client
import signal
import subprocess
import sys
from urllib.parse import urlsplit

import pytest

WORDS = ("play", "random", "--robots", "3", "--set", "n_objects=20")
MAIN = "from swarm_forage_env.cli import main; main()"


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
