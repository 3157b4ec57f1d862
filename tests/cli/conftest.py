"""The console command in this process: words in, exit code and text out."""

import pytest

from tests.support.console import answer
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
        code = answer(*words)
        shown = capsys.readouterr()
        return code, shown.out, shown.err

    return call
