"""The table of addresses: every array of a world stands where the compiled functions look for it."""

from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from swarm_forage_env import scenario
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.world.kernels import many
from swarm_forage_env.world.rack import addresses


def interpreted(name: str) -> Callable[..., Any]:
    """A function of `kernels.many` as Python runs it, whether it is compiled or not."""
    function = getattr(many, name)
    return getattr(function, "py_func", function)


def leaves(value: Any) -> Iterator[Any]:
    """What nested tuples consist of, in order."""
    if not isinstance(value, tuple):
        yield value
    for part in value if isinstance(value, tuple) else ():
        yield from leaves(part)


@pytest.fixture
def placed(monkeypatch) -> None:
    """In the place of an array `kernels.many` notes which array it is like, and the address that it was given."""
    monkeypatch.setattr(many, "array_at", lambda like, address: SimpleNamespace(like=like, address=address))
    for name in ("state_at", "sensors_at"):
        monkeypatch.setattr(many, name, interpreted(name))


@pytest.mark.usefixtures("placed")
@pytest.mark.parametrize("kind", ["world_at", "bodies_at", "payment_at"])
def test_every_array_is_looked_for_where_its_address_stands(kind):
    env = ForageEnv(scenario("warehouse_small", n_robots=2, n_objects=4, physics="compiled"))
    env.reset_batch(0)
    world, bodies = env.arena.parts
    value = {"world_at": world, "bodies_at": bodies, "payment_at": env.reward_model.payment}[kind]
    found = interpreted(kind)(value, addresses(value))
    assert type(found) is type(value)
    for given, made in zip(leaves(value), leaves(found), strict=True):
        if isinstance(given, np.ndarray):
            assert made.like is given
            assert made.address == given.ctypes.data
        else:
            assert made == given, "constants are those of the first world"
