"""Claims about figures: each statement in its three answers, and a world in which every claim of the paper holds."""

import math

import numpy as np
import pytest

from metrics import CLAIMS, METRICS, CurveError, Panel, check_claim
from metrics.claims import EXPERIMENTS, shapes
from metrics.claims import predicates as general
from metrics.claims.panel import signs

N_RUNS = 16
SIX = np.arange(1.0, 7.0)


def panel(curves, *, levels=SIX, sd=0.01, n_runs=N_RUNS, seed=1):
    """Scores around curves, name -> height at each level (a number: the same everywhere); sd may be one per name."""
    rng = np.random.default_rng(seed)
    sds = sd if isinstance(sd, dict) else dict.fromkeys(curves, sd)
    levels = np.asarray(levels, dtype=float)
    noise = {name: sds[name] * rng.standard_normal((levels.size, n_runs)) for name in curves}
    return Panel(
        levels=levels, scores={k: np.broadcast_to(v, levels.shape)[:, None] + noise[k] for k, v in curves.items()}
    )


def answers(predicate, *panels, **parameters):
    """By intervals and by bands."""
    return tuple(predicate(*panels, **parameters, rule=rule).answer for rule in ("intervals", "bands"))


BOTH = ("supported", "supported")
NEITHER = ("contradicted", "contradicted")
OPEN = ("undecided", "undecided")
AB = {"pairs": (("a", "b"),)}
UP = {"upper": ("a",), "lower": ("b", "c")}


def test_signs_by_hand():
    scores = {"a": [[1.0, 1.2, 1.1, 0.9]] * 3, "b": [[3.0, 3.1, 3.2, 2.9], [1.0, 1.2, 1.1, 0.9], [1.0, 1.3, 0.7, 2.0]]}
    found = Panel(levels=[1, 2, 3], scores=scores)
    assert signs(found, "a", "b", "intervals").tolist()[:2] == [-1.0, 0.0]
    assert math.isnan(signs(found, "a", "b", "intervals")[2])
    # Means 1.05 and 1.25 with standard deviations 0.129 and 0.557: 0.2 is less than twice their sum.
    assert signs(found, "a", "b", "bands").tolist() == [-1.0, 0.0, 0.0]


def test_a_difference_too_small_to_see_is_a_tie_however_significant():
    found = panel({"a": 1.0, "b": 1.05}, sd=0.001)
    assert (signs(found, "a", "b", "intervals") == 0.0).all()
    assert (signs(found, "a", "b", "bands") == -1.0).all()


@pytest.mark.parametrize("rule", ["intervals", "bands"])
def test_equal_policies_seldom_differ(rule):
    found = [signs(panel({"a": 1.0, "b": 1.0}, sd=0.5, n_runs=8, seed=k), "a", "b", rule) for k in range(100)]
    assert (np.abs(found) == 1.0).mean() < 0.1


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
        (general.is_higher, {"a": 2.0, "b": 2.0, "c": 1.0}, {}, UP, NEITHER),
        (general.is_higher, {"a": 2.0, "b": 1.9, "c": 1.0}, {"sd": 1.0}, UP, ("undecided", "contradicted")),
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
        (general.reaches_higher, {"a": 0.9, "b": 1.0}, {}, {"upper": "a", "lower": "b"}, NEITHER),
        (shapes.is_linear, {"a": 2.0 * SIX}, {}, {"policies": ("a",)}, BOTH),
        (shapes.is_linear, {"a": -SIX}, {}, {"policies": ("a",)}, NEITHER),
        (shapes.is_linear, {"a": [0, 0, 0, 0, 0, 1]}, {}, {"policies": ("a",)}, NEITHER),
        (shapes.is_linear, {"a": SIX}, {"sd": 2.2}, {"policies": ("a",)}, ("undecided", "supported")),
    ],
)  # fmt: skip
def test_statements_in_their_three_answers(statement, curves, options, parameters, expected):
    assert answers(statement, panel(curves, **options), **parameters) == expected


@pytest.mark.parametrize(
    ("curve", "between", "sd", "expected"),
    [
        ([0, 0, 0, 1, 2, 3], (2.5, 4.0), 0.01, BOTH),  # bend at 3, first level apart is 4
        ([0, 0, 0, 1, 2, 3], (5.0, 6.0), 0.01, NEITHER),
        ([0, 0, 0, 0, 0, 0.0], (2.5, 4.0), 0.0, NEITHER),  # no change at all
        ([1, 1, 1, 1.3, 1.6, 1.9], (2.5, 4.0), 1.0, ("undecided", "contradicted")),
        ([1, 1, 1, 1, 1, 1.0], (1.0, 6.0), 0.3, ("undecided", "contradicted")),  # a bend somewhere, if there is one
    ],
)
def test_where_a_curve_changes(curve, between, sd, expected):
    assert answers(shapes.changes_within, panel({"a": curve}, sd=sd), policies=("a",), between=between) == expected


