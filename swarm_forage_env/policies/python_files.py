"""Policies in plain Python files: `my_module.py:MyPolicy` is the class MyPolicy of the file my_module.py.

The file is run as a module when the policy is made. Its folder is searched last for what it imports, so that a file
beside it can be imported, and nothing that is installed is hidden by one. A process has one module of each name, so a
file is refused that has imported another folder's module instead of the one beside it.
"""

import ast
import hashlib
import inspect
import sys
from functools import lru_cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from swarm_forage_env._internal.faults import INSTALLED, in_words
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.wording import suggestion
from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.policies.model_files import checked_digest
from swarm_forage_env.policies.registry import policy_file


class PythonFileError(ConfigError):
    """A Python file that cannot be read or run, or does not hold the policy that was asked for."""


def open_class(place: str, *, digest: str | None = None, **parameters: Any) -> Policy:
    """Return a policy of a class in a Python file.

    Args:
        place: The file and the class, `my_module.py:MyPolicy`; a function that returns a policy does as well.
        digest: Result of `file_digest` when the run was planned; a file that has changed since then is refused.
        parameters: Keyword arguments of the class.

    Raises:
        ModelError: the file is missing or has changed.
        PythonFileError: no class is named, the file has none of that name, its code raises an error, or it
            imports another folder's module instead of the one beside it.
    """
    said = policy_file(place)
    assert said is not None, "its suffix brought it here"
    file, name = said.path, said.class_name
    found = checked_digest(file, digest)
    if name is None:
        raise PythonFileError(f"Expected the class with its file, as {file}:MyPolicy, got {place!r}. {_known(file)}")
    factory = getattr(_module(Path(file).resolve(), found), name, None)
    if not callable(factory):
        meant = suggestion(name, classes_of(file))
        raise PythonFileError(f"Expected {file} to have a class {name}.{meant} {_known(file)}")
    try:
        inspect.signature(factory).bind(**parameters)
    except TypeError as error:
        raise PythonFileError(f"Expected parameters that {place} takes, got {parameters!r}: {error}.") from error
    try:
        policy: Any = factory(**parameters)
    except Exception as error:
        raise PythonFileError(f"Cannot make {place}: {in_words(error)}.") from error
    lacking = [method for method in ("reset", "act") if not callable(getattr(policy, method, None))]
    if lacking:
        raise PythonFileError(
            f"Expected {place} to make a policy, with the methods reset and act, got {type(policy).__name__} without "
            f"{' and '.join(lacking)}. A function from observations to actions becomes one by from_callable "
            "(docs/policies.md)."
        )
    return policy


def classes_of(file: str | Path) -> tuple[str, ...]:
    """Return the names of the classes in a Python file, which is read and not run.

    Raises:
        PythonFileError: the file cannot be read, or is no Python.
    """
    return tuple(node.name for node in _tree(file).body if isinstance(node, ast.ClassDef))


def _tree(file: str | Path) -> ast.Module:
    try:
        return ast.parse(Path(file).read_bytes(), str(file))
    except OSError as error:
        raise PythonFileError(f"Cannot read the policy file {file}: {error.strerror or error}.") from error
    except (SyntaxError, ValueError) as error:
        raise PythonFileError(f"Expected Python in {file}, got: {error}.") from error


def _known(file: str) -> str:
    return f"Classes in it: {', '.join(classes_of(file)) or 'none'}."


@lru_cache(maxsize=8)  # every run makes its policy anew; the module is run once
def _module(path: Path, digest: str) -> ModuleType:
    """Run a file, given by its whole path, as a module, once for each content that it has."""
    where = hashlib.blake2b(str(path).encode(), digest_size=4).hexdigest()
    spec = spec_from_file_location(f"{path.stem}_{where}_{digest}", path)  # no name that something else has
    assert spec is not None, "its name ends in .py"
    assert spec.loader is not None, "a file has a loader"
    module = module_from_spec(spec)
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    sys.modules[spec.name] = module  # dataclasses look there for the module of a class
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[spec.name]
        raise PythonFileError(f"Cannot run {path}: {in_words(error)}.") from error
    _check_neighbours(path)
    return module


def _check_neighbours(path: Path) -> None:
    """Refuse a file that has imported another folder's module where one of that name lies beside it.

    What is installed hides a file beside it, as it always does.
    """
    nodes = [*ast.walk(_tree(path))]
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom) and not node.level}
    for name in {name.partition(".")[0] for name in names} - {"", *sys.stdlib_module_names}:
        beside, file = path.with_name(name), getattr(sys.modules.get(name), "__file__", None)
        if file is None or not (beside.is_dir() or beside.with_suffix(".py").is_file()):
            continue
        home = Path(file).resolve().parent
        if home not in (path.parent, beside) and INSTALLED.isdisjoint(home.parts):
            raise PythonFileError(
                f"Expected {path} to import the module {name} that lies beside it, but this process has the one of "
                f"{home}; rename one of the two, or run the policies in commands of their own."
            )
