"""The paired t test and Holm's correction."""

import math

import numpy as np
import pytest
from scipy import stats

from metrics import CurveError, paired_tests
from metrics.significance import holm, paired_p

NAN = math.nan


def test_the_paired_test_is_that_of_scipy():
    values = np.array([1.0, 2.5, -0.5, 3.0, 2.0])
    assert paired_p(values) == pytest.approx(stats.ttest_1samp(values, 0.0).pvalue, rel=1e-12)


@pytest.mark.parametrize(
    ("values", "expected"),
    [([0.0, 0.0, 0.0], 1.0), ([2.0, 2.0, 2.0], 0.25), ([1.0], NAN), ([], NAN), ([math.inf, 1.0], NAN)],
    ids=["all zero", "all equal", "one pair", "no pair", "infinite"],
)
def test_where_students_t_does_not_exist(values, expected):
    assert paired_p(np.array(values)) == pytest.approx(expected, nan_ok=True)


def test_holms_example_by_hand():
    # Sorted 0.01, 0.03, 0.04 times 3, 2, 1: 0.03, 0.06, 0.04, never falling.
    np.testing.assert_allclose(holm(np.array([0.04, 0.01, NAN, 0.03])), [0.06, 0.03, NAN, 0.06])
    np.testing.assert_allclose(holm(np.array([0.9, 0.8])), [1.0, 1.0])
    assert holm(np.empty(0)).size == 0


def test_levels_are_tested_together():
    first = np.array([[4.0, 6.0, 8.0], [5.0, 5.0, 6.0]])
    second = np.array([[1.0, 2.0, 3.0], [5.0, 6.0, 5.0]])
    # Differences 3, 4, 5 and 0, -1, 1: p values of scipy, the smaller one times two.
    expected = [2 * stats.ttest_rel(first[0], second[0]).pvalue, stats.ttest_rel(first[1], second[1]).pvalue]
    np.testing.assert_allclose(paired_tests(first, second), expected)
    np.testing.assert_allclose(paired_tests(first[0], second[0]), expected[0] / 2)


def test_a_missing_run_takes_its_partner_along():
    first, second = [[4.0, 6.0, NAN, 8.0], [1.0, NAN, NAN, NAN]], [[1.0, 2.0, 9.0, 3.0], [0.0, 1.0, 2.0, 3.0]]
    expected = stats.ttest_rel([4.0, 6.0, 8.0], [1.0, 2.0, 3.0]).pvalue  # the other level has no test
    np.testing.assert_allclose(paired_tests(first, second), [expected, NAN])


@pytest.mark.parametrize(("first", "second"), [([1.0, 2.0], [1.0]), (1.0, 1.0), ([[[1.0]]], [[[1.0]]])])
def test_runs_that_cannot_be_paired_are_refused(first, second):
    with pytest.raises(CurveError, match="same shape"):
        paired_tests(first, second)
