"""The command `watch`."""

import sys

import pytest

from swarm_forage_env.rendering.window import Window

WORDS = ("--robots", "3", "--size", "240")


def test_watch_ends_when_the_window_is_closed(command, monkeypatch):
    pygame = pytest.importorskip("pygame")
    pytest.importorskip("PIL")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    show = Window.show

    def close_it(window, scene):
        show(window, scene)
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_t, mod=0))
        pygame.event.post(pygame.event.Event(pygame.QUIT))

    monkeypatch.setattr(Window, "show", close_it)
    code, out, err = command("watch", "random", *WORDS, "--wrapper", "sensor_noise:sigma=0.03", "--theme", "light")
    assert (code, err) == (0, "")
    assert out.endswith("0 delivered; changed by hand: throttle 0.05\n")


def test_watch_complains_in_one_line(command, monkeypatch):
    code, _, err = command("watch", "nobody", *WORDS)
    assert (code, err.count("\n")) == (2, 1)
    assert "nobody" in err
    code, _, err = command("watch", "random", *WORDS, "--theme", "pink")
    assert (code, err.count("\n")) == (2, 1)
    assert "theme" in err
    monkeypatch.setitem(sys.modules, "pygame", None)
    code, _, err = command("watch", "random", *WORDS)
    assert (code, err.count("\n")) == (1, 1)
    assert 'pip install ".[render]"' in err
