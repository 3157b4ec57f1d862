"""The replay page as text: data in and out, colours for all readers, nothing from elsewhere."""

import re
from importlib import resources
from itertools import combinations, product

import numpy as np
import pytest

from swarm_forage_env.rendering.pages import SCRIPTS, PageError, build_replay_page, take_replay_page_apart
from tests.support.colours import VISION, seen_lab

FOLDER = resources.files("swarm_forage_env.rendering").joinpath("replay_page")
STYLE = FOLDER.joinpath("replay.css").read_text()


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


def test_a_page_brings_the_licence_of_what_it_borrows():
    page = build_replay_page("", {}, [])
    assert "fflate" in page
    assert "The above copyright notice and this permission notice shall be included" in page


def test_the_page_loads_nothing():
    page = build_replay_page("", {}, [])
    assert re.findall(r"https?:|//[\w.]+\.\w+/|\b(?:src|href)=\"(?!data:,\")|@import|url\(|\bfetch\(", page) == []
    assert "default-src 'none'" in page


def colours(theme: str) -> dict[str, tuple[int, ...]]:
    """The colours of the style sheet under a theme."""
    start = STYLE.index(':root[data-theme="dark"]' if theme == "dark" else ":root {")
    block = STYLE[start : STYLE.index("}", start)]
    found = re.findall(r"--([\w-]+): #(\w{6});", block)
    return {name: tuple(bytes.fromhex(code)) for name, code in found}


def mixed(ground, thing, share: float) -> np.ndarray:
    return np.asarray(ground) + share * (np.asarray(thing) - np.asarray(ground))


def apart(one, two, vision) -> float:
    return float(np.linalg.norm(seen_lab(one, vision) - seen_lab(two, vision)))


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("vision", VISION.values(), ids=VISION.keys())
def test_things_stay_apart_for_colour_blind_readers(theme, vision):
    known = colours(theme)
    things = ("empty", "carrying", "interference", "repair", "object")
    grounds = [known["floor"]] + [
        mixed(known["floor"], known[name], share) for name, share in (("nest", 0.22), ("cache", 0.22), ("source", 0.1))
    ]
    signs = (*things, "cache")
    close = [(one, two) for one, two in combinations(signs, 2) if apart(known[one], known[two], vision) < 17.0]
    assert close == []
    hidden = [
        (thing, ground)
        for thing, ground in product(things, range(4))
        if apart(known[thing], grounds[ground], vision) < 20
    ]
    assert hidden == []


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("vision", VISION.values(), ids=VISION.keys())
def test_the_first_three_runs_have_colours_apart(theme, vision):
    """Dashes tell them apart, too."""
    known = colours(theme)
    runs = [known[f"run-{index}"] for index in range(3)]
    assert min(apart(one, two, vision) for one, two in combinations(runs, 2)) > 15.0
    assert min(apart(one, known["panel"], vision) for one in runs) > 30.0
    assert len({re.sub(r"\s", "", part) for part in dashes()[:3]}) == 3


def dashes() -> list[str]:
    found = re.search(r"const DASHES = \[(.*)\];", FOLDER.joinpath("curves.js").read_text())
    assert found is not None
    return re.findall(r"\[[^\]]*\]", found[1])


def test_both_themes_name_the_same_colours():
    assert colours("light").keys() == colours("dark").keys()


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_text_has_contrast(theme):
    """At least 4.5, as the guidelines for accessible pages ask."""

    def luminance(colour) -> float:
        share = np.asarray(colour) / 255.0
        linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
        return float(linear @ (0.2126, 0.7152, 0.0722))

    known = colours(theme)
    for text, ground in product(("text", "faint"), ("page", "panel")):
        high, low = sorted((luminance(known[text]), luminance(known[ground])), reverse=True)
        assert (high + 0.05) / (low + 0.05) >= 4.5, (text, ground)
