"""Spatial and task-based self-organisation, by hand."""

import numpy as np
import pytest

from metrics import spatial_emergence, task_emergence

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


def test_crowding_swarm_with_counts():
    assert spatial(2, 4, t_lost_as="count") == pytest.approx(-2.4, abs=1e-9)


def test_corrected_form_drops_the_loss_of_a_lone_robot_only_where_it_stands_alone():
    assert spatial(1, 4) == pytest.approx(-0.56, abs=1e-9)
    assert spatial(1, 4, variant="paper") == pytest.approx(4 * 0.1 - 0.56, abs=1e-9)


def test_program_finds_organisation_where_the_print_finds_none():
    assert spatial(2, 4, variant="sierra") == pytest.approx(2 * 0.14444444 - 0.26875, abs=1e-15)
    assert spatial(2, 4, variant="sierra") == pytest.approx(0.02013888, abs=1e-9)
    assert spatial(1, 4, variant="sierra") == pytest.approx(-0.26875, abs=1e-9)  # the interactive form


@pytest.mark.parametrize(("n1", "n2"), [(1, 2), (2, 4), (16, 64)])
def test_programs_value_for_independent_robots(n1, n2):
    fraction = 0.3
    expected = fraction * ((n2 / n1) * (1 - 1 / n1) - (1 - 1 / n2))
    assert independent(n1, n2, fraction, variant="sierra") == pytest.approx(expected, abs=1e-7)


def test_program_takes_any_order_and_is_zero_for_one_robot():
    assert spatial(4, 2, variant="sierra") == pytest.approx(0.5 * 0.26875 - 0.14444444, abs=1e-12)
    assert spatial(4, 4, variant="sierra") == 0.0
    assert spatial(4, 1, variant="sierra") == 0.0


def test_program_reads_the_last_interval():
    first, last = ([9.0, 1.8], [0.9, 0.2]), ([1.0, 3.2], [0.0, 0.3])
    for options in ({}, {"reduce": "last"}):
        value = spatial_emergence(*first, 2, *last, 4, [7.0, 1.0], [0.7, 0.1], variant="sierra", **options)
        assert value == spatial(2, 4, variant="sierra")
    with pytest.raises(ValueError, match="last interval"):
        spatial_emergence(*first, 2, *last, 4, [7.0, 1.0], [0.7, 0.1], variant="sierra", reduce="mean")


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
