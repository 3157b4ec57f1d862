"""The command `record`: films of runs."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from swarm_forage_env.inspect import film
from swarm_forage_env.policies import pretrained
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.network import Network, NetworkAbout

SHORT_FILM = ("--robots", "3", "--seconds", "4", "--size", "240", "--fps", "5")


def test_record_films_a_run(command):
    pytest.importorskip("PIL")
    words = ("--policy", "random", "--robots", "3", "--seconds", "8", "--size", "240", "--fps", "5")
    code, out, _ = command("record", "--file", "film.gif", *words)
    assert (code, out) == (0, "wrote film.gif\n")
    assert Path("film.gif").read_bytes().startswith(b"GIF8")
    assert command("record", *words)[1] == "wrote results/warehouse_small_3_robots_random.gif\n"
    assert Path("results/warehouse_small_3_robots_random.gif").read_bytes() == Path("film.gif").read_bytes()


@pytest.mark.parametrize(("asked", "filmed"), [((), "static"), (("--set", "caches=none"), "none")])
def test_record_films_the_caches_that_were_asked_for(command, monkeypatch, asked, filmed):
    pytest.importorskip("PIL")
    build, built = film.build_env, []

    def note(config, *args, **options):
        built.append(config.caches)
        return build(config, *args, **options)

    monkeypatch.setattr(film, "build_env", note)
    assert command("record", "--policy", "stochm", *asked, *SHORT_FILM)[0] == 0
    assert built == [filmed]


def test_record_films_a_world_whose_horizon_is_not_whole_intervals(command):
    pytest.importorskip("PIL")
    code, out, err = command("record", "--policy", "random", "--set", "horizon_s=30", *SHORT_FILM)
    assert (code, out, err) == (0, "wrote results/warehouse_small_3_robots_30_s_random.gif\n", "")


def test_record_names_a_file_without_the_way_there(command, monkeypatch):
    pytest.importorskip("PIL")
    shutil.copy(Path(pretrained.__file__).with_name("ppo_warehouse_small.npz"), "mine.npz")
    render, titles = film.render_frame, set()

    def note(*args, title, **options):
        titles.add(title)
        return render(*args, title=title, **options)

    monkeypatch.setattr(film, "render_frame", note)
    assert command("record", "--policy", "mine.npz", *SHORT_FILM)[0] == 0
    assert titles == {"warehouse_small: mine, 32 x 16 m"}


def test_record_says_when_a_network_does_not_fit(command):
    pytest.importorskip("PIL")
    about = NetworkAbout(interface=InterfaceConfig())
    Network((np.zeros((2, 3), np.float32),), (np.zeros(3, np.float32),), about).save("mine.npz")
    code, _, err = command("record", "--policy", "mine.npz", *SHORT_FILM)
    assert (code, err.count("\n")) == (2, 1)
    assert "Expected a network from 111 columns to 3 actions" in err


def test_record_draws_one_picture_of_the_run_it_films(command, monkeypatch):
    image = pytest.importorskip("PIL.Image")
    render, filmed = film.render_frame, {}

    def note(*args, tick, **options):
        filmed[tick] = render(*args, tick=tick, **options)
        return filmed[tick]

    words = ("--policy", "random", "--robots", "3", "--size", "240")
    assert command("record", *words, "--seconds", "8", "--fps", "20")[0] == 0
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
    assert command("record", *words, "--at", "0")[1] == "wrote results/warehouse_small_3_robots_random.png\n"


def test_record_says_how_pictures_and_films_are_asked_for(command):
    pytest.importorskip("PIL")
    for words, said in (
        (("--file", "x.png"), "one picture is made by --at SECONDS"),
        (("--file", "x.gif", "--at", "3"), "for a film, leave --at out"),
        (("--at", "-1"), "at_s"),
        (("--at", "20000"), "at_s"),
    ):
        code, out, err = command("record", *words)
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert said in err
    assert not list(Path().iterdir())
