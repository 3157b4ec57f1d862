"""Entry files: what is written is read back, and a file that is no whole entry is refused in a clear line."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from metrics import PAPER_POLICIES
from metrics.benchmark import BenchmarkError, Training, load_protocol, read_entry
from metrics.benchmark.board import bounded
from metrics.benchmark.entry import entry_command
from metrics.benchmark.standing import reference_of, scripted_entries, standing_of
from swarm_forage_env.runs.spec import identity_of
from tests.support.entries import TINY, made_up_entry


@pytest.fixture(scope="module")
def protocol():
    return load_protocol(TINY)


@pytest.fixture
def file(protocol, tmp_path):
    path = tmp_path / "entry.json"
    made_up_entry(protocol, "one", lambda k: 10.0 + k, n_policies=2).write(path)
    return path


def test_what_is_written_is_read_back(protocol, file):
    entry = made_up_entry(protocol, "one", lambda k: 10.0 + k, n_policies=2)
    found = read_entry(file, protocol)
    assert found == entry
    np.testing.assert_array_equal(found.performance("training: here"), [[10.0, 12.0], [11.0, 13.0]])
    assert sum(line.startswith('  "room, ') for line in file.read_text().splitlines()) == 6, "a line per world"


def put(*path_and_value):
    *path, last, value = path_and_value

    def change(content):
        for key in path:
            content = content[key]
        content[last] = value

    return change


ROOM = ("runs", "room, 2 robots")
ODD = {
    "protocol": (put("protocol", "0" * 16), "got one of other worlds or seeds"),
    "name": (put("name", "\x1b[31m"), "Expected name to be a non-empty text without control characters"),
    "amount": (put(*ROOM, "performance", 0, 0, -1.0), r"performance\[0\]\[0\] to be a finite number >= 0"),
    "share": (put(*ROOM, "interference", 0, 0, 1.5), r"interference.* to be a number from 0 to 1"),
    "unknown key": (put(*ROOM, "beauty", [[1.0, 1.0]] * 2), "Unknown key .*beauty"),
    "missing world": (lambda content: content["runs"].pop("room, 2 robots"), "see 'room, 2 robots'"),
}


@pytest.mark.parametrize(("change", "message"), ODD.values(), ids=ODD)
def test_an_entry_from_a_stranger_is_refused_by_the_name_of_the_field(change, message, protocol, file):
    content = json.loads(file.read_text())
    change(content)
    del content["digest"]
    file.write_text(json.dumps(content | {"digest": identity_of(content)}))
    with pytest.raises(BenchmarkError, match=message) as refused:
        read_entry(file, protocol)
    assert str(file) in str(refused.value)


def test_altered_numbers_are_found(protocol, file):
    content = json.loads(file.read_text())
    put(*ROOM, "performance", 0, 0, 77.0)(content)
    file.write_text(json.dumps(content))
    with pytest.raises(BenchmarkError, match="the digest does not fit"):
        read_entry(file, protocol)


def test_one_network_in_two_files_is_no_two_trainings(protocol, tmp_path):
    in_short = Training(worlds="given", track="short", decisions=100)
    entry = made_up_entry(protocol, "copies", lambda k: 10.0, n_policies=2, training=in_short)
    for digests in ("ab", "aa"):
        policies = tuple(replace(one, digest=mark) for one, mark in zip(entry.policies, digests, strict=True))
        replace(entry, policies=policies).write(tmp_path / f"{digests}.json")
    assert read_entry(tmp_path / "ab.json", protocol).name == "copies"
    with pytest.raises(BenchmarkError, match=r"Expected different trainings in .*aa\.json, got one file twice"):
        read_entry(tmp_path / "aa.json", protocol)


def test_a_command_names_files_from_here_and_the_track_of_a_training(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given = [str(tmp_path / "deep" / "a.npz"), "b.npz", str(tmp_path / "a.py") + ":Mine", "crw"]
    words = "swarm-forage benchmark deep/a.npz b.npz a.py:Mine crw --name x"
    assert entry_command(given, "x", training=Training(worlds="given", decisions=5)) == words
    in_short = Training(worlds="given", track="short", decisions=100)
    assert entry_command(given, "x", training=in_short) == f"{words} --trained-in given --track short --decisions 100"


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
    assert standing.disturbed > 1000.0, "no calm world is among them"
    assert standing.calm == pytest.approx(0.5)


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


def test_readme_tells_of_the_minute_what_its_entry_says():
    root = Path(__file__).parents[3]
    protocol = load_protocol()
    entry = read_entry(root / "docs/benchmark/minute.json")
    standing = standing_of(entry, reference_of(scripted_entries(protocol), protocol), protocol)
    *most, last = sorted(standing.won_by_policy, reverse=True)
    words = " ".join((root / "README.md").read_text(encoding="utf-8").split())
    won = f"{', '.join(map(str, most))} and {last} of {len(protocol.scored)} worlds"
    assert f"five such trainings beat the paper's four controllers in {won}" in words
