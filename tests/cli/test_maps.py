"""The command `maps`."""

from pathlib import Path

import pytest


@pytest.mark.compiled
def test_maps_draws_runs_and_differences(command, painted):
    pytest.importorskip("matplotlib")
    words = ("--robots", "3", "--seconds", "4")
    assert command("replay", "random", "crw", *words, "--file", "two.html")[0] == 0
    code, out, err = command("maps", "two.html", "--square", "1")
    assert (code, err) == (0, "")
    assert out == "wrote maps to two.maps.png and .npz files beside it\n"
    assert {path.name for path in Path().iterdir()} == {
        "two.html",
        "two.maps.png",
        "two.maps.random.npz",
        "two.maps.crw.npz",
        "two.maps.crw_minus_random.npz",
    }
    assert Path("two.maps.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.compiled
def test_maps_of_policies_need_no_page(command):
    pytest.importorskip("matplotlib")
    words = ("--robots", "3", "--horizon", "4", "--set", "interval_s=2", "--seeds", "2", "--square", "1")
    code, out, err = command("maps", "random", "crw", *words, "--per-robot")
    assert (code, err) == (0, "")
    assert out == "wrote maps to results/maps/warehouse_small_3_robots_4_s_20cdbe/maps.png and .npz files beside it\n"
    folder = Path("results/maps/warehouse_small_3_robots_4_s_20cdbe")
    assert {path.name for path in folder.glob("*.npz")} == {
        "maps.random.npz",
        "maps.crw.npz",
        "maps.crw_minus_random.npz",
    }


def test_a_page_takes_no_options_of_runs(command):
    code, _, err = command("maps", "page.html", "--robots", "3")
    assert code == 2
    assert "Expected a page without --robots, which describe runs" in err


def test_maps_refuses_other_files(command):
    Path("page.html").write_text("<p>")
    Path("bytes.html").write_bytes(b"\xff\xfe\x00")
    Path("folder").mkdir()
    Path("run.parquet").write_bytes(b"PAR1")
    for name, message in (
        ("page.html", "Cannot read page.html: it is no replay page"),
        ("bytes.html", "Cannot read bytes.html: it is no text, so no replay page."),
        ("gone.html", "Cannot read gone.html: No such file"),
        ("run.parquet", "Cannot read run.parquet: it is no Parquet file or a damaged one"),
    ):
        code, out, err = command("maps", name)
        assert (code, out) == (2, "")
        assert message in err
        assert err.count("\n") == 1


def test_maps_of_a_stored_run(command, monkeypatch):
    short = ("--set", "horizon_s=20", "--set", "interval_s=10", "--robots", "3", "--objects", "20")
    assert command("run", "random", *short, "--jobs", "1")[0] == 0
    (record,) = Path("results/warehouse_small_3_robots_20_s_a1884d").glob("*.parquet")
    code, out, err = command("maps", str(record))
    assert (code, err) == (0, "")
    assert out == f"wrote maps to {record.with_suffix('.maps.png')} and .npz files beside it\n"
    assert [file.name for file in record.parent.glob("*.npz")] == [f"{record.stem}.maps.random.npz"]
    code, _, err = command("maps", str(record), "--seeds", "2")
    assert code == 2
    assert "Expected a stored run without --seeds" in err
    monkeypatch.setattr("swarm_forage_env.policies.registry._installed", lambda _: ())
    code, _, err = command("maps", str(record))
    assert (code, err.startswith("swarm-forage: Unknown policy 'random'.")) == (2, True)
