"""What made a run: versions of the packages that take part, and the commit in a checkout."""

import subprocess
from collections.abc import Mapping
from functools import cache
from importlib import metadata
from pathlib import Path

PACKAGES = ("swarm-forage-env", "numpy", "scipy", "numba", "llvmlite", "pymunk", "pettingzoo")
"""Distributions whose versions are part of every record."""
VERSION_NAMES = (*PACKAGES, "commit")
"""Of all `software_versions`."""


@cache
def software_versions() -> dict[str, str]:
    """Return the versions that results depend on, and the commit in a checkout."""
    commit = _commit()
    return {name: metadata.version(name) for name in PACKAGES} | ({"commit": commit} if commit else {})


def identity(versions: Mapping[str, str]) -> dict[str, str]:
    """Return those of `software_versions` by which runs are told apart; "" for one that is not there."""
    return {name: versions.get(name, "") for name in VERSION_NAMES}


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
