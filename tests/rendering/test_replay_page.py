"""The replay page as text: data in and out, colours for all readers, nothing from elsewhere."""

import re
from importlib import resources

import pytest

from swarm_forage_env.rendering.pages import SCRIPTS, PageError, build_replay_page, take_replay_page_apart

FOLDER = resources.files("swarm_forage_env.rendering").joinpath("replay_page")


def test_data_come_back_whatever_they_hold():
    header = {"name": "</script><b>", "list": [1, None, 2.5]}
    blocks = [b"", bytes(range(256)), b"</script>"]
    page = build_replay_page("a <title> & more", header, blocks)
    assert take_replay_page_apart(page) == (header, blocks)
    assert "<title>a &lt;title&gt; &amp; more</title>" in page


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<html></html>", "no replay page"),
        ('<script type="application/json" id="header">{</script></html>', "damaged"),
        ('<script type="application/json" id="header">[]</script></html>', "no JSON object"),
    ],
)
def test_other_texts_are_refused(text, expected):
    with pytest.raises(PageError, match=expected):
        take_replay_page_apart(text)


def test_every_script_is_in_the_page():
    files = {file.name for file in FOLDER.iterdir() if file.name.endswith(".js")}
    assert files == set(SCRIPTS)
    page = build_replay_page("", {}, [])
    assert all(FOLDER.joinpath(name).read_text() in page for name in SCRIPTS)


def test_the_page_loads_nothing():
    page = build_replay_page("", {}, [])
    assert re.findall(r"https?:|//[\w.]+\.\w+/|\b(?:src|href)=\"(?!data:,\")|@import|url\(|\bfetch\(", page) == []
    assert "default-src 'none'" in page
