"""The command `record`: films of runs."""

from pathlib import Path

import numpy as np
import pytest

from swarm_forage_env.inspect import film


def test_record_films_a_run(command):
    pytest.importorskip("PIL")
    words = ("random", "--robots", "3", "--seconds", "8", "--size", "240")
    code, out, _ = command("record", "--file", "film.gif", *words)
    assert (code, out) == (0, "wrote film.gif\n")
    assert Path("film.gif").read_bytes().startswith(b"GIF8")
    assert command("record", *words)[1] == "wrote results/warehouse_small_3_robots_random.gif\n"
    assert Path("results/warehouse_small_3_robots_random.gif").read_bytes() == Path("film.gif").read_bytes()


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
