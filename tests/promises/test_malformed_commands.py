"""Malformed words and files end in one line and a documented exit code, never in a traceback.

A short look in every test run; `scripts/fuzz commands` gives as many as fit into a time.
"""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.support.malformed import malformed_command, outcome


@pytest.mark.filterwarnings("default")  # what a library warns of is no error of a command
@given(random=st.randoms(use_true_random=False))
@settings(
    max_examples=40,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow, HealthCheck.data_too_large],
)
def test_any_command_ends_in_one_line(random, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = outcome(malformed_command(random, tmp_path))
    assert not found.fault, f"{found.words}\n{found.fault}"


@pytest.mark.parametrize(
    "words",
    [
        "train --algo",
        "train --arenas 1000000000",
        "train --hidden 1000000000",
        "run --seeds 1000000000 --dry-run",
        "score --policy crw --seeds 1000000000 --dry-run",
        "study run S1a --seeds 1000000000 --dry-run",
        "run --horizon 1e308 --dry-run",
        "run --set width_m=1e308 --dry-run",
        "run --density 1e-320 --dry-run",
        "run --wrapper sensor_noise:sigma=1e308 --dry-run",
    ],
)
def test_sizes_without_sense_are_refused_before_anything_is_built(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given_words = [*words.split(), ""] if words.endswith("--algo") else words.split()
    found = outcome(given_words)
    assert (found.fault, found.code) == ("", 2), found
