"""What a scenario has that its preset has not, by field and in words for people.

Whatever names a world asks here, so that a wall, another nest or three objects are never called
"warehouse_small" alone.
"""

import hashlib
import json
from collections.abc import Callable, Sequence
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
_LENGTHS = ("n_robots", "horizon_s", "interval_s")
"""Fields that names state themselves, or leave to the study: how large a swarm is, and how long it runs."""
_ARENA = ("width_m", "height_m", "nest_centre_m", "nest_size_m")
_UNITS = {"_m": " m", "_s": " s", "_mps": " m/s"}
_LONGEST = 40
"""Characters of a list that words show whole (our choice: half a line); of longer ones they tell how many entries."""
_MOST_BOXES = 3
"""Boxes, places and the like that words show whole (our choice)."""


def differences(config: ScenarioConfig) -> dict[str, Any]:
    """Return the fields by name that differ from those of the preset of that name; of quirks, each switched one.

    A preset may fit itself to the swarm, as search and rescue its arena does: it is held against that of this size. A
    scenario of a name that no preset has is held against nothing, so all its fields are there.
    """
    base = preset_of(config)
    if config == base:
        return {}
    here, there = _flat(config), {} if base is None else _flat(base)
    changed = {name: value for name, value in here.items() if name not in there or value != there[name]}
    return {name: _alike(value, there.get(name)) for name, value in changed.items()}


def _alike(value: Any, usual: Any) -> Any:
    """Return a value with floats where the usual one has them: 2 m are 2.0 m, and names tell no difference."""
    if isinstance(value, tuple):
        first = cast("tuple[Any, ...]", usual)[0] if usual else 0.0
        return tuple(_alike(part, first) for part in cast("tuple[Any, ...]", value))
    is_whole = isinstance(value, int) and not isinstance(value, bool)
    return float(value) if is_whole and isinstance(usual, float) else value


def difference_words(config: ScenarioConfig, *, digests: bool = True) -> tuple[str, ...]:
    """Return in words what differs from the preset, apart from the size of the swarm and the length of runs.

    Example: `("3 objects", "obstacles 10,4,11,12", "physics chipmunk")`. Empty for a scenario that no preset has the
    name of: what it is called is all that people know of it.

    Args:
        config: The scenario.
        digests: Tell long lists apart by a digest, "7 obstacles (7d4d)"; needed where other scenarios stand beside.
    """
    base = preset_of(config)
    if base is None:
        return ()
    found = differences(config)
    words = _arena_words(config.arena, base.arena)
    for name, value in found.items():
        if name not in (*_LENGTHS, *_ARENA, *QUIRK_NAMES):
            words.append(_WORDS[name](value) if name in _WORDS else _plain_words(name, value, digests))
    return (*words, *_quirk_words(config, base, digests))


def is_resized(config: ScenarioConfig) -> bool:
    """Return whether the swarm has another size than that of the preset, or there is no preset of that name."""
    try:
        return config.robots.n_robots != scenario(config.name).robots.n_robots
    except ConfigError:
        return True


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
    for sizes in ({"n_robots": n_robots}, {}):
        try:
            return scenario(name, **sizes)
        except ConfigError:  # its arena is too small for them, so this one has another; or its package is broken
            continue
    return None


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
    tolerance_m = 0.0 if factors == (1.0,) * 4 else CELL_M  # a nest keeps to whole cells
    if any(abs(edge - wanted) > tolerance_m + 1e-9 for edge, wanted in zip(here, scaled, strict=True)):
        words.append("nest {2:g} x {3:g} m at {0:g},{1:g}".format(*here))
    return words


def _quirk_words(config: ScenarioConfig, base: ScenarioConfig, digests: bool) -> tuple[str, ...]:
    if config.quirks == base.quirks:
        return ()
    named = [name for name, rules in RULES.items() if rules == config.quirks]
    if named:
        return (f"rules {named[0]}",)
    switched = [name for name in QUIRK_NAMES if getattr(config.quirks, name) != getattr(base.quirks, name)]
    return (_plain_words("quirks", switched, digests),)


def _plain_words(name: str, value: Any, digests: bool) -> str:
    unit = next((ending for ending in _UNITS if name.endswith(ending)), "")
    what = name.removesuffix(unit).replace("_", " ")
    entries = cast("Sequence[Any]", value) if isinstance(value, list | tuple) else ()
    if _is_long(entries):
        return f"{len(entries)} {what}" + (f" ({digest_of(value, 4)})" if digests else "")
    return f"{what} {_value_words(value)}{_UNITS.get(unit, '')}"


def _value_words(value: Any) -> str:
    """A value as --set takes it."""
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, float):
        return f"{value:g}"
    if not isinstance(value, list | tuple):
        return str(value)
    entries = cast("Sequence[Any]", value)
    return ("+" if _is_nested(entries) else ",").join(map(_value_words, entries))


def _is_nested(entries: Sequence[Any]) -> bool:
    return any(isinstance(entry, tuple) for entry in entries)


def _is_long(entries: Sequence[Any]) -> bool:
    return len(entries) > _MOST_BOXES if _is_nested(entries) else len(_value_words(entries)) > _LONGEST


_WORDS: dict[str, Callable[[Any], str]] = {
    "n_objects": lambda value: counted(value, "object"),
    "caches": lambda value: f"{value.replace('none', 'no')} caches",
    "physics_substeps": lambda value: f"{len(value)} substeps",
}
"""Fields that have words of their own."""
