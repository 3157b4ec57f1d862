"""Numbers that claims speak of, by hand, and what is said of them."""

import numpy as np
import pytest

from metrics import CurveError, Panel
from metrics.claims import PanelName
from metrics.claims.panel import Curves, bend, best, height, rise, scatter, slope, steeper_from, variation
from metrics.claims.statements import Untestable, alike, follows, further_apart, group, larger_lead, mostly_tie
from metrics.claims.verdict import Claim, Counts, check_claims
from tests.support.panels import panel

PLACE, OTHER = PanelName("S1a", "raw_performance"), PanelName("S1b", "raw_performance")
FAR = PanelName("S1c", "reactivity")
HIGH = {"crw": 4.0, "dpo": 3.0, "stochm": 2.0, "stochx": 1.0}


def curves(*rows, levels=(0.0, 1.0, 2.0, 4.0)):
    """Two runs of one policy, by level."""
    return Curves(np.array(levels), np.array([rows]), np.ones(len(rows[0]), dtype=bool))


@pytest.mark.parametrize(
    ("number", "expected"),
    [
        (height, [2.25, 1.0]),
        (rise, [3.5, 0.0]),  # 4 less 0.5
        (slope, [4.0 * 13.25 / 8.75, 0.0]),  # deviations from the means: 13.25 over 8.75 a level
        (bend, [4.0, 0.0]),  # 2 a level in the upper half, 1 in the lower, over a span of 4
        (steeper_from(1.0), [4.0 * (12.0 / 7.0 - 1.0), 0.0]),  # 1, 2, 6 at 1, 2, 4 rise by 12 / 7 a level
        (steeper_from(2.0), [4.0, 0.0]),
        (variation, [2.2776084, 0.0]),
        (scatter, [0.875, 0.875]),  # half of the distances of the two runs: 1, 0, 1, 5
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_numbers_of_a_run_by_hand(number, expected):
    np.testing.assert_allclose(number(curves([0, 1], [1, 1], [2, 1], [6, 1]))[0], expected, atol=1e-6)


def test_the_best_of_four_is_of_groups_of_runs():
    runs = np.arange(9.0)
    assert best(Curves(np.ones(1), runs[None, None], np.ones(9, dtype=bool))).tolist() == [[3.0, 7.0]]


def test_curves_are_shares_of_the_unit_without_levels_that_lack_runs():
    scores = {"a": [[2, 4, 6, 8], [np.nan, np.inf, 1, 1], [5, np.nan, 5, 5]], "b": np.ones((3, 4))}
    made = Panel(levels=[1, 2, 3], scores=scores, unit=[2.0, 1.0, 5.0], shares={"a": np.zeros((3, 4))})
    found = made.curves(["a"], shares=False)
    assert found.levels.tolist() == [1.0, 3.0], "half of the runs of the second have no score"
    assert found.values.tolist() == [[[1.0, 3.0, 4.0], [1.0, 1.0, 1.0]]]
    assert found.runs.tolist() == [True, False, True, True]
    assert made.curves(["a"], shares=False, one_unit=True).values[0, 0].tolist() == [0.75, 2.25, 3.0]
    assert made.curves(["a"], shares=True).values.shape == (1, 3, 4)
    with pytest.raises(CurveError, match="Expected scores of c, got those of a, b"):
        made.curves(["c"], shares=False)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"levels": [2, 1], "scores": {"a": np.ones((2, 4))}}, "Expected levels in rising order"),
        ({"levels": [[1, 2]], "scores": {"a": np.ones((2, 4))}}, "Expected levels in rising order"),
        ({"levels": [1, 2], "scores": {"a": np.ones((2, 4)), "b": np.ones((2, 5))}}, "mark a missing run with NaN"),
    ],
)
def test_scores_that_make_no_panel_are_refused(given, message):
    with pytest.raises(CurveError, match=message):
        Panel(**given)


def judged(*statements, reading="amounts", needs="all", margin=None, **panels):
    """The verdict on one claim about panels by name."""
    claim = Claim("X0", "", statements=statements, needs=needs)
    named = {PLACE: panels.get("first"), OTHER: panels.get("second"), FAR: panels.get("far")}
    shown = {name: one for name, one in named.items() if one is not None}
    return check_claims({"X0": claim}, shown, reading=reading, margin=margin)["X0"]


