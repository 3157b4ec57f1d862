"""What a reader does with the page to play with in a browser."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from swarm_forage_env.inspect.play.server import PlayServer
from swarm_forage_env.inspect.play.session import PlaySession
from tests.support.browser import Browser

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
