"""The page to play with: its session is the run of `run_one`, commands do what they say, the server refuses others."""

import http.client
import json
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.inspect.play import session as playing
from swarm_forage_env.inspect.play.levels import LEVELS
from swarm_forage_env.inspect.play.server import HOST
from swarm_forage_env.inspect.play.session import SPEEDS, PlaySession, Setting
from swarm_forage_env.inspect.replay.frames import Status
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.noise import SensorNoiseConfig
from swarm_forage_env.wrappers.throttle import ThrottleConfig
from swarm_forage_env.wrappers.waveform import Waveform
from swarm_forage_env.wrappers.world import World
from tests.reference.replay_arrays import runs_of
from tests.support.browser import served

ROOM = {"width_m": 8.0, "height_m": 8.0, "nest_centre_m": (1.0, 4.0), "nest_size_m": (1.6, 4.0), "n_objects": 40}
SMALL = scenario("warehouse_small", n_robots=8, horizon_s=400.0, interval_s=100.0, **ROOM)
NOISY = (SensorNoiseConfig(sigma=0.01), ThrottleConfig(waveform=Waveform(kind="constant", amplitude=0.1)))
WALL = (4.0, 2.0, 4.4, 5.0)


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """Ticks take long while they are compiled."""
    monkeypatch.setattr("swarm_forage_env.inspect.play.session.LONGEST_S", 1000.0)


def session_of(policy="crw", wrappers=()):
    """A session, and the reader's time, which a test sets forward."""
    clock = SimpleNamespace(now_s=0.0)
    setting = Setting(world=World(SMALL, wrappers), policy=policy, seed=3)
    return PlaySession(setting, clock=lambda: clock.now_s), clock


def look_after(session, clock, seconds, **asked):
    """The frame after so many of the reader's seconds, in looks that follow each other quickly."""
    frame = session.frame(asked or None)
    for _ in range(round(seconds / 0.1)):
        clock.now_s += 0.1
        frame = session.frame(asked or None)
    return frame


def counted(frame, counter=Counter.COLLECTED):
    return frame["counters"][counter]


@pytest.mark.parametrize(
    ("policy", "wrappers"), [("stochm", NOISY), ("ppo_warehouse_small", ())], ids=["stochm", "ppo"]
)
def test_a_run_that_nobody_touches_is_that_of_run_one(policy, wrappers):
    session, clock = session_of(policy, wrappers)
    session.carry_out({"do": "speed", "value": 100})
    frame = look_after(session, clock, 4.1)
    assert (frame["time_s"], frame["over"]) == (400.0, True)
    record = run_one(plan_run(World(SMALL, wrappers), policy, seed=3))
    assert counted(frame) == int(record["collected"].sum()) > 0
    assert frame["changes"] == ""


def test_a_frame_is_plain_values_and_tells_what_is_where():
    session, clock = session_of()
    about = session.frame()["about"]
    frame = look_after(session, clock, 1.0, run=1)
    assert "about" not in frame, "only for a page that does not have it"
    assert json.loads(json.dumps(frame)) == frame
    swarm = session.world.swarm
    np.testing.assert_allclose(np.column_stack((frame["x"], frame["y"])), swarm.position, atol=6e-4)
    assert len(frame["status"]) == about["header"]["n_robots"] == 8
    assert len(frame["objects"]) == 3 * 40
    assert about["header"]["world"]["width_m"] == 8.0
    assert frame["time_s"] == pytest.approx(10.0, abs=0.3)


@pytest.mark.parametrize("name", ["sensor_noise", "wheel_noise", "throttle", "deaths"])
def test_a_level_that_was_set_changes_the_run_and_is_told(name):
    runs = [session_of()[0] for _ in range(2)]
    told = runs[0].levels.set(name, LEVELS[name].most)
    for each in runs:
        for _ in range(400):
            each.carry_out({"do": "step"})
    assert not np.array_equal(*(each.world.swarm.position for each in runs))
    assert runs[0].summary().endswith(f"changed by hand: {told.replace(' is', '')}")


