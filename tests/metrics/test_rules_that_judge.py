"""The rules on simulated runs: false answers at most once in twenty times, and how often a true one is given."""

import numpy as np
import pytest

from metrics import dtw
from metrics.claims.contrast import Contrast, corrected, decide, p_values

N_WORLDS = 4000
MOST_WRONG = 0.058
"""Of 4,000 worlds in which one in twenty is wrong, more than this share is in one of a hundred."""
MARGIN = 0.5


def answers(kind, mean, n_runs=8, margin=MARGIN, draw="standard_normal"):
    """Answers in simulated worlds: a number per run with standard deviation 1 around a mean."""
    noise = getattr(np.random.default_rng(1), draw)(size=(N_WORLDS, n_runs))
    found = Contrast(mean + (noise - 1.0 if draw == "standard_exponential" else noise))
    return decide(kind, found.mean, p_values(kind, found, margin))


def share(found, *words):
    return np.isin(found, words).mean()


@pytest.mark.parametrize("n_runs", [4, 8, 32])
@pytest.mark.parametrize(
    ("kind", "mean", "wrong"),
    [
        ("more", 0.0, ["supported", "contradicted"]),
        ("more", MARGIN, ["equivalent", "contradicted"]),
        ("more", -MARGIN, ["equivalent", "supported"]),
        ("tie", MARGIN, ["supported"]),
        ("tie", -MARGIN, ["contradicted"]),
        ("differ", 0.0, ["supported"]),
        ("differ", MARGIN, ["equivalent"]),
    ],
)
def test_false_answers_are_at_most_one_in_twenty(kind, mean, wrong, n_runs):
    assert share(answers(kind, mean, n_runs), *wrong) <= MOST_WRONG


def test_runs_that_are_far_from_normal_make_false_answers_somewhat_likelier():
    assert share(answers("more", 0.0, 32, draw="standard_exponential"), "supported", "contradicted") <= 0.075


@pytest.mark.parametrize(
    ("kind", "mean", "n_runs", "margin", "answer", "power"),
    [
        ("more", 1.0, 8, 0.1, "supported", 0.69),
        ("more", 1.0, 16, 0.1, "supported", 0.96),
        ("more", -1.0, 16, 0.1, "contradicted", 0.96),
        ("more", 0.0, 16, 1.0, "equivalent", 0.96),
        ("tie", 0.0, 16, 1.0, "supported", 0.96),
        ("tie", 2.0, 16, 1.0, "contradicted", 0.98),
        ("differ", -1.0, 16, 0.1, "supported", 0.96),
        ("more", 0.25, 16, 0.1, "open", 0.84),
    ],
)
def test_true_answers_have_this_power(kind, mean, n_runs, margin, answer, power):
    assert share(answers(kind, mean, n_runs, margin), answer) == pytest.approx(power, abs=0.03)


def test_a_family_has_a_false_answer_once_in_twenty_times():
    """In 400 worlds, four means do not differ from 0, four are as large as the margin, and no pair is reversed."""
    means = np.repeat([0.0, 1.5, 0.0], [4, 4, 2])
    runs = means[:, None] + np.random.default_rng(2).standard_normal((400, 10, 8))
    n_wrong = 0
    for world in runs:
        pairs = np.array([Contrast(of).p_beyond(0.0) for of in world[8:]])
        found, turned = corrected([p_values("more", Contrast(of), 1.5) for of in world[:8]], pairs)
        wrong = [*(p[0] for p in found[:4]), *(p[1] for p in found[4:]), *turned]
        n_wrong += min(wrong) <= 0.05
    assert n_wrong <= 30  # 20 are expected, and 31 or more in one of a hundred


def test_a_correction_by_hand():
    """Two contrasts with two tests each, and a pair: three may err together."""
    found, turned = corrected([(0.01, 0.9, np.nan), (np.nan, 0.02, 0.5)], np.array([0.03]))
    np.testing.assert_allclose(found, [(0.03, 1.0, np.nan), (np.nan, 0.06, 1.0)])
    np.testing.assert_allclose(turned, [0.09])


@pytest.mark.parametrize("n_runs", [4, 16])
def test_equal_policies_seldom_differ_above_the_noise_floor(n_runs):
    """Distances share undisturbed runs with each other and with the floor; a second."""
    rng = np.random.default_rng(3)
    numbers = []
    for _ in range(2):
        calm = rng.poisson(20.0, size=(600, n_runs, 12)).astype(float)
        rough = rng.poisson(16.0, size=calm.shape).astype(float)
        excess = dtw(calm, rough) - dtw(calm, np.roll(calm, -1, axis=1))
        numbers.append(excess / calm.sum(axis=-1))
    assert (Contrast(numbers[0] - numbers[1]).p_differs <= 0.05).mean() <= 0.075


def test_few_runs_and_equal_runs_decide_little():
    assert np.isnan(Contrast(np.ones((2, 3))).p_differs).all()
    assert Contrast(np.full(5, 0.3)).p_differs == pytest.approx(0.0625)  # the sign test
    assert Contrast(np.full(6, 0.3)).p_differs == pytest.approx(0.03125)
    assert Contrast(np.zeros(6)).p_differs == 1.0
    assert Contrast(np.full(5, 0.3)).p_within(0.4) == pytest.approx(0.03125)
    assert Contrast(np.full(5, 0.3)).p_within(0.2) == 1.0


def test_a_contrast_by_hand():
    found = Contrast([1.0, 2.0, 3.0, 6.0])  # mean 3, standard deviation 2.160, t 2.777 with three degrees
    assert (found.mean, found.sd, found.d) == pytest.approx((3.0, 2.1602469, 1.3887301))
    assert found.interval == pytest.approx((-0.4374349, 6.4374349))
    assert found.band == pytest.approx((3.0 - 4.3204938, 3.0 + 4.3204938))
    assert found.p_differs == pytest.approx(0.0691, abs=1e-4)
    assert found.p_beyond(1.0) == pytest.approx(0.0806, abs=1e-4)
