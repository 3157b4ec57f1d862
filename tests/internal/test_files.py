"""Files appear whole or not at all, drafts never meet, and a disk that takes no files is told."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from swarm_forage_env._internal.files import as_file_name, check_file, check_folder, replacing


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