def test_pause_step_and_speed():
    session, clock = session_of()
    session.carry_out({"do": "pause"})
    assert look_after(session, clock, 1.0)["time_s"] == 0.0
    assert session.carry_out({"do": "step"}) == "one tick"
    assert look_after(session, clock, 1.0)["time_s"] == pytest.approx(0.2)
    session.carry_out({"do": "speed", "value": SPEEDS[-1]})
    clock.now_s += 60.0
    session.carry_out({"do": "play"})
    assert session.frame()["time_s"] == pytest.approx(0.2), "what was slept through is not caught up with"
    clock.now_s += 60.0
    assert session.frame()["time_s"] == pytest.approx(0.2 + SPEEDS[-1] * playing.LONGEST_WAIT_S)


def test_a_robot_is_killed_broken_and_repaired():
    session, clock = session_of()
    look_after(session, clock, 0.5)
    assert session.carry_out({"do": "kill", "robot": 2}) == "robot 2 was killed"
    assert session.carry_out({"do": "kill", "robot": 2}) == "robot 2 is not alive"
    assert session.carry_out({"do": "repair", "robot": 5}) == "robot 5 is not in repair"
    assert session.carry_out({"do": "break", "robot": 5}) == "robot 5 broke down and waits for repair"
    assert session.carry_out({"do": "break", "robot": 5}) == "robot 5 is not at work"
    frame = look_after(session, clock, 1.0)
    assert frame["dead"] == [2]
    assert frame["status"][2] & Status.ABSENT
    assert frame["status"][5] & Status.REPAIR
    where = frame["x"][5], frame["y"][5]
    assert session.carry_out({"do": "repair", "robot": 5}) == "robot 5 is at work again"
    frame = look_after(session, clock, 1.0)
    assert not frame["status"][5] & Status.REPAIR
    assert (frame["x"][5], frame["y"][5]) != where
    assert frame["changes"] == "robot 2 killed, robot 5 broken, robot 5 repaired"


def test_robots_policy_scenario_and_seed_start_another_run():
    session, _ = session_of()
    session.carry_out({"do": "wall", "box": WALL})
    assert session.carry_out({"do": "start", "robots": 5, "policy": "dpo", "seed": 9}) == "started again with seed 9"
    about = session.frame()["about"]
    assert (about["header"]["n_robots"], about["policy"], about["header"]["seed"]) == (5, "dpo", 9)
    assert about["header"]["world"]["obstacles_m"] == (WALL,), "walls stay"
    session.carry_out({"do": "start", "scenario": "warehouse_small"})
    about = session.frame()["about"]
    assert about["header"]["world"]["obstacles_m"] == ()
    assert about["header"]["n_robots"] == scenario("warehouse_small").robots.n_robots


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        ({"do": "fly"}, "a command of the page"),
        ({"do": "level", "name": "gravity", "value": 1.0}, "Unknown level"),
        ({"do": "level", "name": "throttle", "value": 2.0}, "amplitude|throttle"),
        ({"do": "kill", "robot": 8}, "robot to be a whole number from 0 to 7"),
        ({"do": "wall", "box": [1.0, 4.0, 1.5, 4.5]}, "A wall cannot stand there"),
        ({"do": "start", "policy": "/tmp/other.py:Mine"}, "Unknown policy"),
        ({"do": "start", "scenario": "/etc/passwd.toml"}, "Unknown scenario"),
    ],
)
def test_a_wrong_command_is_refused_and_changes_nothing(command, expected):
    session, _ = session_of("random")
    before, run = session.setting, session.run
    with pytest.raises(ConfigError, match=expected):
        session.carry_out(command)
    assert (session.setting, session.run, session.levels.changes) == (before, run, [])


def test_the_curve_adds_up_to_what_was_counted():
    session, clock = session_of()
    session.carry_out({"do": "speed", "value": 100})
    frame = look_after(session, clock, 3.0)
    curve = frame["curve"]
    width_s = 300.0 / len(curve["time_s"])  # but for a second, in which frames are
    assert sum(curve["per_1000_s"]) * width_s / 1000.0 == pytest.approx(counted(frame), rel=0.05)
    assert frame["per_1000_s"] == pytest.approx(counted(frame) / 0.3, rel=0.01)
    active, interfering = counted(frame, Counter.ACTIVE), counted(frame, Counter.INTERFERING)
    assert frame["interference"] == pytest.approx(interfering / active)
    assert len(frame["deliveries"]) <= counted(frame)


