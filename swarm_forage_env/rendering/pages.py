"""The replay page and the page to play with, each one HTML file that loads nothing from elsewhere.

The replay page is made of a style sheet, scripts and data. Its parts lie in `replay_page`.
Data are a header in JSON and one block of bytes per run, in base64. The page to play with draws with the scripts and
the style sheet of the replay page; what it has beside them lies in `play_page`.
"""

import base64
import html
import json
from functools import cache
from importlib import resources
from string import Template
from typing import Any

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
_POLICY = (
    '<meta http-equiv="Content-Security-Policy" '
    "content=\"default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:\">"
)


def build_replay_page(title: str, header: dict[str, Any], blocks: list[bytes]) -> str:
    """Return the replay page as text.

    Args:
        title: Title and headline.
        header: Plain values for JSON.
        blocks: One block of bytes per run.
    """
    # "<" within JSON would end the script element early if "/script>" followed.
    written = json.dumps(header, allow_nan=False).replace("<", "\\u003c")
    data = [f'<script type="application/json" id="header">{written}</script>']
    data += [
        f'<script type="text/plain" class="run">{base64.b64encode(one).decode("ascii")}</script>' for one in blocks
    ]
    return _page(html.escape(title), "replay_page", REPLAY_SCRIPTS, policy=_POLICY, data="\n".join(data))


def build_play_page() -> str:
    """Return the page to play with as text; it gets all else from the server that sends it."""
    style = _part("play_page/play.css")
    return _page("swarm-forage play", "play_page", PLAY_SCRIPTS, style=style)


def _page(
    title: str, folder: str, scripts: tuple[str, ...], *, policy: str = "", data: str = "", style: str = ""
) -> str:
    return Template(_part("page.html")).substitute(
        title=title,
        policy=policy,
        style=_part("replay_page/replay.css") + style,
        main=_part(f"{folder}/main.html"),
        keys=_part(f"{folder}/keys.html"),
        data=data,
        script="\n".join(
            [_part(f"replay_page/{name}") for name in SHARED_SCRIPTS] + [_part(f"{folder}/{name}") for name in scripts]
        ),
    )


@cache
def _part(file: str) -> str:
    return resources.files("swarm_forage_env.rendering").joinpath(file).read_text(encoding="utf-8")
