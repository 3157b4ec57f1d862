"""Breakdowns: the rule by hand, shares and survival beside what other programs give."""

import math

import numpy as np
import pytest

from metrics import Breakdowns, CurveError, breakdown_probability, find_breakdowns, time_to_breakdown

# Times of ten runs and whether they ended in a breakdown, for lifelines 0.30.3:
# KaplanMeierFitter().fit(times, broken), median_survival_times of its interval.
TIMES = [2.0, 3, 3, 5, 5, 7, 8, 10, 10, 10]
BROKEN = [True, True, False, True, True, False, True, False, False, False]


def observed(broken, time):
    return Breakdowns(broken=np.array(broken), time=np.array(time, dtype=np.float64))


@pytest.mark.parametrize(
    ("curve", "broken", "time"),
    [
        ([9, 9, 9, 9, 9, 9], False, 5.0),
        ([9, 9, 9, 0, 0, 0], True, 3.0),  # windows of 18, 18, 9, 0, 0 against 10: the third has its middle at 3
        ([9, 9, 9, 9, 9, 0], True, 5.0),  # 18, 18, 18, 18, 9: only the last window is below
        ([9, 0, 0, 9, 9, 9], False, 5.0),  # 9, 0, 9, 18, 18: a jam that dissolves
        ([0, 0, 9, 9, 0, 0], True, 4.0),  # 0, 9, 18, 9, 0: of two spells the last counts
        ([4, 4, 4, 4, 4, 4], True, 0.0),  # from the start
        ([5, 5, 5, 5, 5, 5], False, 5.0),  # exactly half is not below
    ],
)
def test_the_rule_by_hand(curve, broken, time):
    found = find_breakdowns([curve], 10.0, window=2)
    assert (found.broken.tolist(), found.time.tolist()) == ([broken], [time])


def test_the_time_of_a_sudden_end_is_right_within_an_interval():
    for last in range(6, 34):
        curve = np.where(np.arange(40) < last, 10.0, 0.0)
        found = find_breakdowns(curve, 10.0, window=6, interval_s=200.0)
        assert found.broken.all()
        assert abs(found.time[0] - 200.0 * last) <= 200.0


def test_nobody_delivers_at_the_start_and_that_is_no_breakdown():
    reference = [[0, 0, 10, 10], [0, 0, 12, 8]]
    assert not find_breakdowns([[0, 0, 9, 9], [0, 0, 10, 11]], reference, window=2).broken.any()
    assert find_breakdowns([[0, 0, 9, 0]], reference, window=1).broken.tolist() == [True]


def test_runs_with_nan_cannot_be_judged():
    found = find_breakdowns([[1.0, math.nan], [0.0, 0.0], [9.0, 9.0]], 10.0, window=1)
    assert found.broken.tolist() == [False, True, False]
    assert np.isnan(found.time).tolist() == [True, False, False]
    assert breakdown_probability(found).value == 0.5
    assert time_to_breakdown(found).median.n_runs == 2


# statsmodels 0.15.0: proportion_confint(k, n, alpha, method="wilson" and "beta").
@pytest.mark.parametrize(
    ("k", "n", "level", "wilson", "clopper_pearson"),
    [
        (0, 8, 0.95, (0.0, 0.3244075649), (0.0, 0.3694166476)),
        (3, 8, 0.95, (0.1368442858, 0.6942576054), (0.0852334141, 0.7551367836)),
        (8, 8, 0.95, (0.6755924351, 1.0), (0.6305833524, 1.0)),
        (20, 96, 0.90, (0.1486175615, 0.2840384166), (0.1425497882, 0.2881542438)),
    ],
)
def test_intervals_of_a_share_are_those_of_statsmodels(k, n, level, wilson, clopper_pearson):
    cell = observed([True] * k + [False] * (n - k), [1.0] * n)
    found = breakdown_probability(cell, level=level)
    assert (found.value, found.n_runs) == (k / n, n)
    assert (found.lower, found.upper) == pytest.approx(wilson, abs=1e-9)
    exact = breakdown_probability(cell, method="clopper_pearson", level=level)
    assert (exact.lower, exact.upper) == pytest.approx(clopper_pearson, abs=1e-9)


def test_survival_is_that_of_lifelines():
    found = time_to_breakdown(observed(BROKEN, TIMES))
    assert found.times.tolist() == [2.0, 3.0, 5.0, 8.0]
    assert found.surviving == pytest.approx([0.9, 0.8, 0.571429, 0.428571], abs=1e-6)
    assert found.lower == pytest.approx([0.473009, 0.408691, 0.217193, 0.114042], abs=1e-6)
    assert found.upper == pytest.approx([0.985281, 0.945873, 0.814572, 0.718453], abs=1e-6)
    assert (found.median.value, found.median.lower, found.median.upper) == (8.0, 2.0, math.inf)


def test_survival_where_every_run_breaks_down():
    # lifelines: median 5, interval 1 to 8; at the last time nothing survives, bounds 0.
    found = time_to_breakdown(observed([True] * 10, [1.0, 2, 3, 4, 5, 6, 7, 8, 9, 9]))
    assert found.surviving == pytest.approx([0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.0])
    assert found.lower[-2:] == pytest.approx([0.030909, 0.0], abs=1e-6)
    assert found.upper[-2:] == pytest.approx([0.474715, 0.0], abs=1e-6)
    assert (found.median.value, found.median.lower, found.median.upper) == (5.0, 1.0, 8.0)


def test_survival_where_no_run_breaks_down():
    found = time_to_breakdown(observed([False] * 4, [5.0] * 4))
    assert found.times.size == found.surviving.size == 0
    assert found.median.value == math.inf


def test_leaving_out_runs_that_hold_would_make_breakdowns_look_early():
    """Exponential times with mean 10, observed until 8: their median is 10 ln 2 = 6.9."""
    time = np.random.default_rng(1).exponential(10.0, 4000)
    found = time_to_breakdown(observed(time < 8.0, np.minimum(time, 8.0)))
    assert found.median.value == pytest.approx(10.0 * math.log(2.0), rel=0.05)
    assert found.median.holds(10.0 * math.log(2.0))
    assert np.median(time[time < 8.0]) < 4.0


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        (([[1.0, 2.0]], [[1.0, 2.0, 3.0]]), {"window": 1}, "reference of the same T"),
        (([[1.0, 2.0]], 1.0), {"window": 3}, "window of 1 to 2 intervals"),
        (([[1.0, 2.0]], 0.0), {"window": 1}, "reference that achieves something"),
        (([[1.0, 2.0]], [[1.0, math.nan]]), {"window": 1}, "reference that achieves something"),
        (([[1.0, 2.0]], 1.0), {"window": 1, "share": 1.0}, "share of the reference"),
        (([[1.0, 2.0]], 1.0), {"window": 1, "interval_s": 0.0}, "interval of more than 0 s"),
        (([[-1.0, 2.0]], 1.0), {"window": 1}, "Expected perf >= 0"),
    ],
)
def test_nonsense_is_refused(arguments, options, message):
    with pytest.raises(ValueError, match=message):
        find_breakdowns(*arguments, **options)


def test_a_cell_without_runs_that_can_be_judged_is_refused():
    unknown = observed([False], [math.nan])
    for function in (breakdown_probability, time_to_breakdown):
        with pytest.raises(CurveError, match="at least one run that can be judged"):
            function(unknown)
    with pytest.raises(ValueError, match="method"):
        breakdown_probability(observed([True], [1.0]), method="wald")