def test_a_broken_line_by_hand():
    bends, changes = shapes.broken_line(np.array([1.0, 2, 4, 8]), np.array([[3.0, 3, 3, 11], [0, 1, 5, 13]]))
    assert bends.tolist() == [4.0, 2.0]
    assert changes == pytest.approx([2.0, 1.0])


def test_which_curve_changes_first():
    found = panel({"a": [0, 0, 1, 2, 3, 4], "b": [0, 0, 0, 0, 1, 2]})
    assert answers(shapes.changes_before, found, first="a", others=("b",)) == BOTH
    assert answers(shapes.changes_before, found, first="b", others=("a",)) == NEITHER
    assert answers(shapes.changes_before, panel({"a": SIX, "b": SIX}, n_runs=3), first="a", others=("b",))[0] == OPEN[0]


def test_which_panel_has_more_differences():
    apart, alike = panel({"a": 1.0, "b": 2.0}), panel({"a": 1.0, "b": 1.0})
    assert answers(general.differs_more, alike, apart, **AB) == BOTH
    assert answers(general.differs_more, apart, alike, **AB) == NEITHER
    assert answers(general.differs_more, apart, apart, **AB) == OPEN
    assert answers(general.differs_more, alike, panel({"a": 1.0, "b": 2.0}, n_runs=1), **AB) == OPEN


def test_differences_are_counted_in_equally_many_runs():
    few, many = panel({"a": 1.0, "b": 2.0}, n_runs=4), panel({"a": 1.0, "b": 2.0}, n_runs=8)
    outcome = general.differs_more(few, many, pairs=AB["pairs"])
    assert (outcome.answer, outcome.n_runs) == ("undecided", 4)
    assert "of 4 runs each" in outcome.why
    alike = panel({"a": 1.0, "b": 1.0}, n_runs=8)
    assert answers(general.differs_more, alike, few, **AB) == BOTH


def test_more_runs_alone_do_not_make_more_differences():
    """A difference that eight runs tell and four do not."""
    runs = np.array([1.0, -0.6, 1.0, -0.6, 1.2, 1.2, 1.2, 1.2])
    close = Panel(levels=[1.0], scores={"a": np.full((1, 8), 5.0), "b": [5.0 + runs]})
    assert general.differ(close, pairs=AB["pairs"]).answer == "supported"
    four = Panel(levels=[1.0], scores={name: scores[:, :4] for name, scores in close.scores.items()})
    outcome = general.differs_more(four, close, pairs=AB["pairs"])
    assert (outcome.answer, outcome.statistic) == ("undecided", 0.0)


def test_one_run_decides_nothing_by_either_rule():
    alone = panel({"a": SIX, "b": 2.0 * SIX}, n_runs=1)
    both = {"policies": ("a", "b")}
    for statement in (general.is_constant, general.is_narrow, shapes.is_linear):
        assert answers(statement, alone, **both) == OPEN
    assert answers(general.is_wider, alone, upper="a", lower="b") == OPEN
    assert answers(general.ties, alone, **AB) == OPEN
    assert answers(shapes.changes_before, alone, first="a", others=("b",)) == OPEN
    assert answers(shapes.changes_within, alone, policies=("a",), between=(1.0, 2.0)) == OPEN
    assert answers(shapes.same_order, alone, alone, **both) == OPEN


def test_orders_in_two_panels():
    names = {"policies": ("a", "b", "c")}
    rising, falling = panel({"a": 1.0, "b": 2.0, "c": 3.0}), panel({"a": 3.0, "b": 2.0, "c": 1.0})
    assert answers(shapes.same_order, rising, rising, **names) == BOTH
    assert answers(shapes.same_order, rising, falling, **names) == NEITHER
    assert answers(shapes.same_order, rising, falling, better=(1, -1), **names) == BOTH
    assert answers(shapes.not_same_order, rising, falling, **names) == BOTH
    noise = panel({"a": 1.0, "b": 1.01, "c": 1.0}, sd=1.0)
    assert shapes.same_order(rising, noise, **names).answer == "undecided"
    # a < b and c < a in one, c < b in both: one pair of three agrees with each order of the others.
    mixed = shapes.same_order(rising, panel({"a": 2.0, "b": 3.0, "c": 1.0}), **names)
    assert mixed.statistic == pytest.approx(-1 / 3)


