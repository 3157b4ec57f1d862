"""The console command in this process: words in, exit code and text out."""

import sys

import pytest

from swarm_forage_env import cli


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    """Run swarm-forage in an empty folder; returns exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)

    def call(*words):
        monkeypatch.setattr(sys, "argv", ["swarm-forage", *words])
        with pytest.raises(SystemExit) as end:
            cli.main()
        shown = capsys.readouterr()
        return end.value.code or 0, shown.out, shown.err

    return call
