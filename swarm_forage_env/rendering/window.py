"""A window on the screen: it shows scenes and says which keys and clicks came in. pygame draws it.

A process has one window at a time. Nothing here knows a run; `inspect.watch` decides what is shown and what a key does.
"""

import io
import os
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env._internal.wording import install_command
from swarm_forage_env.rendering.view import PALETTE, Palette, RenderError, text_font

PANEL_PX = 320
"""Width of the panel on the right, with its margins."""
CLOSE_UP_PX = 300
"""Side of the close-up in the panel."""
_MARGIN_PX = 10
_LINE_PX = 18
_TEXT_PX = 14
_LOWEST_PX = 600
"""Height that the panel's text needs."""


@dataclass(frozen=True, slots=True)
class Pressed:
    """A key went down."""

    key: str
    """pygame's name of the key: "space", "up", "t"."""
    shift: bool = False


@dataclass(frozen=True, slots=True)
class Clicked:
    """The left button of the mouse went down."""

    x: int
    y: int
    """Pixels from the upper left corner of the scene's frame."""
    shift: bool = False


@dataclass(frozen=True, slots=True)
class Closed:
    """The window was asked to close."""


WindowEvent = Pressed | Clicked | Closed


@dataclass(frozen=True, kw_only=True, slots=True)
class Scene:
    """What a window shows; the frame alone, or the frame with a panel beside and help below."""

    frame: NDArray[np.uint8]
    """(H, W, 3) picture of the arena."""
    title: str
    """Text of the window's title bar."""
    ring: tuple[float, float, float] | None = None
    """Column, row and radius, in pixels of the frame, of a ring around what is chosen."""
    marks: tuple[tuple[float, float, float], ...] = ()
    """Columns, rows and sides, in pixels of the frame, of squares around what the chosen one remembers."""
    close_up: NDArray[np.uint8] | None = None
    """(`CLOSE_UP_PX`, `CLOSE_UP_PX`, 3) picture on top of the panel."""
    lines: tuple[str, ...] = ()
    """Text of the panel; a scene without lines and help has no panel."""
    help: str = ""
    """Text below the frame; it is broken into lines where there are three spaces."""
    palette: Palette = PALETTE
    """Colours of all that is around the pictures."""


class Window:
    """Shows scenes. It opens with the first one; copies and pickles of a window are closed windows."""

    def __init__(self) -> None:
        """Prepare; raises ImportError if pygame is not installed."""
        self._pygame = _load_pygame()
        self._surface: Any = None
        self._font: Any = None
        self.was_closed = False
        """Whether the user has closed it. Then `show` does nothing."""

    def __reduce__(self) -> "tuple[type[Window], tuple[()]]":
        return Window, ()

    def show(self, scene: Scene) -> None:
        """Draw a scene, in a window of the size that it needs.

        Raises:
            RenderError: there is no display.
        """
        if self.was_closed:
            return
        pygame = self._pygame
        height, width = scene.frame.shape[:2]
        has_panel = bool(scene.lines or scene.help)
        if has_panel:
            self._open_font()
            width += PANEL_PX
            height = max(height, _LOWEST_PX)
        help_lines = self._wrapped(scene.help, width - 2 * _MARGIN_PX) if has_panel else []
        size = (width, height + _LINE_PX * len(help_lines) + (_MARGIN_PX if help_lines else 0))
        self._open(size)
        pygame.display.set_caption(scene.title)
        surface = self._surface
        surface.fill(scene.palette.page)
        _put(pygame, surface, scene.frame, (0, 0))
        for column, row, side in scene.marks:
            square = (round(column - side / 2), round(row - side / 2), round(side), round(side))
            pygame.draw.rect(surface, scene.palette.text, square, width=1)
        if scene.ring is not None:
            column, row, radius = scene.ring
            pygame.draw.circle(surface, scene.palette.text, (column, row), radius, width=2)
        if has_panel:
            self._fill_panel(scene)
        for number, line in enumerate(help_lines):
            self._put_text(line, (_MARGIN_PX, height + _LINE_PX * number), scene.palette.faint_text)
        pygame.display.flip()

    def show_picture(self, picture: NDArray[np.uint8], title: str) -> None:
        """Show a picture of a run that does not ask for keys; once the user has closed the window, nothing more."""
        if self.was_closed:
            return
        if any(isinstance(event, Closed) for event in self.events()):
            self.end()
        self.show(Scene(frame=picture, title=title))

    def events(self) -> list[WindowEvent]:
        """Return what came in since the last call, oldest first; [] while there is no window."""
        if self._surface is None:
            return []
        pygame = self._pygame
        found: list[WindowEvent] = []
        for event in pygame.event.get():
            shift = bool(getattr(event, "mod", pygame.key.get_mods()) & pygame.KMOD_SHIFT)
            if event.type == pygame.QUIT:
                found.append(Closed())
            elif event.type == pygame.KEYDOWN:
                found.append(Pressed(pygame.key.name(event.key), shift))
            elif event.type == pygame.MOUSEBUTTONDOWN and event.button == 1:
                x, y = event.pos
                found.append(Clicked(x, y, shift))
        return found

    def wait(self, per_second: float) -> float:
        """Sleep so that there are at most so many calls per second; returns the seconds since the last call."""
        return self._clock.tick(per_second) / 1000.0

    def close(self) -> None:
        """Close the window, if it is open; `show` opens it again."""
        if self._surface is not None:
            self._surface = None
            self._pygame.display.quit()

    def end(self) -> None:
        """Close the window for good: the user wants to see no more."""
        self.close()
        self.was_closed = True

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
        self._clock = pygame.time.Clock()

    def _open_font(self) -> None:
        if self._font is None:
            self._pygame.font.init()
            # The letters of the pictures; pygame's own are hard to read at this size.
            self._font = self._pygame.font.Font(io.BytesIO(text_font(_TEXT_PX).font_bytes), _TEXT_PX)

    def _fill_panel(self, scene: Scene) -> None:
        left, top = scene.frame.shape[1] + _MARGIN_PX, _MARGIN_PX
        if scene.close_up is not None:
            _put(self._pygame, self._surface, scene.close_up, (left, top))
            top += scene.close_up.shape[0] + _MARGIN_PX
        for text in scene.lines:
            for line in self._wrapped(text, PANEL_PX - 2 * _MARGIN_PX, between=" ") or [""]:
                self._put_text(line, (left, top), scene.palette.text)
                top += _LINE_PX

    def _put_text(self, text: str, place: tuple[int, int], colour: tuple[int, int, int]) -> None:
        self._surface.blit(self._font.render(text, True, colour), place)

    def _wrapped(self, text: str, width: int, between: str = "   ") -> list[str]:
        """Break a text between its parts into lines of at most `width` pixels, if every part fits."""
        lines: list[str] = []
        for part in filter(None, text.split(between)):
            longer = f"{lines[-1]}{between}{part}" if lines else part
            if lines and self._font.size(longer)[0] <= width:
                lines[-1] = longer
            else:
                lines.append(part)
        return lines


def _put(pygame: Any, surface: Any, picture: NDArray[np.uint8], place: tuple[int, int]) -> None:
    height, width = picture.shape[:2]
    surface.blit(pygame.image.frombuffer(np.ascontiguousarray(picture), (width, height), "RGB"), place)


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