def test_views_of_a_panel_by_hand():
    found = Panel(levels=[0, 1, 3, 4], scores={"a": [[1.0, 0.0], [2.0, 0.0], [4.0, 4.0], [9.0, 4.0]]})
    assert shapes.rise_of(found).scores["a"].tolist() == [[8.0, 4.0]]
    # Deviations from the middle level are -2, -1, 1, 2: slopes (-2 - 2 + 4 + 18) / 10 and (0 + 0 + 4 + 8) / 10, span 4.
    np.testing.assert_allclose(shapes.slope_of(found).scores["a"], [[7.2, 4.8]])
    np.testing.assert_allclose(shapes.bend_of(found).scores["a"], [[4 * (5.0 - 1.0), 0.0]])
    assert shapes.with_zero(found).scores["zero"].tolist() == [[0.0, 0.0]] * 4


def test_missing_runs_are_left_out_and_counted():
    scores = {"a": [[1.0, 1.1, 0.9, 1.0, math.nan]], "b": [[2.0, 2.1, 1.9, math.inf, 7.0]]}
    assert general.ties(Panel(levels=[1], scores=scores), **AB).answer == "undecided"  # three pairs are left
    assert general.ties(Panel(levels=[1], scores=scores), **AB).n_runs == 4


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


def test_an_absent_policy_and_unknown_options_are_refused():
    found = panel({"a": 1.0, "b": 1.0})
    with pytest.raises(CurveError, match="scores of c"):
        general.is_constant(found, policies=("c",))
    with pytest.raises(ValueError, match="rule"):
        general.ties(found, **AB, rule="eye")
    with pytest.raises(ValueError, match="levels"):
        general.ties(found, **AB, levels="middle")
    with pytest.raises(CurveError, match="three or more levels"):
        shapes.bend_of(found.part("low").part("low"))


# ---------------------------------------------------------------------------------------------- claims of the paper

X = np.linspace(0.0, 1.0, 8)
SIGMA = 0.03 / 7 * np.arange(1.0, 8.0)
WIDE_SIGMA = 0.05 / 7 * np.arange(1.0, 8.0)
LATE = np.where(X > 0.4, 1.0, 0.0)


def ramps(levels, *lines):
    """A curve per policy that is flat at first, of the index where it begins to rise, the slope and the height."""
    return four(*(height + slope * np.maximum(0.0, levels - levels[start]) for start, slope, height in lines))


def flexible(dpo_above_crw):
    """Curves of R and A in scenario 1: STOCHX low and straight, the others rising ever faster."""
    crw = 0.3 + 0.6 * X**2
    return {"crw": crw, "dpo": (1.0 + dpo_above_crw) * crw, "stochm": 0.2 + 0.4 * X**2, "stochx": 0.1 + 0.02 * X}


def four(crw, dpo, stochm, stochx):
    return {"crw": crw, "dpo": dpo, "stochm": stochm, "stochx": stochx}


SHOWN = {
    ("S1a", "spatial_emergence"): (X, four(0.95, 0.6, 0.5, 0.5)),
    ("S1a", "raw_performance"): (X, four(0.9, 1.0, 0.6, 0.4)),
    ("S1b", "task_emergence"): (np.arange(1.0, 9.0), four(0.06, 0.04, 0.05, np.arange(1.0, 9.0) / 8.0)),
    ("S1b", "scalability"): (X, four(0.52, 0.53, 0.45, 0.40)),
    ("S1b", "raw_performance"): (X, four(0.9, 1.0, 0.6, 0.4)),
    **{(experiment, measure): (X, flexible(above)) for experiment, above in (("S1c", 0.0), ("S1d", 0.3))
       for measure in ("reactivity", "adaptability")},
    ("S1e", "noise_robustness"): (SIGMA, ramps(SIGMA, (3, 20, 0.2), (3, 60, 0.4), (3, 40, 0.4), (3, 20, 0.2))),
    ("S1f", "noise_robustness"): (SIGMA, ramps(SIGMA, (3, 20, 0.2), (3, 60, 0.6), (3, 40, 0.5), (3, 20, 0.3))),
    ("S1g", "population_robustness"): (X, four(0.8, 0.2, 0.4, 1.0)),
    ("S1h", "population_robustness"): (X, four(0.8, 0.2, 0.4, 1.0)),
    ("S2a still", "task_emergence"): (X, four(0.7, 0.1 + 0.6 * X, 0.6 - 0.5 * X, 0.95)),
    ("S2a slow", "spatial_emergence"): (X, four(0.7, 0.1 + 0.6 * X, 0.6 - 0.5 * X, 0.95)),
    ("S2a still", "scalability"): (X, four(0.5, 0.5, 0.5, 0.5)),
    ("S2a still", "raw_performance"): (X, four(0.9, 1.0, 0.6, 0.4)),
    ("S2a fast", "raw_performance"): (X, four(0.9, 1.0, 0.6, 0.4)),
    **{(f"S2b {size}", "reactivity"): (X, four(*(0.5 + height * LATE for height in (0.3, 1.0, 0.9, 0.0))))
       for size in (115, 320)},
    **{(f"S2b {size}", "adaptability"): (X, four(0.5, *(low + 0.5 * (X > 0.5) for low in (0.56, 0.54, 0.52))))
       for size in (115, 320)},
    ("S2c 320", "noise_robustness"): (
        WIDE_SIGMA, ramps(WIDE_SIGMA, (4, 20, 0.2), (4, 40, 0.5), (2, 40, 0.5), (4, 20, 0.2))
    ),
    ("S2d 115", "population_robustness"): (X, four(0.8, 0.2, 0.4, 1.0)),
    ("S2d 320", "population_robustness"): (X, four(0.5, 0.5, 0.5, 0.5)),
}  # fmt: skip
"""Curves as the paper describes them, on the scale of their figure."""
SWAPPED = {"crw": "dpo", "dpo": "crw", "stochm": "stochx", "stochx": "stochm"}
FORMULAS = {"V1", "V2"}
HOLD_EITHER_WAY = {
    *("E1", "R3", "A3", "A5", "C4", "D4", "N3"),  # about all four policies alike
    *("E3", "C1", "C2", "C3", "P1", "P2", "P3"),  # about policies that change places with each other
    *("A7", "X2", "X3"),  # about two panels in which they change places alike
    *("N1", "N7"),  # what is said of CRW and STOCHX is here true of DPO and STOCHM, too
}


