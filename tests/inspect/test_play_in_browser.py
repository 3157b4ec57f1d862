"""The page to play with in a real browser: sliders, buttons, clicks and walls reach the run."""

import base64
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from swarm_forage_env.inspect.play.levels import LEVELS
from swarm_forage_env.inspect.play.session import PlaySession, Setting
from swarm_forage_env.inspect.replay.files import read_replays
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.world import World
from tests.support.browser import Browser, chromium
from tests.support.play_page import choose_robot, move_slider, pixel_of, run_shown, served

pytestmark = pytest.mark.compiled

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
    session.run.paused = not plays
    browser.open_address(session.address)
    run_shown(browser, "12 robots")


def keep_picture(browser: Browser, name: str) -> None:
    """Write a picture for people to look at, if the environment says where."""
    if "REPLAY_PICTURES" in os.environ:
        browser.picture(Path(os.environ["REPLAY_PICTURES"]) / f"{name}.png")


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
    tick = session.run.world.tick
    browser.click("#step")
    browser.wait_for("document.getElementById('note').textContent === 'one tick'")
    assert session.run.world.tick == tick + 1
    assert browser.ask("document.documentElement.scrollWidth") <= browser.width
    keep_picture(browser, f"play_page_{kind}")
    settled(browser)


def test_sliders_change_the_run_that_goes_on(desktop, session):
    opened(desktop, session)
    for name, slider in LEVELS.items():
        move_slider(desktop, f"level-{name}", slider.most)
    desktop.wait_for("document.getElementById('changes').textContent.includes('deaths per 1,000 s 20')")
    assert session.frame()["levels"] == {name: slider.most for name, slider in LEVELS.items()}
    assert session.frame()["run"] == 1
    settled(desktop)


def test_a_robot_is_chosen_broken_repaired_and_killed(desktop, session):
    opened(desktop, session)
    choose_robot(desktop, session, 4)
    desktop.wait_for("document.querySelector('#robot table').textContent.includes('wheels')")
    assert "exploring" in desktop.text("#robot table")
    for button, words in (("break", "in repair"), ("repair", "empty"), ("kill", "dead")):
        desktop.click(f"#robot button[data-do={button}]")
        desktop.wait_for(f"document.querySelector('#robot td').textContent === '{words}'")
    assert session.run.levels.changes == ["robot 4 broken", "robot 4 repaired", "robot 4 killed"]
    assert desktop.ask("document.querySelectorAll('#robot button:disabled').length") == 3
    desktop.press("Escape")
    desktop.wait_for("document.querySelector('#robot h2') === null")
    settled(desktop)


def test_walls_are_drawn_and_removed(desktop, session):
    opened(desktop, session)
    desktop.click("#wall")
    desktop.drag(pixel_of(desktop, session, 20.0, 4.0), pixel_of(desktop, session, 21.0, 9.0))
    desktop.wait_for("document.getElementById('note').textContent === 'started again with 1 wall'")
    assert session.setting.world.scenario.arena.obstacles[0] == pytest.approx((20.0, 4.0, 21.0, 9.0), abs=0.1)
    desktop.wait_for("!document.getElementById('no-walls').disabled")
    keep_picture(desktop, "play_page_wall")
    desktop.drag(pixel_of(desktop, session, 1.0, 7.0), pixel_of(desktop, session, 3.0, 9.0))
    desktop.wait_for("document.getElementById('note').textContent.includes('clear of the nest')")
    desktop.click_at(*pixel_of(desktop, session, 20.5, 6.0))
    desktop.wait_for("document.getElementById('note').textContent === 'started again with 0 walls'")
    assert session.setting.world.scenario.arena.obstacles == ()
    assert [text for text in desktop.complaints if "400" not in text] == [], "the browser tells of the wall in the nest"


def test_robots_policy_and_scenario_start_another_run(desktop, session):
    opened(desktop, session)
    move_slider(desktop, "robots", 20)
    run_shown(desktop, "20 robots")
    move_slider(desktop, "policy", "ppo_warehouse_small")
    run_shown(desktop, "ppo_warehouse_small")
    move_slider(desktop, "scenario", "search_and_rescue")
    run_shown(desktop, "search and rescue")
    desktop.ask("document.getElementById('seed').value = 7")
    desktop.click("#restart")
    run_shown(desktop, "seed 7")
    assert (session.setting.policy, session.setting.seed) == ("ppo_warehouse_small", 7)
    settled(desktop)


def test_the_run_so_far_is_saved_as_a_replay(desktop, session, tmp_path):
    desktop.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    opened(desktop, session, plays=True)
    desktop.wait_for(f"{SECONDS} > 3")
    desktop.click("#save")
    desktop.wait_for("document.getElementById('note').textContent.startsWith('saved as')")
    name = desktop.text("#note").removeprefix("saved as ")
    desktop.wait_for("new Promise((done) => setTimeout(() => done(true), 1000))")
    (replay,) = read_replays(tmp_path / name)
    assert replay.end_tick >= 15
    settled(desktop)


def test_after_a_frame_that_is_refused_the_page_goes_on(desktop, session, monkeypatch):
    opened(desktop, session)
    loading = "document.getElementById('loading')"
    with monkeypatch.context() as broken:
        broken.setattr(session, "frame", lambda _: 1 / 0)
        desktop.wait_for(f"!{loading}.hidden && {loading}.textContent === 'ZeroDivisionError: division by zero'")
    desktop.wait_for(f"{loading}.hidden")
    move_slider(desktop, "robots", 20)
    run_shown(desktop, "20 robots")


def test_a_command_that_has_ended_is_told_of(desktop):
    session = PlaySession(Setting(world=World(scenario("warehouse_small", n_robots=12)), policy="random"))
    with served(session) as server:
        session.address = server.address
        opened(desktop, session)
        server.token = base64.b64encode(b"another").decode()  # a page of an earlier command is refused
        desktop.wait_for("document.getElementById('loading').textContent.includes('token')")
