"""Statements about figures in their three answers, by intervals and by bands."""

import math
from dataclasses import replace

import numpy as np
import pytest

from metrics import CurveError, Panel
from metrics.claims import orders, shapes
from metrics.claims import rules as general
from metrics.claims.panel import interval_of, order
from metrics.claims.rules import Outcome, all_of, most_of
from metrics.claims.words import ONSET, SIGMAS
from tests.support.panels import SIX, panel


def answers(predicate, *panels, **parameters):
    """By intervals and by bands."""
    return tuple(predicate(*panels, **parameters, rule=rule).answer for rule in ("intervals", "bands"))


BOTH = ("supported", "supported")
NEITHER = ("contradicted", "contradicted")
TIED = ("tie", "tie")
OPEN = ("undecided", "undecided")
AB = {"pairs": (("a", "b"),)}
UP = {"upper": ("a",), "lower": ("b", "c")}
LEAD = {"leader": "a", "others": ("b", "c")}


def test_orders_by_hand():
    scores = {"a": [[1.0, 1.2, 1.1, 0.9]] * 3, "b": [[3.0, 3.1, 3.2, 2.9], [1.0, 1.2, 1.1, 0.9], [1.0, 1.3, 0.7, 2.0]]}
    found = Panel(levels=[1, 2, 3], scores=scores)
    # Means 1.05 +- 0.065 and 3.05 +- 0.065; 1.05 each, so that Welch's t of six degrees reaches 0.18 to either side;
    # and 1.05 +- 0.065 and 1.25 +- 0.278, which leaves anything open.
    assert order(replace(found, margins=[0.2] * 3), AB["pairs"], "intervals")[0].tolist()[:2] == [-1.0, 0.0]
    assert np.isnan(order(replace(found, margins=[0.17] * 3), AB["pairs"], "intervals")[0][1:]).all()
    # Means 1.05 and 1.25 with standard deviations 0.129 and 0.557: 0.2 is less than twice their sum.
    assert order(found, AB["pairs"], "bands")[0].tolist() == [-1.0, 0.0, 0.0]


def test_a_difference_too_small_to_see_is_a_tie_however_significant():
    found = panel({"a": 1.0, "b": 1.05}, sd=0.001)
    assert (order(found, AB["pairs"], "intervals")[0] == 0.0).all()
    assert (order(found, AB["pairs"], "bands")[0] == -1.0).all()


def test_the_interval_of_a_difference_by_hand():
    # Means 2 and 0, their variances 20 / 3 / 4 each, 10 / 3 together; six degrees of freedom, Student's t 2.4469.
    some = np.array([-1.0, 1.0, 3.0, 5.0])
    lower, upper = interval_of(some, some - 2.0)
    assert (lower, upper) == pytest.approx((2.0 - 2.4469 * 1.82574, 2.0 + 2.4469 * 1.82574), abs=1e-3)
    # Against numbers without scatter, three degrees and 3.1824.
    lower, upper = interval_of(some, np.zeros(4))
    assert (lower, upper) == pytest.approx((2.0 - 3.1824 * 1.29099, 2.0 + 3.1824 * 1.29099), abs=1e-3)
    assert np.isnan(interval_of(some, some[:3])).all()


@pytest.mark.parametrize(("n_runs", "found"), [(4, [math.nan, math.nan]), (5, [math.nan, 0.0]), (6, [1.0, 0.0])])
def test_runs_without_scatter_decide_once_most_runs_surely_score_so(n_runs, found):
    # By chance all runs of one or the other lie on one side of its median: 2 / 2^5 = 6.25 %, 2 / 2^6 = 3.1 %. Ties are
    # tested at 10 %.
    equal = Panel(levels=[1, 2], scores={"a": np.ones((2, n_runs)), "b": [[0.0] * n_runs, [1.0] * n_runs]})
    np.testing.assert_equal(order(equal, AB["pairs"], "intervals")[0], found)
    assert interval_of(np.ones(6), np.zeros(6)) == (1.0, 1.0)
    assert np.isnan(interval_of(np.ones(6), np.zeros(6), 0.99)).all(), "an early look asks for more"


