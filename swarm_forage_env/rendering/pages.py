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

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.files import parse_json

SHARED_SCRIPTS = (
    "theme.js",
    "events.js",
    "run.js",
    "view.js",
    "draw.js",
    "panels.js",
    "curves.js",
    "inspect.js",
    "legend.js",
)
"""Parts of both scripts in the order in which they are put together; later ones use earlier ones."""
REPLAY_SCRIPTS = ("decode.js", "player.js", "controls.js", "main.js")
PLAY_SCRIPTS = ("link.js", "swarm.js", "walls.js", "cards.js", "buttons.js", "play.js")
_HEADER = re.compile(r'<script type="application/json" id="header">(.*?)</script>', re.DOTALL)
_DATA = re.compile(r'<script type="text/plain" class="run">(.*?)</script>', re.DOTALL)


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
    return _page("replay_page", ("replay.css",), REPLAY_SCRIPTS, title=html.escape(title), header=written, data=data)


def take_replay_page_apart(text: str) -> tuple[dict[str, Any], list[bytes]]:
    """Return header and blocks of a page, as they were given to `build_replay_page`.

    Raises:
        ConfigError: there is no header.
        ValueError: the header or a block is damaged.
    """
    found = _HEADER.search(text)
    if found is None or not text.rstrip().endswith("</html>"):
        raise ConfigError("it is no replay page or cut short")
    return parse_json(found[1]), [base64.b64decode(block, validate=True) for block in _DATA.findall(text)]


def build_play_page() -> str:
    """Return the page to play with as text; it gets all else from the server that sends it."""
    return _page("play_page", ("replay.css", "play.css"), PLAY_SCRIPTS)


def _page(folder: str, styles: tuple[str, ...], scripts: tuple[str, ...], **parts: str) -> str:
    return Template(_part(f"{folder}/index.html")).substitute(
        style="".join(_part(f"{name.removesuffix('.css')}_page/{name}") for name in styles),
        script="\n".join(
            [_part(f"replay_page/{name}") for name in SHARED_SCRIPTS] + [_part(f"{folder}/{name}") for name in scripts]
        ),
        **parts,
    )


@cache
def _part(file: str) -> str:
    return resources.files("swarm_forage_env.rendering").joinpath(file).read_text(encoding="utf-8")
