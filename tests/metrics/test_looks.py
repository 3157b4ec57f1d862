"""Looking several times: the parts of 5 %, the runs that a statement is judged on, and how often that is wrong."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtri

from metrics.claims import Panel
from metrics.claims.looks import LOOKS, as_if, at_last_look, confidence_at, last_look, looks_up_to
from metrics.claims.panel import CONFIDENCE, interval_of, mean_over_runs, signs, std_over_runs
from metrics.claims.predicates import is_higher
from metrics.claims.statements import states
from scripts.judge_rules import RULES, answers_over_looks, first_decided, wrong_over_looks

N_WORLDS = 40
MOST_WRONG = 6 / N_WORLDS
"""Of 40 worlds in which one in twenty is wrong, more than six are in one of a hundred."""
FEW_LOOKS = looks_up_to(16)
ONE_LEVEL = {"levels": [1.0], "margins": np.array([0.5])}


def looked_at(n_a, n_b, **told):
    """A panel of two policies with unequally many runs."""
    rng = np.random.default_rng(0)
    scores = {"crw": rng.normal(2.0, 0.1, (1, 16)), "dpo": rng.normal(1.0, 0.1, (1, 16))}
    scores["dpo"][:, n_b:] = np.nan
    return Panel(**ONE_LEVEL, scores=scores, looks=LOOKS, reached={"crw": n_a, "dpo": n_b}, **told)


@pytest.mark.parametrize("most", [4, 5, 64, 192, 300])
def test_all_looks_together_are_wrong_once_in_twenty(most):
    looks = looks_up_to(most)
    assert looks[-1] == most
    levels = [1.0 - confidence_at(looks, n_runs) for n_runs in looks]
    assert levels[0] == pytest.approx((1.0 - CONFIDENCE) * looks[0] / most)
    steps = np.diff([0, *looks])
    sums = np.cumsum(np.random.default_rng(0).normal(size=(100_000, len(looks))) * np.sqrt(steps), axis=1)
    is_outside = np.abs(sums) / np.sqrt(looks) > -ndtri(0.5 * np.array(levels))
    assert is_outside.any(axis=1).mean() == pytest.approx(1.0 - CONFIDENCE, abs=0.002)


def test_a_look_is_reached_when_all_its_runs_are_there():
    assert [last_look(LOOKS, n_runs) for n_runs in (0, 3, 4, 15, 16, 191, 192, 500)] == [0, 0, 4, 8, 16, 128, 192, 192]


def test_a_statement_is_judged_on_the_runs_that_all_policies_have():
    both = looked_at(16, 8)
    (seen,) = at_last_look([both], ("crw", "dpo"))
    assert seen.scores["crw"].tolist() == both.scores["crw"][:, :8].tolist()
    assert seen.confidence == confidence_at(LOOKS, 8)
    (alone,) = at_last_look([both], ("crw",))
    assert alone.scores["crw"].shape == (1, 16)
    once = replace(both, looks=(), reached={})
    assert at_last_look([once], ("crw", "dpo")) == [once]
    statement = states(is_higher, ("S1a", "scalability"), upper=("crw",), lower=("dpo",))
    assert statement.policies == ("crw", "dpo")
    panels = dict.fromkeys(statement.panels, both)
    assert statement.outcome(panels, "intervals").n_runs == 8
    assert statement.outcome(dict.fromkeys(statement.panels, looked_at(16, 0)), "intervals").answer == "no scores"


def test_panels_with_different_looks_are_judged_at_one_that_both_have():
    early = replace(looked_at(16, 16), looks=looks_up_to(12), reached={"crw": 12, "dpo": 12})
    for panels in ((early, looked_at(16, 16)), (looked_at(16, 16), early)):
        seen = at_last_look(panels, ("crw", "dpo"))
        assert [panel.scores["crw"].shape for panel in seen] == [(1, 8), (1, 8)]
        assert {panel.confidence for panel in seen} == {confidence_at(LOOKS, 8)}


def test_as_if_there_were_more_runs():
    found = looked_at(8, 4, undisturbed={"crw": np.arange(16.0), "dpo": np.arange(16.0)})
    more = as_if(found, 16)
    assert more.reached == {"crw": 16, "dpo": 16}
    for name, n_runs in found.reached.items():
        before = found.scores[name][:, :n_runs]
        assert mean_over_runs(more.scores[name]) == pytest.approx(mean_over_runs(before))
        assert std_over_runs(more.scores[name]) == pytest.approx(std_over_runs(before))
    assert more.undisturbed["dpo"].mean() == pytest.approx(1.5)
    assert as_if(looked_at(8, 0), 16).reached == {"crw": 16, "dpo": 0}
    assert np.isnan(as_if(looked_at(8, 0), 16).scores["dpo"]).all()


def signs_over_looks(rng, gap, n_worlds, *, margin=0.5, looks=LOOKS):
    """What Welch's t and the equivalence test say of two policies at each look, (worlds, looks)."""
    found = []
    for _ in range(n_worlds):
        scores = {name: rng.normal(mean, 1.0, (1, looks[-1])) for name, mean in (("a", gap), ("b", 0.0))}
        panel = Panel(levels=[1.0], margins=[margin], scores=scores, looks=looks)
        seen = [at_last_look([replace(panel, reached={"a": n, "b": n})], ())[0] for n in looks]
        found.append([signs(one, "a", "b", "intervals")[0] for one in seen])
    return np.array(found)


def test_seven_looks_are_wrong_no_more_often_than_one():
    rng = np.random.default_rng(1)
    equal = signs_over_looks(rng, 0.0, 600)
    assert (np.abs(equal) == 1.0).any(axis=1).mean() <= 0.07  # 5 %, and two standard deviations of 600 worlds
    at_the_margin = signs_over_looks(rng, 0.5, 600)
    assert (at_the_margin == 0.0).any(axis=1).mean() <= 0.07


def test_looks_without_a_correction_are_wrong_more_often():
    rng = np.random.default_rng(2)
    wrong = 0
    for _ in range(300):
        a, b = rng.normal(size=(2, LOOKS[-1]))
        wrong += any(lower > 0.0 or upper < 0.0 for lower, upper in (interval_of(a[:n], b[:n]) for n in LOOKS))
    assert wrong / 300 > 0.12


@pytest.mark.parametrize(("gap", "margin", "answer"), [(0.286, 0.01, 1.0), (0.0, 0.2985, 0.0)])
def test_seven_looks_find_little_less_than_one(gap, margin, answer):
    """At a difference, and at a margin of a tie, that one look at all runs finds in four of five worlds."""
    rng = np.random.default_rng(3)
    one_look = (signs_over_looks(rng, gap, 500, margin=margin, looks=LOOKS[-1:]) == answer).mean()
    sequence = (signs_over_looks(rng, gap, 500, margin=margin) == answer).any(axis=1).mean()
    assert 0.74 <= one_look <= 0.86
    assert sequence >= one_look - 0.15


@pytest.mark.parametrize("name", RULES)
def test_a_rule_is_seldom_wrong_at_any_look(name):
    assert wrong_over_looks(RULES[name], FEW_LOOKS, N_WORLDS) <= MOST_WRONG


@pytest.mark.parametrize("name", RULES)
def test_a_rule_can_say_yes_and_no_in_a_sequence(name):
    for world, wanted in (("holds", "supported"), ("fails", RULES[name].failing)):
        found = answers_over_looks(RULES[name], world, looks_up_to(128), 2)
        assert {first_decided(seen) for seen in found} == {wanted}
