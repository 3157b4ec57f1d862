"""Watching a run: keys and clicks do what they should, and looking changes nothing."""

import numpy as np
import pytest

from swarm_forage_env.inspect import run_by_hand
from swarm_forage_env.inspect.levels_by_hand import LEVELS, Levels, with_idle
from swarm_forage_env.inspect.watch import HELP, SPEEDS, Watch
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.rendering.view import THEMES, RenderError
from swarm_forage_env.rendering.window import Clicked, Closed, Pressed, Window
from swarm_forage_env.runs.run import LiveRun, build_env
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.noise import SensorNoiseConfig
from swarm_forage_env.wrappers.throttle import ThrottleConfig
from swarm_forage_env.wrappers.waveform import Waveform

pygame = pytest.importorskip("pygame")
pytest.importorskip("PIL")

SMALL = scenario("warehouse_small", n_robots=8, n_objects=40)
NOISY = (SensorNoiseConfig(sigma=0.02), ThrottleConfig(waveform=Waveform(kind="constant", amplitude=0.1)))


@pytest.fixture
def watch() -> Watch:
    return Watch(SMALL, "dpo", seed=3, size_px=400)


def press(watch, *keys, shift=False):
    for key in keys:
        watch.handle(Pressed(key, shift))


def click(watch, robot, *, shift=False):
    x, y = watch.scene().ring[:2] if robot is None else place_of(watch, robot)
    watch.handle(Clicked(round(x), round(y), shift))


def place_of(watch, robot):
    """Pixel of a robot: where the ring is while it is chosen."""
    chosen, watch.robot = watch.robot, robot
    x, y, _ = watch.scene().ring
    watch.robot = chosen
    return x, y


def state_of(world):
    swarm = world.swarm
    arrays = (swarm.position, swarm.heading, swarm.wheel_speed, swarm.carried_object, world.objects.cell)
    return [array.tobytes() for array in (*arrays, world.events.counters)]


@pytest.mark.parametrize(("policy", "wrappers"), [("dpo", ()), ("crw", NOISY), ("stochm", NOISY)])
def test_looking_changes_nothing(policy, wrappers):
    watch = Watch(SMALL, policy, seed=3, size_px=240, wrappers=wrappers)
    watch.robot = 2
    for _ in range(150):
        watch.step()
        if watch.world.tick % 30 == 0:
            watch.scene()
    plain = load_policy(policy)
    run = LiveRun(build_env(watch.scenario, wrappers, reads=getattr(plain, "reads", None)), plain, 3)
    run.advance(to_tick=150)
    assert state_of(watch.world) == state_of(run.forage_env)
    assert watch.levels.changes == []


def test_marks_are_where_the_chosen_robot_remembers_things():
    watch = Watch(SMALL, "stochm", seed=3, size_px=400)
    watch.run.advance(to_tick=1500)
    policy, view = watch.policy, watch._view
    for robot in range(8):
        watch.robot = robot
        objects = [(x, y) for x, y, _ in policy.remembered(robot).values()]
        caches = [(x, y) for x, y, *_ in policy.remembered_caches(robot).values()]
        expected = view.pixels((np.array([*objects, *caches]).reshape(-1, 2) + 0.5) * 0.2)
        marks = np.array(watch.scene().marks).reshape(-1, 3)
        np.testing.assert_allclose(marks[:, :2], expected)
        assert (np.diff(marks[:, 2]) >= 0.0).all(), "caches are larger"
    assert policy.n_known.any()
    assert policy.n_caches.any()


def test_a_policy_that_does_not_tell_has_no_marks():
    watch = Watch(SMALL, "random", seed=3, size_px=240)
    watch.robot = 1
    assert watch.scene().marks == ()


