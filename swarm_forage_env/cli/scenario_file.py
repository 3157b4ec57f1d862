"""What `--scenario FILE.toml` says: a preset, fields that are other ones, and wrappers, as in files of studies.

scenario = "warehouse_small"           # the preset; this one if it is left out

[set]                                  # any scenario field
n_robots = 30

[wrappers.sensor_noise]
sigma = 0.03
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarm_forage_env._internal.fields import ConfigError, as_tuples, table
from swarm_forage_env._internal.files import parse_toml
from swarm_forage_env.wrappers.registry import wrappers_from_mapping

if TYPE_CHECKING:
    from swarm_forage_env.wrappers.base import WrapperConfig

PRESET = "warehouse_small"
"""What a file without a preset changes."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ScenarioFile:
    """A preset, and what is other than in it."""

    preset: str
    fields: dict[str, Any] = field(default_factory=dict)
    """Scenario fields by name."""
    wrappers: "tuple[WrapperConfig, ...]" = ()


def read_scenario_file(path: Path) -> ScenarioFile:
    """Read a file of a scenario.

    The fields may also stand in a table `scenario`, and wrappers in tables of their own, `[sensor_noise]`.

    Raises:
        ConfigError: not readable, no TOML, or tables that no wrapper has or refuses; names the file.
    """
    try:
        tables = parse_toml(path.read_text(encoding="utf-8"))
        preset, fields = tables.pop("scenario", PRESET), tables.pop("set", {})
        if not isinstance(preset, str):
            preset, fields = PRESET, {**table("scenario", preset), **table("set", fields)}
        wrappers = wrappers_from_mapping({**table("wrappers", tables.pop("wrappers", {})), **tables})
        given = {name: as_tuples(value) for name, value in table("set", fields).items()}
    except OSError as error:
        raise ConfigError(f"Cannot use {path}: {error.strerror or error}.") from error
    except ValueError as error:
        raise ConfigError(f"Cannot use {path}: {error}") from error
    return ScenarioFile(preset=preset, fields=given, wrappers=wrappers)
