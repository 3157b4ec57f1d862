"""Docstrings, comments and pages name modules, their contents and files that exist."""

import ast
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("swarm_forage_env", "baselines", "metrics")
SOURCES = sorted(file for package in PACKAGES for file in (ROOT / package).rglob("*.py"))
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
PAGES.remove(ROOT / "CHANGELOG.md")  # it tells of names that are no more
OBJECTS = {
    *("action_space", "algorithm", "b", "claim", "client", "env", "forage_env", "interface", "layout", "model"),
    *("known", "objects", "plan", "policy", "rng", "robot", "robots", "see", "self", "sensor_noise", "settings"),
    *("sigmas", "spec", "state"),
    *("swarm", "table", "training", "verdict", "world", "wrapper"),
}
"""What pages and docstrings call objects, whether a module has the name or not: of these, only classes count."""
FOREIGN = {
    *sys.stdlib_module_names,
    *(
        "dask_jobqueue",
        "gymnasium",
        "imageio",
        "jobqueue",
        "minari",
        "numpy",
        "pettingzoo",
        "polars",
        "python3",
        "torch",
    ),
}
"""Other packages."""
SPELLINGS = (r"reset\((?:self, )?task\b", r"\btask\.(?:layout|n_robots)\b", r"\benv\.task\b", r"\bSwarmTask\b")
"""Old names that are no module's."""
SUFFIXES = {"csv", "js", "json", "md", "mplstyle", "npz", "png", "py", "pyi", "toml", "zip"}
DOTTED = re.compile(r"`([a-z_][a-z_0-9]*(?:\.[A-Za-z_0-9]+)+)")
PATHS = re.compile(r"`?((?:swarm_forage_env|baselines|metrics|tests|scripts|docs)/[\w/.-]+\.(?:py|md|toml|npz|json))")


def names_in(file: Path) -> set[str]:
    """Names that a module defines or imports, whether at its top level or within."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        elif isinstance(node, ast.ImportFrom):
            names |= {alias.asname or alias.name for alias in node.names}
    return names


def inside(folder: Path, rest: list[str]) -> bool:
    """Whether `module.name` or `folder.module.name` is there, seen from a folder."""
    first, *rest = rest
    file = folder / f"{first}.py"
    if file.is_file():
        return not rest or rest[0] in names_in(file)
    if not (folder / first).is_dir():
        return False
    fronts = (front for ending in ("py", "pyi") if (front := folder / first / f"__init__.{ending}").is_file())
    return not rest or inside(folder / first, rest) or any(rest[0] in names_in(front) for front in fronts)


def resolves(dotted: str, file: Path) -> bool:
    """Whether a dotted name leads somewhere from the folder of a file or from one above it."""
    first, *rest = dotted.split(".")
    if first in FOREIGN or rest[0] in SUFFIXES or (first in OBJECTS and rest[0].islower()):
        return True
    folders = [folder for folder in file.parents if ROOT in (folder, *folder.parents)]
    if not any(folder.name in PACKAGES for folder in folders):
        folders = [ROOT, *(ROOT / package for package in PACKAGES)]
    return any(inside(folder, [first, *rest]) for folder in folders)


def stale(text: str, file: Path) -> list[str]:
    """Return what a text names that is not there."""
    found = [name for name in DOTTED.findall(text) if not resolves(name, file)]
    found += [path for path in PATHS.findall(text) if not (ROOT / path).exists()]
    return found + [match[0] for old in SPELLINGS for match in re.finditer(old, text)]


def test_names_of_modules_and_files_are_those_of_today():
    found = {file.relative_to(ROOT).as_posix(): stale(file.read_text(), file) for file in [*SOURCES, *PAGES]}
    assert {file: names for file, names in found.items() if names} == {}


@pytest.mark.parametrize(
    "name",
    [
        "learning.interface",
        "policy_models.open_network",
        "signals.Waveform",
        "recording.RunRecord",
        "policy.Task",
        "config.ScenarioConfig",
        "caches.found_caches",
        "scenarios.config.Gone",
        "metrics/gone.py",
    ],
)
@pytest.mark.parametrize("file", ["README.md", "swarm_forage_env/world/rewards.py"])
def test_a_name_that_has_moved_is_found(name, file):
    assert stale(f"See `{name}`.", ROOT / file) == [name]


@pytest.mark.parametrize(
    "text", ["reset(task, rng)", "def reset(self, task, rng):", "task.layout", "env.task", "SwarmTask"]
)
def test_an_old_spelling_is_found(text):
    assert len(stale(text, ROOT / "README.md")) == 1


def test_names_of_today_are_left_alone():
    page, room = ROOT / "docs/policies.md", ROOT / "swarm_forage_env/world/rewards.py"
    assert (
        stale("`scenarios.config.RewardConfig` `policy.act` `numpy.ndarray` `metrics.scalability` `a.toml`", page) == []
    )
    assert stale("`scenarios.config.RewardConfig` `kernels.drive.drive` `contract.codes.Task`", room) == []
    assert stale("`kernels.drive.drive`", ROOT / "swarm_forage_env/wrappers/throttle.py") == ["kernels.drive.drive"]
