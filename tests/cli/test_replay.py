"""The command `replay`: pages of policies and of stored runs."""

import shutil
from pathlib import Path

import pytest

from swarm_forage_env.inspect.replay.files import read_replays
from swarm_forage_env.policies import pretrained
from swarm_forage_env.runs.store import RunStore

SHORT = ("--robots", "3", "--seconds", "4")


def test_replay_writes_a_page(command):
    code, out, err = command("replay", "random", *SHORT, "--file", "new/run.html")
    assert (code, err) == (0, "")
    assert out.startswith("wrote new/run.html (0.1 MB)")
    (replay,) = read_replays("new/run.html")
    assert (replay.label, replay.n_frames, replay.scenario.robots.n_robots) == ("random", 5, 3)
    assert command("replay", "random", *SHORT)[1].startswith("wrote results/warehouse_small_3_robots_random.html")


def test_replay_shows_runs_of_one_world_and_seed_side_by_side(command):
    shutil.copy(Path(pretrained.__file__).with_name("ppo_warehouse_small.npz"), "mine.npz")
    words = ("--seed", "7", "--wrapper", "throttle:waveform=constant,amplitude=0.2")
    code, _, err = command("replay", "stochm", "crw", "mine.npz", *SHORT, *words, "--file", "a.html")
    assert (code, err) == (0, "")
    replays = read_replays("a.html")
    assert [replay.label for replay in replays] == ["stochm", "crw", "mine"]
    assert [replay.scenario.caches for replay in replays] == ["static", "none", "none"]
    assert {replay.spec.seed for replay in replays} == {7}
    assert [list(replay.signals) for replay in replays] == [["throttle"]] * 3
    starts = {replay.position[0].tobytes() for replay in replays}
    assert len(starts) == 1


@pytest.fixture
def stored(command):
    """A stored run and the words that make it."""
    words = ("--policy", "dpo", "--robots", "3", "--horizon", "200", "--first-seed", "4", "--jobs", "1")
    assert command("run", *words)[0] == 0
    (record,) = RunStore("results/warehouse_small_3_robots_200_s").records()
    return record


def test_replay_makes_a_stored_run_again(command, stored):
    for word in (stored.run_id, f"results/warehouse_small_3_robots_200_s/{stored.run_id}.parquet"):
        code, _, err = command("replay", word, "crw", "--file", "run.html")
        assert (code, err) == (0, "")
        mine, beside = read_replays("run.html")
        assert mine.spec.run_id == stored.run_id
        assert (beside.spec.seed, beside.scenario) == (4, mine.scenario)
        assert mine.counters[-1, 0] == stored.collected.sum()


def test_replay_says_when_a_stored_run_comes_out_different(command, stored):
    import dataclasses

    other = dataclasses.replace(stored, n_carrying=stored.n_carrying + 1.0)
    other.write("results/other.parquet")
    code, _, err = command("replay", "results/other.parquet", "--file", "run.html")
    assert code == 0
    assert "comes out different from its record" in err
