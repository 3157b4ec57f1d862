"""What entries are worth, checked on numbers made up: shares of the best scripted controller."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from metrics import PAPER_POLICIES
from metrics.benchmark import Board, Training, load_protocol, read_entry
from metrics.benchmark.board import bounded
from metrics.benchmark.standing import over_trainings, reference_of, scripted_entries, standing_of
from metrics.statistics import interquartile_mean
from tests.support.entries import TINY, made_up_entry
from tests.support.pictures import words_in


@pytest.fixture(scope="module")
def protocol():
    return load_protocol(TINY)


@pytest.fixture(scope="module")
def scripted(protocol):
    """The first two are best in every other world: 19 and 21 there, so 20 on average."""
    best = (lambda k: 19.0 if k % 2 else 9.0), (lambda k: 9.0 if k % 2 else 19.0)
    performances = (*best, lambda k: 1.0, lambda k: 2.0)
    return [made_up_entry(protocol, name, p) for name, p in zip(PAPER_POLICIES, performances, strict=True)]


@pytest.fixture(scope="module")
def reference(protocol, scripted):
    return reference_of(scripted, protocol)


def test_the_reference_is_the_best_scripted_controller_of_each_world(protocol, reference):
    assert {world: runs.tolist() for world, runs in reference.items()} == {
        world.name: [19.0, 21.0] for world in protocol.worlds if world.is_scored
    }
    assert "room, 1 robot" not in reference


def test_no_scripted_controller_wins_against_itself():
    protocol = load_protocol()
    entries = scripted_entries(protocol)
    assert tuple(entry.name for entry in entries) == PAPER_POLICIES
    reference = reference_of(entries, protocol)
    assert min(runs.mean() for runs in reference.values()) > 0.0, "shares exist in every world"
    assert [standing_of(entry, reference, protocol).n_won for entry in entries] == [0] * len(entries)


def test_the_score_is_the_interquartile_mean_of_shares(protocol, reference):
    standing = standing_of(made_up_entry(protocol, "twice", lambda k: 39.0), reference, protocol)
    assert standing.score.value == pytest.approx(2.0)
    assert standing.score.lower <= 2.0 <= standing.score.upper
    assert (standing.n_won, standing.n_worlds) == (5, 5)
    assert standing.improvement.value == 1.0
    assert (standing.calm, standing.disturbed, standing.training) == pytest.approx((2.0, 2.0, 2.0))
    assert standing.interference == pytest.approx(0.1)
    assert standing.by_policy == standing.won_by_policy == ()


def test_one_world_in_which_a_policy_is_lucky_does_not_decide(protocol, reference):
    lucky = made_up_entry(protocol, "lucky", lambda k: 1e6 if protocol.worlds[k].name == "room, noisy wheels" else 9.0)
    standing = standing_of(lucky, reference, protocol)
    assert standing.score.value == pytest.approx(0.5, abs=0.1)
    assert standing.n_won == 1
    assert standing.disturbed > standing.calm


def test_each_training_seed_has_a_score_of_its_own(protocol, reference):
    standing = standing_of(made_up_entry(protocol, "two", lambda k: 18.5, n_policies=2), reference, protocol)
    assert standing.by_policy == (pytest.approx(19.5 / 20), pytest.approx(20.5 / 20))
    assert standing.won_by_policy == (0, 5)


def test_the_interval_of_a_trained_entry_counts_its_trainings(protocol, reference):
    """Students' t with one degree of freedom, 12.7, times the deviation of the two scores over the root of two."""
    given = Training(worlds="given")
    two = standing_of(made_up_entry(protocol, "two", lambda k: 18.5, n_policies=2, training=given), reference, protocol)
    low, high = two.by_policy
    half = 12.7062047 * (high - low) / 2.0
    assert (two.score.lower, two.score.upper) == pytest.approx((two.score.value - half, two.score.value + half))
    one = standing_of(made_up_entry(protocol, "one", lambda k: 18.5, training=given), reference, protocol)
    assert math.isnan(one.score.lower)
    assert math.isnan(one.improvement.upper)
    assert bounded(one.score) == "0.97"
    script = standing_of(made_up_entry(protocol, "script", lambda k: 18.5), reference, protocol)
    assert script.score.lower < script.score.value < script.score.upper


