"""The replay page in a real browser: it plays, jumps, tells of robots, and asks for nothing."""

import dataclasses
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.inspect.replay.capture import record_replay
from swarm_forage_env.inspect.replay.files import write_replays
from swarm_forage_env.inspect.replay.frames import Status
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import World
from tests.support.browser import Browser, chromium
from tests.support.replay_page import choose, place_of, seek

pytestmark = pytest.mark.compiled

WORLD = scenario(
    "warehouse_small",
    n_robots=12,
    width_m=8.0,
    height_m=8.0,
    nest_centre_m=(1.0, 4.0),
    nest_size_m=(1.6, 4.0),
    n_objects=40,
    horizon_s=400.0,
    interval_s=100.0,
)
DISTURBED = (
    parse_wrapper("population:death_per_tick=0.0002,malfunction_per_tick=0.0005,repair_per_tick=0.01"),
    parse_wrapper("throttle:waveform=sine,amplitude=0.2,offset=0.2,period_s=200"),
)
NUMBER = "Number(document.querySelector('.amount').textContent.replaceAll(',', ''))"
PIXELS = "document.querySelector('.arena canvas').toDataURL()"
DESKTOP = {"width": 1280, "height": 900}
PHONE = {"width": 390, "height": 844, "touch": True}


@pytest.fixture(scope="module")
def replays(tmp_path_factory):
    chromium()  # skips before anything is run
    specs = [plan_run(WORLD, name, wrappers=DISTURBED, seed=0) for name in ("stochm", "crw")]
    return [record_replay(spec)[0] for spec in specs]


@pytest.fixture(scope="module")
def page(replays, tmp_path_factory) -> Path:
    return write_replays(tmp_path_factory.mktemp("page") / "one.html", replays[0])


@pytest.fixture(scope="module")
def pair(replays, tmp_path_factory) -> Path:
    return write_replays(tmp_path_factory.mktemp("page") / "two.html", replays)


@pytest.fixture(scope="module")
def desktop(tmp_path_factory) -> Iterator[Browser]:
    """One browser for all tests of this file; each opens its page anew."""
    with Browser(tmp_path_factory.mktemp("desktop"), **DESKTOP) as browser:
        yield browser


@pytest.fixture(scope="module")
def phone(tmp_path_factory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("phone"), **PHONE) as browser:
        yield browser


@pytest.fixture(params=["desktop", "phone"])
def browser(request) -> Browser:
    return request.getfixturevalue(request.param)


def keep_picture(browser: Browser, name: str) -> None:
    """Write a picture for people to look at, if the environment says where."""
    if "REPLAY_PICTURES" in os.environ:
        browser.picture(Path(os.environ["REPLAY_PICTURES"]) / f"{name}.png")


def test_play_moves_robots_and_pause_stops_them(page, browser):
    browser.open(page)
    before = browser.ask(PIXELS)
    browser.click("#play")
    browser.wait_for("Number(document.getElementById('scrub').value) > 5")
    assert browser.ask(PIXELS) != before
    browser.click("#play")
    seek(browser, 100.0)
    still = browser.ask(PIXELS)
    browser.ask("new Promise((done) => setTimeout(done, 200))")
    assert browser.ask(PIXELS) == still
    keep_picture(browser, f"play_{browser.width}")
    assert (browser.complaints, browser.requests) == ([], [])


def test_the_end_shows_the_counts_of_the_record(page, replays, browser):
    delivered = int(replays[0].counters[-1, Counter.COLLECTED])
    assert delivered > 0
    browser.open(page)
    assert browser.ask(NUMBER) == 0
    seek(browser, 400.0)
    assert browser.ask(NUMBER) == delivered
    assert browser.text("#score td") == str(delivered)
    seek(browser, 200.0)
    assert browser.ask(NUMBER) == replays[0].counters[200, Counter.COLLECTED]
    keep_picture(browser, f"end_{browser.width}")
    assert (browser.complaints, browser.requests) == ([], [])


def test_nothing_is_wider_than_the_window(pair, browser):
    browser.open(pair)
    assert browser.ask("document.documentElement.scrollWidth") <= browser.width


