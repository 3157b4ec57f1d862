"""Files appear whole or not at all, drafts never meet, and a disk that takes no files is told."""

import errno
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Thread

import pytest

from swarm_forage_env._internal.files import (
    alone_in,
    as_file_name,
    check_file,
    check_folder,
    parse_json,
    read_json,
    replacing,
)

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


def test_who_waits_comes_after_the_first(tmp_path):
    pytest.importorskip("fcntl")
    told = []

    def second():
        with alone_in(tmp_path):
            told.append("second")

    waiting = Thread(target=second)
    with alone_in(tmp_path):
        waiting.start()
        waiting.join(0.2)
        told.append("first")
    waiting.join()
    assert told == ["first", "second"]


def test_a_disk_without_locks_refuses_nobody(tmp_path, monkeypatch):
    fcntl = pytest.importorskip("fcntl")

    def none(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", none)
    with alone_in(tmp_path, RefusalError), alone_in(tmp_path):
        pass


def test_texts_that_no_file_can_hold_are_refused(tmp_path):
    assert parse_json(r'{"a": "\ud83d\ude00"}') == {"a": "\U0001f600"}, "a pair is a character"
    for text in (r'{"a": ["\ud800"]}', r'{"\udcff": 1}'):
        with pytest.raises(ValueError, match=r"Expected texts that can be written as UTF-8, got one with '.udc?"):
            parse_json(text)
    (tmp_path / "a.json").write_text("[", encoding="utf-8")
    for name, message in (("a.json", "Cannot use .*a.json"), ("b.json", "Cannot read .*b.json: No such file")):
        with pytest.raises(RefusalError, match=message):
            read_json(tmp_path / name, RefusalError)


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


def test_errors_about_other_files_keep_their_name(tmp_path):
    with pytest.raises(FileNotFoundError) as caught, replacing(tmp_path / "a"):
        Path(tmp_path, "missing").read_bytes()
    assert caught.value.filename == str(tmp_path / "missing")


def test_a_check_leaves_nothing_behind(tmp_path):
    check_folder(tmp_path / "a" / "b")
    check_folder(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_told_by_the_name_of_the_folder(full_disk, tmp_path):
    with pytest.raises(OSError, match="File too large") as caught:
        check_folder(tmp_path / "runs")
    assert caught.value.filename == str(tmp_path / "runs")


def test_a_folder_in_the_place_of_a_file_is_told(tmp_path):
    with pytest.raises(IsADirectoryError, match="Expected a file to write, got a folder"):
        check_file(tmp_path)


@pytest.mark.parametrize(
    ("text", "name"), [("dpo minus crw", "dpo_minus_crw"), ("../a/b", ".._a_b"), ("a\\b:c", "a_b_c")]
)
def test_texts_become_parts_of_file_names(text, name):
    assert as_file_name(text) == name