def test_one_wild_level_does_not_decide_whether_a_curve_is_constant():
    wild = np.where(SIX == 3.0, -4.0, 1.0)
    steep = np.where(SIX > 4.0, 2.0, 1.0)
    a = {"policies": ("a",)}
    assert answers(general.is_constant, panel({"a": wild}), **a) == BOTH
    assert answers(general.varies, panel({"a": wild}), **a) == NEITHER
    assert answers(general.is_constant, panel({"a": steep}), **a) == NEITHER, "two levels are no single wild one"
    few = panel({"a": [1.0, 1.0, 2.0]}, levels=[1.0, 2.0, 3.0])
    assert answers(general.is_constant, few, **a) == NEITHER, "of three levels all count"


def test_a_wild_level_that_scatters_widely_silences_no_others():
    made = panel({"a": 1.0, "b": 1.0}, n_runs=8)
    made.scores["a"][2] = np.linspace(-40.0, 30.0, 8)
    assert answers(general.is_constant, made, policies=("a",)) == BOTH


@pytest.mark.parametrize(
    ("statement", "curves", "options", "parameters", "expected"),
    [
        (general.ties, {"a": 1.0, "b": 1.0}, {}, AB, BOTH),
        (general.ties, {"a": 1.0, "b": 2.0}, {}, AB, NEITHER),
        (general.ties, {"a": 1.0, "b": 1.0}, {"sd": 1.0}, AB, ("undecided", "supported")),
        (general.differ, {"a": 1.0, "b": 2.0}, {}, AB, BOTH),
        (general.ties, {"a": [1, 1, 1, 2, 2, 2], "b": 1.0}, {}, {**AB, "levels": "low"}, BOTH),
        (general.ties, {"a": [1, 1, 1, 2, 2, 2], "b": 1.0}, {}, {**AB, "levels": "high"}, NEITHER),
        (general.ties, {"a": [1, 1, 1, 2, 2, 2], "b": 1.0}, {}, AB, OPEN),
        (general.is_higher, {"a": 3.0, "b": 2.0, "c": 1.0}, {}, UP, BOTH),
        (general.is_higher, {"a": 2.0, "b": 2.0, "c": 1.0}, {}, UP, TIED),
        (general.is_higher, {"a": [1, 1, 1, 2, 1, 2], "b": 1.0, "c": [2, 2, 1, 1, 2, 1]}, {}, UP, NEITHER),
        (general.is_higher, {"a": 2.0, "b": 1.9, "c": 1.0}, {"sd": 1.0}, UP, ("undecided", "tie")),
        (general.differ, {"a": 1.0, "b": 1.0}, {}, AB, TIED),
        (general.is_not_higher, {"a": 1.0, "b": 2.0}, {}, {"first": "a", "second": "b"}, BOTH),
        (general.is_not_higher, {"a": 1.0, "b": 1.0}, {}, {"first": "a", "second": "b"}, BOTH),
        (general.is_not_higher, {"a": 2.0, "b": 1.0}, {}, {"first": "a", "second": "b"}, NEITHER),
        (general.is_constant, {"a": 1.0}, {}, {"policies": ("a",)}, BOTH),
        (general.is_constant, {"a": SIX}, {}, {"policies": ("a",)}, NEITHER),
        (general.is_constant, {"a": 1.0}, {"sd": 0.4}, {"policies": ("a",)}, ("undecided", "supported")),
        (general.varies, {"a": SIX}, {}, {"policies": ("a",)}, BOTH),
        (general.is_narrow, {"a": 1.0}, {}, {"policies": ("a",)}, BOTH),
        (general.is_narrow, {"a": 1.0}, {"sd": 0.3}, {"policies": ("a",)}, NEITHER),
        (general.is_wide, {"a": 1.0}, {"sd": 0.3}, {"policies": ("a",)}, BOTH),
        (general.is_wide, {"a": 1.0}, {"sd": 0.07}, {"policies": ("a",)}, ("undecided", "contradicted")),
        (general.is_wider, {"a": 1.0, "b": 1.0}, {"sd": {"a": 0.3, "b": 0.1}}, {"upper": "a", "lower": "b"}, BOTH),
        (general.is_wider, {"a": 1.0, "b": 1.0}, {"sd": {"a": 0.1, "b": 0.3}}, {"upper": "a", "lower": "b"}, NEITHER),
        (general.reaches_higher, {"a": 1.0, "b": 1.0}, {"sd": {"a": 0.3, "b": 0.1}}, {"upper": "a", "lower": "b"},
         BOTH),
        (general.reaches_higher, {"a": 0.8, "b": 1.0}, {}, {"upper": "a", "lower": "b"}, NEITHER),
        (general.reaches_higher, {"a": 1.0, "b": 1.0}, {"sd": 0.05}, {"upper": "a", "lower": "b"}, OPEN),
        (general.is_wider, {"a": 1.0, "b": 1.0}, {"sd": 0.1}, {"upper": "a", "lower": "b"}, OPEN),
        (general.never_differ, {"a": 1.0, "b": 1.0}, {}, AB, BOTH),
        (general.never_differ, {"a": [1, 1, 1, 1, 1, 2], "b": 1.0}, {}, AB, NEITHER),
        (general.never_differ, {"a": 1.0, "b": 1.0}, {"sd": 1.0}, AB, ("undecided", "supported")),
        (general.leads_by_little, {"a": 1.0, "b": 0.92, "c": 0.5}, {}, LEAD, BOTH),
        (general.leads_by_little, {"a": 1.0, "b": 0.5, "c": 0.5}, {}, LEAD, NEITHER),
        (general.leads_by_little, {"a": 0.8, "b": 1.0, "c": 0.5}, {}, LEAD, NEITHER),
        (general.leads_by_little, {"a": 1.0, "b": 1.0, "c": 0.5}, {}, LEAD, OPEN),
        (shapes.is_linear, {"a": 2.0 * SIX}, {}, {"policies": ("a",)}, BOTH),
        (shapes.is_linear, {"a": -SIX}, {}, {"policies": ("a",)}, NEITHER),
        (shapes.is_linear, {"a": [0, 0, 0, 0, 0, 1]}, {}, {"policies": ("a",)}, NEITHER),
        (shapes.is_linear, {"a": SIX}, {"sd": 2.2}, {"policies": ("a",)}, OPEN),
    ],
)  # fmt: skip
def test_statements_in_their_three_answers(statement, curves, options, parameters, expected):
    assert answers(statement, panel(curves, **options), **parameters) == expected


