"""The command `saliency`."""

import sys
from pathlib import Path

import pytest

from tests.support.pictures import keep_figures

WORDS = ("--robots", "3", "--seconds", "20")


@pytest.mark.compiled
def test_saliency_is_told_and_drawn(command, monkeypatch):
    pytest.importorskip("matplotlib")
    code, out, err = command("saliency", "ppo_warehouse_small", *WORDS)
    assert code == 0
    assert "share of decisions that change when a slice comes from another observation" in out
    assert "cos, sin of the heading" in out
    picture = Path("results/warehouse_small_3_robots_ppo_warehouse_small.saliency.png")
    assert err == f"picture {picture}\n"
    assert picture.read_bytes().startswith(b"\x89PNG")
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    code, out, err = command("saliency", "ppo_warehouse_small", *WORDS, "--picture", "other.png")
    assert code == 0
    assert "No picture without matplotlib" in err
    assert not Path("other.png").exists()


def test_saliency_refuses_what_is_no_network(command):
    Path("broken.npz").write_text("nothing")
    for name, message in (
        (
            "crw",
            "Expected a network, that is the name of a shipped one (generalist, ppo_warehouse_small) or an .npz file",
        ),
        ("nosuch", "the name of a shipped one (generalist, ppo_warehouse_small)"),
        ("ppo_warehous_small", "Did you mean 'ppo_warehouse_small'?"),
        ("broken.npz", "Expected broken.npz to hold a network"),
        ("model.zip", "Expected a network"),
    ):
        code, _, err = command("saliency", name)
        assert code == 2
        assert message in err
        assert err.count("\n") == 1
    code, _, err = command("saliency", "missing.npz")
    assert code == 1
    assert "missing.npz" in err


@pytest.mark.compiled
def test_the_axis_says_what_is_measured_and_what_its_ends_mean(command, monkeypatch):
    pytest.importorskip("matplotlib")
    figures = keep_figures(monkeypatch)
    assert command("saliency", "ppo_warehouse_small", *WORDS)[0] == 0
    label = figures[0].axes[0].get_xlabel()
    assert label.startswith("share of decisions that change when the slice comes from another observation")
    assert "0: it is not looked at, 1: every decision changes" in label


@pytest.mark.compiled
def test_saliency_is_shown_even_if_its_picture_cannot_be_written(command, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("swarm_forage_env.rendering.plots.draw_saliency", full)
    code, out, err = command("saliency", "ppo_warehouse_small", *WORDS, "--picture", "a.png")
    assert code == 0
    assert "cos, sin of the heading" in out
    assert err == "No picture a.png: No space left on device.\n"


def test_the_place_of_the_picture_is_looked_at_before_anything_is_run(command, monkeypatch):
    Path("taken.png").mkdir()
    monkeypatch.setattr("swarm_forage_env.inspect.saliency.saliency", lambda *_, **__: pytest.fail("a run was started"))
    told = "swarm-forage: Expected a file to write, got a folder: taken.png\n"
    assert command("saliency", "ppo_warehouse_small", *WORDS, "--picture", "taken.png") == (1, "", told)
