"""The replay page, the report page and the page to play with, each one HTML file that loads nothing from elsewhere.

The replay page is made of a style sheet, scripts and data, and gives the data back. Its parts lie in `replay_page`.
Data are a header in JSON and one block of bytes per run, in base64. The report page on studies is made of a template,
a style sheet, a script and plain values. Its parts lie in `report_page`. It needs Jinja2 (the optional extra "plots"),
which is imported when a page is built. The page to play with draws with the scripts and the style sheet of the replay
page; what it has beside them lies in `play_page`.
"""

import base64
import html
import json
import re
from collections.abc import Mapping
from functools import cache, partial
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


def build_report(values: Mapping[str, Any]) -> str:
    """Return the report page as text.

    Args:
        values: What `report_page/report.html` names; a name that is missing is an error, and all texts are escaped.

    Raises:
        ImportError: Jinja2 is not installed.
    """
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    pages = Environment(
        loader=FunctionLoader(partial(_part, "report_page")),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    pages.filters["shown"] = shown
    return pages.get_template("report.html").render(values) + "\n"


def shown(cell: Any) -> str:
    """Return a cell of a table as readers see it: about four digits, no exponent where digits do, a dash for nothing.

    shown(1492.625), shown(0.0128571)  # ("1,493", "0.01286")
    """
    if cell is None:
        return "-"
    if not isinstance(cell, float):
        return f"{cell:,}" if isinstance(cell, int) and not isinstance(cell, bool) else str(cell)
    return f"{cell:,.0f}" if 1e3 <= abs(cell) < 1e7 else f"{cell:.4g}"


def picture_address(content: bytes, kind: str = "image/svg+xml") -> str:
    """Return a picture as an address that holds all of it."""
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


@cache
def _part(folder: str, name: str) -> str:
    return resources.files("swarm_forage_env.rendering").joinpath(folder, name).read_text(encoding="utf-8")
