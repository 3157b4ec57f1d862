"""What every `reset` and `step` refuses, or ends, before it looks at the world."""

from collections.abc import Collection, Mapping
from typing import Any

from swarm_forage_env._internal.fields import ConfigError

OPTION_OF_TESTS = "options"
"""A reset option without a meaning: PettingZoo's own `parallel_api_test` gives it to every environment."""


def no_options(options: Mapping[str, Any] | None) -> None:
    """Refuse reset options, for environments that take none.

    Raises:
        ConfigError: there is one; the message names it.
    """
    for name in options or ():
        if name != OPTION_OF_TESTS:
            raise ConfigError(
                f"Expected no reset options, got {name!r}. An environment with an interface changes its scenario at a "
                "reset: parallel_env(..., interface={}), then reset(options={'scenario': {'n_objects': 50}})."
            )


def is_over(agents_left: Collection[str], actions: Any, *, is_reset: bool) -> bool:
    """Return whether a step has nothing to do, because no agent is left and no action was given.

    Libraries that step many environments side by side ask for it until all of them are done.

    Args:
        agents_left: Agents of the environment.
        actions: What its `step` was given.
        is_reset: Whether it was reset.

    Raises:
        RuntimeError: no agent is left, but there are actions, or it was never reset.
    """
    if agents_left:
        return False
    if not is_reset:
        raise RuntimeError("Call reset before step.")
    if actions:
        raise RuntimeError("All agents are done; call reset first.")
    return True