def world(*, n_runs=N_RUNS, names=None):
    panels = {}
    for number, (name, (levels, curves)) in enumerate(SHOWN.items()):
        sd = {k: 0.1 if name == ("S1b", "scalability") and k.startswith("stoch") else 0.01 for k in curves}
        made = panel(curves, levels=levels, sd=sd, n_runs=n_runs, seed=number)
        renamed = {(names or {}).get(key, key): values for key, values in made.scores.items()}
        panels[name] = Panel(levels=made.levels, scores=renamed)
    return panels


TRUE, EXCHANGED, SCARCE = world(), world(names=SWAPPED), world(n_runs=3)


@pytest.mark.parametrize("name", CLAIMS)
def test_each_claim_is_supported_where_it_holds(name):
    verdict = check_claim(CLAIMS[name], TRUE)
    assert (verdict.claim, verdict.answer, verdict.by_bands) == (name, *BOTH), verdict.why
    assert verdict.n_runs == (0 if name in FORMULAS else N_RUNS)


@pytest.mark.parametrize("name", sorted(set(CLAIMS) - FORMULAS))
def test_most_claims_fail_where_policies_have_changed_places(name):
    """CRW with DPO, and STOCHM with STOCHX."""
    verdict = check_claim(CLAIMS[name], EXCHANGED)
    assert (verdict.answer == "supported") is (name in HOLD_EITHER_WAY), verdict.why


@pytest.mark.parametrize("name", sorted(set(CLAIMS) - FORMULAS))
def test_three_runs_decide_nothing_by_intervals(name):
    verdict = check_claim(CLAIMS[name], SCARCE)
    assert verdict.answer == "undecided", verdict.why


@pytest.mark.parametrize("name", sorted(set(CLAIMS) - FORMULAS))
def test_claims_without_scores_are_undecided_and_say_what_is_missing(name):
    verdict = check_claim(CLAIMS[name], {})
    assert (verdict.answer, verdict.by_bands, verdict.n_runs) == (*OPEN, 0)
    assert CLAIMS[name].panels[0][0] in verdict.why


def test_claims_speak_of_known_experiments_and_measures():
    named = {panel for claim in CLAIMS.values() for panel in claim.panels}
    assert {measure for _, measure in named} <= set(METRICS)
    assert {experiment for experiment, _ in named} == set(EXPERIMENTS)
    assert set(SHOWN) == named


def test_all_claims_are_there():
    numbers = {"E": 9, "C": 4, "P": 3, "R": 5, "A": 7, "N": 8, "V": 2, "D": 4, "X": 4}
    assert set(CLAIMS) == {f"{letter}{k}" for letter, last in numbers.items() for k in range(1, last + 1)}
    assert all(claim.text.endswith(".") and claim.figure for claim in CLAIMS.values())


def test_availability_as_the_paper_says():
    # (6/5)^-k from 5 to 50 over 0 to 50, by hand: (6/5)^-5 nearly, 0.4019.
    assert check_claim(CLAIMS["V1"], {}).statistic == pytest.approx(0.4018, abs=1e-4)
