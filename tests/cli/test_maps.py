"""The command `maps`."""

from pathlib import Path

import pytest


@pytest.mark.compiled
def test_maps_draws_runs_and_differences(command, painted):
    pytest.importorskip("matplotlib")
    words = ("--robots", "3", "--seconds", "4")
    assert command("replay", "random", "--beside", "crw", *words, "-o", "two.html")[0] == 0
    code, out, err = command("maps", "two.html", "--side", "1")
    assert (code, err) == (0, "")
    assert out == "wrote maps of 2 runs to two.maps.png and .npz files beside it\n"
    assert {path.name for path in Path().iterdir()} == {
        "two.html",
        "two.maps.png",
        "two.maps.random.npz",
        "two.maps.crw.npz",
        "two.maps.crw_minus_random.npz",
    }
    assert Path("two.maps.png").read_bytes().startswith(b"\x89PNG")


def test_maps_refuses_other_files(command):
    Path("page.html").write_text("<p>")
    code, _, err = command("maps", "page.html")
    assert code == 2
    assert "Cannot read page.html: it is no replay page" in err
