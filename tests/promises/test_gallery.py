"""The gallery shows everything that there is to see, in the present page."""

from importlib import resources

import pytest

from scripts.make_gallery import EXHIBITS, FILMS, FOLDER, page
from swarm_forage_env.inspect.replay.files import FORMAT_VERSION
from swarm_forage_env.policies.registry import POLICIES
from swarm_forage_env.rendering.pages import SCRIPTS, take_replay_page_apart
from swarm_forage_env.wrappers.registry import WRAPPERS
from tests.support.foraging import NEAR

MOST_BYTES = 6
"""Per robot and frame: 3 MB for 50 robots in a whole run, 30 MB for the five million poses of the largest replays."""
DISTURBED = {exhibit.name: exhibit.wrapper.partition(":")[0] for exhibit in EXHIBITS}


def test_every_scenario_controller_and_wrapper_is_shown():
    assert {exhibit.scenario for exhibit in EXHIBITS} >= NEAR.keys()
    assert {name for exhibit in EXHIBITS for name in exhibit.policies} == {*POLICIES} - {"random"}
    assert {*DISTURBED.values()} - {""} == WRAPPERS.keys()


def test_every_wrapper_has_a_film():
    assert {DISTURBED[film.exhibit] for film in FILMS} - {""} == WRAPPERS.keys()


def test_the_page_shows_what_the_script_makes():
    assert (FOLDER.parent / "gallery.md").read_text() == page()
    made = {f"{exhibit.name}{suffix}" for exhibit in EXHIBITS for suffix in (".html", ".png")}
    made |= {f"{film.name}.gif" for film in FILMS}
    assert {path.name for path in FOLDER.iterdir()} == made


@pytest.mark.parametrize("exhibit", EXHIBITS, ids=lambda exhibit: exhibit.name)
def test_stored_replays_have_the_runs_and_the_present_page(exhibit):
    text = (FOLDER / f"{exhibit.name}.html").read_text()
    header, _ = take_replay_page_apart(text)
    assert header["version"] == FORMAT_VERSION, "python scripts/make_gallery.py makes the gallery anew"
    assert [run["run_id"] for run in header["runs"]] == [spec.run_id for spec in exhibit.specs()]
    parts = resources.files("swarm_forage_env.rendering").joinpath("replay_page")
    for name in (*SCRIPTS, "replay.css"):
        present = parts.joinpath(name).read_text(encoding="utf-8")
        assert present in text, f"{name} is another one: python scripts/make_gallery.py --pages"


@pytest.mark.parametrize("exhibit", EXHIBITS, ids=lambda exhibit: exhibit.name)
def test_stored_replays_are_small(exhibit):
    text = (FOLDER / f"{exhibit.name}.html").read_text()
    header, blocks = take_replay_page_apart(text)
    poses = sum(run["n_robots"] * run["n_frames"] for run in header["runs"])
    in_base64 = sum(len(block) for block in blocks) * 4 / 3
    assert 0.5 * poses < in_base64 < MOST_BYTES * poses
    assert len(text) - in_base64 < 200_000, "style sheet, scripts, header"
