"""The page to play with and its session over HTTP, for one reader on this machine.

It listens on the loopback address only. An address without its random token is refused, and so is a request that names
another host (as a page does whose own name was made to lead here) or comes from another page. So of all that a browser
shows, only this page can look at the run or steer it.

    GET  /TOKEN/         the page
    POST /TOKEN/frame    what is asked for as JSON; a frame as JSON
    POST /TOKEN/command  a command as JSON; what it has done as JSON
    POST /TOKEN/replay   nothing; the replay page of the run so far

What is refused is answered with a table of "error", one line for people.
"""

import json
import secrets
import sys
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from swarm_forage_env._internal.files import parse_json
from swarm_forage_env.inspect.play.session import PlaySession
from swarm_forage_env.rendering.pages import build_play_page

HOST = "127.0.0.1"
MOST_BYTES = 10_000
"""Longest body of a request; our choice: a hundred times the longest command."""
SILENCE_S = 60.0
"""A connection on which nothing comes for so long is closed."""
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class PlayServer(ThreadingHTTPServer):
    """Serves one session until `shutdown`.

    Attributes:
        session: What is looked at and steered.
        token: What every address begins with.
        hosts: What a browser names as the host of the page.
        address: Where the page is.
    """

    daemon_threads = True

    def __init__(self, session: PlaySession, port: int = 0) -> None:
        """Listen.

        Args:
            session: The session.
            port: The port, 0 for any that is free.

        Raises:
            OSError: the port is taken, or not ours to take.
        """
        super().__init__((HOST, port), _Handler)
        self.session = session
        self.token = secrets.token_urlsafe(16)
        suffix = "" if self.server_port == 80 else f":{self.server_port}"  # browsers leave that of HTTP out
        self.hosts = (f"{HOST}{suffix}", f"localhost{suffix}")
        self.address = f"http://{self.hosts[0]}/{self.token}/"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Keep quiet about a reader who has left; whatever else went wrong is told."""
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):
            super().handle_error(request, client_address)


class _Refused(Exception):  # noqa: N818 - it is an answer, no error of ours
    """A request that is refused: status and one line for people."""

    def __init__(self, status: int, words: str) -> None:
        super().__init__(words)
        self.status = status


class _Handler(BaseHTTPRequestHandler):
    """Answers one connection after the other, each in a thread of its own."""

    server: PlayServer  # pyright: ignore[reportIncompatibleVariableOverride] - nobody else makes it
    protocol_version = "HTTP/1.1"
    timeout = SILENCE_S
    server_version = "swarm-forage"
    sys_version = ""

    def do_POST(self) -> None:
        """Send the page, a frame or a replay, or carry out a command."""
        try:
            self._send(*self._outcome())
        except (ConnectionError, TimeoutError):  # the reader has gone, maybe in the middle of the answer
            self.close_connection = True

    do_GET = do_POST  # noqa: N815 - the name that http.server has

    def _outcome(self) -> tuple[int, Any]:
        """Return the status, and the page as text or the answer as a table."""
        try:
            self._check_sender()
            place = self.path.removeprefix(f"/{self.server.token}/")
            return 200, self._page(place) if self.command == "GET" else self._made(place, self._body())
        except _Refused as refused:
            self.close_connection = True  # its body may be still to come
            return refused.status, {"error": str(refused)}
        except ValueError as error:  # what was asked for cannot be
            return 400, {"error": str(error)}
        except (ConnectionError, TimeoutError):
            raise
        except Exception as error:  # noqa: BLE001 - a user's policy may raise anything, and the page tells of it
            return 500, {"error": f"{type(error).__name__}: {error}"}

    def _check_sender(self) -> None:
        """Refuse whoever is not our page."""
        token = self.path.lstrip("/").partition("/")[0]
        origins = [f"http://{host}" for host in self.server.hosts]
        if self.headers.get("Host") not in self.server.hosts:
            raise _Refused(403, f"Expected the host {self.server.hosts[0]}; open the address that the command shows.")
        if self.headers.get("Origin", origins[0]) not in origins:
            raise _Refused(403, "Expected a request of the page itself, got one of another page.")
        if not secrets.compare_digest(token.encode(), self.server.token.encode()):
            raise _Refused(403, "Expected the address with its token, as the command shows it.")

    def _page(self, place: str) -> str:
        if self.headers.get("Content-Length", "0") != "0" or "Transfer-Encoding" in self.headers:
            self.close_connection = True  # nobody reads the body, which would be taken for the next request
        if place:
            raise _Refused(404, "There is no such page.")
        return build_play_page()

    def _made(self, place: str, body: str) -> dict[str, Any]:
        session = self.server.session
        if place == "frame":
            return session.frame(parse_json(body))
        if place == "command":
            return {"done": session.carry_out(parse_json(body))}
        if place == "replay":
            return dict(zip(("name", "page"), session.replay_page(), strict=True))
        raise _Refused(404, "There is no such place.")

    def _body(self) -> str:
        length = self.headers.get("Content-Length", "")
        if not (length.isascii() and length.isdecimal()):
            raise _Refused(411, "Expected the length of the body as a whole number.")
        if len(length) > len(str(MOST_BYTES)) or int(length) > MOST_BYTES:
            raise _Refused(413, f"Expected a body of at most {MOST_BYTES:,} bytes, got {length[:20]}.")
        return self.rfile.read(int(length)).decode("utf-8")

    def _send(self, status: int, answer: Any) -> None:
        kind = "text/html; charset=utf-8" if isinstance(answer, str) else "application/json"
        body = (answer if isinstance(answer, str) else json.dumps(answer, allow_nan=False)).encode()
        self.send_response(status)
        for name, value in {**_HEADERS, "Content-Type": kind, "Content-Length": str(len(body))}.items():
            self.send_header(name, value)
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002 - the name that http.server has
        """Keep quiet: what is asked for is nobody else's business."""
