"""Pages in a real browser: the pictures of docs/replay.md and docs/play.md, and how large and fast replays are.

    python -m scripts.replay_in_browser pictures
    python -m scripts.replay_in_browser play
    python -m scripts.replay_in_browser speed [--robots 819] [--seconds 200]

`pictures` writes docs/images/replay_desktop.png and replay_phone.png, and `play` play_desktop.png. `speed` makes the
start of a run of search and rescue, prints the size of its page, and the processor time that the page takes when a
reader jumps to another time.
Needs chromium and the test extra.
"""

import argparse
import statistics
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from scripts.arguments import whole
from swarm_forage_env import World, plan_run, record_replay, scenario, write_replays
from swarm_forage_env.inspect.play.session import PlaySession, Setting
from swarm_forage_env.inspect.replay.frames import Replay
from tests.support.browser import NAMES, Browser, find_chromium
from tests.support.play_page import choose_robot, served
from tests.support.replay_page import choose, seek

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
POLICIES = ("crw", "dpo", "ppo_warehouse_small")
PHONE_POLICY = "stochx"
PICTURE_S = 1500.0
"""When the pictures are taken; the runs last twice as long."""
SEED = 1
DESKTOP: dict[str, Any] = {"width": 1280, "height": 1080}
PHONE: dict[str, Any] = {"width": 390, "height": 844, "touch": True}
PLAY_DESKTOP: dict[str, Any] = {"width": 1280, "height": 800}
PLAY_WALL = (18.0, 4.0, 18.6, 12.0)
PLAY_S = 1200.0
"""When the picture of the page to play with is taken; half of it, its run is as planned."""
JUMPS = 30
JUMP = """new Promise((done) => {{
  const scrub = document.getElementById("scrub");
  scrub.value = {time_s};
  scrub.dispatchEvent(new Event("input"));
  requestAnimationFrame(done);
}})"""
"""Jump to a time and wait until the page has painted it: the page's own callback comes before."""


def replay_of(policy: str) -> Replay:
    """Run a policy in the small warehouse."""
    world = scenario("warehouse_small", physics="compiled")
    return record_replay(plan_run(world, policy, seed=SEED), seconds=2.0 * PICTURE_S)[0]


def draw_pictures(folder: Path) -> None:
    """Take both pictures; under the second policy, the chosen robot delivers more than all others."""
    replays = [replay_of(policy) for policy in POLICIES]
    with Browser(folder / "desktop", **DESKTOP) as browser:
        browser.open(write_replays(folder / "three.html", replays))
        robot = int(np.bincount(replays[1].deliveries[:, 1]).argmax())
        frame = int(np.searchsorted(replays[1].times_s, PICTURE_S))
        choose(browser, replays[1], frame, robot, panel=2)
        browser.ask("scrollTo(0, 0)")
        print(browser.picture(IMAGES / "replay_desktop.png"))
    with Browser(folder / "phone", **PHONE, dark=True) as browser:
        browser.open(write_replays(folder / "one.html", replay_of(PHONE_POLICY)))
        seek(browser, PICTURE_S)
        print(browser.picture(IMAGES / "replay_phone.png"))


def draw_play(folder: Path) -> None:
    """Take the picture of the page to play with: a wall, some noise, one robot dead and another one chosen."""
    world = scenario("warehouse_small", n_robots=40, obstacles=(PLAY_WALL,), physics="compiled")
    session = PlaySession(Setting(world=World(world), policy="dpo", seed=SEED))
    session.carry_out({"do": "pause"})
    for _ in range(round(PLAY_S / 2 / world.dt_s)):
        session.run.step()
    session.carry_out({"do": "level", "name": "throttle", "value": 0.2})
    session.carry_out({"do": "kill", "robot": 7})
    with served(session) as server, Browser(folder / "play", **PLAY_DESKTOP) as browser:
        browser.open_address(server.address)
        for _ in range(round(PLAY_S / 2 / world.dt_s)):
            session.run.step()
        browser.wait_for(f"document.getElementById('clock').textContent === '{PLAY_S:,.0f} s'")
        carrying = session.run.world.swarm.carried_object >= 0
        choose_robot(browser, session, int(np.flatnonzero(carrying)[0]))
        browser.wait_for("document.querySelector('#robot table').textContent.includes('wheels')")
        browser.ask("scrollTo(0, 0)")
        print(browser.picture(IMAGES / "play_desktop.png"))


def measure(folder: Path, n_robots: int, seconds: int) -> None:
    """Print size and speed of a page of many robots."""
    world = scenario("search_and_rescue", n_robots=n_robots, physics="compiled")
    replay, _ = record_replay(plan_run(world, "crw", seed=SEED), seconds=float(seconds))
    path = write_replays(folder / "many.html", replay)
    empty = write_replays(folder / "two_frames.html", record_replay(replay.spec, seconds=world.dt_s)[0])
    own_bytes = path.stat().st_size - empty.stat().st_size
    rate = own_bytes / replay.status.size
    print(f"{n_robots} robots, {replay.n_frames} frames: {path.stat().st_size / 1e6:.2f} MB")
    print(f"beyond a page of two frames: {rate:.2f} bytes per robot and frame")
    with Browser(folder / "desktop", **DESKTOP) as browser:
        browser.open(path)
        browser.call("Performance.enable", timeDomain="threadTicks")
        took: list[float] = []
        for time_s in np.random.default_rng(SEED).uniform(0.0, replay.times_s[-1], JUMPS).tolist():
            before = processor_ms(browser)
            browser.ask(JUMP.format(time_s=time_s))
            took.append(processor_ms(browser) - before)
    print(f"a jump: {statistics.median(took):.1f} ms of processor time in the median of {JUMPS}")


def processor_ms(browser: Browser) -> float:
    """Return the processor time that the page's own thread has used so far."""
    metrics = browser.call("Performance.getMetrics")["metrics"]
    return 1000.0 * next(metric["value"] for metric in metrics if metric["name"] == "TaskDuration")


def main() -> None:
    """Do what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("pictures", "play", "speed"))
    parser.add_argument("--robots", type=whole(at_least=1), default=819)
    parser.add_argument("--seconds", type=whole(at_least=1), default=200)
    words = parser.parse_args()
    if find_chromium() is None:
        sys.exit(f"Expected a browser, {', '.join(NAMES)}, found none; install one or set CHROMIUM to its path.")
    with tempfile.TemporaryDirectory() as folder:
        if words.what == "pictures":
            draw_pictures(Path(folder))
        elif words.what == "play":
            draw_play(Path(folder))
        else:
            measure(Path(folder), words.robots, words.seconds)


if __name__ == "__main__":
    main()
