"""What made a run: versions of the packages that take part, and a digest of our own code.

A version number stands for many states of a checkout, and an installed wheel knows no commit. The digest tells two
states apart wherever they are installed. No change of documents, tests or commands touches it, and none of comments,
docstrings or blank lines.
"""

import hashlib
import re
import subprocess
from collections.abc import Mapping
from functools import cache
from importlib import metadata, util
from pathlib import Path

PACKAGES = ("swarm-forage-env", "numpy", "scipy", "numba", "llvmlite", "pymunk", "pettingzoo")
"""Distributions whose versions are part of every record."""
VERSION_NAMES = (*PACKAGES, "code", "commit")
"""Of all `software_versions`."""
CODE_OF_RUNS = ("_internal", "contract", "env.py", "policies", "runs", "scenarios", "world", "wrappers")
"""Parts of swarm_forage_env that may have a say in a run; all of `baselines` has."""
_SUFFIXES = (".npz", ".py", ".toml")
_STRING = r"""
    "{3} [^"\\]* (?: (?: \\. | "(?!"") ) [^"\\]* )* "{3} | " (?: [^"\\\n] | \\. )* "
  | '{3} [^'\\]* (?: (?: \\. | '(?!'') ) [^'\\]* )* '{3} | ' (?: [^'\\\n] | \\. )* '
"""
_PIECE = re.compile(
    rf"""
    (?P<alone> ^[ \t]* (?: {_STRING} ) [ \t]* (?= \# | $ ) )
    | (?P<string> {_STRING} )
    | (?P<comment> \# [^\n]* )
    | (?P<opens> [(\[{{] )
    | (?P<closes> [)\]}}] )
    """,
    re.VERBOSE | re.DOTALL | re.MULTILINE,
)
"""What source is searched for. A string alone on its lines, and outside of brackets, is a docstring."""


@cache
def software_versions() -> dict[str, str]:
    """Return the versions that results depend on, the digest of our code, and the commit in a checkout."""
    versions = {name: metadata.version(name) for name in PACKAGES} | {"code": code_digest()}
    commit = _commit()
    return versions | ({"commit": commit} if commit else {})


def identity(versions: Mapping[str, str]) -> dict[str, str]:
    """Return those of `software_versions` by which runs are told apart: the commit only where no digest is stored."""
    names = (*PACKAGES, "code" if versions.get("code") else "commit")
    return {name: versions.get(name, "") for name in names}


@cache  # every run of a study needs it
def code_digest() -> str:
    """Return the `digest_of` the installed packages."""
    baselines = util.find_spec("baselines")
    folders = None if baselines is None else baselines.submodule_search_locations
    assert folders, "it is installed with this package"
    return digest_of(Path(__file__).parents[1], Path(folders[0]))


def digest_of(package: Path, baselines: Path) -> str:
    """Return a digest of the code that runs depend on, 16 hexadecimal digits, wherever it is installed.

    Files of a user, such as a policy named by its file, are not part of it; specifications hold their digests.

    Args:
        package: The folder of swarm_forage_env.
        baselines: The folder of baselines.
    """
    parts = [(package, package / part) for part in CODE_OF_RUNS] + [(baselines, baselines)]
    files = {
        f"{folder.name}/{file.relative_to(folder).as_posix()}": file
        for folder, part in parts
        for file in (part.rglob("*") if part.is_dir() else (part,))
        if file.suffix in _SUFFIXES
    }
    state = hashlib.blake2b(digest_size=8)
    for name, file in sorted(files.items()):
        content = code_of(file.read_text(encoding="utf-8")).encode() if file.suffix == ".py" else file.read_bytes()
        state.update(f"{name}\n{len(content)}\n".encode())
        state.update(content)
    return state.hexdigest()


def code_of(source: str) -> str:
    """Return Python source without comments, docstrings and blank lines.

    By pattern, which is quicker than a parser, and gives the same under every Python.
    """
    kept: list[str] = []
    end = depth = 0
    for found in _PIECE.finditer(source):
        kind = found.lastgroup
        if kind == "opens":
            depth += 1
        elif kind == "closes":
            depth -= 1
        elif kind == "comment" or (kind == "alone" and depth == 0):
            kept.append(source[end : found.start()])
            end = found.end()
    lines = "".join([*kept, source[end:]]).split("\n")
    return "\n".join(line.rstrip() for line in lines if line.strip())


@cache  # git is asked once per process
def _commit() -> str:
    """Return the checked-out commit ("-dirty" appended when edited), or "" outside a checkout of this package."""
    here = Path(__file__)
    tracked = ["git", "ls-files", "--error-unmatch", here.name]
    describe = ["git", "describe", "--always", "--abbrev=40", "--dirty", "--exclude=*"]
    try:
        for command in (tracked, describe):
            answer = subprocess.run(command, cwd=here.parent, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return ""
    return answer.stdout.strip()
