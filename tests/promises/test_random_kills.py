"""A command that is killed at random moments and given again leaves what an undisturbed one leaves.

`scripts/fuzz kills` does it as often as fits into a time.
"""

from random import Random

import pytest

from tests.support.kills import COMMANDS, kill, possible

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("name", COMMANDS)
def test_a_killed_command_ends_as_an_undisturbed_one(name, tmp_path):
    if name not in possible():
        pytest.skip("needs the train extra: stable-baselines3 and torch")
    seen = kill(Random(1), tmp_path, (name,))
    assert not seen.fault, seen.fault
    assert seen.figures["kills"] >= 1
