"""Files of every format with other bytes are read or refused in one line; `scripts/fuzz files` gives many more."""

from random import Random

import pytest

from tests.support.changed_files import READERS, give


@pytest.mark.filterwarnings("ignore")  # of libraries
@pytest.mark.parametrize("name", READERS)
def test_any_changed_file_is_read_or_refused_in_one_line(name, tmp_path, capfd):
    seen = set()
    for number in range(24):
        told, fault = give(Random(number), tmp_path, name)
        assert not fault
        seen.add(told)
    assert seen == {"accepted", "refused"}
    assert capfd.readouterr() == ("", "")
    assert [path.name for path in tmp_path.iterdir()] == [name]
