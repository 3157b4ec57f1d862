"""Policies that were trained with this package and come with it: small networks, run without torch.

Beside each network `NAME.npz` lies its card, `NAME.md`, and the plan that it was trained by, `NAME.toml`.
"""

from functools import cache
from pathlib import Path
from typing import ClassVar

from swarm_forage_env.policies.network import Network, NetworkPolicy

_FOLDER = Path(__file__).parent


@cache
def _network(name: str) -> Network:
    return Network.load(_FOLDER / f"{name}.npz")


def plan_file(name: str) -> Path | None:
    """Return the file with the training plan of a shipped policy, None when there is no policy of that name."""
    return _shipped(f"{name}.toml")


def network_file(name: str) -> Path | None:
    """Return the file with the network of a shipped policy, None when there is no policy of that name."""
    return _shipped(f"{name}.npz")


def network_names() -> tuple[str, ...]:
    """Return the names of the shipped policies that are networks."""
    return tuple(sorted(path.stem for path in _FOLDER.glob("*.npz")))


def plan_names() -> tuple[str, ...]:
    """Return the names of the shipped policies that have a training plan."""
    return tuple(sorted(path.stem for path in _FOLDER.glob("*.toml")))


def _shipped(file: str) -> Path | None:
    path = _FOLDER / file
    return path if path.is_file() else None


class PPOWarehouseSmall(NetworkPolicy):
    """Network trained by PPO in warehouse_small.

    Its card is `ppo_warehouse_small.md`.
    """

    caches: ClassVar[str] = "none"
    """Kind of caches that it was trained with."""

    def __init__(self) -> None:
        """Open the network."""
        super().__init__(_network("ppo_warehouse_small"))


class Generalist(NetworkPolicy):
    """Network trained by PPO in all scenarios.

    It was trained with and without adversity. Its card is `generalist.md`.
    """

    caches: ClassVar[str] = "none"
    """Kind of caches that it was trained with."""

    def __init__(self) -> None:
        """Open the network."""
        super().__init__(_network("generalist"))
