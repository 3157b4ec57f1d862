"""Writing films: GIF with Pillow, MP4 with imageio and ffmpeg."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env._internal.fields import ConfigError, number
from swarm_forage_env._internal.files import replacing
from swarm_forage_env._internal.wording import install_command

Frame = NDArray[np.uint8]
MAX_FPS = {".gif": 50, ".mp4": 60}
"""Ending of a film -> its highest rate. GIF counts in hundredths of a second, and viewers slow down films with less
than two per frame."""
MAX_GIF_FRAMES = 1500
"""A GIF is built in memory, 1 byte per pixel and frame."""


def check_film(path: Path, fps: float, n_frames: int) -> None:
    """Refuse a film that cannot be written, before its run.

    Raises:
        ConfigError: unknown suffix, impossible rate, or a GIF of too many frames.
        ImportError: the library that writes this kind of film is not installed.
    """
    suffix = path.suffix.lower()
    if suffix not in MAX_FPS:
        hint = "; one picture is made by --at SECONDS, at_s in Python" if suffix == ".png" else ""
        raise ConfigError(f"Expected a film's path to end in {' or '.join(MAX_FPS)}, got {str(path)!r}{hint}.")
    number(f"fps of a {suffix}", fps, at_least=1, at_most=MAX_FPS[suffix])
    if suffix == ".mp4":
        _imageio()
    elif n_frames > MAX_GIF_FRAMES:
        raise ConfigError(
            f"Expected at most {MAX_GIF_FRAMES} frames for a GIF, got {n_frames}; "
            "film a shorter time, raise speedup, lower fps, or write an .mp4."
        )


def write_film(frames: Iterable[Frame], path: Path, *, fps: float) -> None:
    """Write pictures as a film, whole or not at all; the suffix of `path`, as in `check_film`, chooses the format.

    GIFs use the colours of the first picture, without dithering, and store only what changed from frame to frame, so
    they stay small. Identical consecutive pictures become one longer frame. GIF rates are rounded to whole
    hundredths of a second per frame.

    Args:
        frames: (H, W, 3) uint8 pictures of equal size, consumed one at a time.
        path: Ends in .gif or .mp4; a missing folder is made.
        fps: Pictures per second.
    """
    suffix = path.suffix.lower()
    with replacing(path, ending=suffix) as draft:
        if suffix == ".gif":
            _write_gif(frames, draft, fps)
        else:
            _write_mp4(frames, draft, fps)


def _write_gif(frames: Iterable[Frame], path: Path, fps: float) -> None:
    from PIL import Image

    frames = iter(frames)
    first = Image.fromarray(next(frames))
    # The legend has all colours from the start; one index means "unchanged".
    palette = first.quantize(255, method=Image.Quantize.MAXCOVERAGE)
    pictures = (Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    palette.save(
        path,
        save_all=True,
        append_images=pictures,
        duration=10 * round(100 / fps),
        loop=0,
        optimize=True,
        disposal=1,
    )


def _write_mp4(frames: Iterable[Frame], path: Path, fps: float) -> None:
    # The usual pixel format halves the resolution of colour, so sides must be even; imageio's default macro block
    # would instead rescale the picture to multiples of 16.
    with _imageio().get_writer(
        path, format="FFMPEG", fps=fps, codec="libx264", quality=8, macro_block_size=1
    ) as writer:
        for frame in frames:
            odd_rows, odd_columns = frame.shape[0] % 2, frame.shape[1] % 2
            writer.append_data(np.pad(frame, ((0, odd_rows), (0, odd_columns), (0, 0)), mode="edge"))


def _imageio() -> Any:
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
