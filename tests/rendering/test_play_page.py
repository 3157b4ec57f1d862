"""The page to play with as text: all of its scripts, and nothing from elsewhere."""

import re
from importlib import resources

from swarm_forage_env.rendering.pages import PLAY_SCRIPTS, SCRIPTS, SHARED_SCRIPTS, build_play_page

FOLDER = resources.files("swarm_forage_env.rendering").joinpath("play_page")


def test_every_script_is_in_the_page():
    assert {file.name for file in FOLDER.iterdir() if file.name.endswith(".js")} == set(PLAY_SCRIPTS)
    assert [name for name in SCRIPTS if name in SHARED_SCRIPTS] == list(SHARED_SCRIPTS), (
        "in the order of the replay page"
    )
    page = build_play_page()
    assert all(FOLDER.joinpath(name).read_text() in page for name in PLAY_SCRIPTS)


def test_the_page_loads_nothing_from_elsewhere():
    page = build_play_page()
    assert re.findall(r"https?:|//[\w.]+\.\w+/|\b(?:src|href)=\"(?!data:,\")|@import|url\(", page) == []
    assert re.findall(r"\bfetch\((\w+)", page) == ["place"], "relative to the address with the token"


def test_what_a_server_sends_is_shown_as_text():
    own = "".join(FOLDER.joinpath(name).read_text() for name in PLAY_SCRIPTS)
    assert "innerHTML" not in own
