"""What commands do when the machine fails them: full disks, too little memory, SIGTERM. One line, no traceback."""

import os
import signal
import time
from importlib.util import find_spec

import pytest

from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import RandomPolicy
from swarm_forage_env.runs.store import load

RUN = ("run", "--policy", "random", "--robots", "3", "--horizon", "4", "--set", "interval_s=2", "--jobs", "1")
needs_training = pytest.mark.skipif(
    find_spec("stable_baselines3") is None or find_spec("torch") is None, reason="needs the train extra"
)
FILMED = ("--policy", "random", "--robots", "3")


@pytest.mark.parametrize(
    "words",
    [
        RUN,
        ("score", "--policy", "random", "--budget", "quick", "--jobs", "1"),
        ("score", "--policy", "random,crw", "--budget", "quick", "--jobs", "1"),
        ("study", "run", "S1a", "--budget", "smoke", "--jobs", "1"),
        ("record", *FILMED),
        ("replay", "random", "--robots", "3"),
        pytest.param(("train", "--robots", "3", "--steps", "1", "--arenas", "1"), marks=needs_training),
    ],
    ids=lambda words: words[0],
)
def test_a_full_disk_is_told_before_anything_is_run(command, full_disk, monkeypatch, words):
    monkeypatch.setattr(ForageEnv, "reset_batch", lambda *_, **__: pytest.fail("a run was started"))
    code, out, err = command(*words)
    assert (code, out) == (1, "")
    assert err.splitlines()[-1].startswith("swarm-forage: File too large: results")
    assert "Traceback" not in err


def test_sigterm_keeps_finished_runs_as_ctrl_c_does(command, monkeypatch):
    command(*RUN, "--seeds", "1")
    before = signal.getsignal(signal.SIGTERM)

    def terminated(self, task, rng):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(60)

    monkeypatch.setattr(RandomPolicy, "reset", terminated)
    code, _, err = command(*RUN, "--seeds", "3")
    assert code == 143
    assert "Interrupted: 1 of 3 runs are finished and kept." in err.splitlines()[-1]
    assert len(load("results/warehouse_small_3_robots_4_s_20cdbe")) == 1
    assert signal.getsignal(signal.SIGTERM) == before