def test_a_click_chooses_a_robot_and_tells_its_state(pair, replays, desktop):
    replay = replays[0]
    desktop.open(pair)
    frame = 150  # one per second
    robot = next(r for r in range(12) if not replay.status[frame, r] & (8 | 4))
    choose(desktop, replay, frame, robot)
    words = desktop.text("#robot .told")
    assert replay.activities[replay.activity[frame, robot]] in words
    assert f"{replay.remembered[frame // 5, robot]} thing" in words
    desktop.press("f")
    desktop.wait_for("document.querySelector('#robot button').ariaPressed === 'true'")
    keep_picture(desktop, "robot")
    desktop.press("Escape")
    desktop.wait_for("document.querySelector('#robot h2') === null")
    assert (desktop.complaints, desktop.requests) == ([], [])


def test_a_link_goes_to_a_moment_and_a_robot(pair, desktop):
    value = "Number(document.getElementById('scrub').value)"
    desktop.open(pair, fragment="#t=120&robot=7")
    desktop.wait_for(f"{value} === 120")
    assert desktop.text("#robot h2").startswith("robot 7")
    desktop.ask("location.hash = '#t=60&robot=3'")
    desktop.wait_for(f"{value} === 60 && document.querySelector('#robot h2').textContent.startsWith('robot 3')")
    for nonsense in ("#t=soon&robot=99", "#robot=-1", "#t=", "#elsewhere"):
        desktop.ask(f"location.hash = '{nonsense}'")
        desktop.ask("new Promise((done) => setTimeout(done, 50))")
        assert desktop.ask(value) == 60
        assert desktop.text("#robot h2").startswith("robot 3")
    assert (desktop.complaints, desktop.requests) == ([], [])


def test_the_address_of_a_page_that_stands_still_is_such_a_link(page, desktop):
    desktop.open(page)
    desktop.ask("new Promise((done) => setTimeout(done, 500))")
    assert desktop.ask("location.hash") == ""
    seek(desktop, 150.0)
    desktop.wait_for("location.hash === '#t=150'")
    desktop.ask("location.hash = '#t=150&robot=2'")
    desktop.press("Escape")
    desktop.wait_for("location.hash === '#t=150'")
    assert desktop.complaints == []


def test_keys_play_step_and_switch_to_dark(page, desktop):
    value = "Number(document.getElementById('scrub').value)"
    desktop.open(page)
    desktop.press("ArrowRight")
    desktop.wait_for(f"{value} === 10")
    desktop.press("End")
    desktop.wait_for(f"{value} === 400")
    desktop.press("Home")
    desktop.press(" ", code="Space")
    desktop.wait_for(f"{value} > 1")
    desktop.press(" ", code="Space")
    light = desktop.ask("getComputedStyle(document.body).backgroundColor")
    desktop.press("t")
    assert desktop.ask("getComputedStyle(document.body).backgroundColor") != light
    assert desktop.complaints == []


def test_the_system_may_ask_for_dark(page, tmp_path):
    with Browser(tmp_path, **DESKTOP, dark=True) as browser:
        browser.open(page)
        theme = "document.documentElement.dataset.theme"
        assert browser.ask(theme) == "dark"
        system_asks_for(browser, "light")
        browser.wait_for(f"{theme} === 'light'")
        browser.press("t")
        for asked in ("dark", "light"):
            system_asks_for(browser, asked)
        assert browser.ask(f"matchMedia('(prefers-color-scheme: light)').matches && {theme}") == "dark", "as chosen"


def system_asks_for(browser: Browser, scheme: str) -> None:
    browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])


def test_a_click_on_a_curve_jumps_there(page, desktop):
    desktop.open(page)
    desktop.click(".curve:not([hidden]) canvas")
    desktop.wait_for("Math.abs(Number(document.getElementById('scrub').value) - 200) < 30")


def test_two_fingers_zoom(page, phone):
    phone.open(page)
    x, y = phone.middle(".arena canvas")
    before = phone.ask(PIXELS)
    phone.touch("touchStart", (x - 20, y), (x + 20, y))
    for reach in (40, 60, 80):
        phone.touch("touchMove", (x - reach, y), (x + reach, y))
    phone.touch("touchEnd")
    phone.wait_for("document.querySelector('.arena canvas').classList.contains('zoomed')")
    assert phone.ask(PIXELS) != before
    assert phone.complaints == []


def test_a_damaged_page_says_so(page, desktop, tmp_path):
    text = page.read_text()
    start = text.index('class="run">') + 40
    broken = tmp_path / "broken.html"
    broken.write_text(text[:start] + "AAAA" * 20 + text[start + 80 :])
    desktop.open(broken, "document.getElementById('loading')?.textContent.includes('cannot be shown')")
    assert "may be damaged" in desktop.text("#loading")


