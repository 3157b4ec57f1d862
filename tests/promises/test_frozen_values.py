"""Scores, verdicts and trainings stay as they are, whatever becomes of the code that makes them."""

import pytest

from tests.support.frozen import score_values, stored, training_weights, verdict_answers
from tests.support.golden_runs import AS_THEN

pytestmark = [*AS_THEN]


def test_scores_of_four_policies_have_the_same_values():
    """Five seconds: it makes the runs of all measures."""
    found, then = score_values(), stored("score")
    assert found.keys() == then.keys()
    for policy in then:
        assert found[policy].keys() == then[policy].keys()
        for key, values in then[policy].items():
            assert found[policy][key] == pytest.approx(values, rel=1e-9, nan_ok=True), (policy, key)


def test_claims_have_the_same_answers():
    """Three seconds: it makes the runs of a small study under both rules."""
    assert verdict_answers() == stored("verdict")


def test_a_training_learns_the_same():
    """Ten seconds: 20,000 decisions with torch. The last digits depend on the processor."""
    pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")
    assert training_weights() == pytest.approx(stored("training"), rel=1e-4)
