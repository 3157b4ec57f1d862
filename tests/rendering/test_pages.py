"""Both pages as text: data in and out, all scripts, nothing from elsewhere."""

import re
from importlib import resources

import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.rendering.pages import (
    PLAY_SCRIPTS,
    REPLAY_SCRIPTS,
    SHARED_SCRIPTS,
    build_play_page,
    build_replay_page,
    take_replay_page_apart,
)

FOLDER = resources.files("swarm_forage_env.rendering")
PAGES = {
    "replay_page": (build_replay_page("", {}, []), SHARED_SCRIPTS + REPLAY_SCRIPTS),
    "play_page": (build_play_page(), PLAY_SCRIPTS),
}


def test_data_come_back_whatever_they_hold():
    header = {"name": "</script><b>", "list": [1, None, 2.5]}
    blocks = [b"", bytes(range(256)), b"</script>"]
    page = build_replay_page("a <title> & more", header, blocks)
    assert take_replay_page_apart(page) == (header, blocks)
    assert "<title>a &lt;title&gt; &amp; more</title>" in page


@pytest.mark.parametrize("text", ["<html></html>", '<script type="application/json" id="header">{}</script>'])
def test_other_texts_are_refused(text):
    with pytest.raises(ConfigError, match="no replay page or cut short"):
        take_replay_page_apart(text)


@pytest.mark.parametrize("folder", PAGES)
def test_every_script_is_in_its_page_which_loads_nothing(folder):
    page, scripts = PAGES[folder]
    files = {file.name: file.read_text() for file in FOLDER.joinpath(folder).iterdir() if file.name.endswith(".js")}
    assert files.keys() == set(scripts)
    assert all(script in page for script in files.values())
    assert re.findall(r"https?:|//[\w.]+\.\w+/|\b(?:src|href)=\"(?!data:,\")|@import|url\(", page) == []
    asked = ["place"] if folder == "play_page" else []  # relative to the address with the token
    assert re.findall(r"\bfetch\((\w+)", page) == asked


def test_what_a_server_sends_is_shown_as_text():
    assert not any("innerHTML" in FOLDER.joinpath("play_page", name).read_text() for name in PLAY_SCRIPTS)
