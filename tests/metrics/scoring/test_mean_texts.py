"""Numbers as people read them."""

import math

import pytest

from metrics import aggregate
from metrics.scoring.scores import spread

NAN = math.nan


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ([0.0, 0.0], "0 ± 0"),
        ([0.0041, 0.0041], "0.0041 ± 0"),
        ([0.1, 0.1, 0.1], "0.1 ± 0"),
        ([2e-18, -1e-18, 0.0], "0 ± 0"),
        ([1.0, 2.0, 3.0, 4.0, 5.0], "3.0 ± 2.0"),
        ([-0.001, 0.0012, -0.0003], "0.0000 ± 0.0028"),
        ([7.0], "7"),
        ([NAN], "-"),
        ([1.0, -math.inf], "-inf"),
    ],
)
def test_a_mean_is_shown_with_half_its_interval_to_two_digits(values, text):
    assert spread(aggregate(values)) == text


def test_shares_are_shown_in_percent():
    assert spread(aggregate([0.5, 0.5]), is_share=True) == "50 ± 0 %"
    assert spread(aggregate([0.4, 0.6]), is_share=True) == "50 ± 127 %"
