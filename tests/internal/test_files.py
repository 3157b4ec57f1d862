"""Files appear whole or not at all, drafts never meet, and a disk that takes no files is told."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from swarm_forage_env._internal.files import alone_in, replacing
from swarm_forage_env._internal.rng import Stream, TickDraws, stream_rng

HOLDER = """
import sys, time
from pathlib import Path
from swarm_forage_env._internal.files import alone_in
with alone_in(Path(sys.argv[1]), ValueError):
    print("has it", flush=True)
    time.sleep(60)
"""


def test_a_folder_is_kept_until_its_process_ends_however_it_ends(tmp_path):
    pytest.importorskip("fcntl")
    folder = tmp_path / "new" / "folder"
    holder = subprocess.Popen([sys.executable, "-c", HOLDER, folder], stdout=subprocess.PIPE, text=True)
    try:
        assert holder.stdout.readline() == "has it\n"
        with pytest.raises(LookupError, match="but another command does; wait until it has ended"):
            enter(folder)
    finally:
        holder.kill()  # nothing is left to remove
        holder.wait()
        holder.stdout.close()
    with alone_in(folder, RefusalError):
        assert list(folder.iterdir()) == []
    assert folder.exists(), "it was there"
    enter(tmp_path / "other")
    assert not (tmp_path / "other").exists(), "it was made for nothing"


def enter(folder):
    with alone_in(folder, RefusalError):
        pass


class RefusalError(ValueError, LookupError):
    """An error of whoever asks."""


def test_drafts_of_one_file_have_different_names_in_every_thread(tmp_path):
    def draft_name(_) -> str:
        with replacing(tmp_path / "record.parquet") as draft:
            draft.write_text("whole")
            return draft.name

    with ThreadPoolExecutor(4) as pool:
        names = list(pool.map(draft_name, range(20)))
    assert len(set(names)) == 20
    assert [file.name for file in tmp_path.iterdir()] == ["record.parquet"]


def test_a_file_keeps_its_content_when_its_successor_does_not_fit(full_disk, tmp_path):
    path = tmp_path / "record.parquet"
    path.write_bytes(b"short")
    with pytest.raises(OSError, match="File too large") as caught, replacing(path) as draft:
        draft.write_bytes(bytes(100_000))
    assert caught.value.filename == str(path), "the draft's name means nothing to people"
    assert path.read_bytes() == b"short"
    assert [file.name for file in tmp_path.iterdir()] == ["record.parquet"]


def test_stream_numbers_are_stored_history():
    names = (
        "PLACEMENT START_POSE OBJECT_MOTION INTERACTION CACHE POLICY SENSOR_NOISE ACTUATOR_NOISE POPULATION SCENARIO"
    )
    assert {stream.name: int(stream) for stream in Stream} == dict(zip(names.split(), [*range(9), 12], strict=True))


def test_streams_and_seeds_differ_and_come_again():
    firsts = {stream_rng(seed, stream).random() for seed in range(50) for stream in Stream}
    assert len(firsts) == 50 * len(Stream)
    assert firsts == {stream_rng(seed, stream).random() for seed in range(50) for stream in Stream}


@pytest.mark.parametrize("shape", [(1,), (7,), (9000,), (0,), (3, 4), (700, 4)])
def test_draws_by_tick_are_those_of_one_call_per_tick(shape):
    draws, rng = TickDraws(np.random.default_rng(5), *shape), np.random.default_rng(5)
    for tick in range(1, 12 if shape != (1,) else 10_000):
        expected = rng.random(shape)
        np.testing.assert_array_equal(draws.row(tick), expected, strict=True)
        np.testing.assert_array_equal(draws.row(tick), expected, strict=True)


@pytest.mark.parametrize("shape", [(2000,), (500, 4)])
def test_rows_are_of_the_ticks_that_are_drawn_already_and_ticks_may_be_left_out(shape):
    draws, again = TickDraws(np.random.default_rng(5), *shape), np.random.default_rng(5).random((40, *shape))
    for tick in (1, 3, 4, 17, 33):  # so that a whole block is asked for by nobody
        rows = draws.rows(tick)
        np.testing.assert_array_equal(rows, again[tick - 1 : tick - 1 + len(rows)], strict=True)
        np.testing.assert_array_equal(draws.rows(tick + len(rows) - 1), rows[-1:], strict=True)
