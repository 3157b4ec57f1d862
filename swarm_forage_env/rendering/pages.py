"""The replay page and the page to play with, each one HTML file that loads nothing from elsewhere.

The replay page is made of a style sheet, scripts and data, and gives the data back. Its parts lie in `replay_page`.
Data are a header in JSON and one block of bytes per run, in base64. The page to play with draws with the scripts and
the style sheet of the replay page; what it has beside them lies in `play_page`.
"""

import base64
import html
import json
import re
from functools import cache
from importlib import resources
from string import Template
from typing import Any

from swarm_forage_env._internal.files import parse_json

SCRIPTS = (
    "theme.js",
    "fflate.js",
    "decode.js",
    "events.js",
    "run.js",
    "player.js",
    "view.js",
    "draw.js",
    "panels.js",
    "curves.js",
    "inspect.js",
    "legend.js",
    "controls.js",
    "main.js",
)
"""Parts of the script in the order in which they are put together; later ones use earlier ones."""
_OF_REPLAYS = ("fflate.js", "decode.js", "player.js", "controls.js", "main.js")
SHARED_SCRIPTS = tuple(script for script in SCRIPTS if script not in _OF_REPLAYS)
"""Those that the page to play with has, too."""
PLAY_SCRIPTS = ("link.js", "swarm.js", "walls.js", "cards.js", "buttons.js", "play.js")
"""Its own, which come after them."""
_HEADER = re.compile(r'<script type="application/json" id="header">(.*?)</script>', re.DOTALL)
_DATA = re.compile(r'<script type="text/plain" class="run">(.*?)</script>', re.DOTALL)


class PageError(ValueError):
    """A text that is no replay page, or a damaged one."""


def build_replay_page(title: str, header: dict[str, Any], blocks: list[bytes]) -> str:
    """Return the replay page as text.

    Args:
        title: Title and headline.
        header: Plain values for JSON.
        blocks: One block of bytes per run.
    """
    data = "\n".join(
        f'<script type="text/plain" class="run">{base64.b64encode(block).decode("ascii")}</script>' for block in blocks
    )
    # "<" within JSON would end the script element early if "/script>" followed.
    written = json.dumps(header, allow_nan=False).replace("<", "\\u003c")
    return Template(_part("replay_page", "index.html")).substitute(
        title=html.escape(title),
        style=_part("replay_page", "replay.css"),
        script="\n".join(_part("replay_page", name) for name in SCRIPTS),
        header=written,
        data=data,
    )


def take_replay_page_apart(text: str) -> tuple[dict[str, Any], list[bytes]]:
    """Return header and blocks of a page, as they were given to `build_replay_page`.

    Raises:
        PageError: there is no header, or header or blocks cannot be read.
    """
    found = _HEADER.search(text)
    if found is None or not text.rstrip().endswith("</html>"):
        raise PageError("it is no replay page or cut short")
    try:
        header = parse_json(found[1])
        blocks = [base64.b64decode(block, validate=True) for block in _DATA.findall(text)]
    except ValueError as error:
        raise PageError(f"its content is damaged ({error})") from error
    if not isinstance(header, dict):
        raise PageError("its header is no JSON object")
    return header, blocks


def build_play_page() -> str:
    """Return the page to play with as text; it gets all else from the server that sends it."""
    shared = [_part("replay_page", name) for name in SHARED_SCRIPTS]
    own = [_part("play_page", name) for name in PLAY_SCRIPTS]
    return Template(_part("play_page", "index.html")).substitute(
        style=_part("replay_page", "replay.css") + _part("play_page", "play.css"), script="\n".join([*shared, *own])
    )


@cache
def _part(folder: str, name: str) -> str:
    return resources.files("swarm_forage_env.rendering").joinpath(folder, name).read_text(encoding="utf-8")
