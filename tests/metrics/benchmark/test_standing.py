"""What entries are worth: shares of the best scripted controller, their middle half, and how sure the score is."""

import json
from dataclasses import replace

import numpy as np
import pytest

from metrics import PAPER_POLICIES
from metrics.benchmark import Training, board_of, load_protocol
from metrics.benchmark.standing import best_of, entries_of_package, score_of, standings_of
from tests.support.entries import made_up_entry, write_package


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two controllers are best in every other world: 19 and 21 there, so 20 on average."""
    place = tmp_path_factory.mktemp("benchmark")
    best = (lambda k: 19.0 if k % 2 else 9.0), (lambda k: 9.0 if k % 2 else 19.0)
    write_package(place, (*best, lambda k: 1.0, lambda k: 2.0))
    return place


@pytest.fixture
def protocol(folder, monkeypatch):
    monkeypatch.setattr("metrics.benchmark.protocol.FOLDER", folder)
    return load_protocol()


def standing(protocol, performance, **fields):
    (found,) = standings_of([made_up_entry(protocol, "mine", performance, **fields)], protocol)
    return found


def test_the_reference_is_the_best_scripted_controller_of_each_world(protocol):
    assert best_of(PAPER_POLICIES, protocol.worlds, protocol).tolist() == [20.0] * 6


def test_no_scripted_controller_wins_against_itself():
    protocol = load_protocol()
    entries = entries_of_package(PAPER_POLICIES, protocol)
    assert tuple(entry.name for entry in entries) == PAPER_POLICIES
    found = standings_of(entries, protocol)
    assert [one.won for one in found] == [0] * len(entries)
    assert np.isfinite([one.by_world for one in found]).all()


def test_the_score_is_the_interquartile_mean_of_shares(protocol):
    found = standing(protocol, lambda k: 39.0)
    assert (found.score.value, found.worst, found.in_training) == pytest.approx((2.0, 2.0, 2.0))
    assert found.won == 5
    assert (found.score.lower, found.score.upper) == pytest.approx((2.0, 2.0)), "all worlds are alike"


def test_one_world_in_which_a_policy_is_lucky_does_not_decide(protocol):
    found = standing(protocol, lambda k: 1e6 if k == 5 else 9.0)
    assert found.score.value == pytest.approx(0.5, abs=0.1)
    assert found.won == 1
    assert found.score.lower < found.score.value < found.score.upper


def test_the_worst_tenth_is_three_of_33_worlds():
    protocol = load_protocol()
    first = len(protocol.training)
    best = best_of(PAPER_POLICIES, protocol.worlds, protocol)
    entry = made_up_entry(protocol, "steps", lambda k: 0.0)
    runs = {world.name: ((best[k] * (1 + (k - first) % 33),) * 3,) for k, world in enumerate(protocol.worlds)}
    (found,) = standings_of([replace(entry, runs=runs)], protocol)
    assert found.worst == pytest.approx(2.0), "the mean of 1, 2 and 3"


def test_a_training_that_failed_counts_as_one_of_all(protocol):
    """Four trainings are twice as good as the best of the four, one achieves nothing; a middle half would hide it."""
    made = made_up_entry(protocol, "five", lambda k: 39.0, n_policies=5, training=Training(worlds="given"))
    runs = {world: (*rows[:4], (0.0, 0.0)) for world, rows in made.runs.items()}
    (found,) = standings_of([replace(made, runs=runs)], protocol)
    assert found.by_policy == pytest.approx([2.0, 2.05, 2.1, 2.15, 0.0])
    assert found.score.value == pytest.approx(8.3 / 5)


def test_the_interval_counts_trainings(protocol):
    """Worlds are alike, so it is Student's with one degree of freedom, 12.7, over the scores of the two."""
    found = standing(protocol, lambda k: 18.5, n_policies=2)
    low, high = found.by_policy
    half = 12.7062047 * (high - low) / 2.0
    assert (found.score.lower, found.score.upper) == pytest.approx((found.score.value - half, found.score.value + half))


@pytest.mark.parametrize("of_trainings", [0.03, 0.15])
def test_95_percent_of_intervals_hold_the_truth(of_trainings):
    """Trainings, groups and worlds differ, with effects of their own and together; worlds of a group are alike."""
    rng = np.random.default_rng(2)
    n, groups = 150, load_protocol().groups
    of_groups = rng.normal(size=(n, 1, len(groups), 1))[:, :, [groups.index(name) for name in groups]]
    trainings, worlds = rng.normal(size=(n, 5, 1, 1)), rng.normal(size=(n, 1, 33, 1))
    both, runs = rng.normal(size=(n, 5, 33, 1)), rng.normal(size=(n, 5, 33, 3))
    shares = 1.0 + of_trainings * trainings + 0.22 * of_groups + 0.08 * worlds + 0.12 * both + 0.09 * runs
    single = [str(world) for world in range(len(groups))]
    holding, by_worlds = (np.mean([score_of(one, kinds).holds(1.0) for one in shares]) for kinds in (groups, single))
    assert 0.90 <= holding <= 0.97
    assert by_worlds < 0.90


def test_the_board_ranks_by_score_and_says_where_policies_were_trained(protocol):
    told = Training(worlds="held-out", decisions=9_984_000)
    entries = [
        made_up_entry(protocol, "mine", lambda k: 29.0, n_policies=2, training=told),
        made_up_entry(protocol, "crw", lambda k: 5.0),
    ]
    (rows,) = json.loads(board_of(entries).json()).values()
    assert [row["entry"] for row in rows] == ["mine", "dpo", "crw", "stochx", "stochm"]
    assert [row["trained in"] for row in rows[:2]] == ["held-out worlds, too", "not trained"]
    assert [row["trainings"] for row in rows[:2]] == ["2 x 10.0M", ""]
