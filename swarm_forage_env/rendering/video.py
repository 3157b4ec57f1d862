"""Writing pictures: one as PNG, many as a film. GIF and PNG with Pillow, MP4 with imageio and ffmpeg."""

from collections.abc import Iterable, Iterator
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env._internal.fields import number
from swarm_forage_env._internal.files import replacing
from swarm_forage_env._internal.wording import install_command
from swarm_forage_env.rendering.view import (
    CACHE_OPACITY,
    NEST_OPACITY,
    SOURCE_OPACITY,
    THEMES,
    Palette,
    RenderError,
    refusing,
)

if TYPE_CHECKING:
    from PIL import Image

Frame = NDArray[np.uint8]
SUFFIXES = (".gif", ".mp4")
PICTURE_SUFFIX = ".png"
MAX_FPS = {".gif": 50, ".mp4": 60}
"""Highest rates. GIF counts in hundredths of a second, and viewers slow down films with less than two per frame."""
MAX_GIF_FRAMES = 1500
"""A GIF is built in memory, 1 byte per pixel and frame."""


def check_film(path: str | Path, fps: float, n_frames: int) -> Path:
    """Return `path` if a film can be written there.

    Raises:
        RenderError: unknown suffix, a file in place of the folder, impossible rate, or a GIF of too many frames.
        ImportError: the library that writes this kind of film is not installed.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        hint = "; one picture is made by --at SECONDS, at_s in Python" if suffix == PICTURE_SUFFIX else ""
        raise RenderError(f"Expected a film's path to end in {' or '.join(SUFFIXES)}, got {str(path)!r}{hint}.")
    _check_place(path)
    with refusing():
        number(f"fps of a {suffix}", fps, at_least=1, at_most=MAX_FPS[suffix])
    if suffix == ".gif" and n_frames > MAX_GIF_FRAMES:
        raise RenderError(
            f"Expected at most {MAX_GIF_FRAMES} frames for a GIF, got {n_frames}; "
            "film a shorter time, raise speedup, lower fps, or write an .mp4."
        )
    if suffix == ".mp4":
        _import_imageio()
    return path


def check_picture(path: str | Path) -> Path:
    """Return `path` if a picture can be written there.

    Raises:
        RenderError: another suffix than .png, or a file in place of the folder.
    """
    path = Path(path)
    if path.suffix.lower() != PICTURE_SUFFIX:
        raise RenderError(
            f"Expected a picture's path to end in {PICTURE_SUFFIX}, got {str(path)!r}; for a film, leave --at out."
        )
    _check_place(path)
    return path


def _check_place(path: Path) -> None:
    existing = next(folder for folder in path.absolute().parents if folder.exists())
    if not existing.is_dir():
        raise RenderError(f"Expected {str(path.parent)!r} to be a folder, but {str(existing)!r} is a file.")


def write_picture(frame: Frame, path: Path) -> Path:
    """Write one picture, (H, W, 3) uint8, as PNG, whole or not at all; returns the path."""
    from PIL import Image

    with replacing(path, ending=PICTURE_SUFFIX) as draft:
        Image.fromarray(frame).save(draft)
    return path


def write_film(frames: Iterable[Frame], path: str | Path, *, fps: float, n_frames: int, theme: str = "dark") -> Path:
    """Write pictures as a film; the suffix of `path` chooses the format.

    A missing folder is made. The file appears under its name only when it is complete. GIFs use one palette made for
    this package's pictures, without dithering, and store only what changed from frame to frame, so they stay small.
    Identical consecutive pictures become one longer frame of a GIF. GIF rates are rounded to whole hundredths of a
    second per frame.

    Args:
        frames: (H, W, 3) uint8 pictures of equal size, consumed one at a time.
        path: Ends in .gif or .mp4.
        fps: Pictures per second.
        n_frames: How many pictures will come at most.
        theme: That of the pictures, whose colours a GIF keeps.

    Returns:
        The path written.

    Raises:
        RenderError: what `check_film` refuses.
        ImportError: the library that writes this kind of film is not installed.
    """
    path = check_film(path, fps, n_frames)
    path.parent.mkdir(parents=True, exist_ok=True)
    suffix = path.suffix.lower()
    with replacing(path, ending=suffix) as draft:
        if suffix == ".gif":
            _write_gif(frames, draft, fps, THEMES[theme])
        else:
            _write_mp4(frames, draft, fps)
    return path


def _write_gif(frames: Iterable[Frame], path: Path, fps: float, colours: Palette) -> None:
    from PIL import Image

    palette = _gif_palette(colours)

    def indexed() -> Iterator["Image.Image"]:
        for frame in frames:
            yield Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)

    pictures = indexed()
    first = next(pictures)
    delay_ms = 10 * round(100 / fps)
    first.save(path, save_all=True, append_images=pictures, duration=delay_ms, loop=0, optimize=True, disposal=1)


def _gif_palette(colour: Palette) -> "Image.Image":
    """Colours of our pictures: grounds, things on them, and mixtures that antialiasing and fading produce.

    There are fewer than 256, since one index means "unchanged".
    """
    from PIL import Image

    nest, cache, source = (
        _mix(colour.floor, tint, share)
        for tint, share in ((colour.nest, NEST_OPACITY), (colour.cache, CACHE_OPACITY), (colour.source, SOURCE_OPACITY))
    )
    grounds = (colour.floor, nest, cache, source, colour.page, colour.wall)
    things = (
        colour.empty,
        colour.carrying,
        colour.interference,
        colour.repair,
        colour.object,
        colour.light,
        colour.nest,
        colour.cache,
        colour.text,
    )
    steps = (0.25, 0.5, 0.75)
    mixed = [_mix(ground, thing, step) for ground, thing, step in product(grounds, things, steps)]
    fading = [_mix(colour.floor, thing, step) for thing, step in product(things[:2], (0.06, 0.12, 0.18, 0.37))]
    glow = [_mix(nest, colour.light, step) for step in (0.06, 0.12, 0.18, 0.31, 0.37, 0.43)]
    on_robots = [_mix(colour.carrying, colour.object, step) for step in steps]
    chosen = list(dict.fromkeys([*grounds, *things, *mixed, *fading, *glow, *on_robots]))[:255]
    picture = Image.new("P", (1, 1))
    picture.putpalette([channel for entry in chosen for channel in entry])
    return picture


def _mix(ground: tuple[int, int, int], thing: tuple[int, int, int], share: float) -> tuple[int, int, int]:
    red, green, blue = (round(a + (b - a) * share) for a, b in zip(ground, thing, strict=True))
    return (red, green, blue)


def _write_mp4(frames: Iterable[Frame], path: Path, fps: float) -> None:
    # The usual pixel format halves the resolution of colour, so sides must be even; imageio's default macro block
    # would instead rescale the picture to multiples of 16.
    with _import_imageio().get_writer(
        path, format="FFMPEG", fps=fps, codec="libx264", quality=8, macro_block_size=1
    ) as writer:
        for frame in frames:
            odd_rows, odd_columns = frame.shape[0] % 2, frame.shape[1] % 2
            writer.append_data(np.pad(frame, ((0, odd_rows), (0, odd_columns), (0, 0)), mode="edge"))


def _import_imageio() -> Any:
    """Return the module `imageio.v2`, checked to be able to write MP4."""
    try:
        import imageio.v2
        import imageio_ffmpeg  # noqa: F401  (imageio loads it by itself; without it the error is hard to understand)
    except ImportError as error:
        raise ImportError(
            "Writing .mp4 needs imageio and imageio-ffmpeg, which are not installed; "
            f"run {install_command('render')}, or write a .gif."
        ) from error
    return imageio.v2
