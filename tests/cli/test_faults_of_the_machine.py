"""What commands do when the disk is full: one line, before anything is run."""

from importlib.util import find_spec

import pytest

from swarm_forage_env.env import ForageEnv

RUN = ("run", "random", "--robots", "3", "--horizon", "4", "--set", "interval_s=2", "--jobs", "1")
needs_training = pytest.mark.skipif(
    find_spec("stable_baselines3") is None or find_spec("torch") is None, reason="needs the train extra"
)
FILMED = ("random", "--robots", "3")


@pytest.mark.parametrize(
    "words",
    [
        RUN,
        ("score", "random", "--budget", "quick", "--jobs", "1"),
        ("score", "random,crw", "--budget", "quick", "--jobs", "1"),
        ("study", "run", "S1a", "--budget", "smoke", "--jobs", "1"),
        ("record", *FILMED),
        ("replay", "random", "--robots", "3"),
        pytest.param(("train", "--robots", "3", "--steps", "1", "--set", "n_arenas=1"), marks=needs_training),
    ],
    ids=lambda words: words[0],
)
def test_a_full_disk_is_told_before_anything_is_run(command, full_disk, monkeypatch, words):
    monkeypatch.setattr(ForageEnv, "reset_batch", lambda *_, **__: pytest.fail("a run was started"))
    code, out, err = command(*words)
    assert (code, out) == (1, "")
    assert err.splitlines()[-1].startswith("swarm-forage: File too large: results")
    assert "Traceback" not in err
