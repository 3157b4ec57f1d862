"""How commands end that fail: what a user can mend is a line on stderr, all else a traceback."""

import subprocess
import sys
from importlib.util import find_spec

import pytest

from swarm_forage_env.env import ForageEnv


def test_what_nobody_foresaw_is_raised(command, monkeypatch):
    monkeypatch.setattr("swarm_forage_env.inspect.descriptions.overview", None)  # our code calls it
    with pytest.raises(TypeError, match="not callable"):
        command("list")


@pytest.mark.parametrize(
    ("error", "code", "told"),
    [
        (OSError(28, "No space left on device", "here"), 1, "No space left on device: here"),
        (KeyboardInterrupt("Interrupted: 3 runs are kept."), 130, "Interrupted: 3 runs are kept."),
        (KeyboardInterrupt(), 130, "Interrupted. Unfinished work is not kept; run the same command to start again."),
    ],
)
def test_what_happens_to_a_user_is_one_line(command, monkeypatch, error, code, told):
    def overview(_):
        raise error

    monkeypatch.setattr("swarm_forage_env.inspect.descriptions.overview", overview)
    assert command("list") == (code, "", f"swarm-forage: {told}\n")


MAIN = f"{sys.executable} -c 'from swarm_forage_env.cli import main; main()'"
DRAWS_AT_LAST = MAIN.replace("-c '", '-c \'import atexit; atexit.register(__import__, "matplotlib"); ')


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "out", "err"),
    [
        (f"{MAIN} info warehouse_small | head -1", "warehouse_small: ", ""),
        (f"{MAIN} info warehouse_small >&-", "", "swarm-forage: Expected a standard output to write to, got a closed"),
        (f"{MAIN} info nobody 2>&-", "", ""),
        (f"echo 'raise ImportError(42)' > polars.py; {MAIN} list", "", "swarm-forage: Cannot import polars: 42"),
        (f"MPLBACKEND=nonsense {DRAWS_AT_LAST} --version", "swarm-forage ", ""),
        (f"mkdir gone; cd gone; rmdir ../gone; {MAIN} info a.toml", "", "swarm-forage: The working folder is gone; "),
    ],
)
def test_where_a_command_reads_and_writes_may_be_gone(tmp_path, words, out, err):
    """Whoever reads the output may stop, too."""
    ended = subprocess.run(words, shell=True, capture_output=True, text=True, timeout=120, check=False, cwd=tmp_path)
    assert ended.stdout.startswith(out)
    assert ended.stderr.startswith(err)
    assert (ended.stdout.count("\n"), ended.stderr.count("\n")) == (bool(out), bool(err))


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
