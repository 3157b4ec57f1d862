"""The console command in this process: words in, exit code and text out."""

import sys

import pytest

from swarm_forage_env import cli
from tests.support.pictures import keep_figures


@pytest.fixture
def painted():
    """Ask for this in a test of the picture itself."""


@pytest.fixture(autouse=True)
def unpainted(request, monkeypatch):
    """Most tests are about words; to paint a picture takes several times as long as the rest of a short command."""
    if "painted" not in request.fixturenames:
        keep_figures(monkeypatch)


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
