"""What made a run: versions of the packages that take part, and the commit in a checkout."""

import subprocess
from functools import cache
from importlib import metadata
from pathlib import Path

PACKAGES = ("swarm-forage-env", "numpy", "scipy", "numba", "llvmlite", "pymunk", "pettingzoo")
"""Distributions whose versions are part of every record."""
VERSION_NAMES = (*PACKAGES, "commit")
"""Of all `software_versions`."""


@cache
def software_versions() -> dict[str, str]:
    """Return the versions that results depend on, and the commit ("-dirty" where edited) in a checkout."""
    versions = {name: metadata.version(name) for name in PACKAGES}
    here = Path(__file__)
    tracked = ["git", "ls-files", "--error-unmatch", here.name]  # fails where the package lies in another repository
    describe = ["git", "describe", "--always", "--abbrev=40", "--dirty", "--exclude=*"]
    try:
        for command in (tracked, describe):
            answer = subprocess.run(command, cwd=here.parent, capture_output=True, text=True, timeout=10, check=True)
    except (OSError, subprocess.SubprocessError):
        return versions
    return {**versions, "commit": answer.stdout.strip()}
