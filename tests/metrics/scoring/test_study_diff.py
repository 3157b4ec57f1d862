"""Two studies held against each other: bits, conditions, lines."""

import math

import numpy as np
import polars as pl
import pytest
from scipy import stats

from metrics import CurveError
from metrics.scoring import diff
from swarm_forage_env.studies.study import Axis
from swarm_forage_env.studies.study_table import StudyTable
from tests.support.made_tables import made_study, made_table

PERFORMANCE = ("performance",)


def steady(place):
    return 10.0 * place.values[-1]


def noisy(spec, *, of=1, shift=0.0, where=lambda place: True, lost=()):
    """A study whose runs scatter by a tenth, on their own for each `of`; conditions `where` are shifted by a share."""
    table = made_table(spec, steady, lost=lost)
    rng = np.random.default_rng(of)
    factors = {
        (number, seed): (1.0 + 0.1 * rng.normal()) * (1.0 + shift * where(place))
        for number, place in enumerate(spec.places)
        for seed in spec.seeds
    }
    frame = table.frame.with_columns(
        performance=pl.Series(
            None if value is None else value * factors[place, seed]
            for value, place, seed in table.frame.select("performance", "cell", "seed").iter_rows()
        )
    )
    return StudyTable(spec=spec, frame=frame, versions=table.versions)


def test_the_same_runs_are_identical_and_need_no_test():
    table = noisy(made_study())
    found = diff(table, table, PERFORMANCE)
    assert {place.state for place in found.places} == {"identical"}
    assert {place.n_identical for place in found.places} == {6}
    assert (found.shifts, found.differs, found.settings) == ((), False, ())


def test_other_runs_of_the_same_science_are_alike():
    found = diff(noisy(made_study()), noisy(made_study(), of=2), PERFORMANCE)
    assert {place.state for place in found.places} == {"alike"}
    assert not found.differs


def test_a_place_that_changed_is_found_and_the_others_are_not():
    spec = made_study(seeds=tuple(range(12)))
    changed = spec.places[4]
    found = diff(noisy(spec), noisy(spec, of=2, shift=0.5, where=lambda place: place == changed), PERFORMANCE)
    assert [place.place for place in found.places if place.state == "different"] == [changed]
    (shift,) = (shift for place in found.places for shift in place.shifts if shift.is_significant)
    assert shift.words == found.places[4].words == ("described", "dpo", "2")
    assert shift.lower < 10.0 < shift.upper, "half of 20"
    assert found.differs


def test_a_small_change_everywhere_is_found_in_a_line_only():
    axis = Axis(name="population_size", values=tuple(range(1, 13)))
    spec = made_study("S1a", axis)
    found = diff(noisy(spec), noisy(spec, of=2, shift=0.1, where=lambda place: place.policy == "dpo"), PERFORMANCE)
    assert found.count("different") == 0
    (line,) = (line for line in found.lines if line.is_significant)
    assert (line.words, line.column) == (("described", "dpo"), "performance")
    assert line.lower < 0.1 < line.upper
    assert found.differs


def test_the_same_seeds_are_paired_and_others_are_not():
    spec = made_study()
    table, other = noisy(spec), noisy(spec, of=2)
    place = spec.places[0]
    a, b = (t.curves(place, "performance")[1]["performance"].mean(axis=1) for t in (table, other))
    paired = diff(table, other, PERFORMANCE).places[0].shifts[0]
    assert paired.is_paired
    assert paired.p == pytest.approx(stats.ttest_rel(b, a).pvalue)
    late = noisy(made_study(seeds=tuple(range(6, 11))), of=2)
    c = late.curves(place, "performance")[1]["performance"].mean(axis=1)
    welch = diff(table, late, PERFORMANCE).places[0].shifts[0]
    expected = stats.ttest_ind(c, a, equal_var=False)
    assert (welch.is_paired, welch.n_first, welch.n_second) == (False, 6, 5)
    assert welch.p == pytest.approx(expected.pvalue)
    assert [welch.lower, welch.upper] == pytest.approx([*expected.confidence_interval()])


def test_single_runs_with_other_bits_leave_it_open():
    spec = made_study(seeds=(3,))
    found = diff(noisy(spec), noisy(spec, of=2), PERFORMANCE)
    assert {place.state for place in found.places} == {"open"}
    assert found.differs, "nobody can say that they are alike"
    assert all(math.isnan(shift.p) for shift in found.shifts)
    assert found.to_mapping()["conditions"][0]["shifts"][0]["p"] is None


