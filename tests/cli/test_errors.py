"""How commands end: one line on stderr, whatever happens, and names are shown as they are."""

import json
import os
import re
import shutil
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from swarm_forage_env.cli.errors import DEBUG_VARIABLE, end
from swarm_forage_env.cli.options import EXIT_FAILURE, EXIT_UNFORESEEN, EXIT_USAGE, complain
from swarm_forage_env.policies.pretrained import network_file

SHORT = ("--robots", "2", "--objects", "10", "--horizon", "4", "--set", "interval_s=2", "--jobs", "1")


@pytest.fixture
def broken(monkeypatch):
    """Let `swarm-forage list` fail as nobody foresaw."""
    monkeypatch.setattr("swarm_forage_env.inspect.descriptions.overview", None)  # our code calls it


@pytest.mark.usefixtures("broken")
def test_what_nobody_foresaw_is_one_line_and_a_file_with_the_details(command, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    code, out, err = command("list")
    assert (code, out, err.count("\n")) == (EXIT_UNFORESEEN, "", 1)
    assert "an error that should not happen: TypeError: 'NoneType' object is not callable" in err
    kept = Path(re.search(r"Details: (\S+);", err)[1]).read_text(encoding="utf-8")
    for words in ("command: swarm-forage list", "numpy: ", "Traceback", "look.py", "is not callable"):
        assert words in kept


def raised_by(file: Path, function: str) -> Exception:
    """What a function of a file raises that is no package of ours."""
    spec = spec_from_file_location(file.stem, file)
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    with pytest.raises((ValueError, TypeError, AttributeError)) as caught:
        getattr(module, function)()
    return caught.value


def test_code_of_a_user_that_fails_is_not_told_as_a_fault_of_ours(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    file = tmp_path / "mine.py"
    file.write_text(
        "import json\nfrom swarm_forage_env.cli.errors import complain\n"
        "def on_step():\n    json.loads('{')\n"
        "def calls_us():\n    complain(None, 1, 2, 3)\n"
        "def calls_us_wrongly_inside():\n    complain(5, 1)\n"
    )
    assert end(raised_by(file, "on_step"), ("train",)) == EXIT_FAILURE
    told = capsys.readouterr().err
    assert told.startswith(f"swarm-forage: Your code failed in {file}, line 4: json.decoder.JSONDecodeError: ")
    assert "send this file" not in told
    assert "command: swarm-forage train" in Path(re.search(r"Details: (\S+)\.$", told)[1]).read_text(encoding="utf-8")
    assert end(raised_by(file, "calls_us")) == EXIT_FAILURE, "the call was wrong"
    assert end(raised_by(file, "calls_us_wrongly_inside")) == EXIT_UNFORESEEN, "our code failed last"


@pytest.mark.usefixtures("broken")
def test_the_line_says_so_where_the_details_cannot_be_kept(command, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", "/nowhere")
    code, _, err = command("list")
    assert (code, err.count("\n")) == (EXIT_UNFORESEEN, 1)
    assert f"with {DEBUG_VARIABLE}=1 the command shows them" in err


@pytest.mark.usefixtures("broken")
def test_the_debug_variable_shows_the_traceback(command, monkeypatch):
    monkeypatch.setenv(DEBUG_VARIABLE, "1")
    with pytest.raises(TypeError, match="not callable"):
        command("list")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("run", "--seeds", "x"), "Expected --seeds to be a whole number, got 'x'. It is: Runs per policy."),
        (("run", "--seeds", "0"), "Expected --seeds to be a number >= 1, got '0'. It is: Runs per policy."),
        (
            ("run", "--horizon", "long"),
            "Expected --horizon to be a number, got 'long'. It is: Simulated seconds",
        ),
        (("list", "--jobs", "2"), "No such option: --jobs"),
        (("train", "--plan"), "Option '--plan' requires an argument."),
        (("run", "crw", "--seeds"), "Option '--seeds' requires an argument."),
    ],
)
def test_wrong_words_are_told_as_other_errors_are(command, words, told):
    code, _, err = command(*words)
    assert (code, err.count("\n")) == (EXIT_USAGE, 1)
    assert err.startswith(f"swarm-forage: {told}")


def test_too_little_memory_is_told(capsys):
    assert end(MemoryError("Unable to allocate 9 GiB")) == EXIT_FAILURE
    assert "Not enough memory: Unable to allocate 9 GiB; ask for fewer" in capsys.readouterr().err


def test_complaints_hold_no_escape_sequences(capsys):
    assert complain("a\x1b[31mred\nfile\udcff", EXIT_USAGE) == EXIT_USAGE
    assert capsys.readouterr().err == "swarm-forage: a\\x1b[31mred file\\udcff\n"


def test_words_that_are_no_text_are_refused(command):
    code, out, err = command("run", "--policy", "\udcff.npz")
    assert (code, out) == (EXIT_USAGE, "")
    assert "Expected words in UTF-8, got '\\udcff.npz'" in err


def test_names_are_shown_as_they_are_in_tables_and_pictures(command, tmp_path):
    name = "p$x$[red]a[nope].npz"
    shutil.copyfile(network_file("ppo_warehouse_small"), tmp_path / name)
    code, out, err = command("run", "--policy", name, *SHORT, "--out", "[red]o[x]")
    assert code == 0
    assert name.removesuffix(".npz") in out
    assert "picture [red]o[x]/performance.png\n1 record in [red]o[x]" in err


def test_a_terminal_that_knows_ascii_alone_shows_the_rest_as_escapes():
    words = [sys.executable, "-m", "swarm_forage_env.cli", "info", "warehouse_small"]
    told = {**os.environ, "PYTHONIOENCODING": "ascii", "LANG": "C", "LC_ALL": "C"}
    ended = subprocess.run(words, env=told, capture_output=True, timeout=120, check=False)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.isascii()


def test_whoever_reads_the_output_may_stop(tmp_path):
    words = f"{sys.executable} -m swarm_forage_env.cli info warehouse_small | head -1"
    ended = subprocess.run(words, shell=True, capture_output=True, text=True, timeout=120, check=False, cwd=tmp_path)
    assert ended.stdout.startswith("warehouse_small:")
    assert ended.stderr == ""


def test_the_guard_is_around_every_command(command, monkeypatch, tmp_path):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr("swarm_forage_env.inspect.descriptions.overview", None)
    assert command("list")[0] == EXIT_UNFORESEEN


def test_a_missing_word_is_explained_and_our_own_words_have_no_prefix(command):
    code, _, err = command("export", "generalist")
    assert code == 2
    assert err.startswith("swarm-forage: Missing option '--file'. It is: File to write")
    assert command("export", "--file", "net.h")[2].startswith("swarm-forage: Expected a policy")


def test_a_policy_that_cannot_run_at_all_is_told_once_with_the_reason_and_what_to_do(command):
    in_the_way = ("--set", "obstacles=13.5,7.5,15.5,8.5")
    code, out, err = command("run", "stochm", *SHORT, *in_the_way, "--seeds", "4")
    assert code == 1
    (told,) = out.splitlines()
    assert "stochm in warehouse_small, 2 robots, seed 0, and 3 more of its runs: " in told
    assert told.endswith("; move nest or obstacles, or do without static caches.")
    assert err.count("again, alone: ") == 1
    _, out, _ = command("run", "stochm", *SHORT, *in_the_way, "--seeds", "4", "--json")
    assert len(json.loads(out)["failures"]) == 4
