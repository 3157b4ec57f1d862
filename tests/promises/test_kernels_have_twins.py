"""A compiled function has a slow, obvious twin that a test compares it with."""

import ast
import importlib
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.reference.twins import TWINS, WITHOUT

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("swarm_forage_env", "baselines", "metrics")


def is_kernel(node: ast.AST) -> bool:
    return isinstance(node, ast.FunctionDef) and any(
        isinstance(decorator, ast.Name) and decorator.id in ("kernel", "inline_kernel")
        for decorator in node.decorator_list
    )


class Module:
    """One source file and the names that it takes from others."""

    def __init__(self, path: Path, root: Path = ROOT) -> None:
        self.name = ".".join(path.relative_to(root).with_suffix("").parts)
        self.folder = self.name.rpartition(".")[0]
        self.tree = ast.parse(path.read_text(encoding="utf-8"))
        self.kernels = {f"{self.name}.{node.name}" for node in self.tree.body if is_kernel(node)}
        self.names = {kernel.rpartition(".")[2]: kernel for kernel in self.kernels}
        for node in ast.walk(self.tree):
            if isinstance(node, ast.ImportFrom):
                home = f"{self.folder}.{node.module}" if node.level == 1 and node.module else node.module or self.folder
                self.names |= {alias.asname or alias.name: f"{home}.{alias.name}" for alias in node.names}

    def uses(self, node: ast.AST, compiled: bool = False) -> Iterator[tuple[str, bool]]:
        """Yield the full names that are mentioned, and whether a kernel mentions them."""
        compiled = compiled or is_kernel(node)
        if isinstance(node, ast.Name) and node.id in self.names:
            yield self.names[node.id], compiled
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in self.names:
            yield f"{self.names[node.value.id]}.{node.attr}", compiled
        for child in ast.iter_child_nodes(node):
            yield from self.uses(child, compiled)


def kernels_that_need_a_twin(root: Path = ROOT) -> set[str]:
    """Return the kernels that uncompiled code or kernels of another folder call."""
    modules = [Module(path, root) for package in PACKAGES for path in sorted((root / package).rglob("*.py"))]
    folder_of = {kernel: module.folder for module in modules for kernel in module.kernels}
    return {
        name
        for module in modules
        for name, compiled in module.uses(module.tree)
        if name in folder_of and (not compiled or folder_of[name] != module.folder)
    }


def test_every_kernel_has_a_twin_or_a_reason():
    assert sorted({*TWINS, *WITHOUT}) == sorted(kernels_that_need_a_twin())
    assert not TWINS.keys() & WITHOUT.keys()
    assert all(WITHOUT.values())


def test_a_new_kernel_is_found(tmp_path):
    """However it is called: by name, through its module, out of another folder."""
    for package in PACKAGES:
        (tmp_path / package).mkdir()
    (tmp_path / "metrics/fast.py").write_text(
        "@kernel\ndef inner(x): ...\n@kernel\ndef shared(x): ...\n@inline_kernel\ndef outer(x): inner(x)\n"
        "@kernel\ndef other(x): inner(x)\n"
    )
    (tmp_path / "metrics/slow.py").write_text(
        "from .fast import outer\nfrom metrics import fast\nouter(fast.other(1))\n"
    )
    (tmp_path / "baselines/robot.py").write_text("from metrics.fast import shared\n@kernel\ndef act(x): shared(x)\n")
    assert kernels_that_need_a_twin(tmp_path) == {"metrics.fast.outer", "metrics.fast.other", "metrics.fast.shared"}


@pytest.mark.parametrize("twin", sorted(set(TWINS.values())))
def test_a_test_compares_with_the_twin(twin):
    """The twin is there, and a test module takes it from where it is."""
    module, name = twin.split(".")
    assert callable(getattr(importlib.import_module(f"tests.reference.{module}"), name))
    tests = [path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py") if path != Path(__file__)]
    assert any(f"tests.reference.{module} import" in text and name in text for text in tests) or any(
        f"from tests.reference import {module}" in text for text in tests
    )
