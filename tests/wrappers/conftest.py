"""Fixtures of the tests of the wrappers."""

from tests.support.engines import each_engine  # noqa: F401 - pytest finds it here