@pytest.mark.parametrize(
    ("curve", "between", "sd", "expected"),
    [
        ([0, 0, 0, 1, 2, 3], (2.5, 4.0), 0.01, BOTH),  # bend at 3, first level apart is 4
        ([0, 0, 0, 1, 2, 3], (3.0, 4.0), 0.01, BOTH),  # bend at the lower edge, band apart at the upper edge
        ([0, 0, 0, 1, 2, 3], (5.0, 6.0), 0.01, NEITHER),
        ([0, 0, 0, 0, 0, 0.0], (2.5, 4.0), 0.0, NEITHER),  # no change at all
        ([1, 1, 1, 1.3, 1.6, 1.9], (2.5, 4.0), 1.0, ("undecided", "contradicted")),
        ([1, 1, 1, 1, 1, 1.0], (1.0, 6.0), 0.3, ("undecided", "contradicted")),  # a bend somewhere, if there is one
    ],
)
def test_where_a_curve_changes(curve, between, sd, expected):
    assert answers(shapes.changes_within, panel({"a": curve}, sd=sd), policies=("a",), between=between) == expected


@pytest.mark.parametrize("bend", range(2, 7))
@pytest.mark.parametrize("sigmas", [SIGMAS, 0.03 * np.arange(8) / 7, np.linspace(0.0, 0.03, 8)])
def test_a_change_at_the_edge_of_the_window_is_within_it(bend, sigmas):
    """Three to five sevenths of the largest noise, however the levels were rounded."""
    curve = np.maximum(0.0, sigmas[1:] - sigmas[bend])
    found = panel({"a": curve / curve[-1]}, levels=sigmas[1:], n_runs=4)
    outcome = shapes.changes_within(found, policies=("a",), between=ONSET)
    assert outcome.answer == ("supported" if 3 <= bend <= 5 else "contradicted"), outcome.why


