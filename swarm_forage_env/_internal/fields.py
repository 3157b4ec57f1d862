"""Checks of the fields of configurations."""


class ConfigError(ValueError):
    """A configuration that cannot describe a world; the message says what was expected and what came."""