def test_a_group_is_compared_by_its_mean_and_fails_if_a_pair_of_its_members_is_turned_round():
    two = group(PLACE, "crw stochx", "dpo stochm")
    assert judged(two, first=panel({"crw": 1.3, "dpo": 1.0, "stochm": 0.9, "stochx": 1.2})).answer == "supported"
    turned = judged(two, first=panel({"crw": 2.0, "dpo": 1.0, "stochm": 0.9, "stochx": 0.8}))
    assert (turned.answer, turned.parts[0].numbers()["mean"] > 0) == ("contradicted", True)
    assert turned.why.endswith("; dpo above stochx, stochm above stochx in S1a raw performance")
    assert turned.parts[0].numbers()["p"] < 0.001
    almost = judged(two, first=panel({"crw": 2.0, "dpo": 1.0, "stochm": 0.9, "stochx": 0.98}))
    assert almost.answer == "supported", "2 % less is a tie"
    far = judged(group(FAR, "crw", "dpo"), far=panel({"crw": 1.0, "dpo": 2.0}))
    assert far.answer == "supported", "a shorter distance is better"


def test_comparisons_are_counted_at_each_level_and_by_bands():
    heights = {"crw": np.array([2, 2, 1, 0.5, 1, 1.3]), "dpo": 1.0}
    made = panel(heights, sd=0.08, n_runs=32)
    one = judged(group(PLACE, "crw", "dpo"), first=made)
    assert one.counts == Counts(3, 1, 2, 0)
    assert one.why == "3 of 6 comparisons as claimed, 1 reversed, 2 tie"
    bands = judged(group(PLACE, "crw", "dpo"), first=made, reading="bands")
    assert bands.counts == Counts(2, 1, 3), "1.3 and 1 are less than four standard deviations apart"
    assert bands.answer == "open"
    assert one.parts[0].numbers()["p"] < 0.001
    assert np.isnan(bands.parts[0].numbers()["p"])


@pytest.mark.parametrize(
    ("heights", "answer"),
    [
        ([1, 1, 1, 1, 2, 2], "supported"),
        ([1, 1, 2, 2, 2, 2], "contradicted"),
        ([1, 1, 1, 2, 2, 2], "open"),
    ],
)
def test_mostly_counts_levels(heights, answer):
    made = panel({"crw": np.array(heights), "dpo": 1.0}, n_runs=16)
    said = mostly_tie(PLACE, "crw dpo")
    assert {judged(said, first=made, reading=reading).answer for reading in ("amounts", "bands")} == {answer}


def test_a_number_by_its_band_is_a_tie_where_the_band_holds_zero():
    said = group(PLACE, "crw", of=rise, kind="more")
    steep, flat = panel({"crw": np.arange(1.0, 7.0)}), panel({"crw": 1.0}, sd=0.3)
    assert [judged(said, first=one, reading="bands").answer for one in (steep, flat)] == ["supported", "equivalent"]
    tied = group(PLACE, "crw", of=rise, kind="tie")
    assert [judged(tied, first=one, reading="bands").answer for one in (steep, flat)] == ["contradicted", "supported"]


