"""Spatial and task-based self-organisation, by hand."""

import numpy as np
import pytest

from metrics import (
    CurveError,
    interference_gain,
    spatial_emergence,
    task_emergence,
    time_emergence,
    undisturbed_gain,
)

CROWDING = {1: (1.0, 0.1), 2: (1.8, 0.2), 4: (3.2, 0.3)}
"""Swarm size -> performance and interference fraction in one interval."""


def spatial(n1, n2, **options):
    (perf1, lost1), (perf2, lost2) = CROWDING[n1], CROWDING[n2]
    return spatial_emergence([perf1], [lost1], n1, [perf2], [lost2], n2, [1.0], [0.1], **options)


def independent(n1, n2, fraction=0.1, **options):
    lost = [fraction, fraction]
    return spatial_emergence([n1, n1], lost, n1, [n2, n2], lost, n2, [1, 1], lost, **options)


@pytest.mark.parametrize(("n1", "n2"), [(1, 2), (1, 4), (2, 4), (4, 32)])
def test_independent_robots_are_not_organised(n1, n2):
    assert independent(n1, n2) == pytest.approx(0.0, abs=1e-12)
    assert task_emergence([n1, n1], n1, [n2, n2], n2) == pytest.approx(0.0, abs=1e-12)


def test_the_print_counts_the_walls_of_a_lone_robot_as_organisation():
    assert independent(1, 2, variant="paper") == pytest.approx(0.4, abs=1e-9)
    assert independent(2, 4, variant="paper") == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("variant", ["paper", "corrected"])
def test_crowding_swarm(variant):
    assert spatial(2, 4, variant=variant) == pytest.approx(-0.24, abs=1e-9)
    assert task_emergence([1.8], 2, [3.2], 4) == pytest.approx(-0.4, abs=1e-9)


def test_corrected_form_drops_the_loss_of_a_lone_robot_only_where_it_stands_alone():
    assert spatial(1, 4) == pytest.approx(-0.56, abs=1e-9)
    assert spatial(1, 4, variant="paper") == pytest.approx(4 * 0.1 - 0.56, abs=1e-9)


@pytest.mark.parametrize("variant", ["paper", "corrected"])
def test_one_robot_drops_out_between_larger_swarms(variant):
    twelve, fifty = ([30.0, 25.0], [0.1, 0.2], 12), ([90.0, 70.0], [0.3, 0.25], 50)
    one = ([2.0, 3.0], [0.05, 0.1])
    with_one = spatial_emergence(*twelve, *fifty, *one, variant=variant)
    without = spatial_emergence(*twelve, *fifty, None, None, variant=variant)
    assert without == pytest.approx(float(with_one), rel=1e-12)
    assert without == pytest.approx(50 / 12 * (3.0 + 5.0) - (27.0 + 17.5))


@pytest.mark.parametrize(("n1", "variant"), [(1, "paper"), (1, "corrected")])
def test_elsewhere_one_robot_is_needed(n1, variant):
    with pytest.raises(CurveError, match="perf_one"):
        spatial_emergence([1.0], [0.1], n1, [2.0], [0.1], 50, None, None, variant=variant)


def test_a_nan_in_an_early_interval_spoils_the_last_value_too():
    value = spatial_emergence([np.nan, 1.8], [0.2] * 2, 2, [3.2] * 2, [0.3] * 2, 4, [1.0] * 2, [0.1] * 2, reduce="last")
    assert np.isnan(value)
    assert np.isnan(task_emergence([1.0, 2.0], 1, [np.nan, 4.0], 2, reduce="last"))


def test_reductions():
    perf1, perf2 = [1.0, 2.0, 3.0], [3.0, 5.0, 10.0]  # gains 1, 1, 4
    gains = {"sum": 6.0, "mean": 2.0, "last": 4.0, "total": 6.0}
    for reduce, expected in gains.items():
        assert task_emergence(perf1, 1, perf2, 2, reduce=reduce) == pytest.approx(expected, abs=1e-12)
    calm, busy = [0.0] * 3, [0.1, 0.2, 0.5]  # losses of the larger swarm 0.3, 1, 5
    losses = {"sum": -6.3, "mean": -2.1, "last": -5.0, "total": -6.3}
    for reduce, expected in losses.items():
        value = spatial_emergence(perf1, calm, 2, perf2, busy, 4, perf1, calm, reduce=reduce)
        assert value == pytest.approx(expected, abs=1e-12)


def test_relative_gain_does_not_depend_on_the_unit():
    perf1, perf2 = np.array([1.0, 2.0]), np.array([3.0, 5.0])
    assert task_emergence(perf1, 1, perf2, 2, relative=True) == pytest.approx(2.0 / 8.0, abs=1e-12)
    assert task_emergence(9 * perf1, 1, 9 * perf2, 2, relative=True) == pytest.approx(0.25, abs=1e-12)
    assert np.isnan(task_emergence([0.0], 1, [0.0], 2, relative=True))


COLLAPSE = ([8.0], [0.2], 2, [1.6], [0.6], 4)
"""A swarm that delivers a fifth when its size doubles, and whose robots lose three times the time; no walls."""


