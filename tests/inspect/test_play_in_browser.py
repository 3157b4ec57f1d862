"""The page to play with in a real browser: sliders, buttons, clicks and walls reach the run."""

from collections.abc import Iterator

import pytest

from swarm_forage_env.inspect.play.session import PlaySession, Setting
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.world import World
from tests.support.browser import Browser, chromium
from tests.support.play_page import choose_robot, run_shown, served

pytestmark = pytest.mark.slow

DESKTOP = {"width": 1280, "height": 800}
PHONE = {"width": 390, "height": 844, "touch": True}
SECONDS = "Number(document.getElementById('clock').textContent.replace(/\\D/g, ''))"


@pytest.fixture(scope="module")
def desktop(tmp_path_factory) -> Iterator[Browser]:
    chromium()  # skips before anything is run
    with Browser(tmp_path_factory.mktemp("desktop"), **DESKTOP) as browser:
        yield browser


@pytest.fixture(scope="module")
def phone(tmp_path_factory) -> Iterator[Browser]:
    chromium()
    with Browser(tmp_path_factory.mktemp("phone"), **PHONE) as browser:
        yield browser


@pytest.fixture
def session():
    world = scenario("warehouse_small", n_robots=12, n_objects=60, horizon_s=2000.0)
    session = PlaySession(Setting(world=World(world), policy="stochm", seed=1))
    with served(session) as server:
        session.address = server.address
        yield session


def opened(browser: Browser, session, *, plays: bool = False) -> None:
    session.paused = not plays
    browser.open_address(session.address)
    run_shown(browser, "12 robots")


def settled(browser: Browser) -> None:
    """All went well, and nothing was asked for elsewhere."""
    assert browser.complaints == []
    assert [address for address in browser.requests if not address.startswith("http://127.0.0.1:")] == []


@pytest.mark.parametrize("kind", ["desktop", "phone"])
def test_it_plays_pauses_and_steps(request, kind, session):
    browser = request.getfixturevalue(kind)
    opened(browser, session, plays=True)
    browser.wait_for(f"{SECONDS} > 3")
    browser.click("#play")
    browser.wait_for("document.getElementById('play').ariaLabel === 'Play'")
    browser.click("#theme")  # a space is for the page, and not for what was clicked last
    for word in ("Pause", "Play"):
        browser.press(" ")
        browser.wait_for(f"document.getElementById('play').ariaLabel === '{word}'")
    tick = session.world.tick
    browser.click("#step")
    browser.wait_for("document.getElementById('note').textContent === 'one tick'")
    assert session.world.tick == tick + 1
    assert browser.ask("document.documentElement.scrollWidth") <= browser.width
    browser.keep_picture(f"play_page_{kind}")
    settled(browser)


def test_a_robot_is_chosen_broken_repaired_and_killed(desktop, session):
    opened(desktop, session)
    choose_robot(desktop, session, 4)
    desktop.wait_for("document.querySelector('#robot table').textContent.includes('wheels')")
    assert "exploring" in desktop.text("#robot table")
    for button, words in (("break", "in repair"), ("repair", "empty"), ("kill", "dead")):
        desktop.click(f"#robot button[data-do={button}]")
        desktop.wait_for(f"document.querySelector('#robot td').textContent === '{words}'")
    assert session.levels.changes == ["robot 4 broken", "robot 4 repaired", "robot 4 killed"]
    assert desktop.ask("document.querySelectorAll('#robot button:disabled').length") == 3
    desktop.press("Escape")
    desktop.wait_for("document.querySelector('#robot h2') === null")
    settled(desktop)