def test_an_order_goes_from_one_panel_to_another_unless_policies_tie():
    first, turned = panel(HIGH), panel(dict(zip(HIGH, reversed(HIGH.values()), strict=True)), seed=2)
    said = follows(PLACE, OTHER)
    assert judged(said, first=first, second=first).answer == "supported"
    assert judged(said, first=first, second=turned).answer == "contradicted"
    other = judged(follows(PLACE, OTHER, turned=True), first=first, second=turned)
    assert other.answer == "supported"
    leads = [one.parts[0].numbers()["mean"] for one in (other, judged(said, first=first, second=turned))]
    assert leads[0] == pytest.approx(-leads[1])
    assert judged(follows(PLACE, FAR), first=first, far=turned).answer == "supported", "shorter distances are better"
    tied = judged(said, first=panel({**dict.fromkeys(HIGH, 1.0), "crw": 2.0}, n_runs=4), second=first)
    assert tied.answer == "supported", "three of six pairs differ, and crw leads the others"
    assert tied.parts[0].numbers()["mean"] == pytest.approx((1.0 + 2.0 + 3.0) / 3.0 / 2.5, abs=0.01)
    wild = panel({"crw": 1.0, "dpo": 1.1, "stochm": 1.05, "stochx": 1.05},
                 sd={"crw": 0.001, "dpo": 0.001, "stochm": 1.0, "stochx": 1.0})  # fmt: skip
    assert judged(said, first=wild, second=first).why.startswith("2 of 6 pairs")
    none = judged(said, first=panel(dict.fromkeys(HIGH, 1.0), n_runs=4), second=first)
    assert none.answer == "untestable"
    assert none.why == "0 of 6 pairs of policies have an order in S1a raw performance, and policies that tie have none"
    with pytest.raises(Untestable):
        said.number([panel(dict.fromkeys(HIGH, 1.0)).curves(HIGH, shares=False)] * 2)


def test_two_panels_are_compared_in_the_runs_that_both_have():
    first, second = panel(HIGH), panel({"crw": 1.5, "dpo": 1.0, "stochm": 0.8, "stochx": 0.7}, n_runs=12, seed=2)
    first.scores["crw"][:, 3] = np.nan
    found = judged(further_apart(PLACE, OTHER), first=first, second=second)
    assert (found.answer, found.parts[0].numbers()["n_runs"]) == ("supported", 11)
    assert judged(further_apart(OTHER, PLACE), first=first, second=second).answer == "contradicted"
    led = larger_lead(PLACE, OTHER, "crw", "dpo stochm")
    assert judged(led, first=first, second=second).parts[0].numbers()["mean"] == pytest.approx(
        1.5 / 2.5 - 0.6, abs=0.02
    )
    assert judged(alike(PLACE, OTHER, "dpo"), first=first, second=second).answer == "contradicted"
    assert judged(alike(PLACE, OTHER, "dpo"), first=first, second=first).answer == "supported"
    grown = panel({"crw": 9.0, "dpo": 3.0}, seed=3)
    assert judged(alike(PLACE, OTHER, "dpo"), first=first, second=grown).answer == "supported", "in one unit"


def test_shares_answer_where_a_measure_has_some():
    amounts = {"crw": 1.0, "dpo": 2.0}
    made = Panel(levels=[1, 2], scores=panel(amounts, levels=[1, 2]).scores,
                 shares=panel({"crw": 1.0, "dpo": 0.5}, levels=[1, 2]).scores)  # fmt: skip
    said = group(FAR, "crw", "dpo")
    assert [judged(said, far=made, reading=of).answer for of in ("amounts", "shares")] == ["supported", "contradicted"]
    other = group(PLACE, "dpo", "crw")
    assert judged(other, first=made, reading="shares").answer == "supported", "performance has no shares"
    always = group(PLACE, "crw", "dpo", is_share=True)
    assert judged(always, first=made).answer == "supported"


def test_statements_join_and_margins_decide():
    first = panel({"crw": 1.10, "dpo": 1.0, "stochm": 1.0})
    two = (group(PLACE, "crw", "dpo"), group(PLACE, "dpo", "stochm"))
    assert judged(*two, first=first).answer == "equivalent"
    assert judged(*two, first=first).why.startswith("1 of 2 statements hold; 6 of 12 comparisons")
    assert judged(*two, first=first, needs="most").answer == "open", "one of two is not most"
    assert judged(two[0], *two, first=first, needs="most").answer == "supported"
    assert judged(two[0], first=first, margin=0.2).answer == "equivalent"
    limit = group(PLACE, "crw", of=scatter, less=0.05, sign=-1.0)
    assert judged(limit, first=first, margin=0.2).answer == "supported", "a limit has no margin"
    lacking = judged(two[0], group(OTHER, "crw", "dpo"), first=first)
    assert (lacking.answer, lacking.parts[1].why) == ("no runs", "no runs of S1b raw performance")
    assert judged(two[0], first=panel({"crw": 2.0, "dpo": 1.0}, n_runs=3)).answer == "open"
