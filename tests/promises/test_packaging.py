"""What an installed package promises: light imports, complete names, one version, commands that are pinned."""

import ast
import os
import pkgutil
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest

import metrics
import metrics.claims
import metrics.scoring
import swarm_forage_env

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
HEAVY = (
    "numba",
    "pymunk",
    "polars",
    "scipy",
    "matplotlib",
    "torch",
    "swarm_forage_env.env",
    "baselines",
    "metrics",
)


def run_python(code: str, *arguments: str, **environment: str) -> str:
    result = subprocess.run(
        [sys.executable, *arguments, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | environment,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


@pytest.mark.parametrize("package", [swarm_forage_env, metrics], ids=lambda package: package.__name__)
def test_a_package_loads_its_names_and_nothing_heavy(package):
    assert [name for name in package.__all__ if getattr(package, name) is None or name not in dir(package)] == []
    tree = ast.parse(Path(str(package.__file__)).with_suffix(".pyi").read_text())
    written = [alias.name for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names]
    assert sorted(written) == sorted(package.__all__), "each is written once"
    heavy = {*HEAVY, "numpy", "swarm_forage_env"} - {package.__name__} if package is metrics else HEAVY
    name = package.__name__
    assert run_python(f"import sys, {name}; print(*[name for name in {heavy} if name in sys.modules])").split() == []
    with pytest.raises(AttributeError, match="Scenaroi"):
        _ = package.Scenaroi


@pytest.mark.parametrize("package", [metrics, metrics.claims, metrics.scoring], ids=["metrics", "claims", "scoring"])
def test_no_public_name_is_that_of_a_module(package):
    """So that functions are what they are, whatever is imported first."""
    modules = {module.name for module in pkgutil.iter_modules(package.__path__)}
    assert not modules & {*package.__all__, *(name for name in vars(package) if callable(vars(package)[name]))}


def test_version_comes_from_the_installed_package():
    assert swarm_forage_env.__version__ == version("swarm-forage-env") == PROJECT["version"]


def test_a_users_own_metrics_module_does_not_disturb_the_environment(tmp_path):
    for name in ("metrics", "baselines"):
        (tmp_path / f"{name}.py").write_text("raise ImportError('a file of the user, not ours')\n")
    code = (
        "from swarm_forage_env import parallel_env; env = parallel_env('warehouse_small', n_robots=2); "
        "env.reset(seed=0); env.step({agent: env.action_space(agent).sample() for agent in env.agents}); "
        "print(env.tick)"
    )
    assert run_python(code, PYTHONPATH=str(tmp_path)).strip() == "1"
