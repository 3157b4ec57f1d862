"""What commands do when the machine fails them: full disks, too little memory, SIGTERM. One line, no traceback."""

import ctypes
import gc
import os
import resource
import signal
import time
from importlib.util import find_spec
from pathlib import Path

import pytest

from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import RandomPolicy
from swarm_forage_env.runs.record import RunRecord
from swarm_forage_env.runs.store import load

RUN = ("run", "--policy", "random", "--robots", "3", "--horizon", "4", "--set", "interval_s=2", "--jobs", "1")
NO_SPACE = OSError(28, "No space left on device")
needs_training = pytest.mark.skipif(
    find_spec("stable_baselines3") is None or find_spec("torch") is None, reason="needs the train extra"
)
FILMED = ("--policy", "random", "--robots", "3")


@pytest.mark.parametrize(
    "words",
    [
        RUN,
        ("score", "--policy", "random", "--budget", "quick", "--jobs", "1"),
        ("compare", "--policy", "random,crw", "--budget", "quick", "--jobs", "1"),
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


@pytest.mark.parametrize(
    "words", [("record", "--file", "taken.gif", *FILMED), ("replay", "random", "--file", "taken.gif")]
)
def test_a_folder_in_the_place_of_the_file_is_told_before_anything_is_run(command, monkeypatch, words):
    Path("taken.gif").mkdir()
    monkeypatch.setattr(ForageEnv, "reset_batch", lambda *_, **__: pytest.fail("a run was started"))
    assert command(*words) == (1, "", "swarm-forage: Expected a file to write, got a folder: taken.gif\n")


@pytest.mark.parametrize(
    "words",
    [
        (*RUN, "--out", "taken"),
        ("score", "--policy", "random", "--budget", "quick", "--jobs", "1", "--out", "taken"),
        ("study", "run", "S1a", "--budget", "smoke", "--jobs", "1", "--out", "taken"),
    ],
    ids=lambda words: words[0],
)
def test_a_file_in_the_place_of_the_folder_cannot_be_written_to(command, monkeypatch, words):
    """It is no mistake in the words: the same command can succeed elsewhere, as with a full disk."""
    Path("taken").touch()
    monkeypatch.setattr(ForageEnv, "reset_batch", lambda *_, **__: pytest.fail("a run was started"))
    code, out, err = command(*words)
    assert (code, out) == (1, "")
    assert err.splitlines()[-1].endswith(": taken")


def test_a_disk_that_fills_up_later_ends_the_command_with_one_line(command, monkeypatch):
    def full(self, path):
        raise OSError(*NO_SPACE.args, str(path))

    monkeypatch.setattr(RunRecord, "write", full)
    code, out, err = command(*RUN)
    assert (code, out) == (1, "")
    folder = "results/warehouse_small_3_robots_4_s_20cdbe"
    assert err.splitlines()[-1].startswith(f"swarm-forage: No space left on device: {folder}/")
    assert "Traceback" not in err


def test_results_are_shown_even_if_their_picture_cannot_be_written(command, monkeypatch):
    def full(*_, **options):
        raise NO_SPACE

    monkeypatch.setattr("metrics.scoring.summary.draw_curves", full)
    code, out, err = command(*RUN)
    assert code == 0
    assert "random" in out
    picture = "results/warehouse_small_3_robots_4_s_20cdbe/performance.png"
    assert f"No picture {picture}: No space left on device." in " ".join(err.split())


@pytest.mark.parametrize("words", [("run", "random"), ("score", "random")])
def test_a_picture_of_an_unknown_kind_is_told_before_anything_is_run(command, monkeypatch, words):
    monkeypatch.setattr(ForageEnv, "reset_batch", lambda *_, **__: pytest.fail("a run was started"))
    told = "swarm-forage: Expected a picture file that ends in .png, .svg, .pdf, got 'wrong.gif'.\n"
    assert command(*words, "--jobs", "1", "--picture", "wrong.gif") == (2, "", told)


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


@pytest.mark.parametrize(("number", "expected"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
@pytest.mark.parametrize("fails", [True, False], ids=["compiler fails", "compiler goes on"])
def test_an_interrupt_that_llvm_swallows_still_ends_the_command(number, expected, fails, command, monkeypatch):
    @ctypes.CFUNCTYPE(None)
    def called_from_c():  # as LLVM calls Python: what it raises goes nowhere
        os.kill(os.getpid(), number)
        time.sleep(0.01)

    def compiling(self, task, rng):
        called_from_c()
        if fails:
            raise RuntimeError("no compiled object yet")
        time.sleep(60)

    monkeypatch.setattr(RandomPolicy, "reset", compiling)
    code, _, err = command("record", "--policy", "random", "--robots", "2", "--seconds", "20")
    assert code == expected, err
    assert "should not happen" not in err
    assert "Traceback" not in err


@pytest.mark.compiled
def test_a_run_that_memory_does_not_suffice_for_fails_with_one_line(command):
    swarm = ("run", "--scenario", "warehouse_medium", "--robots", "1000", "--objects", "20000", "--horizon", "200")
    gc.collect()  # what earlier tests have left may be as large as what is refused here
    taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (taken + 150_000_000, before[1]))  # memories of dpo would take 400 MB
    try:
        code, out, err = command(*swarm, "--policy", "dpo", "--jobs", "1", "--seeds", "1")
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)
    assert (code, out.count("\n")) == (1, 1)
    assert "MemoryError: Unable to allocate" in out
    assert "Traceback" not in err