def test_pause_one_tick_and_speed(watch, monkeypatch):
    monkeypatch.setattr(run_by_hand, "LONGEST_S", 1000.0)  # ticks take long while they are compiled
    watch.advance(0.2)
    assert watch.world.tick == 10
    press(watch, "space")
    watch.advance(1.0)
    assert watch.world.tick == 10
    press(watch, ".", "right")
    assert watch.world.tick == 12
    press(watch, "space", "up")
    assert (watch.paused, watch.speed) == (False, 20.0)
    press(watch, "down", "down")
    assert watch.speed == 5.0
    press(watch, *["up"] * 20)
    assert watch.speed == SPEEDS[-1]
    press(watch, *["down"] * 20)
    assert watch.speed == SPEEDS[0]


def test_a_slow_run_does_not_keep_the_window_waiting(watch, monkeypatch):
    monkeypatch.setattr(run_by_hand, "LONGEST_S", -1.0)
    watch.advance(0.2)
    assert watch.world.tick == 1
    watch.advance(0.02)
    assert watch.world.tick == 2, "what could not be done is not owed"


def test_a_run_that_is_over_stays_as_it_is():
    watch = Watch(scenario("warehouse_small", n_robots=3, horizon_s=200.0), "random", size_px=240)
    for _ in range(1100):
        watch.step()
    assert (watch.world.tick, watch.run.over) == (1000, True)
    assert any("over" in line for line in watch.scene().lines)


def test_choosing_robots(watch):
    press(watch, "tab")
    assert watch.robot == 0
    press(watch, "tab", shift=True)
    assert watch.robot == 7
    press(watch, "tab")
    assert watch.robot == 0
    click(watch, 5)
    assert watch.robot == 5
    press(watch, "escape")
    assert watch.robot is None
    press(watch, "tab", shift=True)
    assert watch.robot == 7
    watch.handle(Clicked(0, 0))
    assert watch.robot is None


def test_the_scene_tells_of_the_chosen_robot(watch):
    bare = watch.scene()
    assert bare.close_up is None
    assert bare.ring is None
    click(watch, 4)
    watch.step()
    scene = watch.scene()
    text = "\n".join(scene.lines)
    assert scene.close_up.shape == (300, 300, 3)
    assert "robot 4 at" in text
    assert watch.policy.describe_robot(4) in text
    assert "remembers: 0, in thin frames" in text
    assert scene.help == HELP


def test_a_light_scene_is_light_all_over(watch):
    bright, dark = Watch(SMALL, "dpo", seed=3, size_px=400, theme="light"), watch
    for one in (bright, dark):
        press(one, "tab")
    light, scene, other = THEMES["light"], bright.scene(), dark.scene()
    assert tuple(scene.frame[0, 0]) == light.page
    assert (scene.close_up == light.floor).all(axis=2).any()
    assert scene.palette == light
    assert other.palette == THEMES["dark"]
    assert not (other.close_up == light.floor).all(axis=2).any()


def test_tasks_are_told_where_there_are_some():
    watch = Watch(SMALL, "stochm", size_px=240)
    press(watch, "tab")
    watch.step()
    assert any(line.startswith("task: ") for line in watch.scene().lines)
    silent = Watch(SMALL, "random", size_px=240)
    press(silent, "tab")
    assert "random does not tell what its robots are doing" in silent.scene().lines


def test_what_a_trained_policy_remembers_is_told():
    watch = Watch(SMALL, "generalist", size_px=240)
    press(watch, "tab")
    watch.step()
    assert "remembers: 0, in thin frames" in watch.scene().lines


def test_the_close_up_gets_closer_and_wider(watch):
    press(watch, "tab")
    middle = watch.scene().close_up
    press(watch, "+")
    closer = watch.scene().close_up
    press(watch, "-", "-")
    wider = watch.scene().close_up
    assert (closer != middle).any()
    assert (wider != middle).any()
    press(watch, "=")
    np.testing.assert_array_equal(watch.scene().close_up, middle)


@pytest.mark.parametrize("key", LEVELS)
def test_levels_go_up_and_down_and_are_named(watch, key):
    start, name = watch.levels.level(key), LEVELS[key].name
    press(watch, key, shift=True)
    assert "lowest level" in watch.note
    assert "changed by hand" not in watch.title()
    press(watch, key, key)
    assert watch.levels.level(key) == pytest.approx(start + 2 * LEVELS[key].step)
    press(watch, key, shift=True)
    level = watch.levels.level(key)
    assert watch.title().endswith(f"changed by hand: {name} {level:g}")
    assert watch.summary().endswith(f"changed by hand: {name} {level:g}")
    assert watch.note in watch.scene().lines


