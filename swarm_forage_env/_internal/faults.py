"""Where an error began: in our code, or in a file of the user that our code calls."""

import sysconfig
import traceback
from pathlib import Path

PACKAGES = ("swarm_forage_env", "baselines", "metrics")
"""Our packages. They speak to users by subclasses of ValueError such as ConfigError, by warnings and loggers."""
INSTALLED = frozenset({"site-packages", "dist-packages"})
"""Names of the folders into which packages are installed."""
_ROOT = Path(__file__).resolve().parents[2]
"""Folder of our packages."""


def place_in_code_of_user(error: BaseException) -> str:
    """Return the line of a user's file in which an error began, as "FILE, line N"; empty where the last code was ours.

    Files of Python and of installed packages are neither: an error that numpy raises is that of whoever called numpy.
    So an installed package of the user is not seen here.
    """
    standard_library = Path(sysconfig.get_path("stdlib"))
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        file = Path(frame.filename)
        if any(file.is_relative_to(_ROOT / package) for package in PACKAGES):
            return ""
        if file.is_file() and not file.is_relative_to(standard_library) and INSTALLED.isdisjoint(file.parts):
            return f"{file}, line {frame.lineno}"
    return ""


def in_words(error: BaseException) -> str:
    """Return an error that code of the user may have raised in one line: its class, its message and its place."""
    place = place_in_code_of_user(error)
    message = " ".join(str(error).split()) or "no message"
    return f"{type(error).__name__}: {message}{f' ({place})' if place else ''}"