def test_a_collapse_counts_as_spatial_organisation_and_not_in_robot_time():
    perf1, lost1, n1, _, lost2, n2 = COLLAPSE
    e_s = spatial_emergence(*COLLAPSE, [5.0], [0.0])
    assert e_s == pytest.approx(2 * (8.0 * 0.2) - 1.6 * 0.6, abs=1e-12)
    assert e_s == pytest.approx(2.24, abs=1e-12)
    assert spatial_emergence(perf1, lost1, n1, [0.0], lost2, n2, [5.0], [0.0]) > e_s  # nothing delivered: still better
    assert time_emergence(lost1, n1, lost2, n2) == pytest.approx(-1.6, abs=1e-12)


def test_time_emergence_of_the_crowding_swarm():
    lost = {n: [CROWDING[n][1]] for n in CROWDING}
    assert time_emergence(lost[2], 2, lost[4], 4) == pytest.approx(4 * (0.2 - 0.3), abs=1e-12)
    assert time_emergence(lost[1], 1, lost[4], 4) == pytest.approx(4 * (0.1 - 0.3), abs=1e-12)


def test_time_emergence_is_in_robots_whatever_the_length_of_the_run():
    calm, busy = [0.1, 0.2, 0.3], [0.2, 0.4, 0.3]
    values = {"mean": -4 * 0.1, "last": 0.0, "sum": -4 * 0.3}
    for reduce, expected in values.items():
        assert time_emergence(calm, 2, busy, 4, reduce=reduce) == pytest.approx(expected, abs=1e-12)
    assert time_emergence(calm * 5, 2, busy * 5, 4) == pytest.approx(-0.4, abs=1e-12)


def test_the_same_walls_at_both_sizes_cancel_in_robot_time():
    assert time_emergence([0.3], 2, [0.35], 4) == pytest.approx(time_emergence([0.1], 2, [0.15], 4), abs=1e-12)


def test_task_emergence_of_a_collapse_by_its_parts():
    """u1 = 8 / (2 * 0.8) = 5 and u2 = 1.6 / (4 * 0.4) = 1 objects per undisturbed robot."""
    assert interference_gain(*COLLAPSE) == pytest.approx(4 * (0.2 - 0.6) * 3.0, abs=1e-12)
    assert interference_gain(*COLLAPSE) == pytest.approx(-4.8, abs=1e-12)
    assert undisturbed_gain(*COLLAPSE) == pytest.approx(4 * (1.0 - 5.0) * 0.6, abs=1e-12)
    assert undisturbed_gain(*COLLAPSE) == pytest.approx(-9.6, abs=1e-12)
    assert task_emergence([8.0], 2, [1.6], 4) == pytest.approx(-14.4, abs=1e-12)
    assert interference_gain(*COLLAPSE, relative=True) == pytest.approx(-4.8 / 1.6, abs=1e-12)
    assert undisturbed_gain(*COLLAPSE, relative=True) == pytest.approx(-9.6 / 1.6, abs=1e-12)


def test_scarce_objects_are_no_interference():
    """Twice the robots deliver the same few objects, and nobody is in anybody's way."""
    assert interference_gain([6.0], [0.1], 2, [6.0], [0.1], 4) == pytest.approx(0.0, abs=1e-12)
    assert undisturbed_gain([6.0], [0.1], 2, [6.0], [0.1], 4) == pytest.approx(-6.0, abs=1e-12)


def test_crowding_alone_leaves_the_work_of_undisturbed_robots_as_it_was():
    """Each robot delivers 10 objects per undisturbed run: 2 * 0.9 * 10 = 18 and 4 * 0.5 * 10 = 20."""
    assert interference_gain([18.0], [0.1], 2, [20.0], [0.5], 4) == pytest.approx(20.0 - 36.0, abs=1e-12)
    assert undisturbed_gain([18.0], [0.1], 2, [20.0], [0.5], 4) == pytest.approx(0.0, abs=1e-12)


def test_parts_are_those_of_the_whole_run():
    perf1, perf2, lost1, lost2 = [[2.0, 6.0]], [[1.6, 0.0]], [[0.4, 0.0]], [[0.2, 1.0]]
    assert interference_gain(perf1, lost1, 2, perf2, lost2, 4) == pytest.approx(-4.8, abs=1e-12)
    assert np.isnan(undisturbed_gain([1.0], [1.0], 2, [2.0], [0.5], 4))


def test_parts_and_robot_time_check_their_curves():
    with pytest.raises(CurveError, match="n1 < n2"):
        time_emergence([0.1], 4, [0.1], 4)
    with pytest.raises(CurveError, match="n1 < n2"):
        interference_gain([1.0], [0.1], 4, [1.0], [0.1], 2)
    with pytest.raises(CurveError, match="fraction of the robots"):
        undisturbed_gain([1.0], [0.1], 2, [1.0], [3.0], 4)
    with pytest.raises(CurveError, match="fraction of the robots"):
        time_emergence([0.1], 2, [3.0], 4)
