"""The window, on a display that nobody sees."""

import copy
import sys

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.rendering.window import Window

pygame = pytest.importorskip("pygame")

FRAME = np.full((120, 200, 3), (10, 200, 30), np.uint8)


@pytest.fixture
def window(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    window = Window()
    yield window
    window.close()


def test_a_picture_fills_the_window(window):
    for picture in (FRAME, FRAME[:60]):
        copy.deepcopy(window).show(picture, "a run")
        shown = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
        np.testing.assert_array_equal(shown, picture)
    assert pygame.display.get_caption()[0] == "a run"


def test_a_closed_window_opens_again_and_one_that_the_user_has_closed_does_not(window):
    window.show(FRAME, "")
    window.close()
    assert not pygame.display.get_init()
    window.show(FRAME, "")
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    for _ in range(2):
        window.show(FRAME, "")
        assert window.was_closed
        assert not pygame.display.get_init()


def test_without_a_display_or_pygame_the_message_says_what_to_do(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "there is no such driver")
    with pytest.raises(ConfigError, match="swarm-forage record"):
        Window().show(FRAME, "")
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(ImportError, match=r'pygame-ce.*pip install ".\[render\]"'):
        Window()