def test_a_page_is_ready_when_it_is_loaded(page, desktop):
    asked = "addEventListener('load', () => { window.atLoad = document.getElementById('loading').hidden; })"
    number = desktop.call("Page.addScriptToEvaluateOnNewDocument", source=asked)["identifier"]
    desktop.open(page)
    desktop.call("Page.removeScriptToEvaluateOnNewDocument", identifier=number)
    desktop.wait_for("window.atLoad !== undefined")
    assert desktop.ask("window.atLoad"), "a picture taken at once would show no run"


def test_names_are_whole_above_the_counts_of_many_runs(replays, browser, tmp_path):
    names = ["ppo_warehouse_small", "dpo minus site fidelity", "stochm with sensor noise", "crw"]
    many = [dataclasses.replace(replays[1], label=name) for name in names]
    browser.open(write_replays(tmp_path / "many.html", many))
    seek(browser, 400.0)
    heads = "[...document.querySelectorAll('#score thead span')]"
    assert browser.ask(f"{heads}.map((head) => head.textContent)") == names
    assert browser.ask(f"{heads}.every((h) => h.scrollWidth <= h.clientWidth + 1 && h.offsetHeight <= 170)")
    score = "document.getElementById('score')"
    assert browser.ask(f"{score}.scrollWidth - {score}.clientWidth") == 0
    captions = "[...document.querySelectorAll('.caption .name')]"
    assert browser.ask(f"{captions}.map((name) => name.textContent)") == names
    assert browser.ask(f"{captions}.every((name) => name.scrollWidth <= name.clientWidth)")
    keep_picture(browser, f"names_{browser.width}")


def test_the_subtitle_names_what_disturbs_the_runs(replays, pair, desktop, tmp_path):
    desktop.open(pair)
    told = "population: a death every 1,000 s on average, a malfunction every 400 s on average, a repair every 20 s"
    assert desktop.text("#subtitle").count(told) == 1
    assert "throttle: robots lose 0 to 40 % of their speed (sine, period 200 s)" in desktop.text("#subtitle")
    undisturbed = dataclasses.replace(replays[1].spec, world=World(replays[1].spec.scenario))
    quiet = dataclasses.replace(replays[1], spec=undisturbed, label="quiet")
    desktop.open(write_replays(tmp_path / "one_of_two.html", [quiet, replays[0]]))
    assert "stochm: population: a death" in desktop.text("#subtitle"), "not of both"
    assert "quiet:" not in desktop.text("#subtitle")


def test_the_subtitle_names_a_world_of_ones_own_and_what_differs_from_the_preset(replays, desktop, tmp_path):
    arena = dataclasses.replace(replays[1].spec.scenario.arena, obstacles=((4.0, 2.0, 4.4, 3.0),))
    scenario = dataclasses.replace(replays[1].spec.scenario, arena=arena)
    mine = dataclasses.replace(replays[1].spec, world=World(scenario, name="hall"))
    desktop.open(write_replays(tmp_path / "mine.html", [dataclasses.replace(replays[1], spec=mine)]))
    assert desktop.text("#subtitle").startswith("hall (warehouse small) with ")
    assert "obstacles 4,2,4.4,3" in desktop.text("#subtitle")


def test_robots_that_are_not_yet_born_are_not_called_dead(desktop, tmp_path):
    births = parse_wrapper("population:initial_robots=2,birth_per_tick=0.02")
    replay, _ = record_replay(plan_run(WORLD, "random", wrappers=(births,), seed=1), seconds=40.0)
    absent = replay.has(Status.ABSENT)
    born = int(np.flatnonzero(absent[0] & ~absent[-1])[0])
    first = int(np.argmin(absent[:, born]))
    desktop.open(write_replays(tmp_path / "births.html", replay))
    assert "a birth every 10 s on average, 2 robots at the start" in desktop.text("#subtitle")
    assert "in interference" in desktop.text("#legend")
    assert "dead" not in desktop.text("#legend")
    choose(desktop, replay, 40, born)
    assert told(desktop) != "not yet born"
    seek(desktop, first - 1.0)
    assert told(desktop) == "not yet born"
    assert desktop.complaints == []


