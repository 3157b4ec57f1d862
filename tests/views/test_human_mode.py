"""render_mode="human": steps are shown in a window, and nothing else changes."""

import sys

import numpy as np
import pytest

import swarm_forage_env  # noqa: F401 - registers the environment ids
from swarm_forage_env.views.pettingzoo import parallel_env

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
    for _ in range(60):
        obs, rewards, *_ = env.step_batch(rng.uniform(-1.0, 1.0, (5, 3)).astype(np.float32))
        seen += [obs.copy(), rewards.copy()]
    env.close()
    return [array.tobytes() for array in seen]


@pytest.mark.parametrize("options", [{}, {"wrappers": ("sensor_noise:sigma=0.02",)}, {"physics": "compiled"}])
def test_a_window_changes_no_result(display, options):
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


def test_without_pygame_the_message_tells_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(ImportError, match=r'pip install ".\[render\]"'):
        parallel_env(**SMALL, render_mode="human")
