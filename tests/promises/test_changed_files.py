"""Files of every format with other bytes are read or refused in one line; CASES=1000 tries as many of each."""

import os
from random import Random

import pytest

from tests.support.changed_files import READERS, give

CASES = int(os.environ.get("CASES", "24"))


@pytest.mark.filterwarnings("ignore")  # of libraries
@pytest.mark.parametrize("name", READERS)
def test_any_changed_file_is_read_or_refused_in_one_line(name, tmp_path, capfd):
    seen = set()
    for number in range(CASES):
        told, fault = give(Random(number), tmp_path, name)
        assert not fault
        seen.add(told)
    assert seen == {"accepted", "refused"}
    assert capfd.readouterr() == ("", "")
    assert [path.name for path in tmp_path.iterdir()] == [name]
