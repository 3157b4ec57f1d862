"""The command `maps`."""

from pathlib import Path

import pytest


def test_maps_of_policies_need_no_page(command):
    pytest.importorskip("matplotlib")
    words = ("--robots", "3", "--horizon", "4", "--set", "interval_s=2", "--seeds", "2")
    code, out, err = command("maps", "random", "crw", *words)
    assert (code, err) == (0, "")
    name = "warehouse_small_3_robots_4_s_20cdbe_random_crw_maps"
    assert out == f"wrote maps to results/{name}.png and .npz files beside it\n"
    assert {path.name for path in Path("results").glob("*.npz")} == {
        f"{name}.random.npz",
        f"{name}.crw.npz",
        f"{name}.crw_minus_random.npz",
    }
