"""Options of the algorithms that no training can succeed with, although stable-baselines3 accepts them."""

from typing import Any

from swarm_forage_env._internal.fields import number, table, whole

_COUNTS = ("n_steps", "batch_size", "n_epochs", "buffer_size")
_RANGES: dict[str, dict[str, float]] = {
    "gamma": {"above": 0.0, "at_most": 1.0},
    "gae_lambda": {"at_least": 0.0, "at_most": 1.0},
    "tau": {"above": 0.0, "at_most": 1.0},
    "learning_rate": {"above": 0.0},
    "clip_range": {"above": 0.0},
}
"""Options of the algorithms that mean the same in all of them, and what they may be."""


def check_options(name: str, options: Any) -> None:
    """Refuse values that stable-baselines3 accepts although no training can succeed with them.

    Args:
        name: What the table of options is called, for the message.
        options: Arguments of an algorithm by name.

    Raises:
        ConfigError: see above, or no table.
    """
    for key, value in table(name, options).items():
        if key in _COUNTS:
            whole(f"{name}.{key}", value, at_least=1)
        if key == "learning_starts":
            whole(f"{name}.{key}", value, at_least=0)
        if isinstance(value, int | float) and not isinstance(value, bool):
            number(f"{name}.{key}", value)
        if key in _RANGES:
            number(f"{name}.{key}", value, **_RANGES[key])
