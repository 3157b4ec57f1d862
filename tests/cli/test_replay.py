"""The command `replay`: pages of policies and of stored runs."""

import shutil
from pathlib import Path

from swarm_forage_env.inspect.replay.files import read_replays
from swarm_forage_env.policies import pretrained
from swarm_forage_env.runs.record import Record

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


def test_replay_makes_a_stored_run_again(command):
    assert command("run", "dpo", "--robots", "3", "--horizon", "200", "--jobs", "1")[0] == 0
    (file,) = Path("results/warehouse_small_3_robots_200_s").glob("*.parquet")
    stored = Record.read(file)
    code, out, err = command("replay", str(file))
    assert (code, err) == (0, "")
    (replay,) = read_replays(out.split()[1])
    assert replay.spec.run_id == stored.run_id
    assert replay.counters[-1, 0] == stored["collected"].sum()
    for beside in (("crw",), ("--seed", "3"), ("--robots", "2")):
        code, _, err = command("replay", str(file), *beside)
        assert (code, err.count("\n")) == (2, 1)
        assert "Expected stored runs alone" in err