def test_where_levels_cannot_tell_the_place_of_a_change_it_is_undecided():
    few = SIGMAS[[1, 3, 5, 7]]  # lines can meet at the second and the third only, both in the window
    curve = np.maximum(0.0, few - few[1])
    for rule in ("intervals", "bands"):
        outcome = shapes.changes_within(
            panel({"a": curve / curve[-1]}, levels=few), policies=("a",), between=ONSET, rule=rule
        )
        assert outcome.answer == "undecided"
        assert "no level that was run could show a change below" in outcome.why
    whole = SIGMAS[[0, 3, 5, 7]]  # with the undisturbed swarm nothing can be hidden below
    bent = np.maximum(0.0, whole - whole[1])
    found = panel({"a": bent / bent[-1]}, levels=whole)
    outcome = shapes.changes_within(found, policies=("a",), between=(ONSET[0], 0.9 * ONSET[1]))
    assert outcome.answer == "supported"
    flat = shapes.changes_within(panel({"a": 1.0}, levels=few), policies=("a",), between=ONSET)
    assert flat.answer == "contradicted", "no change at all needs no place"
    outside = panel({"a": [0, 0, 0, 1, 2, 3]})
    outcome = shapes.changes_within(outside, policies=("a",), between=(3.2, 3.8))
    assert (outcome.answer, "could show a change at" in outcome.why) == ("undecided", True)


def test_a_broken_line_by_hand():
    bends, changes = shapes.broken_line(np.array([1.0, 2, 4, 8]), np.array([[3.0, 3, 3, 11], [0, 1, 5, 13]]))
    assert bends.tolist() == [4.0, 2.0]
    assert changes == pytest.approx([2.0, 1.0])


def test_which_curve_changes_first():
    found = panel({"a": [0, 0, 1, 2, 3, 4], "b": [0, 0, 0, 0, 1, 2]})
    assert answers(shapes.changes_before, found, first="a", others=("b",)) == BOTH
    assert answers(shapes.changes_before, found, first="b", others=("a",)) == NEITHER
    assert answers(shapes.changes_before, panel({"a": SIX, "b": SIX}, n_runs=3), first="a", others=("b",))[0] == OPEN[0]


def test_what_does_not_change_changes_before_nothing():
    bent = {"a": 1.0 + 0.001 * np.maximum(0.0, SIX - 2), "b": 1.0 + 0.001 * np.maximum(0.0, SIX - 4)}
    assert answers(shapes.changes_before, panel(bent), first="a", others=("b",)) == OPEN
    one = {"a": [0, 0, 1, 2, 3, 4], "b": 1.0}
    outcome = shapes.changes_before(panel(one), first="a", others=("b",))
    assert (outcome.answer, "no change of b" in outcome.why) == ("undecided", True)
    assert answers(shapes.changes_before, panel(one), first="a", others=("b",)) == OPEN


def test_which_panel_has_more_differences():
    apart, alike = panel({"a": 1.0, "b": 2.0}), panel({"a": 1.0, "b": 1.0})
    assert answers(orders.differs_more, alike, apart, **AB) == BOTH
    assert answers(orders.differs_more, apart, alike, **AB) == NEITHER
    assert answers(orders.differs_more, apart, apart, **AB) == ("contradicted", "undecided"), "surely no more"
    assert answers(orders.differs_more, alike, panel({"a": 1.0, "b": 2.0}, n_runs=1), **AB) == OPEN


def test_differences_are_counted_in_equally_many_runs():
    few, many = panel({"a": 1.0, "b": 2.0}, n_runs=4), panel({"a": 1.0, "b": 2.0}, n_runs=8)
    outcome = orders.differs_more(few, many, pairs=AB["pairs"])
    assert (outcome.answer, outcome.n_runs) == ("contradicted", 4)
    assert "of 4 runs each" in outcome.why
    alike = panel({"a": 1.0, "b": 1.0}, n_runs=8)
    assert answers(orders.differs_more, alike, few, **AB) == BOTH


def test_one_run_decides_nothing_by_either_rule():
    alone = panel({"a": SIX, "b": 2.0 * SIX}, n_runs=1)
    both = {"policies": ("a", "b")}
    for statement in (general.is_constant, general.is_narrow, shapes.is_linear):
        assert answers(statement, alone, **both) == OPEN
    assert answers(general.is_wider, alone, upper="a", lower="b") == OPEN
    assert answers(general.ties, alone, **AB) == OPEN
    assert answers(shapes.changes_before, alone, first="a", others=("b",)) == OPEN
    assert answers(shapes.changes_within, alone, policies=("a",), between=(1.0, 2.0)) == OPEN
    assert answers(orders.same_order, alone, alone, **both) == OPEN


