"""The page to play with and its session over HTTP, for one reader on this machine.

It listens on the loopback address only, and refuses an address without its random token. So of all that a browser
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
        self.address = f"http://{HOST}:{self.server_port}/{self.token}/"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Keep quiet about a reader who has left; whatever else went wrong is told."""
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    """Answers one request, in a thread of its own."""

    server: PlayServer  # pyright: ignore[reportIncompatibleVariableOverride] - nobody else makes it
    timeout = SILENCE_S
    server_version = "swarm-forage"
    sys_version = ""

    def do_POST(self) -> None:
        """Send the page, a frame or a replay, or carry out a command."""
        status, answer = self._outcome()
        kind = "text/html; charset=utf-8" if isinstance(answer, str) else "application/json"
        body = (answer if isinstance(answer, str) else json.dumps(answer, allow_nan=False)).encode()
        self.send_response(status)
        for name, value in {**_HEADERS, "Content-Type": kind, "Content-Length": str(len(body))}.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    do_GET = do_POST  # noqa: N815 - the name that http.server has

    def _outcome(self) -> tuple[int, Any]:
        """Return the status, and the page as text or the answer as a table."""
        token, _, place = self.path.lstrip("/").partition("/")
        if not secrets.compare_digest(token.encode(), self.server.token.encode()):
            return 403, {"error": "Expected the address with its token, as the command shows it."}
        try:
            if self.command == "GET" and not place:
                return 200, build_play_page()
            session = self.server.session
            asked = parse_json(self.rfile.read(int(self.headers.get("Content-Length", "0"))).decode() or "null")
            if place == "frame":
                return 200, session.frame(asked)
            if place == "command":
                return 200, {"done": session.carry_out(asked)}
            if place == "replay":
                return 200, dict(zip(("name", "page"), session.replay_page(), strict=True))
            return 404, {"error": "There is no such place."}
        except ValueError as error:  # what was asked for cannot be
            return 400, {"error": str(error)}
        except Exception as error:  # noqa: BLE001 - a user's policy may raise anything, and the page tells of it
            return 500, {"error": f"{type(error).__name__}: {error}"}

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002 - the name that http.server has
        """Keep quiet: what is asked for is nobody else's business."""
