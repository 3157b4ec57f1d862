"""Changed files of every format end in one line and a documented exit code; `scripts/fuzz files` gives many more."""

from random import Random

import pytest

from tests.support.changed_files import FORMATS, changed_file, what_is_wrong


@pytest.mark.filterwarnings("default")  # what a library warns of is no error of a command
@pytest.mark.parametrize("kind", FORMATS)
def test_any_changed_file_ends_in_one_line(kind, tmp_path, monkeypatch):
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    for number in range(4):
        words = changed_file(Random(number), tmp_path, kind)
        code, fault = what_is_wrong(words, tmp_path)
        assert not fault, f"{words}\n{fault}"
        assert code in (0, 1, 2)
