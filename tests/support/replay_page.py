"""What a reader does with a replay page in a browser."""

from swarm_forage_env.inspect.replay.frames import Replay
from tests.support.browser import Browser

_MARGIN_PX = 8
"""Of the arena in its canvas, as in `view.js`."""


def seek(browser: Browser, time_s: float) -> None:
    """Move the slider, and wait until the page is painted."""
    browser.ask(f"document.getElementById('scrub').value = {time_s}")
    browser.ask("document.getElementById('scrub').dispatchEvent(new Event('input'))")
    browser.ask("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def place_of(browser: Browser, replay: Replay, frame: int, robot: int, *, panel: int = 1) -> tuple[float, float]:
    """Return where a robot is in the window, in pixels, while an arena is shown as a whole; `panel` counts from 1."""
    left, top, width, height = browser.box(f".arena:nth-child({panel}) canvas")
    arena = replay.scenario.arena
    scale = min((width - 2 * _MARGIN_PX) / arena.width_m, (height - 2 * _MARGIN_PX) / arena.height_m)
    x_m, y_m = replay.position_m[frame, robot]
    return left + width / 2 + scale * (x_m - arena.width_m / 2), top + height / 2 - scale * (y_m - arena.height_m / 2)


def choose(browser: Browser, replay: Replay, frame: int, robot: int, *, panel: int = 1) -> None:
    """Go to a frame and click on a robot; frames are as far apart as `replay` has them."""
    seek(browser, float(replay.times_s[frame]))
    browser.click_at(*place_of(browser, replay, frame, robot, panel=panel))
    browser.wait_for(f"document.querySelector('#robot h2')?.textContent.startsWith('robot {robot}f')")
