"""A compiled function has a slow, obvious twin that a test compares it with."""

import ast
import importlib
import pkgutil
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.reference.twins import TWINS, WITHOUT, Twin

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("swarm_forage_env", "baselines", "metrics")
ABOVE = ("cli", "studies", "runs", "inspect", "replay", "training", "sb3", "checks", "scoring", "claims")
"""Folders that call environments and policies, and that no kernel's caller calls."""


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


ORDER = "swarm_forage_env.world.kernels.tick"
"""Only calls the kernels of the world in their order; each of those is a rule with a twin of its own."""


def kernels_that_need_a_twin(root: Path = ROOT) -> set[str]:
    """Return the kernels that uncompiled code, kernels of another folder or the order of the tick call."""
    modules = [Module(path, root) for package in PACKAGES for path in sorted((root / package).rglob("*.py"))]
    folder_of = {kernel: module.folder for module in modules for kernel in module.kernels}
    return {
        name
        for module in modules
        for name, compiled in module.uses(module.tree)
        if name in folder_of
        and (not compiled or folder_of[name] != module.folder or (module.name == ORDER and name not in module.kernels))
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


TAKE_KERNELS = {"direct", "staticmethod"}
"""Functions that take a kernel and call it later."""


def last_name(node: ast.AST) -> str | None:
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else None


def calls_in(tree: ast.AST) -> set[str]:
    """Return the last names of everything that is called, "act" for `policy.act(...)`, now or by `TAKE_KERNELS`."""
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    later = [part for call in calls if last_name(call.func) in TAKE_KERNELS for part in call.args]
    return {name for node in (*(call.func for call in calls), *later) if (name := last_name(node))}


@cache
def calls_of_functions() -> dict[str, set[str]]:
    """Return what every function of the packages calls, by the last names of both, without folders `ABOVE`."""
    found: dict[str, set[str]] = {}
    for path in (
        path for package in PACKAGES for path in (ROOT / package).rglob("*.py") if path.parent.name not in ABOVE
    ):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                found.setdefault(node.name, set()).update(calls_in(node))
            elif isinstance(node, ast.ClassDef):  # what stands in its body belongs to all methods
                shared = {name for item in node.body if isinstance(item, ast.Assign) for name in calls_in(item)}
                for method in (item for item in node.body if isinstance(item, ast.FunctionDef)):
                    found.setdefault(method.name, set()).update(shared)
    return found


def leads_to(caller: str, kernel: str) -> bool:
    """Whether `caller` may call `kernel`, itself or through others."""
    todo, seen = [caller], set[str]()
    while todo:
        name = todo.pop()
        if name == kernel:
            return True
        new = calls_of_functions().get(name, set()) - seen
        seen |= new
        todo += new
    return False


def faults(kernel: str, twin: Twin, root: Path = ROOT) -> list[str]:
    """Say what is wrong with an entry of the table."""
    module, name = twin.name.split(".")
    path, last = root / "tests" / twin.test, twin.caller.rpartition(".")[2]
    found = []
    if not callable(getattr(importlib.import_module(f"tests.reference.{module}"), name, None)):
        found.append(f"tests.reference has no {twin.name}")
    if not callable(pkgutil.resolve_name(twin.caller)):
        found.append(f"{twin.caller} is nothing to call")
    if not leads_to(last, kernel.rpartition(".")[2]):
        found.append(f"{twin.caller} does not lead to {kernel}")
    if not path.is_file():
        return [*found, f"there is no {twin.test}"]
    text = path.read_text(encoding="utf-8")
    called = calls_in(ast.parse(text))
    if not re.search(rf"^from tests\.reference(\.{module} import|\b.* import .*\b{module}\b)", text, re.MULTILINE):
        found.append(f"{twin.test} does not import tests.reference.{module}")
    return found + [f"{twin.test} does not call {wanted}" for wanted in (name, last) if wanted not in called]


@pytest.mark.parametrize("kernel", TWINS)
def test_the_named_test_compares_with_the_twin(kernel):
    assert faults(kernel, TWINS[kernel]) == []


def test_a_wrong_entry_is_found(tmp_path):
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests/test_other.py").write_text("from tests.reference.motion import free_motion\nfree_motion()\n")
    kernel = "swarm_forage_env.world.kernels.walk.walk"
    wrong = Twin("sensing.observe", "test_other.py", "metrics.scaling.scalability")
    assert faults(kernel, wrong, tmp_path) == [
        f"metrics.scaling.scalability does not lead to {kernel}",
        "test_other.py does not import tests.reference.sensing",
        "test_other.py does not call observe",
        "test_other.py does not call scalability",
    ]
    gone = Twin("sensing.gone", "test_gone.py", kernel)
    assert faults(kernel, gone, tmp_path) == ["tests.reference has no sensing.gone", "there is no test_gone.py"]
