"""Which policy is better, and whether the difference is significant: pairing, families of tests, what is shown."""

import math
from dataclasses import replace

import numpy as np
import pytest

from metrics import CurveError, aggregate, compare_tables
from metrics.scoring.score_tables import Comparison, ScoreTable
from metrics.scoring.scores import Score
from metrics.significance import holm, paired_p

NAN = math.nan


def score(values, *, measure="raw_performance", at="N = 4", relative=None) -> Score:
    per_seed = dict(enumerate(values)) if isinstance(values, list) else values
    return Score(
        measure=measure,
        at=at,
        criterion="population_size",
        x=4.0,
        n_robots=(4,),
        unit="objects",
        summary=aggregate(list(per_seed.values())),
        per_seed=per_seed,
        relative_per_seed=dict(enumerate(relative or [])),
    )


def compared(**tables) -> Comparison:
    return compare_tables(
        [
            ScoreTable(policy=name, scenario="", scores=tuple(scores) if isinstance(scores, list) else (scores,))
            for name, scores in tables.items()
        ]
    )


def test_rounding_does_not_make_equal_differences_significant():
    """6/50 - 5/50 and 5/50 - 4/50 differ in the last bit, which is no spread that a test could trust."""
    differences = np.array([6 / 50 - 5 / 50, 5 / 50 - 4 / 50, 3 / 50 - 2 / 50])
    assert differences.std(ddof=1) > 0.0
    assert paired_p(differences) == 0.25
    (difference,) = compared(a=score([6 / 50, 5 / 50, 3 / 50]), b=score([5 / 50, 4 / 50, 2 / 50])).differences
    assert not difference.is_significant
    assert difference.cell() == "0.02 ± 0"


def test_differences_pair_runs_by_seed():
    (difference,) = compared(a=score({0: 5.0, 1: 7.0, 3: 9.0}), b=score({1: 4.0, 0: 3.0, 2: 100.0})).differences
    assert difference.summary.mean == pytest.approx(2.5)
    assert difference.summary.n_used == 2


@pytest.mark.parametrize(("measure", "better"), [("raw_performance", "a"), ("adaptability", "b"), ("scalability", "a")])
def test_the_better_policy_is_named_by_the_direction_of_the_measure(measure, better):
    high, low = [10.0, 11.0, 10.5, 10.2], [1.0, 1.2, 0.9, 1.1]
    (difference,) = compared(a=score(high, measure=measure), b=score(low, measure=measure)).differences
    assert difference.is_significant
    assert difference.better == better
    assert difference.cell().endswith(" *")


def test_a_difference_within_the_noise_is_not_significant():
    (difference,) = compared(a=score([1.0, 2.0, 3.0]), b=score([2.0, 1.0, 3.5])).differences
    assert not difference.is_significant
    assert difference.better == ""
    assert "*" not in difference.cell()


def test_the_correction_is_over_levels_and_pairs_of_a_measure_and_nothing_else():
    rng = np.random.default_rng(1)
    levels = {name: [rng.normal(size=6).tolist() for _ in range(2)] for name in "abc"}
    tables = {
        name: [
            score(runs[0], at="N = 2"),
            score(runs[1], at="N = 4"),
            score(runs[0], measure="scalability"),
        ]
        for name, runs in levels.items()
    }
    found = compared(**tables).differences
    raw = [d for d in found if d.measure == "raw_performance"]
    assert len(raw) == 6
    np.testing.assert_allclose([d.p_holm for d in raw], holm(np.array([d.p for d in raw])))
    other = [d for d in found if d.measure == "scalability"]
    np.testing.assert_allclose([d.p_holm for d in other], holm(np.array([d.p for d in other])))


def test_nobody_is_better_by_a_difference_that_the_correction_takes_away():
    clear, nothing = [1.0, 1.6, 0.4, 1.2], [0.1, -0.1, 0.2, -0.2]
    zero = [0.0] * 4
    found = compared(
        a=[score(clear), *(score(nothing, at=f"N = {n}") for n in range(5, 9))],
        b=[score(zero), *(score(zero, at=f"N = {n}") for n in range(5, 9))],
    ).differences
    assert found[0].p <= 0.05 < found[0].p_holm
    assert (found[0].better, found[0].is_significant) == ("", False)


