"""The replay page and the page to play with in a real browser: sliders, buttons and clicks do what they say."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from swarm_forage_env.inspect.play.session import PlaySession, Setting
from swarm_forage_env.inspect.replay.capture import record_replay
from swarm_forage_env.inspect.replay.files import write_replays
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import World
from tests.support.browser import Browser, choose_robot, chromium, served
from tests.support.foraging import CROWDED

WORLD = with_overrides(CROWDED, n_objects=40, horizon_s=400.0, interval_s=100.0)
DISTURBED = (
    parse_wrapper("population:death_per_tick=0.0002,malfunction_per_tick=0.0005,repair_per_tick=0.01"),
    parse_wrapper("throttle:waveform=sine,amplitude=0.2,offset=0.2,period_s=200"),
)
pytestmark = pytest.mark.slow

PIXELS = "document.querySelector('.arena canvas').toDataURL()"


@pytest.fixture(scope="module")
def replays(tmp_path_factory):
    chromium()  # skips before anything is run
    specs = [plan_run(WORLD, name, wrappers=DISTURBED, seed=0) for name in ("stochm", "crw")]
    return [record_replay(spec) for spec in specs]


@pytest.fixture(scope="module")
def page(replays, tmp_path_factory) -> Path:
    return write_replays(tmp_path_factory.mktemp("page") / "two.html", replays)


@pytest.fixture(scope="module")
def desktop(tmp_path_factory) -> Iterator[Browser]:
    chromium()  # skips before anything is run
    with Browser(tmp_path_factory.mktemp("desktop"), width=1280, height=900) as browser:
        yield browser


@pytest.fixture(scope="module")
def phone(tmp_path_factory) -> Iterator[Browser]:
    chromium()
    with Browser(tmp_path_factory.mktemp("phone"), width=390, height=844, touch=True) as browser:
        yield browser


@pytest.fixture(params=["desktop", "phone"])
def browser(request) -> Browser:
    return request.getfixturevalue(request.param)


def test_play_moves_robots_and_pause_stops_them(page, browser):
    browser.open(page.as_uri())
    before = browser.ask(PIXELS)
    browser.click("#play")
    browser.wait_for("Number(document.getElementById('scrub').value) > 5")
    assert browser.ask(PIXELS) != before
    browser.click("#play")
    seek(browser, 100.0)
    still = browser.ask(PIXELS)
    browser.ask("new Promise((done) => setTimeout(done, 200))")
    assert browser.ask(PIXELS) == still
    assert (browser.complaints, browser.requests) == ([], [])


def test_a_click_chooses_a_robot_and_tells_its_state(page, replays, desktop):
    replay = replays[0]
    desktop.open(page.as_uri())
    frame = 150  # one per second
    robot = next(r for r in range(12) if not replay.status[frame, r] & (8 | 4))
    seek(desktop, float(replay.times_s[frame]))
    choose_robot(desktop, replay.scenario.arena, robot, *replay.position_m[frame, robot])
    words = desktop.text("#robot .told")
    assert replay.activities[replay.activity[frame, robot]] in words
    assert "thing" in words
    desktop.press("f")
    desktop.wait_for("document.querySelector('#robot button').ariaPressed === 'true'")
    desktop.press("Escape")
    desktop.wait_for("document.querySelector('#robot h2') === null")
    assert (desktop.complaints, desktop.requests) == ([], [])


def test_a_damaged_page_says_so(page, desktop, tmp_path):
    text = page.read_text()
    start = text.index('class="run">') + 40
    broken = tmp_path / "broken.html"
    broken.write_text(text[:start] + "AAAA" * 20 + text[start + 80 :])
    desktop.open(broken.as_uri(), "document.getElementById('loading')?.textContent.includes('cannot be shown')")
    assert "may be damaged" in desktop.text("#loading")


SECONDS = "Number(document.getElementById('clock').textContent.replace(/\\D/g, ''))"


@pytest.fixture
def session():
    world = scenario("warehouse_small", n_robots=12, n_objects=60, horizon_s=2000.0)
    session = PlaySession(Setting(world=World(world), policy="stochm", seed=1))
    with served(session) as server:
        session.address = server.address
        yield session


def opened(browser: Browser, session, *, plays: bool = False) -> None:
    session.paused = not plays
    browser.open(session.address)
    browser.wait_for("document.querySelector('.names').textContent.includes('12 robots')")


def settled(browser: Browser) -> None:
    """All went well, and nothing was asked for elsewhere."""
    assert browser.complaints == []
    assert [address for address in browser.requests if not address.startswith("http://127.0.0.1:")] == []


def test_it_plays_pauses_and_steps(browser, session):
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
    settled(browser)


def test_a_robot_is_chosen_broken_repaired_and_killed(desktop, session):
    opened(desktop, session)
    choose_robot(desktop, session.spec.scenario.arena, 4, *session.world.swarm.position[4].tolist())
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


def seek(browser: Browser, time_s: float) -> None:
    """Move the slider, and wait until the page is painted."""
    browser.ask(f"document.getElementById('scrub').value = {time_s}")
    browser.ask("document.getElementById('scrub').dispatchEvent(new Event('input'))")
    browser.ask("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
