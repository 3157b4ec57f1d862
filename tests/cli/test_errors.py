"""How commands end: one line on stderr, whatever happens, and names are shown as they are."""

import re
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from swarm_forage_env.cli.errors import DEBUG_VARIABLE, end
from swarm_forage_env.cli.options import EXIT_FAILURE, EXIT_UNFORESEEN


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
def test_the_debug_variable_shows_the_traceback(command, monkeypatch):
    monkeypatch.setenv(DEBUG_VARIABLE, "1")
    with pytest.raises(TypeError, match="not callable"):
        command("list")


def test_too_little_memory_is_told(capsys):
    assert end(MemoryError("Unable to allocate 9 GiB")) == EXIT_FAILURE
    assert "Not enough memory: Unable to allocate 9 GiB; ask for fewer" in capsys.readouterr().err


def test_whoever_reads_the_output_may_stop(tmp_path):
    words = f"{sys.executable} -m swarm_forage_env.cli info warehouse_small | head -1"
    ended = subprocess.run(words, shell=True, capture_output=True, text=True, timeout=120, check=False, cwd=tmp_path)
    assert ended.stdout.startswith("warehouse_small:")
    assert ended.stderr == ""
