"""The window, on a display that nobody sees."""

import copy
import pickle
import sys

import numpy as np
import pytest

from swarm_forage_env.rendering.view import PALETTE, THEMES, RenderError
from swarm_forage_env.rendering.window import PANEL_PX, Clicked, Closed, Pressed, Scene, Window

pygame = pytest.importorskip("pygame")
pytest.importorskip("PIL")

FRAME = np.full((120, 200, 3), (10, 200, 30), np.uint8)


@pytest.fixture
def window(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    window = Window()
    yield window
    window.close()


def shown() -> np.ndarray:
    """What is on the screen, (H, W, 3)."""
    return pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)


def post(kind, **values):
    pygame.event.post(pygame.event.Event(kind, **values))


def test_a_frame_alone_fills_the_window(window):
    window.show(Scene(frame=FRAME, title="a run"))
    np.testing.assert_array_equal(shown(), FRAME)
    assert pygame.display.get_caption()[0] == "a run"


def test_a_scene_with_text_has_a_panel_and_help_below(window):
    window.show(Scene(frame=FRAME, title="", lines=("tick 5",), help="q: quit"))
    picture = shown()
    assert picture.shape[1] == FRAME.shape[1] + PANEL_PX
    np.testing.assert_array_equal(picture[:120, :200], FRAME)
    page = np.array(PALETTE.page)
    assert (picture[:100, 200:] != page).any(), "the line of the panel"
    assert (picture[-40:, :200] != page).any(), "the help"
    assert (picture[130:-40, :200] == page).all()


def test_around_the_frame_are_the_colours_of_the_scene(window):
    light = THEMES["light"]
    window.show(Scene(frame=FRAME, title="", lines=("tick 5",), help="q: quit", palette=light))
    picture = shown()
    assert (picture[130:-40, :200] == light.page).all()
    assert (picture[:100, 200:] == light.text).all(axis=2).any(), "the line of the panel"
    assert (picture[-40:] == light.faint_text).all(axis=2).any(), "the help"


def test_a_long_text_is_broken_where_it_may_be(window):
    short = Scene(frame=FRAME, title="", lines=("x",), help="a: one")
    long = Scene(frame=FRAME, title="", lines=("x",), help="   ".join(f"{key}: a word" for key in "abcdefghijklmnop"))
    window.show(short)
    one_line = shown().shape[0]
    window.show(long)
    assert shown().shape[0] > one_line


def test_the_ring_is_drawn_over_the_frame(window):
    window.show(Scene(frame=FRAME, title="", ring=(100.0, 60.0, 20.0)))
    assert tuple(shown()[60, 81]) == PALETTE.text
    assert tuple(shown()[60, 100]) == tuple(FRAME[0, 0])


def test_squares_are_drawn_around_what_is_marked(window):
    window.show(Scene(frame=FRAME, title="", marks=((100.0, 60.0, 20.0), (30.0, 30.0, 6.0))))
    picture = shown()
    for row, column in ((60, 90), (50, 100), (30, 27)):
        assert tuple(picture[row, column]) == PALETTE.text
    assert tuple(picture[60, 100]) == tuple(FRAME[0, 0])


def test_the_close_up_is_in_the_panel(window):
    close_up = np.full((300, 300, 3), (9, 8, 7), np.uint8)
    window.show(Scene(frame=FRAME, title="", close_up=close_up, lines=("x",)))
    np.testing.assert_array_equal(shown()[10:310, 210:510], close_up)


def test_events_come_in_order(window):
    assert window.events() == []
    window.show(Scene(frame=FRAME, title=""))
    window.events()
    post(pygame.KEYDOWN, key=pygame.K_SPACE, mod=0)
    post(pygame.KEYDOWN, key=pygame.K_t, mod=pygame.KMOD_LSHIFT)
    post(pygame.MOUSEBUTTONDOWN, button=1, pos=(30, 40))
    post(pygame.MOUSEBUTTONDOWN, button=3, pos=(1, 1))
    post(pygame.QUIT)
    assert window.events() == [Pressed("space"), Pressed("t", shift=True), Clicked(30, 40), Closed()]


def test_a_closed_window_opens_again_and_an_ended_one_does_not(window):
    window.show(Scene(frame=FRAME, title=""))
    window.close()
    assert not pygame.display.get_init()
    window.show(Scene(frame=FRAME, title=""))
    assert pygame.display.get_init()
    post(pygame.QUIT)
    window.show_picture(FRAME, title="")
    assert window.was_closed
    assert not pygame.display.get_init()
    window.show_picture(FRAME, title="")
    window.show(Scene(frame=FRAME, title=""))
    assert not pygame.display.get_init()


def test_copies_are_closed_windows(window):
    window.show(Scene(frame=FRAME, title=""))
    for twin in (copy.deepcopy(window), pickle.loads(pickle.dumps(window))):  # noqa: S301 - our own bytes
        assert twin.events() == []
    assert pygame.display.get_init()


def test_without_a_display_the_message_says_what_else_there_is(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "there is no such driver")
    with pytest.raises(RenderError, match="swarm-forage record"):
        Window().show(Scene(frame=FRAME, title=""))


def test_a_display_that_nobody_can_see_is_none_unless_it_was_asked_for(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    window = Window()
    monkeypatch.setattr(pygame.display, "get_driver", lambda: "offscreen")
    window.show(Scene(frame=FRAME, title=""))
    window.close()
    set_mode = pygame.display.set_mode

    def without_the_variable(size):
        surface = set_mode(size)
        monkeypatch.delenv("SDL_VIDEODRIVER")
        return surface

    monkeypatch.setattr(pygame.display, "set_mode", without_the_variable)
    with pytest.raises(RenderError, match="nobody can see"):
        window.show(Scene(frame=FRAME, title=""))
    assert not pygame.display.get_init()


def test_without_pygame_the_message_tells_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(ImportError, match=r'pygame-ce.*pip install ".\[render\]"'):
        Window()