def test_relative_values_are_tested_on_their_own():
    high, low = [10.0, 11.0, 12.0], [1.0, 2.2, 2.9]
    comparison = compared(
        a=score(high, measure="adaptability", relative=[0.5, 0.6, 0.4]),
        b=score(low, measure="adaptability", relative=[0.4, 0.6, 0.5]),
    )
    (row,) = comparison.rows()
    assert comparison.difference(("a", "b"), row).is_significant
    assert not comparison.difference(("a", "b"), row, is_relative=True).is_significant
    assert [line[0] for line in comparison.difference_rows()] == ["measure", "adaptability", "adaptability, relative"]


def test_undefined_runs_do_not_count_and_infinite_ones_forbid_the_test():
    (difference,) = compared(a=score([1.0, NAN, 3.0]), b=score([0.0, 1.0, 1.5])).differences
    assert difference.summary.n_used == 2
    (difference,) = compared(a=score([1.0, -math.inf]), b=score([0.0, 1.0])).differences
    assert math.isnan(difference.p)
    assert not difference.is_significant


def test_rows_that_only_one_policy_has_are_shown_and_not_compared():
    comparison = compared(a=[score([1.0, 2.0]), score([1.0, 2.0], at="N = 9")], b=score([1.0, 2.0]))
    assert [line[1:] for line in comparison.value_rows()][2][-1] == "-"
    assert len(comparison.differences) == 1
    assert len(comparison.difference_rows()) == 2


def test_notes_of_all_policies_are_told_once():
    tables = [
        ScoreTable(policy=name, scenario="", scores=(score([1.0]),), missing={"reactivity": "x"}, failures=failures)
        for name, failures in (("a", ()), ("b", ("run 7",)))
    ]
    assert compare_tables(tables).notes() == ("reactivity is not computed: x", "b: failed: run 7")


@pytest.mark.parametrize("names", [["a"], ["a", "a"], []])
def test_policies_need_different_names(names):
    with pytest.raises(CurveError, match="two or more policies"):
        compare_tables([ScoreTable(policy=name, scenario="", scores=()) for name in names])


def test_false_alarms_are_as_rare_as_promised():
    """Three equal policies at two levels: any significant difference in at most 5 % of studies, up to chance."""
    rng = np.random.default_rng(3)
    alarms = 0
    for _ in range(400):
        tables = {name: [score(rng.normal(size=5).tolist(), at=at) for at in "xy"] for name in "abc"}
        alarms += any(difference.is_significant for difference in compared(**tables).differences)
    assert alarms <= 32  # 20 expected at most; 32 is exceeded by chance in 0.4 % of such tests


def test_noise_floors_stand_below_the_values_and_doubt_beside_them():
    doubtful = replace(score([1.0, 2.0], measure="spatial_emergence"), is_doubtful=True)
    distance = replace(score([3.0, 5.0], measure="adaptability"), noise_floor=1.5, relative_floor=0.25)
    comparison = compared(a=[doubtful, distance], b=[score([1.0, 2.0], measure="spatial_emergence"), score([1.0])])
    lines = [line[0] for line in comparison.value_rows()]
    assert lines == ["measure", "spatial_emergence", "adaptability", "adaptability, noise floor", "raw_performance"]
    values = {line[0]: line[3:] for line in comparison.value_rows()}
    assert values["adaptability, noise floor"] == ("1.5 (25 %)", "-")
    assert [cell.endswith(" ?") for cell in values["spatial_emergence"]] == [True, False]
    assert "? = misleads" in str(comparison)


def test_bands_stand_in_square_brackets_on_request():
    comparison = compared(a=score([1.0, 3.0]), b=score([2.0, 2.0]))
    std = math.sqrt(2.0)
    banded = replace(comparison, tables=tuple(replace(table, band=True) for table in comparison.tables))
    assert banded.value_rows()[1][-2].endswith(f"[{2 - 2 * std:.4g} to {2 + 2 * std:.4g}]")
    assert "two standard deviations" in str(banded)
    assert "two standard deviations" not in str(comparison)


def test_variants_are_compared_and_corrected_apart():
    tables = {
        name: [score(values), replace(score([x + 1.0 for x in values]), variant="sierra")]
        for name, values in {"a": [1.0, 2.0, 4.0], "b": [1.5, 2.5, 3.0]}.items()
    }
    found = compared(**tables).differences
    assert [difference.label for difference in found] == ["raw_performance", "raw_performance, sierra"]
    assert [difference.p for difference in found] == [difference.p_holm for difference in found]