def test_pointing_at_a_robot_tells_its_state(page, replays, desktop):
    replay = replays[0]
    desktop.open(page)
    seek(desktop, 150.0)
    robot = int(np.flatnonzero(~replay.has(Status.ABSENT)[150])[0])
    x, y = place_of(desktop, replay, 150, robot)
    desktop.move_to(x, y)
    desktop.wait_for("!document.getElementById('tip').hidden")
    lines = desktop.ask("[...document.getElementById('tip').children].map((line) => line.innerText.trim())")
    assert lines[0] == f"robot {robot}"
    assert f"activity: {replay.activities[replay.activity[150, robot]]}" in lines
    x_m, y_m = replay.position_m[150, robot]
    assert lines[-1] == f"place: {x_m:.1f}, {y_m:.1f} m"
    desktop.move_to(2.0, 2.0)
    desktop.wait_for("document.getElementById('tip').hidden")
    assert desktop.complaints == []


def test_thin_frames_show_what_the_chosen_robot_remembers(page, replays, desktop, tmp_path):
    replay = replays[0]
    unknown = write_replays(tmp_path / "unknown.html", dataclasses.replace(replay, memory_events=None))
    here = ~replay.has(Status.ABSENT)[300]
    robot = int(np.flatnonzero(here & (replay.remembered[60] > 0))[0])
    pictures = []
    for file in (page, unknown):
        desktop.open(file)
        choose(desktop, replay, 300, robot)
        desktop.move_to(2.0, 2.0)
        seek(desktop, 300.0)
        pictures.append(desktop.ask(PIXELS))
        keep_picture(desktop, f"memory_{file.stem}")
    assert pictures[0] != pictures[1]
    assert desktop.complaints == []


def test_following_keeps_the_robot_in_the_middle(page, replays, desktop):
    replay = replays[0]
    inner = np.abs(replay.position_m - 4.0).max(axis=2) < 2.0  # near a wall the arena ends before the window does
    frames = np.array([50, 60])
    robot = int(np.flatnonzero(inner[frames].all(axis=0) & ~replay.has(Status.ABSENT)[-1])[0])
    desktop.open(page)
    choose(desktop, replay, int(frames[0]), robot)
    desktop.press("f")
    desktop.wait_for("document.querySelector('.arena canvas').classList.contains('zoomed')")
    for frame in frames.tolist():
        seek(desktop, float(frame))
        desktop.press("Escape")  # lets go; the view stays
        desktop.click_at(*desktop.middle(".arena canvas"))
        desktop.wait_for(f"document.querySelector('#robot h2')?.textContent.startsWith('robot {robot}f')")
        desktop.press("f")
    assert np.ptp(replay.position_m[frames, robot], axis=0).max() > 0.1, "it has moved"


def test_the_throttle_has_a_curve_that_tells_its_value(page, replays, desktop):
    (throttle,) = replays[0].signals.values()
    desktop.open(page)
    values = "[...document.querySelectorAll('.curve')].find((c) => c.querySelector('h2').innerText === 'throttle')"
    for frame in (40, 150):
        seek(desktop, float(frame))
        assert float(desktop.ask(f"{values}.querySelector('.values').innerText")) == pytest.approx(
            throttle[frame], abs=0.005
        )


def test_a_ring_shows_where_an_object_has_been_delivered(page, replays, desktop, tmp_path):
    replay = replays[0]
    silent = write_replays(tmp_path / "silent.html", dataclasses.replace(replay, deliveries=replay.deliveries[:0]))
    first_s = float(replay.deliveries[0, 0]) * replay.scenario.dt_s
    pictures = []
    for file in (page, silent):
        desktop.open(file)
        for time_s in (first_s - 1.0, first_s + 0.4):
            seek(desktop, time_s)
            pictures.append(desktop.ask(PIXELS))
    before, after, silent_before, silent_after = pictures
    assert before == silent_before
    assert after != silent_after


def test_dead_robots_and_those_in_repair_are_told_and_explained(page, replays, desktop):
    replay = replays[0]
    absent, repair = replay.has(Status.ABSENT), replay.has(Status.REPAIR)
    dead = int(np.flatnonzero(absent[-1])[0])
    frame, broken = (int(place[0]) for place in np.nonzero(repair))
    desktop.open(page)
    for name in ("dead", "in repair"):
        assert name in desktop.text("#legend")
    choose(desktop, replay, int(np.argmax(absent[:, dead])) - 1, dead)
    assert told(desktop) != "dead"
    seek(desktop, 400.0)
    assert told(desktop) == "dead"
    choose(desktop, replay, frame, broken)
    assert told(desktop) == "in repair"
    assert desktop.complaints == []


def told(browser: Browser) -> str:
    """Return the state of the chosen robot, as the page calls it."""
    return browser.text("#robot td")
