"""Settings shared by all tests, kernels that they share, and rules for skipped tests."""

import re
import subprocess
import sys
from collections.abc import Generator
from pathlib import Path

import pytest
from hypothesis import settings

# Same examples on every machine and no time limit per example: a red test means a defect, not bad luck.
settings.register_profile("reproducible", derandomize=True, deadline=None)
settings.load_profile("reproducible")

MAY_BE_SKIPPED = {
    r"fingerprints of \w+ say nothing on \w+": "made on another kind of machine",
    r"needs a browser: .*": "chromium comes with the operating system, not from a package registry",
    r"needs (agilerl|benchmarl|optuna|ray|sb3_contrib|torchrl), see docs/libraries.md": "each wants its own versions",
    r"needs a C compiler: .*": "it comes with the operating system, not from a package registry",
    r"could not import 'onnx(runtime)?': .*": "its wheels come later than a new Python does",
}
"""Reason of a skip -> why it is no failure under --no-skips."""
_skipped: dict[str, str] = {}
"""Test or file -> reason."""


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("swarm_forage_env")
    group.addoption("--no-skips", action="store_true", help="fail on skips that tests/conftest.py does not name")
    group.addoption("--skips-to", type=Path, metavar="FILE", help="write tests skipped without a name, one a line")


@pytest.fixture
def full_disk() -> None:
    """A disk on which no file can be longer than 1 kB, also for those who may write everywhere."""


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> Generator[None, object, object]:
    """Fill the disk while a test runs that asks for it, and no longer: pytest itself may write to a file."""
    if "full_disk" not in pyfuncitem.fixturenames:
        return (yield)
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1_000, before[1]))
    try:
        return (yield)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def _note(report: pytest.TestReport | pytest.CollectReport) -> None:
    if report.skipped and isinstance(report.longrepr, tuple):
        _skipped[report.nodeid] = report.longrepr[2].removeprefix("Skipped: ")


pytest_runtest_logreport = _note
pytest_collectreport = _note


def _is_worker(config: pytest.Config) -> bool:
    """Whether this is one of several processes over which another one spreads the tests."""
    return hasattr(config, "workerinput")


@pytest.hookimpl(tryfirst=True)
def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile what most tests need before several processes begin with them: each would compile it for itself."""
    config = session.config
    if _is_worker(config) or not config.getoption("numprocesses", None):
        return
    command = [sys.executable, "-m", "tests.support.first_kernels"]
    compiling = [subprocess.Popen([*command, engine], cwd=config.rootpath) for engine in ("chipmunk", "compiled")]
    for process in compiling:
        process.wait()  # where one fails, the tests will say why


def _unnamed() -> dict[str, str]:
    return {
        test: reason
        for test, reason in _skipped.items()
        if not any(re.fullmatch(known, reason) for known in MAY_BE_SKIPPED)
    }


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write the list, and make a good end a bad one where something was skipped that should not be."""
    config = session.config
    if _is_worker(config):
        return
    if config.getoption("skips_to") is not None:
        config.getoption("skips_to").write_text("".join(f"{test}\n" for test in _unnamed()))
    if config.getoption("no_skips") and _unnamed() and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Say what was skipped and why, each reason once."""
    if not config.getoption("no_skips"):
        return
    unnamed = _unnamed()
    for test, reason in unnamed.items():
        terminalreporter.write_line(f"skipped, which --no-skips forbids: {test}: {reason}")
    for reason in sorted({*_skipped.values()} - {*unnamed.values()}):
        n_tests = list(_skipped.values()).count(reason)
        terminalreporter.write_line(f"skipped, and named: {n_tests} x {reason}")