@pytest.mark.parametrize("key", ["t", "s", "w"])
def test_a_level_that_was_raised_changes_the_run(key):
    runs = [Watch(SMALL, "crw", seed=3, size_px=240) for _ in range(2)]
    for watch in runs:
        watch.step()
    press(runs[0], *[key] * 4)
    for watch in runs:
        for _ in range(80):
            watch.step()
    assert state_of(runs[0].world) != state_of(runs[1].world)


def test_a_raised_throttle_slows_robots_down(watch):
    press(watch, *["t"] * 100)
    assert watch.levels.level("t") == 1.0
    assert watch.note == "throttle is 1, the highest level"
    watch.step()
    straight = np.isclose(*watch.world.swarm.wheel_speed.T)
    assert not watch.world.swarm.wheel_speed[straight].any()


def test_raised_noise_is_in_what_the_close_up_shows(watch):
    press(watch, "tab")
    watch.step()
    proximity = watch.world.layout["proximity"]
    assert not watch.world.arena.obs[0, proximity].any()
    press(watch, *["s"] * 5)
    watch.step()
    assert watch.world.arena.obs[0, proximity].any()


def test_raised_handling_ticks_take_time(watch):
    press(watch, "h")
    assert watch.levels.level("h") == 11.0
    press(watch, *["h"] * 2, shift=True)
    assert watch.levels.level("h") == 1.0


def test_a_level_by_a_table_stays_as_it_is():
    table = ThrottleConfig(waveform=Waveform(kind="table", times_s=(0.0, 9.0), values=(0.1, 0.2)))
    levels = Levels(build_env(SMALL, with_idle((table,))))
    assert "no amplitude" in levels.change("t", up=True)
    assert levels.changes == []


def test_a_click_with_shift_kills(watch):
    watch.step()
    click(watch, 6, shift=True)
    assert not watch.world.swarm.present[6]
    assert "robot 6 killed" in watch.title()
    watch.robot = 6
    assert "robot 6: not in the arena" in watch.scene().lines
    assert watch.levels.kill(6) == "robot 6 is not alive"
    press(watch, "tab")
    assert watch.robot == 7
    watch.handle(Clicked(0, 0, shift=True))
    assert watch.world.swarm.present.sum() == 7


def test_a_swarm_that_is_dead_ends_the_run(watch):
    for robot in range(8):
        watch.levels.kill(robot)
    watch.step()
    assert watch.run.over
    watch.robot = None
    press(watch, "tab")
    assert watch.robot is None


@pytest.mark.parametrize("event", [Closed(), Pressed("q")])
def test_closing_is_noted(watch, event):
    watch.handle(Pressed("x"))
    assert not watch.is_closed
    watch.handle(event)
    assert watch.is_closed


def test_the_window_lasts_until_the_window_is_closed(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    show, shown = Window.show, []

    def note(window, scene):
        show(window, scene)
        shown.append(scene)
        if len(shown) == 2:
            pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_TAB, mod=0))
        if len(shown) == 4:
            pygame.event.post(pygame.event.Event(pygame.QUIT))

    monkeypatch.setattr(Window, "show", note)
    watched = Watch(SMALL, "crw", seed=1, speed=50.0, size_px=240)
    watched.show()
    assert len(shown) == 4
    assert [scene.close_up is None for scene in shown] == [True, True, False, False]
    assert watched.world.tick > 0
    assert not pygame.display.get_init()


@pytest.mark.parametrize(("name", "value"), [("size_px", 10), ("speed", 0.0), ("theme", "pink")])
def test_impossible_values_are_refused(name, value):
    with pytest.raises(RenderError, match=name):
        Watch(SMALL, "crw", **{name: value})
