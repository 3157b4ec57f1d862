"""The command `maps`."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from swarm_forage_env.inspect import film
from swarm_forage_env.policies import pretrained
from swarm_forage_env.runs.record import Record
from tests.reference.replay_arrays import runs_of


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


def test_record_draws_one_picture_of_the_run_it_films(command, monkeypatch):
    image = pytest.importorskip("PIL.Image")
    render, filmed = film.render_frame, {}

    def note(*args, tick, **options):
        filmed[tick] = render(*args, tick=tick, **options)
        return filmed[tick]

    words = ("random", "--robots", "3", "--size", "240")
    assert command("record", *words, "--seconds", "8")[0] == 0
    monkeypatch.setattr(film, "render_frame", note)
    code, out, err = command("record", *words, "--at", "8", "--file", "new/at.png")
    assert (code, out, err) == (0, "wrote new/at.png\n", "")
    assert list(filmed) == [40]
    with image.open("new/at.png") as picture:
        assert np.array_equal(np.asarray(picture), filmed[40])
    with image.open("results/warehouse_small_3_robots_random.gif") as gif:
        gif.seek(gif.n_frames - 1)
        off = np.abs(np.asarray(gif.convert("RGB"), float) - filmed[40]).mean()
    assert off < 4.0, "the last picture of the film, but for the colours of a GIF and the length of trails"
    assert command("record", *words, "--at", "0")[1] == "wrote results/warehouse_small_3_robots_random_0_s.png\n"


SHORT = ("--robots", "3", "--seconds", "4")


def test_replay_shows_runs_of_one_world_and_seed_side_by_side(command):
    shutil.copy(Path(pretrained.__file__).with_name("ppo_warehouse_small.npz"), "mine.npz")
    words = ("--seed", "7", "--wrapper", "throttle:waveform=constant,amplitude=0.2")
    code, _, err = command("replay", "stochm", "crw", "mine.npz", *SHORT, *words, "--file", "a.html")
    assert (code, err) == (0, "")
    runs = runs_of(Path("a.html"))
    assert [about["label"] for about, _ in runs] == ["stochm", "crw", "mine"]
    assert [about["world"]["caches"] for about, _ in runs] == ["static", "none", "none"]
    assert {about["seed"] for about, _ in runs} == {7}
    assert [[one["name"] for one in about["signals"]] for about, _ in runs] == [["throttle"]] * 3
    assert len({arrays["position"][0].tobytes() for _, arrays in runs}) == 1


def test_replay_makes_a_stored_run_again(command):
    assert command("run", "dpo", "--robots", "3", "--horizon", "200", "--jobs", "1")[0] == 0
    (file,) = Path("results/warehouse_small_3_robots_200_s").glob("*.parquet")
    stored = Record.read(file)
    code, out, err = command("replay", str(file))
    assert (code, err) == (0, "")
    ((about, arrays),) = runs_of(Path(out.split()[1]))
    assert about["run_id"] == stored.run_id
    assert arrays["counters"][-1, 0] == stored["collected"].sum()
    for beside in (("crw",), ("--seed", "3"), ("--robots", "2")):
        code, _, err = command("replay", str(file), *beside)
        assert (code, err.count("\n")) == (2, 1)
        assert "Expected stored runs alone" in err


RUNS = ("--robots", "3", "--set", "n_objects=20", "--set", "interval_s=2", "--horizon", "4", "--jobs", "1")


def test_a_figure_for_a_paper(command, painted):
    from matplotlib import image

    words = ("--width-in", "3.5", "--no-title", "--picture", "figure.png")
    for _ in range(2):  # what is stored is drawn anew
        code, _, err = command("run", "random,stochm", *RUNS, "--seeds", "2", *words)
        assert (code, "picture figure.png" in err) == (0, True)
    assert "4 of 4 runs stored already" in err
    assert image.imread("figure.png").shape[1] == round(3.5 * 150)
