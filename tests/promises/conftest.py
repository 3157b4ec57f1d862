"""Scripts of the project, run in this process: a new one would import for seconds."""

import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Run a script in an empty folder; returns code and texts."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(ROOT / "scripts")

    def call(script, *words):
        monkeypatch.setattr(sys, "argv", [f"{script}.py", *words])
        code = 0
        try:
            runpy.run_path(str(ROOT / f"scripts/{script}.py"), run_name="__main__")
        except SystemExit as end:
            code = end.code
        shown = capsys.readouterr()
        return code, shown.out, shown.err

    return call