def test_a_training_that_failed_counts_as_one_of_all(protocol, reference):
    """Four trainings are twice as good as the best of the four, one achieves nothing; a middle half would hide it."""
    made = made_up_entry(protocol, "five", lambda k: 39.0, n_policies=5, training=Training(worlds="given"))
    runs = {world: replace(run, performance=(*run.performance[:4], (0.0, 0.0))) for world, run in made.runs.items()}
    standing = standing_of(replace(made, runs=runs), reference, protocol)
    assert standing.score.value == pytest.approx(np.mean([*standing.by_policy[:4], 0.0]))
    assert standing.calm == pytest.approx(standing.score.value, rel=0.05)


def test_policies_without_training_are_judged_by_all_their_runs(protocol, reference):
    """One is twice as good as the best of the four and one achieves nothing: the middle half of all lies between."""
    made = made_up_entry(protocol, "two", lambda k: 39.0, n_policies=2)
    runs = {world: replace(run, performance=(run.performance[0], (0.0, 0.0))) for world, run in made.runs.items()}
    standing = standing_of(replace(made, runs=runs), reference, protocol)
    whole = interquartile_mean([np.ravel(runs[world.name].performance) / 20.0 for world in protocol.scored])
    assert standing.score.value == pytest.approx(whole.value)
    assert standing.score.lower < standing.score.value < standing.score.upper
    assert standing.by_policy[1] == 0.0


@pytest.mark.parametrize(("n_trainings", "spread"), [(2, 0.3), (5, 0.05)])
def test_intervals_over_trainings_hold_the_truth(n_trainings, spread):
    """Trainings scatter by `spread`, runs by 0.1: about 95 of 100 intervals hold the score of all trainings."""
    rng = np.random.default_rng(1)
    worlds = rng.uniform(0.6, 1.6, 26)

    def shares(n):
        trainings = 1.0 + spread * rng.standard_normal((n, 1, 1))
        return worlds[:, None] * trainings * (1.0 + 0.1 * rng.standard_normal((n, 26, 3)))

    def middle(values):
        return interquartile_mean(values.reshape(-1), n_resamples=1)

    truth = np.mean([middle(of_one).value for of_one in shares(5_000)])
    held = 0
    for _ in range(400):
        of_entry = shares(n_trainings)
        held += over_trainings([middle(of_one) for of_one in of_entry]).holds(truth)
    assert 0.92 * 400 <= held <= 0.985 * 400


def test_the_figure_shows_every_entry_and_world(protocol, scripted, reference, tmp_path):
    pytest.importorskip("matplotlib")
    standings = tuple(standing_of(e, reference, protocol) for e in scripted)
    Board(standings=standings, reference=reference, protocol=protocol).draw(tmp_path / "it.svg")
    assert {"CRW", "DPO", "STOCHM", "STOCHX", "room, noisy wheels"} <= {*words_in(tmp_path / "it.svg")}


def test_readme_tells_of_the_minute_what_its_entry_says():
    root = Path(__file__).parents[3]
    protocol = load_protocol()
    entry = read_entry(root / "docs/benchmark/minute.json")
    standing = standing_of(entry, reference_of(scripted_entries(protocol), protocol), protocol)
    assert len(standing.won_by_policy) == 5
    median = sorted(standing.won_by_policy)[2]
    assert median >= 20
    words = " ".join((root / "README.md").read_text(encoding="utf-8").split())
    n_worlds = len(protocol.scored)
    assert (
        f"of five such trainings, the median beats all four of the paper's controllers in {median} of {n_worlds}"
        in words
    )
    assert f", and the worst in {min(standing.won_by_policy)}. " in words
