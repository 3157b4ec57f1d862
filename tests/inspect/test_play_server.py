"""The server of the page to play with: who is refused, and what a browser gets."""

import http.client
import json
import socket
from itertools import product

import pytest

from swarm_forage_env.inspect.play.server import HOST, MOST_BYTES
from swarm_forage_env.inspect.play.session import PlaySession, Setting
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.world import World
from tests.support.play_page import served


@pytest.fixture(scope="module")
def server():
    world = World(scenario("warehouse_small", n_robots=3, n_objects=20))
    with served(PlaySession(Setting(world=world, policy="random"))) as server:
        yield server


def ask(server, method="POST", place="command", *, body="", path=None, **headers):
    """The status and the text that come back; a header of None is left out."""
    connection = http.client.HTTPConnection(HOST, server.server_port, timeout=60)
    content = body.encode() if isinstance(body, str) else body
    given = {"Host": server.hosts[0], "Content-Length": str(len(content))} | {
        name.replace("_", "-"): value for name, value in headers.items()
    }
    connection.putrequest(method, f"/{server.token}/{place}" if path is None else path, skip_host=True)
    for name, value in given.items():
        if value is not None:
            connection.putheader(name, value)
    connection.endheaders(content)
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
    assert ask(server, "GET", "", Host=f"localhost:{server.server_port}")[0].status == 200


def test_without_the_token_all_is_refused(server):
    for method, path in product(("GET", "POST"), ("/", "/x/command", "//command", "/%C3%B6/")):
        status, words = refusal(server, method, path=path, body='{"do": "pause"}')
        assert (status, words) == (403, "Expected the address with its token, as the command shows it.")
    assert refusal(server, "GET", "../etc/passwd", body="null")[0] == 404


def test_another_host_is_refused(server):
    for method, host in product(("GET", "POST"), ("evil.example", "127.0.0.1", "127.0.0.1:1", None)):
        status, words = refusal(server, method, body='{"do": "pause"}', Host=host)
        assert (status, words.startswith("Expected the host 127.0.0.1:")) == (403, True)
    assert not server.session.paused


def test_another_page_is_refused(server):
    for origin in ("http://evil.example", "null", f"http://127.0.0.1:{server.server_port}0"):
        assert refusal(server, body='{"do": "pause"}', Origin=origin)[0] == 403
    assert not server.session.paused
    answer, text = ask(server, body='{"do": "pause"}', Origin=f"http://127.0.0.1:{server.server_port}")
    assert (answer.status, json.loads(text)) == (200, {"done": ""})
    ask(server, body='{"do": "play"}')


@pytest.mark.parametrize("body", ["{", b"\xff\xfe", '{"do": "fly"}', "[" * 9000])
def test_garbage_and_unknown_commands_are_refused(server, body):
    before = server.session.run
    status, words = refusal(server, body=body)
    assert status == 400
    assert words
    assert server.session.run is before


def test_long_bodies_are_refused_before_they_are_read(server):
    assert refusal(server, body="", Content_Length=str(MOST_BYTES + 1))[0] == 413
    assert refusal(server, body="", Content_Length="9" * 5000)[0] == 413
    for length in (None, "-1", "many", "٣"):
        given = length if length is None else length.encode().decode("latin-1")
        assert refusal(server, body="", Content_Length=given)[0] == 411


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


@pytest.mark.parametrize("told", ["Content-Length: 40", "Transfer-Encoding: chunked"])
def test_what_comes_with_a_get_is_no_further_request(server, told):
    smuggled = f"POST /{server.token}/command HTTP/1.1\r\n"
    with socket.create_connection((HOST, server.server_port), timeout=60) as connection:
        head = f"GET /{server.token}/ HTTP/1.1\r\nHost: {server.hosts[0]}\r\n{told}\r\n\r\n"
        connection.sendall((head + smuggled).encode())
        with connection.makefile("rb") as answer:
            head = answer.readline(), *iter(answer.readline, b"\r\n")
            assert head[0].startswith(b"HTTP/1.1 200")
            assert b"Connection: close\r\n" in head
