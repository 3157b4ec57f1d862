"""A window on the screen that shows pictures of a run, for `render_mode="human"`. pygame draws it.

A process has one window.
"""

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.wording import install_command


class Window:
    """Shows pictures. It opens with the first one; what the user has closed stays closed (`was_closed`)."""

    def __init__(self) -> None:
        """Prepare; raises ImportError if pygame is not installed."""
        _pygame()
        self.was_closed = False

    def show(self, picture: NDArray[np.uint8], title: str) -> None:
        """Show a picture (H, W, 3); once the user has closed the window, nothing more.

        Raises:
            ConfigError: there is no display.
        """
        pygame = _pygame()
        if pygame.display.get_init() and any(event.type == pygame.QUIT for event in pygame.event.get()):
            self.close()
            self.was_closed = True
        if self.was_closed:
            return
        height, width = picture.shape[:2]
        try:
            pygame.display.init()
            surface = pygame.display.get_surface()
            if surface is None or surface.get_size() != (width, height):
                surface = pygame.display.set_mode((width, height))
        except pygame.error as error:
            raise ConfigError(f"Expected a display to open a window on, got {error}; {_ELSE}.") from error
        if pygame.display.get_driver() == "offscreen" and "SDL_VIDEODRIVER" not in os.environ:
            self.close()
            raise ConfigError(f"Expected a display to open a window on, got one that nobody can see; {_ELSE}.")
        pygame.display.set_caption(title)
        surface.blit(pygame.image.frombuffer(np.ascontiguousarray(picture), (width, height), "RGB"), (0, 0))
        pygame.display.flip()

    def close(self) -> None:
        """Close the window, if it is open; `show` opens it again."""
        _pygame().display.quit()


_ELSE = "without one, film the run (`swarm-forage record`) or use render_mode='rgb_array'"


def _pygame() -> Any:
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # else pygame greets on standard output
    try:
        import pygame
    except ImportError as error:
        raise ImportError(
            f"A window needs pygame-ce, which is not installed; run {install_command('render')}."
        ) from error
    return pygame
