"""What `--config FILE.toml` says: fields of the scenario and wrappers, one table each."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarm_forage_env._internal.fields import ConfigError, as_tuples, table
from swarm_forage_env._internal.parsing import parse_toml
from swarm_forage_env.wrappers.registry import wrappers_from_mapping

if TYPE_CHECKING:
    from swarm_forage_env.wrappers.base import WrapperConfig


def read_config(path: Path) -> "tuple[dict[str, Any], tuple[WrapperConfig, ...]]":
    """Read a configuration file.

    Args:
        path: TOML file. Its table `scenario` holds scenario fields by name; every other table is a wrapper.

    Returns:
        Scenario fields, and wrapper configurations.

    Raises:
        ConfigError: not readable, no TOML, or tables that no wrapper has or refuses; names the file.
    """
    try:
        tables = parse_toml(path.read_text(encoding="utf-8"))
        fields = table("scenario", tables.pop("scenario", {}))
        wrappers = wrappers_from_mapping(tables)
    except OSError as error:
        raise ConfigError(f"Cannot use {path}: {error.strerror or error}.") from error
    except ValueError as error:
        raise ConfigError(f"Cannot use {path}: {error}") from error
    return {name: as_tuples(value) for name, value in fields.items()}, wrappers