def test_orders_in_two_panels():
    names = {"policies": ("a", "b", "c", "d")}
    rising = panel({"a": 1.0, "b": 2.0, "c": 3.0, "d": 4.0})
    falling = panel({"a": 4.0, "b": 3.0, "c": 2.0, "d": 1.0})
    mixed = panel({"a": 3.0, "b": 1.0, "c": 4.0, "d": 2.0})  # three pairs of six as in rising
    assert answers(orders.same_order, rising, rising, **names) == BOTH
    assert answers(orders.same_order, rising, falling, **names) == NEITHER
    assert answers(orders.same_order, rising, falling, better=(1, -1), **names) == BOTH
    assert answers(orders.same_order, falling, rising, better=(-1, 1), **names) == BOTH
    assert answers(orders.same_order, rising, rising, better=(1, -1), **names) == NEITHER
    assert answers(orders.unrelated, rising, mixed, **names) == BOTH
    assert answers(orders.unrelated, rising, rising, **names) == NEITHER
    assert answers(orders.unrelated, rising, falling, **names) == NEITHER, "the opposite order is a tie, too"
    alike = panel(dict.fromkeys("abcd", 1.0))
    assert answers(orders.unrelated, alike, alike, **names) == OPEN, "what ties has no order that could be free"
    apart = panel({"a": 2.0, "b": 1.0, "c": 1.0, "d": 1.0})
    assert answers(orders.unrelated, apart, rising, **names) == OPEN, "one policy alone stands at one end or the other"
    noise = panel(dict.fromkeys("abcd", 1.0), sd=1.0)
    for statement in (orders.same_order, orders.unrelated):
        assert answers(statement, rising, noise, **names) == OPEN
    # a < b and c < a in one, c < b in both: one pair of three agrees with each order of the others.
    three = orders.same_order(rising, panel({"a": 2.0, "b": 3.0, "c": 1.0}), policies=("a", "b", "c"))
    assert three.statistic == pytest.approx(-1 / 3)


def test_views_of_a_panel_by_hand():
    found = Panel(levels=[0, 1, 3, 4], scores={"a": [[1.0, 0.0], [2.0, 0.0], [4.0, 4.0], [9.0, 4.0]]})
    assert shapes.rise_of(found).scores["a"].tolist() == [[8.0, 4.0]]
    # Deviations from the middle level are -2, -1, 1, 2: slopes (-2 - 2 + 4 + 18) / 10 and (0 + 0 + 4 + 8) / 10, span 4.
    np.testing.assert_allclose(shapes.slope_of(found).scores["a"], [[7.2, 4.8]])
    np.testing.assert_allclose(shapes.bend_of(found).scores["a"], [[4 * (5.0 - 1.0), 0.0]])
    assert shapes.with_zero(found).scores["zero"].tolist() == [[0.0, 0.0]] * 4


def test_missing_runs_are_left_out_and_counted():
    scores = {"a": [[1.0, 1.1, 0.9, 1.0, math.nan]], "b": [[2.0, 2.1, 1.9, math.inf, math.nan]]}
    assert general.ties(Panel(levels=[1], scores=scores), **AB).answer == "undecided"  # three runs of b are left
    assert general.ties(Panel(levels=[1], scores=scores), **AB).n_runs == 3


def test_one_score_that_is_not_finite_costs_its_level_alone():
    made = panel({"a": 1.0, "b": 2.0}, levels=np.arange(9.0), n_runs=4)
    made.scores["a"][2, 1] = math.nan
    for statement in (general.is_narrow, general.is_constant):
        outcome = statement(made, policies=("a",))
        assert outcome.answer == "supported"
        assert "1 of 9 levels left out" in outcome.why
        assert outcome.n_runs == 4
    assert orders.same_order(made, made, policies=("a", "b")).answer == "supported"
    made.scores["a"][2:8, 1] = math.nan
    outcome = general.is_narrow(made, policies=("a",))
    assert (outcome.answer, outcome.why) == ("undecided", "6 of 9 levels have fewer than 4 runs with a score of a")