def test_a_line_is_of_the_places_that_can_be_tested_and_of_identical_ones():
    """A condition of one run, or without the column, says nothing; it does not make the line look smaller."""
    axis = Axis(name="population_size", values=(1, 2, 4, 8))
    spec = made_study("S1a", axis)
    single, same = {1, 2}, {4}
    lost = {(place, seed) for place in spec.places for seed in spec.seeds if place.values[-1] in single and seed}
    before = made_table(spec, steady, lost=lost)
    after = made_table(spec, lambda place: steady(place) * (1.0 if place.values[-1] in same else 1.2), lost=lost)
    found = diff(before, after, PERFORMANCE)
    assert [place.state for place in found.places[:4]] == ["open", "open", "identical", "different"]
    assert found.lines[0].difference == pytest.approx(0.5 * 0.2 / 1.1), "half of the two conditions that count"


def test_other_bits_without_a_column_to_test_are_open():
    spec = made_study()
    tables = []
    for pickups in (1.0, 2.0):
        table = noisy(spec)
        first = pl.col("cell") == 0
        frame = table.frame.with_columns(
            cache_pickups=pl.when(~first).then(3.0), n_active=pl.when(first).then(pickups).otherwise(4.0)
        )
        tables.append(StudyTable(spec=spec, frame=frame, versions=table.versions))
    found = diff(*tables, ("cache_pickups",))
    assert [place.state for place in found.places] == ["open"] + ["identical"] * (len(found.places) - 1)
    assert found.differs


def test_columns_without_any_scatter_are_told_apart_too():
    table = made_table(made_study(), steady)
    frame = table.frame.with_columns(n_active=pl.col("n_active") + 1.0)
    other = StudyTable(spec=table.spec, frame=frame, versions=table.versions)
    found = diff(table, other, ("n_active", "performance"))
    by_column = {shift.column: shift for shift in found.places[0].shifts}
    assert by_column["n_active"].p == 2.0**-5
    assert by_column["performance"].p == 1.0


def test_what_is_not_compared_is_told():
    small, large = made_study(), made_study("S1a", Axis(name="population_size", values=(1, 2, 8)))
    lost = {(small.places[0], seed) for seed in small.seeds}
    found = diff(noisy(small, lost=lost), noisy(large), PERFORMANCE)
    reasons = {one.place.values[-1]: one.why for one in found.lacking if one.place.policy == "crw"}
    assert reasons == {
        1: "the first study has no finished run of it",
        4: "the second study does not have it",
        8: "the first study does not have it",
    }
    assert len(found.places) == 7


@pytest.mark.parametrize("sizes", [(1, 2), (1, 2, 4, 8)])
def test_a_place_that_one_study_lacks_is_a_difference(sizes):
    """One condition of a hundred says nothing about the others."""
    whole = made_study()
    part = made_study("S1a", Axis(name="population_size", values=sizes))
    found = diff(made_table(whole, steady), made_table(part, steady), PERFORMANCE)
    assert {place.state for place in found.places} == {"identical"}
    assert len(found.lacking) == 4
    assert found.differs


def test_a_place_that_neither_study_has_run_is_not_compared():
    spec = made_study()
    table = noisy(spec, lost={(spec.places[0], seed) for seed in spec.seeds})
    found = diff(table, table, PERFORMANCE)
    assert [(one.place, one.why) for one in found.lacking] == [
        (spec.places[0], "neither study has a finished run of it")
    ]
    assert found.differs


def test_two_places_do_not_look_alike():
    """Not even if one is of the first study, the other of the second."""
    a, b = (made_study("S1e", Axis(name="noise", values=(0.0, value))) for value in (0.03 / 7, 0.00428571))
    found = diff(made_table(a, lambda place: 1.0), made_table(b, lambda place: 1.0), PERFORMANCE)
    assert [one["place"][2] for one in found.to_mapping()["lacking"] if one["place"][1] == "crw"] == [
        "0.004285714285714286",
        "0.00428571",
    ]


def test_settings_and_versions_that_differ_are_told():
    first = noisy(made_study())
    other = noisy(made_study(settings={"n_objects": 30}))
    other = StudyTable(spec=other.spec, frame=other.frame, versions=({"numpy": "3.0"},))
    assert diff(first, other, PERFORMANCE).settings == ("settings: n_objects 20 and 30", "versions: numpy")


@pytest.mark.parametrize(
    ("changes", "columns", "message"),
    [
        ({"horizon_s": 80.0}, PERFORMANCE, "the same horizon_s, got 40 and 80"),
        (
            {"axes": (Axis(name="noise", values=(0.0, 0.1)),)},
            PERFORMANCE,
            "the same axes, got population_size and noise",
        ),
        ({"rules": ("program",)}, PERFORMANCE, "got none that both have"),
        ({}, ("speed",), "got 'speed'"),
    ],
)
def test_what_cannot_be_compared_is_refused(changes, columns, message):
    other = made_study(**changes)
    with pytest.raises(CurveError, match=message):
        diff(noisy(made_study()), made_table(other, steady), columns)
