"""The server of the page to play with: who is refused, and what a browser gets."""

import http.client
import json
from itertools import product

import pytest

from swarm_forage_env.inspect.play.server import HOST
from swarm_forage_env.inspect.play.session import PlaySession, Setting
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.world import World
from tests.support.play_page import served


@pytest.fixture(scope="module")
def server():
    world = World(scenario("warehouse_small", n_robots=3, n_objects=20))
    with served(PlaySession(Setting(world=world, policy="random"))) as server:
        yield server


def ask(server, method="POST", place="command", *, body="", path=None):
    """The answer, and its text."""
    connection = http.client.HTTPConnection(HOST, server.server_port, timeout=60)
    connection.request(method, f"/{server.token}/{place}" if path is None else path, body)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer, text


def refusal(server, *words, **more):
    answer, text = ask(server, *words, **more)
    return answer.status, json.loads(text)["error"]


def test_the_page_comes_with_its_token_and_may_load_nothing_else(server):
    answer, text = ask(server, "GET", "")
    assert answer.status == 200
    assert text.startswith("<!doctype html>")
    assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
    assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]
    assert (answer.headers["Referrer-Policy"], answer.headers["Cache-Control"]) == ("no-referrer", "no-store")


def test_without_the_token_all_is_refused(server):
    for method, path in product(("GET", "POST"), ("/", "/x/command", "//command", "/%C3%B6/")):
        status, words = refusal(server, method, path=path, body='{"do": "pause"}')
        assert (status, words) == (403, "Expected the address with its token, as the command shows it.")
    assert refusal(server, "GET", "../etc/passwd", body="null")[0] == 404


@pytest.mark.parametrize("body", ["{", b"\xff\xfe", '{"do": "fly"}', "[" * 9000])
def test_garbage_and_unknown_commands_are_refused(server, body):
    before = server.session.run
    status, words = refusal(server, body=body)
    assert status == 400
    assert words
    assert server.session.run is before


def test_a_frame_a_command_and_a_replay_come_as_json(server):
    answer, text = ask(server, place="frame", body='{"run": 0}')
    assert answer.status == 200
    assert json.loads(text)["about"]["header"]["n_robots"] == 3
    assert json.loads(ask(server, body='{"do": "kill", "robot": 1}')[1]) == {"done": "robot 1 was killed"}
    server.session.paused = True
    assert json.loads(ask(server, place="frame", body="null")[1])["dead"] == [1]
    while server.session.world.tick < 5:
        ask(server, body='{"do": "step"}')
    told = json.loads(ask(server, place="replay", body="null")[1])
    assert told["name"].endswith("_random.html")
    assert told["page"].rstrip().endswith("</html>")
    ask(server, body='{"do": "play"}')
