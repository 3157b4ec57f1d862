"""The replay page in a real browser: it plays, jumps, tells of robots, and asks for nothing."""

import os
from pathlib import Path

import pytest

from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.study.replay.capture import record_replay
from swarm_forage_env.study.replay.files import write_replays
from swarm_forage_env.study.spec import plan_run
from swarm_forage_env.wrappers.registry import parse_wrapper
from tests.support.browser import Browser, chromium

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
    specs = [plan_run(WORLD, name, wrappers=DISTURBED, seed=2) for name in ("stochm", "crw")]
    return [record_replay(spec)[0] for spec in specs]


@pytest.fixture(scope="module")
def page(replays, tmp_path_factory) -> Path:
    return write_replays(tmp_path_factory.mktemp("page") / "one.html", replays[0])


@pytest.fixture(scope="module")
def pair(replays, tmp_path_factory) -> Path:
    return write_replays(tmp_path_factory.mktemp("page") / "two.html", replays)


@pytest.fixture(params=[DESKTOP, PHONE], ids=["desktop", "phone"])
def shape(request):
    return request.param


def keep_picture(browser: Browser, name: str) -> None:
    """Write a picture for people to look at, if the environment says where."""
    if "REPLAY_PICTURES" in os.environ:
        browser.picture(Path(os.environ["REPLAY_PICTURES"]) / f"{name}.png")


def seek(browser: Browser, time_s: float) -> None:
    browser.ask(f"document.getElementById('scrub').value = {time_s}")
    browser.ask("document.getElementById('scrub').dispatchEvent(new Event('input'))")
    browser.ask("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def test_play_moves_robots_and_pause_stops_them(page, shape, tmp_path):
    with Browser(tmp_path, **shape) as browser:
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
        keep_picture(browser, f"play_{shape['width']}")
        assert (browser.complaints, browser.requests) == ([], [])


def test_the_end_shows_the_counts_of_the_record(page, replays, shape, tmp_path):
    delivered = int(replays[0].counters[-1, Counter.COLLECTED])
    assert delivered > 0
    with Browser(tmp_path, **shape) as browser:
        browser.open(page)
        assert browser.ask(NUMBER) == 0
        seek(browser, 400.0)
        assert browser.ask(NUMBER) == delivered
        assert browser.text("#score td") == str(delivered)
        seek(browser, 200.0)
        assert browser.ask(NUMBER) == replays[0].counters[200, Counter.COLLECTED]
        keep_picture(browser, f"end_{shape['width']}")
        assert (browser.complaints, browser.requests) == ([], [])


def test_nothing_is_wider_than_the_window(pair, shape, tmp_path):
    with Browser(tmp_path, **shape) as browser:
        browser.open(pair)
        assert browser.ask("document.documentElement.scrollWidth") <= shape["width"]


def test_a_click_chooses_a_robot_and_tells_its_state(pair, replays, tmp_path):
    replay = replays[0]
    with Browser(tmp_path, **DESKTOP) as browser:
        browser.open(pair)
        seek(browser, 150.0)
        frame = 150  # one per second
        robot = next(r for r in range(12) if not replay.status[frame, r] & (8 | 4))
        left, top, width, height = browser.box(".arena canvas")
        scale = (min(width, height) - 16) / 8.0
        x_m, y_m = replay.position_m[frame, robot]
        browser.click_at(left + width / 2 + scale * (x_m - 4.0), top + height / 2 - scale * (y_m - 4.0))
        browser.wait_for("document.querySelector('#robot h2') !== null")
        assert browser.text("#robot h2").startswith("robot ")
        chosen = int(browser.text("#robot h2").removeprefix("robot ").removesuffix("follow"))
        assert abs(replay.position_m[frame, chosen] - (x_m, y_m)).max() < 0.3
        told = browser.text("#robot .told")
        assert replay.activities[replay.activity[frame, chosen]] in told
        assert f"{replay.remembered[frame // 5, chosen]} thing" in told
        browser.press("f")
        browser.wait_for("document.querySelector('#robot button').ariaPressed === 'true'")
        keep_picture(browser, "robot")
        browser.press("Escape")
        browser.wait_for("document.querySelector('#robot h2') === null")
        assert (browser.complaints, browser.requests) == ([], [])


def test_keys_play_step_and_switch_to_dark(page, tmp_path):
    value = "Number(document.getElementById('scrub').value)"
    with Browser(tmp_path, **DESKTOP) as browser:
        browser.open(page)
        browser.press("ArrowRight")
        browser.wait_for(f"{value} === 10")
        browser.press("End")
        browser.wait_for(f"{value} === 400")
        browser.press("Home")
        browser.press(" ", code="Space")
        browser.wait_for(f"{value} > 1")
        browser.press(" ", code="Space")
        light = browser.ask("getComputedStyle(document.body).backgroundColor")
        browser.press("t")
        assert browser.ask("getComputedStyle(document.body).backgroundColor") != light
        assert browser.complaints == []


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


def test_a_click_on_a_curve_jumps_there(page, tmp_path):
    with Browser(tmp_path, **DESKTOP) as browser:
        browser.open(page)
        browser.click(".curve:not([hidden]) canvas")
        browser.wait_for("Math.abs(Number(document.getElementById('scrub').value) - 200) < 30")


def test_two_fingers_zoom(page, tmp_path):
    with Browser(tmp_path, **PHONE) as browser:
        browser.open(page)
        x, y = browser.middle(".arena canvas")
        before = browser.ask(PIXELS)
        browser.touch("touchStart", (x - 20, y), (x + 20, y))
        for reach in (40, 60, 80):
            browser.touch("touchMove", (x - reach, y), (x + reach, y))
        browser.touch("touchEnd")
        browser.wait_for("document.querySelector('.arena canvas').classList.contains('zoomed')")
        assert browser.ask(PIXELS) != before
        assert browser.complaints == []


def test_a_damaged_page_says_so(page, tmp_path):
    text = page.read_text()
    start = text.index('class="run">') + 40
    broken = tmp_path / "broken.html"
    broken.write_text(text[:start] + "AAAA" * 20 + text[start + 80 :])
    with Browser(tmp_path, **DESKTOP) as browser:
        browser.open(broken, "document.getElementById('loading')?.textContent.includes('cannot be shown')")
        assert "may be damaged" in browser.text("#loading")
