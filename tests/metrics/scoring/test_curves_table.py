"""Tables of runs become arrays: where each row goes, and which runs are paired."""

import numpy as np
import polars as pl
import pytest

from metrics import CurveError, PopulationRates
from metrics.scoring.curves_file import study_curves
from metrics.scoring.run_curves import common_runs
from tests.support.curve_tables import rows, table


def only(frame):
    (study,) = study_curves(frame)
    return study


def test_runs_become_rows_and_intervals_columns():
    study = only(table(rows(3, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], first_seed=7)))
    (runs,) = study.experiments
    assert (runs.criterion, runs.n_robots, runs.seeds) == ("population_size", 3, (7, 8))
    np.testing.assert_array_equal(runs.performance, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    assert runs.performance.dtype == np.float64


def test_rows_of_an_experiment_may_come_in_any_order():
    frame = table(rows(3, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))
    mixed = only(frame.sample(fraction=1.0, shuffle=True, seed=1))
    np.testing.assert_array_equal(mixed.experiments[0].performance, only(frame).experiments[0].performance)


def test_experiments_are_told_apart_by_criterion_value_and_size():
    frame = table(
        rows(1, [[1.0]], criterion="population_size", criterion_value=1.0),
        rows(5, [[2.0]], criterion="population_size", criterion_value=5.0),
        rows(5, [[3.0]], criterion="none", criterion_value=0.0),
        rows(5, [[4.0]], criterion="noise", criterion_value=0.1),
        rows(5, [[5.0]], criterion="noise", criterion_value=0.2),
    )
    study = only(frame)
    assert [float(e.performance[0, 0]) for e in study.experiments] == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert [size.n_robots for size in study.sizes()] == [1, 5]
    assert [(ref.criterion, level.value) for ref, level in study.levels("noise")] == [("none", 0.1), ("none", 0.2)]


def test_an_own_reference_goes_before_the_shared_one():
    frame = table(
        rows(5, [[3.0]], criterion="none", criterion_value=0.0),
        rows(5, [[2.0]], criterion="throttle", criterion_value=0.0),
        rows(5, [[4.0]], criterion="throttle", criterion_value=0.4),
    )
    ((reference, level),) = only(frame).levels("throttle")
    assert (reference.criterion, reference.value, level.value) == ("throttle", 0.0, 0.4)


def test_a_reference_has_the_same_swarm_size():
    frame = table(
        rows(5, [[3.0]], criterion="none", criterion_value=0.0),
        rows(9, [[4.0]], criterion="noise", criterion_value=0.4),
    )
    with pytest.raises(CurveError, match=r"reference run for noise 0\.4, N = 9"):
        only(frame).levels("noise")


def test_one_study_per_policy():
    frame = table(rows(1, [[1.0]], controller="a"), rows(1, [[2.0]], controller="b"))
    assert [study.controller for study in study_curves(frame)] == ["a", "b"]
    assert study_curves(table(rows(1, [[1.0]])), controller="mine")[0].controller == "mine"


def test_further_columns_are_ignored_and_whole_numbers_may_be_written_as_decimals():
    frame = table(rows(2, [[1.0]], comment="nice")).with_columns(pl.col("seed").cast(pl.Float64))
    runs = only(frame).experiments[0]
    assert runs.seeds == (0,)
    assert runs.curves.keys() == {"performance"}


def test_columns_of_some_experiments_are_there_for_those_only():
    frame = table(
        rows(2, [[1.0, 2.0]], criterion="none", criterion_value=0.0),
        rows(2, [[1.0, 2.0]], criterion="throttle", criterion_value=0.2, adversity=[0.0, 0.4]),
    )
    undisturbed, throttled = only(frame).experiments
    assert "adversity" not in undisturbed.curves
    np.testing.assert_array_equal(throttled.curves["adversity"], [[0.0, 0.4]])


def test_rates_are_read_per_second():
    frame = table(rows(2, [[1.0]], criterion="population_dynamics", criterion_value=3.0, malfunctions_per_s=0.005))
    assert only(frame).experiments[0].rates == PopulationRates(lambda_bd=0.005)
    assert only(table(rows(2, [[1.0]]))).experiments[0].rates is None


def test_the_clock_is_that_of_all_runs():
    assert only(table(rows(2, [[1.0, 1.0]], t_end_s=[100.0, 200.0]))).horizon_s == 200.0
    assert only(table(rows(2, [[1.0, 1.0]]))).horizon_s is None


def test_runs_are_paired_by_their_number():
    first, second = only(
        table(rows(1, [[1.0], [2.0], [3.0]], first_seed=0), rows(2, [[20.0], [30.0], [40.0]], first_seed=1))
    ).experiments
    few, many = common_runs(first, second)
    assert few.seeds == many.seeds == (1, 2)
    np.testing.assert_array_equal(many.performance / few.performance, [[10.0], [10.0]])


def test_averaging_keeps_the_given_performance():
    runs = only(table(rows(2, [[1.0, 2.0], [3.0, 4.0]], adversity=[0.1, 0.3]))).experiments[0]
    mean = runs.averaged(np.array([9.0, 9.0]))
    np.testing.assert_array_equal(mean.performance, [9.0, 9.0])
    np.testing.assert_allclose(mean.curves["adversity"], [0.1, 0.3])
