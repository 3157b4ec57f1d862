"""Two commands at once leave what one leaves, and a signal ends any command in one line.

A few each time; `scripts/fuzz pairs` and `scripts/fuzz signals` give as many as fit into a time.
"""

from random import Random

import pytest

from tests.support import pairs
from tests.support.pairs import READERS, can_be_given, interrupted, pair

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("name", [*pairs.WRITERS, *pairs.MIXED])
def test_two_at_once_leave_what_one_leaves(name, tmp_path):
    if name not in (*can_be_given(), *pairs.MIXED):
        pytest.skip("needs an extra: stable-baselines3 and torch, or Pillow; or the packed results")
    seen = pair(Random(1), tmp_path, (name,))
    assert not seen.fault, seen.fault


@pytest.mark.parametrize("name", [*pairs.WRITERS, *READERS])
def test_a_signal_ends_any_command_in_one_line(name, tmp_path):
    if name not in (*can_be_given(), *READERS):
        pytest.skip("needs an extra: stable-baselines3 and torch, or Pillow; or the packed results")
    seen = interrupted(Random(1), tmp_path, (name,))
    assert not seen.fault, seen.fault
