"""Fixtures of the tests of the world."""

import pytest

from swarm_forage_env.scenarios.config import PHYSICS_ENGINES
from tests.support import engines


@pytest.fixture(params=PHYSICS_ENGINES)
def each_engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a test once with each engine in the arenas of `stage.tidy_world` and in `engines.CHOSEN`."""
    monkeypatch.setattr(engines, "CHOSEN", request.param)
