"""render_mode="human": steps are shown in a window, and nothing else changes."""

import copy
import sys

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.rendering.window import Window
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.views.gymnasium import JointForageEnv
from swarm_forage_env.views.pettingzoo import ParallelLearnerEnv, parallel_env
from tests.support.branches import pickled

SMALL = {"scenario": "warehouse_small", "n_robots": 5, "n_objects": 20}


@pytest.fixture
def display(monkeypatch):
    """A display that nobody sees."""
    pygame = pytest.importorskip("pygame")
    pytest.importorskip("PIL")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    yield pygame.display
    pygame.display.quit()


def observed(mode, **options):
    env = parallel_env(**SMALL, render_mode=mode, **options)
    rng = np.random.default_rng(1)
    seen = [env.reset_batch(seed=4).copy()]
    for _ in range(20):
        obs, rewards, *_ = env.step_batch(rng.uniform(-1.0, 1.0, (5, 3)).astype(np.float32))
        seen += [obs.copy(), rewards.copy()]
    env.close()
    return [array.tobytes() for array in seen]


def test_a_window_changes_no_result(display):
    options = {"wrappers": ("sensor_noise:sigma=0.02",)}
    assert observed("human", **options) == observed(None, **options)


def test_each_step_is_shown(display):
    env = parallel_env(**SMALL, render_mode="human")
    plain = parallel_env(**SMALL, render_mode="rgb_array")
    for world in (env, plain):
        world.reset(seed=1)
        world.step({agent: np.array([1.0, 0.5, 0.0], np.float32) for agent in world.agents})
    assert env.render() is None
    pixels = sys.modules["pygame"].surfarray.array3d(display.get_surface()).swapaxes(0, 1)
    np.testing.assert_array_equal(pixels, plain.render())
    env.close()
    assert not display.get_init()


def test_a_window_that_the_user_closes_stays_closed(display):
    pygame = sys.modules["pygame"]
    env = parallel_env(**SMALL, render_mode="human")
    env.reset(seed=1)
    assert display.get_init()
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    for _ in range(3):
        env.step({agent: np.zeros(3, np.float32) for agent in env.agents})
        assert not display.get_init()


def test_a_copied_window_takes_the_size_of_its_pictures(display):
    for size in ((120, 200, 3), (60, 200, 3)):
        copy.deepcopy(Window()).show(np.zeros(size, np.uint8), "a run")
        assert display.get_surface().get_size() == size[1::-1]


def test_without_a_display_or_pygame_the_message_says_what_to_do(monkeypatch):
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "there is no such driver")
    with pytest.raises(ConfigError, match="swarm-forage record"):
        Window().show(np.zeros((60, 60, 3), np.uint8), "")
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(ImportError, match=r'pygame-ce.*pip install ".\[render\]"'):
        Window()


NUMBERED = InterfaceConfig(observation="compact", actions="discrete", decision_ticks=3)
DEATHS = ("population:death_per_tick=0.05", "sensor_noise:sigma=0.05")


def parallel(**options) -> ParallelLearnerEnv:
    return parallel_env("warehouse_small", n_robots=6, n_objects=20, physics="compiled", wrappers=DEATHS,
                        **{"interface": NUMBERED, **options})  # fmt: skip


def joint(**options) -> JointForageEnv:
    return JointForageEnv(n_robots=6, n_objects=20, physics="compiled", wrappers=DEATHS,
                          **{"interface": NUMBERED, **options})  # fmt: skip


def decisions(target: ParallelLearnerEnv, n: int) -> list:
    """What agents see and earn who choose by their number and the tick."""
    seen = []
    for _ in range(n):
        tick = target.forage_env.tick
        observations, *rest = target.step({agent: (int(agent[-1]) + tick) % 11 for agent in target.agents})
        seen.append(({agent: row.tolist() for agent, row in observations.items()}, repr(rest)))
    return seen


def together(target: JointForageEnv, n: int) -> list:
    """The same, one agent for all."""
    seen = []
    for _ in range(n):
        obs, *rest = target.step((np.arange(6) + target.forage_env.tick) % 11)
        seen.append((obs.tolist(), repr(rest)))
    return seen


@pytest.mark.parametrize(("make", "go_on"), [(parallel, decisions), (joint, together)])
def test_a_copy_of_a_learners_environment_goes_on_as_the_original(make, go_on):
    learner = make()
    learner.reset(seed=3, options={"scenario": {"n_objects": 7}})
    go_on(learner, 20)
    twins = [copy.deepcopy(learner), pickled(learner)]
    for _ in range(2):
        expected = go_on(learner, 8)
        for twin in twins:
            assert go_on(twin, 8) == expected
        for one in (learner, *twins):
            one.reset()
    assert {one.forage_env.seed_value for one in twins} == {learner.forage_env.seed_value}


@pytest.mark.parametrize("make", [joint, parallel, lambda: ForageEnv(scenario("classroom", n_robots=2))])
def test_copies_before_the_first_reset_draw_worlds_of_their_own(make):
    original = make()
    twins = original, copy.deepcopy(original), pickled(original)
    for twin in twins:
        twin.reset()
    assert len({getattr(twin, "forage_env", twin).state().tobytes() for twin in twins}) == 3
