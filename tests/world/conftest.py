"""Fixtures of the tests of the world."""

from tests.support.engines import each_engine  # noqa: F401 - pytest finds it here
