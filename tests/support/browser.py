"""A real browser without a window, driven over its debugging pipe: no package is needed, only chromium."""

import itertools
import json
import os
import select
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from swarm_forage_env.inspect.play.server import PlayServer
from swarm_forage_env.inspect.play.session import PlaySession
from swarm_forage_env.scenarios.config import ArenaConfig

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
PATIENCE_S = 60.0


def chromium() -> str:
    """Return the path of a browser; skips the test where there is none."""
    found = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip(f"needs a browser: none of {', '.join(NAMES)} is installed")
    return found


class Browser:
    """One page in a browser. Everything that goes wrong in the page, and every request, is kept.

    Attributes:
        complaints: Errors and messages on the console.
        requests: Addresses that the page has asked for, itself aside.
        width: Width of the window in pixels.
    """

    def __init__(self, folder: Path, *, width: int, height: int, touch: bool = False) -> None:
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.width = width
        self._ids = itertools.count(1)
        self._unread = b""
        self._address = ""
        self._session: str | None = None
        from_us, to_browser = os.pipe()
        from_browser, to_us = os.pipe()
        options = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run")
        # The browser reads commands from descriptor 3 and writes answers to 4.
        self._process = subprocess.Popen(
            ["bash", "-c", f'exec "$0" "$@" 3<&{from_us} 4>&{to_us}', chromium(), *options,
             "--remote-debugging-pipe", f"--user-data-dir={folder / 'profile'}", "about:blank"],
            pass_fds=(from_us, to_us), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(from_us)
        os.close(to_us)
        self._in, self._out = to_browser, from_browser
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")
        shape = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": touch}
        self.call("Emulation.setDeviceMetricsOverride", **shape)
        self.call("Emulation.setTouchEmulationEnabled", enabled=touch)
        scheme = {"name": "prefers-color-scheme", "value": "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.wait(PATIENCE_S)
        os.close(self._in)
        os.close(self._out)

    def call(self, method: str, **arguments: Any) -> dict[str, Any]:
        """Give one command of the debugging protocol and return its answer."""
        number = next(self._ids)
        message: dict[str, Any] = {"id": number, "method": method, "params": arguments}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._in, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._read()
            if answer.get("id") == number:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return answer["result"]
            self._note(answer)

    def _read(self) -> dict[str, Any]:
        while b"\0" not in self._unread:
            ready, _, _ = select.select([self._out], [], [], PATIENCE_S)
            part = os.read(self._out, 1 << 20) if ready else b""
            assert part, "the browser does not answer"
            self._unread += part
        message, _, self._unread = self._unread.partition(b"\0")
        return json.loads(message)

    def _note(self, event: dict[str, Any]) -> None:
        about = event.get("params", {})
        if event["method"] == "Runtime.exceptionThrown":
            self.complaints.append(json.dumps(about["exceptionDetails"].get("exception", about)))
        elif event["method"] == "Runtime.consoleAPICalled":
            self.complaints.append(json.dumps(about["args"]))
        elif event["method"] == "Log.entryAdded":
            self.complaints.append(about["entry"]["text"])
        elif event["method"] == "Network.requestWillBeSent" and about["request"]["url"] != self._address:
            self.requests.append(about["request"]["url"])

    def open(self, address: str, ready: str = "document.getElementById('loading')?.hidden === true") -> None:
        """Open an address and wait until it is ready, by default until its run is shown; what was kept is gone."""
        self.call("Page.navigate", url="about:blank")  # an earlier page may ask a server that has ended
        self.complaints.clear()
        self.requests.clear()
        self._address = address
        self.call("Page.navigate", url=address)
        self.wait_for(ready)

    def ask(self, expression: str) -> Any:
        """Return the value of an expression in the page."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait_for(self, expression: str) -> None:
        """Wait until an expression is true."""
        end = time.monotonic() + PATIENCE_S
        while not self.ask(expression):
            assert time.monotonic() < end, f"{expression} never came true; {self.complaints}"
            time.sleep(0.05)

    def text(self, selector: str) -> str:
        """Return the text of an element."""
        return self.ask(f"document.querySelector({json.dumps(selector)}).textContent").strip()

    def box(self, selector: str) -> tuple[float, float, float, float]:
        """Return left, top, width and height of an element in the window; it is scrolled into sight."""
        element = f"document.querySelector({json.dumps(selector)})"
        self.ask(f"{element}.scrollIntoView({{block: 'nearest'}})")
        left, top, width, height = self.ask(
            f"(({{left, top, width, height}}) => [left, top, width, height])({element}.getBoundingClientRect())"
        )
        return left, top, width, height

    def click(self, selector: str) -> None:
        """Click in the middle of an element."""
        left, top, width, height = self.box(selector)
        self.click_at(left + width / 2, top + height / 2)

    def click_at(self, x: float, y: float) -> None:
        """Press and release the mouse."""
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def press(self, key: str) -> None:
        """Press and release a key."""
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=key)


_MARGIN_PX = 8
"""Of the arena in its canvas, as in `view.js`."""


@contextmanager
def served(session: PlaySession) -> Iterator[PlayServer]:
    """Serve a session while the context lasts."""
    server = PlayServer(session)
    thread = threading.Thread(target=server.serve_forever, args=(0.05,))
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def choose_robot(browser: Browser, arena: ArenaConfig, robot: int, x_m: float, y_m: float) -> None:
    """Click on a robot that stands at a place of an arena which is shown as a whole."""
    left, top, width, height = browser.box(".arena canvas")
    scale = min((width - 2 * _MARGIN_PX) / arena.width_m, (height - 2 * _MARGIN_PX) / arena.height_m)
    x, y = scale * (x_m - arena.width_m / 2), scale * (y_m - arena.height_m / 2)
    browser.click_at(left + width / 2 + x, top + height / 2 - y)
    browser.wait_for(f"parseInt(document.querySelector('#robot h2')?.textContent.slice(6)) === {robot}")
