"""How commands end that fail: with a line on stderr."""

import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from swarm_forage_env.cli.errors import end
from swarm_forage_env.cli.options import EXIT_FAILURE, EXIT_UNFORESEEN


@pytest.fixture
def broken(monkeypatch):
    """Let `swarm-forage list` fail as nobody foresaw."""
    monkeypatch.setattr("swarm_forage_env.inspect.descriptions.overview", None)  # our code calls it


@pytest.mark.usefixtures("broken")
def test_what_nobody_foresaw_is_told_with_its_traceback(command):
    code, out, err = command("list")
    assert (code, out) == (EXIT_UNFORESEEN, "")
    assert err.startswith("Traceback")
    assert "TypeError: 'NoneType' object is not callable" in err
    assert err.endswith("\nswarm-forage: An error that should not happen; please send us the lines above.\n")


def raised_by(file: Path, function: str) -> Exception:
    """What a function of a file raises that is no package of ours."""
    spec = spec_from_file_location(file.stem, file)
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    with pytest.raises((ValueError, TypeError, AttributeError)) as caught:
        getattr(module, function)()
    return caught.value


def test_code_of_a_user_that_fails_is_not_told_as_a_fault_of_ours(tmp_path, capsys):
    file = tmp_path / "mine.py"
    file.write_text(
        "import json\nfrom swarm_forage_env.cli.errors import complain\n"
        "def on_step():\n    json.loads('{')\n"
        "def calls_us():\n    complain(None, 1, 2, 3)\n"
        "def calls_us_wrongly_inside():\n    complain(5, 1)\n"
    )
    assert end(raised_by(file, "on_step")) == EXIT_FAILURE
    told = capsys.readouterr().err
    assert "json.decoder.JSONDecodeError: " in told
    assert told.endswith(f"\nswarm-forage: Your code failed in {file}, line 4.\n")
    assert end(raised_by(file, "calls_us")) == EXIT_FAILURE, "the call was wrong"
    assert end(raised_by(file, "calls_us_wrongly_inside")) == EXIT_UNFORESEEN, "our code failed last"


def test_too_little_memory_is_told(capsys):
    assert end(MemoryError("Unable to allocate 9 GiB")) == EXIT_FAILURE
    assert "Not enough memory: Unable to allocate 9 GiB; ask for fewer" in capsys.readouterr().err


def test_whoever_reads_the_output_may_stop(tmp_path):
    words = f"{sys.executable} -m swarm_forage_env.cli info warehouse_small | head -1"
    ended = subprocess.run(words, shell=True, capture_output=True, text=True, timeout=120, check=False, cwd=tmp_path)
    assert ended.stdout.startswith("warehouse_small:")
    assert ended.stderr == ""