def test_a_run_is_saved_as_a_replay_and_goes_on():
    session, clock = session_of()
    with pytest.raises(ConfigError, match="let it go on"):
        session.replay_page()
    session.carry_out({"do": "speed", "value": 100})
    look_after(session, clock, 1.0)
    session.carry_out({"do": "kill", "robot": 1})
    session.carry_out({"do": "level", "name": "throttle", "value": 0.3})
    look_after(session, clock, 1.0)
    session.carry_out({"do": "step"})  # the replay ends with the last whole frame
    name, page = session.replay_page()
    assert name.startswith("warehouse_small")
    assert name.endswith("_crw.html")
    ((about, arrays),) = runs_of(page)
    assert (about["end_tick"], about["n_frames"]) == (1000, 201)
    assert about["label"] == "crw, changed by hand: robot 1 killed, throttle 0.3"
    assert (arrays["status"][-1] & Status.ABSENT != 0).tolist() == [False, True] + 6 * [False]
    assert arrays["signal_throttle"][[0, -1]].tolist() == pytest.approx([0.0, 0.3])
    assert len(arrays["deliveries"]) == arrays["counters"][-1, Counter.COLLECTED]
    session.carry_out({"do": "play"})
    assert look_after(session, clock, 2.0)["over"]


@pytest.fixture(scope="module")
def server():
    world = World(scenario("warehouse_small", n_robots=3, n_objects=20))
    with served(PlaySession(Setting(world=world, policy="random"))) as server:
        yield server


def ask(server, method="POST", place="command", *, body="", path=None):
    """The answer, and its text."""
    connection = http.client.HTTPConnection(HOST, server.server_port, timeout=60)
    connection.request(method, f"/{server.token}/{place}" if path is None else path, body)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer, text


def refusal(server, *words, **more):
    answer, text = ask(server, *words, **more)
    return answer.status, json.loads(text)["error"]


def test_the_page_comes_with_its_token_and_may_load_nothing_else(server):
    answer, text = ask(server, "GET", "")
    assert answer.status == 200
    assert text.startswith("<!doctype html>")
    assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
    assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]
    assert (answer.headers["Referrer-Policy"], answer.headers["Cache-Control"]) == ("no-referrer", "no-store")


def test_without_the_token_all_is_refused(server):
    for method, path in product(("GET", "POST"), ("/", "/x/command", "//command", "/%C3%B6/")):
        status, words = refusal(server, method, path=path, body='{"do": "pause"}')
        assert (status, words) == (403, "Expected the address with its token, as the command shows it.")
    assert refusal(server, "GET", "../etc/passwd", body="null")[0] == 404


@pytest.mark.parametrize("body", ["{", b"\xff\xfe", '{"do": "fly"}', "[" * 9000])
def test_garbage_and_unknown_commands_are_refused(server, body):
    before = server.session.run
    status, words = refusal(server, body=body)
    assert status == 400
    assert words
    assert server.session.run is before


def test_a_frame_a_command_and_a_replay_come_as_json(server):
    answer, text = ask(server, place="frame", body='{"run": 0}')
    assert answer.status == 200
    assert json.loads(text)["about"]["header"]["n_robots"] == 3
    assert json.loads(ask(server, body='{"do": "kill", "robot": 1}')[1]) == {"done": "robot 1 was killed"}
    server.session.paused = True
    assert json.loads(ask(server, place="frame", body="null")[1])["dead"] == [1]
    while server.session.world.tick < 5:
        ask(server, body='{"do": "step"}')
    told = json.loads(ask(server, place="replay", body="null")[1])
    assert told["name"].endswith("_random.html")
    assert told["page"].rstrip().endswith("</html>")
    ask(server, body='{"do": "play"}')
