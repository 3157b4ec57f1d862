"""The command `maps`."""

from pathlib import Path

import pytest


def test_maps_of_policies_need_no_page(command):
    pytest.importorskip("matplotlib")
    words = ("--robots", "3", "--horizon", "4", "--set", "interval_s=2", "--seeds", "2", "--square", "1")
    code, out, err = command("maps", "random", "crw", *words)
    assert (code, err) == (0, "")
    assert out == "wrote maps to results/maps/warehouse_small_3_robots_4_s_20cdbe/maps.png and .npz files beside it\n"
    folder = Path("results/maps/warehouse_small_3_robots_4_s_20cdbe")
    assert {path.name for path in folder.glob("*.npz")} == {
        "maps.random.npz",
        "maps.crw.npz",
        "maps.crw_minus_random.npz",
    }
