"""A window on the screen that shows pictures of a run, for `render_mode="human"`. pygame draws it.

A process has one window at a time.
"""

import os
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env._internal.wording import install_command
from swarm_forage_env.rendering.view import RenderError


class Window:
    """Shows pictures. It opens with the first one; copies and pickles of a window are closed windows."""

    def __init__(self) -> None:
        """Prepare; raises ImportError if pygame is not installed."""
        self._pygame = _load_pygame()
        self._surface: Any = None
        self.was_closed = False
        """Whether the user has closed it. Then `show` does nothing."""

    def __reduce__(self) -> "tuple[type[Window], tuple[()]]":
        return Window, ()

    def show(self, picture: NDArray[np.uint8], title: str) -> None:
        """Show a picture (H, W, 3); once the user has closed the window, nothing more.

        Raises:
            RenderError: there is no display.
        """
        pygame = self._pygame
        if self._surface is not None and any(event.type == pygame.QUIT for event in pygame.event.get()):
            self.close()
            self.was_closed = True
        if self.was_closed:
            return
        height, width = picture.shape[:2]
        self._open((width, height))
        pygame.display.set_caption(title)
        shown = pygame.image.frombuffer(np.ascontiguousarray(picture), (width, height), "RGB")
        surface: Any = self._surface  # opened above
        surface.blit(shown, (0, 0))
        pygame.display.flip()

    def close(self) -> None:
        """Close the window, if it is open; `show` opens it again."""
        if self._surface is not None:
            self._surface = None
            self._pygame.display.quit()

    def _open(self, size: tuple[int, int]) -> None:
        pygame = self._pygame
        if self._surface is not None and self._surface.get_size() == size and pygame.display.get_init():
            return
        try:
            pygame.display.init()
            self._surface = pygame.display.set_mode(size)
        except pygame.error as error:
            raise _no_display(str(error)) from error
        if pygame.display.get_driver() == "offscreen" and "SDL_VIDEODRIVER" not in os.environ:
            self.close()
            raise _no_display("one that nobody can see")


def _no_display(what_came: str) -> RenderError:
    return RenderError(
        f"Expected a display to open a window on, got {what_came}; without one, film the run (`swarm-forage record`) "
        "or use render_mode='rgb_array'."
    )


def _load_pygame() -> ModuleType:
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # else pygame greets on standard output
    try:
        import pygame
    except ImportError as error:
        raise ImportError(
            f"A window needs pygame-ce, which is not installed; run {install_command('render')}."
        ) from error
    return pygame
