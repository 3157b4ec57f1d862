"""How commands end that fail: what a user can mend is a line on stderr, all else a traceback."""

import subprocess
import sys

import pytest


def test_what_nobody_foresaw_is_raised(command, monkeypatch):
    monkeypatch.setattr("swarm_forage_env.inspect.descriptions.overview", None)  # our code calls it
    with pytest.raises(TypeError, match="not callable"):
        command("list")


@pytest.mark.parametrize(
    ("error", "code", "told"),
    [
        (OSError(28, "No space left on device", "here"), 1, "No space left on device: here"),
        (ImportError("No picture without matplotlib"), 1, "No picture without matplotlib"),
        (KeyboardInterrupt("Interrupted: 3 runs are kept."), 130, "Interrupted: 3 runs are kept."),
        (KeyboardInterrupt(), 130, "Interrupted. Unfinished work is not kept; run the same command to start again."),
    ],
)
def test_what_happens_to_a_user_is_one_line(command, monkeypatch, error, code, told):
    def overview(_):
        raise error

    monkeypatch.setattr("swarm_forage_env.inspect.descriptions.overview", overview)
    assert command("list") == (code, "", f"swarm-forage: {told}\n")


def test_whoever_reads_the_output_may_stop(tmp_path):
    words = f"{sys.executable} -m swarm_forage_env.cli info warehouse_small | head -1"
    ended = subprocess.run(words, shell=True, capture_output=True, text=True, timeout=120, check=False, cwd=tmp_path)
    assert ended.stdout.startswith("warehouse_small:")
    assert ended.stderr == ""
