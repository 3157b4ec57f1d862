"""A real browser without a window, driven over its debugging pipe: no package is needed, only chromium."""

import base64
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

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
PATIENCE_S = 60.0


def find_chromium() -> str | None:
    """Return the path of a browser, None where there is none."""
    return os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)


def chromium() -> str:
    """Return the path of a browser; skips the test where there is none."""
    found = find_chromium()
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

    def open(
        self, file: Path, ready: str = "document.getElementById('loading')?.hidden === true", *, fragment: str = ""
    ) -> None:
        """Open a file and wait until it is ready; by default until its replay is unpacked.

        A fragment such as "#t=60" ends the address.
        """
        self.open_address(file.resolve().as_uri(), ready, fragment=fragment)

    def open_address(
        self, address: str, ready: str = "document.getElementById('loading')?.hidden === true", *, fragment: str = ""
    ) -> None:
        """Open an address and wait until it is ready; what was kept of an earlier page is gone."""
        self.call("Page.navigate", url="about:blank")  # another fragment alone would not load the page anew
        self.complaints.clear()  # an earlier page may have asked a server that has ended
        self.requests.clear()
        self._address = address
        self.call("Page.navigate", url=self._address + fragment)
        self.wait_for(ready)

    def keep_picture(self, name: str) -> None:
        """Write a picture for people to look at, if the environment says where."""
        if "REPLAY_PICTURES" in os.environ:
            self.picture(Path(os.environ["REPLAY_PICTURES"]) / f"{name}.png")

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

    def middle(self, selector: str) -> tuple[float, float]:
        """Return where the middle of an element is in the window."""
        left, top, width, height = self.box(selector)
        return left + width / 2, top + height / 2

    def click(self, selector: str) -> None:
        """Click in the middle of an element."""
        self.click_at(*self.middle(selector))

    def click_at(self, x: float, y: float) -> None:
        """Press and release the mouse."""
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def press(self, key: str, *, code: str = "") -> None:
        """Press and release a key."""
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=code or key)

    def picture(self, file: Path) -> Path:
        """Write what the page looks like as PNG."""
        file.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))
        return file


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


def pixel_of(browser: Browser, session: PlaySession, x_m: float, y_m: float) -> tuple[float, float]:
    """Return where a place of the arena is in the window, while the whole arena is shown."""
    left, top, width, height = browser.box(".arena canvas")
    arena = session.spec.scenario.arena
    scale = min((width - 2 * _MARGIN_PX) / arena.width_m, (height - 2 * _MARGIN_PX) / arena.height_m)
    return left + width / 2 + scale * (x_m - arena.width_m / 2), top + height / 2 - scale * (y_m - arena.height_m / 2)


def choose_robot(browser: Browser, session: PlaySession, robot: int) -> None:
    """Click on a robot of a run that stands still."""
    browser.click_at(*pixel_of(browser, session, *session.world.swarm.position[robot].tolist()))
    browser.wait_for(f"document.querySelector('#robot h2')?.textContent === 'robot {robot}'")


def run_shown(browser: Browser, text: str) -> None:
    """Wait until the headline, or the line below it, has some text."""
    browser.wait_for(f"document.querySelector('.names').textContent.includes('{text}')")
