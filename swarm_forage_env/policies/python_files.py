"""Policies in plain Python files: `my_module.py:MyPolicy` is the class MyPolicy of the file my_module.py.

The file is run as a module when the policy is made. Its folder is searched last for what it imports, so that a file
beside it can be imported, and nothing that is installed is hidden by one. A process has one module of each name, so a
file is refused that would import another folder's module instead of the one beside it.
"""

import ast
import hashlib
import inspect
import sys
import traceback
from functools import lru_cache
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from swarm_forage_env._internal.faults import INSTALLED
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
        PythonFileError: no class is named, the file has none of that name, its code raises an error, or it would
            import another folder's module instead of the one beside it.
    """
    said = policy_file(place)
    assert said is not None, "its suffix brought it here"
    file, name = said.path, said.class_name
    if "interface" in parameters:
        raise PythonFileError(
            f"Expected {place} without an interface, got {parameters['interface']!r}; a class in Python reads "
            "observations and returns actions as the environment has them."
        )
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
        raise PythonFileError(f"Cannot make {place}: {_told(error, file)}.") from error
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
    _check_neighbours(path)
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    sys.modules[spec.name] = module  # dataclasses look there for the module of a class
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[spec.name]
        raise PythonFileError(f"Cannot run {path}: {_told(error, path)}.") from error
    return module


def _check_neighbours(path: Path) -> None:
    """Refuse a file that would import another folder's module where one of that name lies beside it.

    Files beside it that it imports are looked at, too. What is installed hides a file beside it, as it always does.
    """
    to_read, seen = [path], set[str]()
    while to_read:
        for name in _imported_names(_tree(to_read.pop())) - seen - sys.stdlib_module_names:
            seen.add(name)
            beside = PathFinder.find_spec(name, [str(path.parent)])
            if beside is None:
                continue
            loaded = sys.modules.get(name)
            found = find_spec(name) if loaded is None else getattr(loaded, "__spec__", None)
            home = path.parent if found is None else _home(found)  # none: not found before, or made by a program
            if home == path.parent:
                if beside.origin is not None and beside.origin.endswith(".py"):
                    to_read.append(Path(beside.origin))
            elif not INSTALLED.intersection(home.parts):
                raise PythonFileError(
                    f"Expected {path} to import the module {name} that lies beside it, but this process has the one "
                    f"of {home}; rename one of the two, or run the policies in commands of their own."
                )


def _imported_names(tree: ast.Module) -> set[str]:
    """Return the first words of all modules that a file imports, wherever it does."""
    names = set[str]()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names.update(alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None and node.level == 0:
            names.add(node.module.partition(".")[0])
    return names


def _home(spec: ModuleSpec) -> Path:
    """Return the folder in which a module lies, or the folder of its package."""
    folders = spec.submodule_search_locations
    place = next(iter(folders)) if folders else spec.origin
    return Path(place or "").resolve().parent


def _told(error: Exception, file: str | Path) -> str:
    """Return an error in a user's file with the last line of that file that it passed."""
    whole = str(Path(file).resolve())
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == whole]
    place = f" (line {lines[-1]})" if lines else ""
    return f"{type(error).__name__}: {' '.join(str(error).split()) or 'no message'}{place}"
