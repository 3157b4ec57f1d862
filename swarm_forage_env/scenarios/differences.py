"""What a scenario has that its preset has not, by field and in words for people.

Whatever names a world asks here, so that a wall, another nest or three objects are never called
"warehouse_small" alone.
"""

import hashlib
import json
from functools import lru_cache
from typing import Any, cast

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.wording import counted
from swarm_forage_env.scenarios.config import ArenaConfig, ScenarioConfig, to_mapping
from swarm_forage_env.scenarios.floor import CELL_M
from swarm_forage_env.scenarios.overrides import field_sections
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario
from swarm_forage_env.scenarios.quirks import QUIRK_NAMES, RULES

_READ_ONLY = ("name", "performance")
"""Fields that change no run: what a scenario is called, and how its runs are read."""
_TOLD_ELSEWHERE = ("n_robots", "horizon_s", "interval_s", "width_m", "height_m", "nest_centre_m", "nest_size_m")
"""Fields that names state themselves, or leave to the study, and those that `_arena_words` tells."""
_UNITS = {"_m": " m", "_s": " s", "_mps": " m/s"}
_LONGEST = 40
"""Characters of a list that words show whole (our choice: half a line); of longer ones they tell how many entries, and
a digest that tells two of them apart."""


def differences(config: ScenarioConfig) -> dict[str, Any]:
    """Return the fields by name that differ from those of the preset of that name; of quirks, each switched one.

    A preset may fit itself to the swarm, as search and rescue its arena does: it is held against that of this size. A
    scenario of a name that no preset has is held against nothing, so all its fields are there.
    """
    base = preset_of(config)
    usual = {} if base is None else _flat(base)
    return {name: value for name, value in _flat(config).items() if name not in usual or value != usual[name]}


def difference_words(config: ScenarioConfig) -> tuple[str, ...]:
    """Return in words what differs from the preset, apart from the size of the swarm and the length of runs.

    Example: `("3 objects", "obstacles 10,4,11,12", "physics chipmunk")`. Empty for a scenario that no preset has the
    name of: what it is called is all that people know of it.
    """
    base = preset_of(config)
    if base is None:
        return ()
    words, found = _arena_words(config.arena, base.arena), differences(config)
    switched = [name for name in QUIRK_NAMES if name in found]
    words += [_words(name, value) for name, value in found.items() if name not in (*_TOLD_ELSEWHERE, *switched)]
    named = [name for name, rules in RULES.items() if rules == config.quirks]
    if switched:
        words.append(f"rules {named[0]}" if named else _words("quirks", switched))
    return tuple(words)


def is_resized(config: ScenarioConfig) -> bool:
    """Return whether the swarm has another size than that of the preset, or there is no preset of that name."""
    return config.name not in SCENARIO_NAMES or config.robots.n_robots != scenario(config.name).robots.n_robots


def digest_of(values: Any, digits: int) -> str:
    """Return a short hexadecimal digest of plain values, the same in every process."""
    text = json.dumps(values, sort_keys=True, default=to_mapping)
    return hashlib.blake2b(text.encode(), digest_size=8).hexdigest()[:digits]


def preset_of(config: ScenarioConfig) -> ScenarioConfig | None:
    """Return the preset of that name for a swarm of that size, where it can be; None if there is no such preset."""
    return _preset(config.name, config.robots.n_robots)


@lru_cache(maxsize=256)  # each world asks
def _preset(name: str, n_robots: int) -> ScenarioConfig | None:
    if name not in SCENARIO_NAMES:
        return None
    try:
        return scenario(name, n_robots=n_robots)
    except ConfigError:  # its arena is too small for them, so this one has another
        return scenario(name)


def _flat(config: ScenarioConfig) -> dict[str, Any]:
    return {
        name: getattr(getattr(config, section) if section else config, name)
        for name, section in field_sections().items()
        if name not in _READ_ONLY
    }


def _arena_words(arena: ArenaConfig, base: ArenaConfig) -> list[str]:
    """The sides where they differ, and the nest unless it has kept its place and its share of them."""
    words: list[str] = []
    if (arena.width_m, arena.height_m) != (base.width_m, base.height_m):
        words.append(f"{arena.width_m:g} x {arena.height_m:g} m")
    factors = (arena.width_m / base.width_m, arena.height_m / base.height_m) * 2
    scaled = [edge * factor for edge, factor in zip((*base.nest_centre_m, *base.nest_size_m), factors, strict=True)]
    here = (*arena.nest_centre_m, *arena.nest_size_m)
    tolerance_m = CELL_M if words else 0.0  # a nest keeps to whole cells
    if any(abs(edge - wanted) > tolerance_m + 1e-9 for edge, wanted in zip(here, scaled, strict=True)):
        words.append("nest {2:g} x {3:g} m at {0:g},{1:g}".format(*here))
    return words


def _words(name: str, value: Any) -> str:
    if name == "n_objects":
        return counted(value, "object")
    if name == "caches":
        return f"{value.replace('none', 'no')} caches"
    unit = next((ending for ending in _UNITS if name.endswith(ending)), "")
    what, told = name.removesuffix(unit).replace("_", " "), as_setting(value)
    if len(told) > _LONGEST:
        return f"{len(value)} {what} ({digest_of(value, 4)})"
    return f"{what} {told}{_UNITS.get(unit, '')}"


def as_setting(value: Any) -> str:
    """Return the value of a field as --set takes it: "4,6", places as "1,2+3,4"."""
    if isinstance(value, list | tuple):
        entries = cast("tuple[Any, ...]", value)
        return ("+" if entries and isinstance(entries[0], tuple) else ",").join(map(as_setting, entries))
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and value == float(f"{value:.9g}"):
        return f"{value:.9g}"
    return str(value)
