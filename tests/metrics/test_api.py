"""The public names and arguments, and that the package needs nothing of the environment."""

import pkgutil
import subprocess
import sys

import pytest

import metrics
import metrics.claims
import metrics.scoring
from tests.support.public_names import homes_of


def test_every_public_name_loads():
    assert [name for name in metrics.__all__ if getattr(metrics, name) is None or name not in dir(metrics)] == []


def test_each_public_name_is_written_once():
    assert sorted(homes_of(metrics)) == sorted(metrics.__all__)


@pytest.mark.parametrize("package", [metrics, metrics.claims, metrics.scoring], ids=["metrics", "claims", "scoring"])
def test_no_public_name_is_that_of_a_module(package):
    modules = {module.name for module in pkgutil.iter_modules(package.__path__)}
    assert not modules & {*package.__all__, *(name for name in vars(package) if callable(vars(package)[name]))}


def test_unknown_names_are_refused():
    with pytest.raises(AttributeError, match="No metrics attribute scalabilty"):
        _ = metrics.scalabilty


def test_functions_and_modules_are_what_they_are_in_any_order_of_imports():
    code = (
        "import importlib, sys\n"
        "for first in ('metrics.scaling', 'metrics.scoring', 'metrics.population', 'metrics'):\n"
        "    for name in [name for name in sys.modules if name.split('.')[0] == 'metrics']:\n"
        "        del sys.modules[name]\n"
        "    importlib.import_module(first)\n"
        "    from metrics import scalability\n"
        "    import metrics.scaling, metrics.scoring\n"
        "    print(scalability([1], 1, [2], 2), type(metrics.scaling).__name__)"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (result.stdout.splitlines(), result.stderr) == (["1.0 module"] * 4, "")


def test_importing_the_package_loads_nothing_heavy():
    heavy = ("numpy", "numba", "scipy", "polars", "pymunk", "swarm_forage_env", "baselines")
    code = f"import sys, metrics; print(*[name for name in {heavy} if name in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.split() == []