def test_one_wild_level_says_nothing_about_the_others():
    made = panel({"a": 1.0, "b": 2.0}, levels=np.arange(7.0), sd={"a": 0.02, "b": 0.1})
    made.scores["a"][0] = 1000.0 * made.scores["a"][0] - 1023.0
    made = replace(made, unit=1.0)
    assert general.is_narrow(made, policies=("a",)).answer == "supported"
    assert general.is_wider(made, upper="a", lower="b").answer == "contradicted"
    assert general.reaches_higher(made, upper="a", lower="b").answer == "contradicted"


def test_nothing_to_judge_has_its_own_answer():
    made = panel({"a": 1.0, "b": math.nan, "c": 1.0})
    found = [
        general.ties(made, **AB),
        general.never_differ(made, **AB),
        general.is_higher(made, **UP),
        general.is_not_higher(made, first="a", second="b"),
        general.leads_by_little(made, **LEAD),
        general.is_constant(made, policies=("a", "b")),
        general.is_wider(made, upper="a", lower="b"),
        orders.differs_more(made, made, **AB),
        shapes.changes_within(made, policies=("b",), between=(2.0, 3.0)),
        shapes.is_linear(made, policies=("b",)),
        orders.unrelated(made, made, policies=("a", "b")),
    ]
    assert {outcome.answer for outcome in found} == {"no scores"}


def test_several_statements_make_one_answer():
    def outcome(answer, effect=0.1):
        return Outcome(answer=answer, statistic=0.0, effect=effect, n_runs=4, why="w")

    yes, no, open_, nothing, tie = map(outcome, ("supported", "contradicted", "undecided", "no scores", "tie"))
    assert all_of([yes, tie, open_, nothing]).answer == "tie"
    assert all_of([tie, no]).answer == "contradicted"
    assert most_of([tie, tie, no]).answer == "tie"
    assert most_of([tie, no, yes]).answer == "contradicted", "two of three fail"
    assert most_of([tie, yes]).answer == "undecided"
    assert all_of([yes, yes]).answer == "supported"
    assert all_of([yes, nothing, open_, no]).answer == "contradicted"
    assert all_of([yes, nothing, open_]).answer == "no scores"
    assert all_of([yes, open_]).answer == "undecided"
    assert most_of([yes, yes, no]).answer == "supported"
    assert most_of([yes, no]).answer == "undecided"
    assert most_of([yes, nothing]).answer == "no scores"


def test_reasons_are_one_line_per_statement_and_the_effect_sums_them_up():
    made = panel({"a": -SIX, "b": 1.0, "c": SIX})
    outcome = all_of([shapes.is_linear(made, policies=("a", "c")), general.varies(made, policies=("b",))])
    assert outcome.lines == (
        "contradicted: " + shapes.is_linear(made, policies=("a",)).why,
        "supported: " + shapes.is_linear(made, policies=("c",)).why,
        "contradicted: " + general.is_constant(made, policies=("b",)).why,
    )
    assert "it does not grow" in outcome.lines[0]
    assert "0.25 is still constant" in outcome.lines[2]
    two = [part.effect for part in outcome.parts if part.answer == "contradicted"]
    assert outcome.effect == pytest.approx(np.mean(two))
    assert outcome.statistic == pytest.approx(1 / 3)


@pytest.mark.parametrize(
    ("levels", "scores", "message"),
    [
        ([2, 1], {"a": [[1.0], [2.0]]}, "rising order"),
        ([1, 2], {"a": [[1.0]]}, "2 levels"),
        ([1], {"a": [[1.0]], "b": [[1.0, 2.0]]}, "same for all"),
        ([1], {}, "scores of shape"),
    ],
)
def test_panels_that_do_not_fit_are_refused(levels, scores, message):
    with pytest.raises(CurveError, match=message):
        Panel(levels=levels, scores=scores)


def test_an_absent_policy_and_too_few_levels_are_refused():
    found = panel({"a": 1.0, "b": 1.0})
    with pytest.raises(CurveError, match="scores of c"):
        general.is_constant(found, policies=("c",))
    with pytest.raises(CurveError, match="three or more levels"):
        shapes.bend_of(found.part("low").part("low"))
