"""Replays in files: pages that any browser shows.

The header of a page says what it holds: per run the specification, units, geometry for the page,
and which array lies where in the run's block of bytes (`coding` says how).
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, checked
from swarm_forage_env._internal.files import replacing
from swarm_forage_env.contract.codes import Counter, Task
from swarm_forage_env.inspect.replay.coding import pack
from swarm_forage_env.inspect.replay.frames import Replay
from swarm_forage_env.rendering.figures import places_of
from swarm_forage_env.rendering.pages import build_replay_page
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M, WALL_M
from swarm_forage_env.scenarios.performance import performance_of
from swarm_forage_env.wrappers.recorder import TOTALS

_ARRAYS = {
    "position": "u2",
    "heading": "u1",
    "status": "u1",
    "activity": "u1",
    "counters": "i4",
    "object_events": "i4",
    "deliveries": "i4",
    "cache_events": "i4",
    "memory_events": "i4",
}
"""Arrays of a `Replay` and their types in a file; those that are None are left out."""
_PLAIN = ("label", "frame_ticks", "end_tick", "activities", "versions", "has_tasks")
"""Fields of a `Replay` that a header has as they are."""
_SIGNAL = "signal_"
"""What the name of an array begins with that is a waveform, by the name of its wrapper."""
_SIGNALS = {"throttle": ("throttle", ""), "handling_cost": ("handling cost", " ticks")}
"""Wrapper -> what its waveform is called in the page, and its unit."""
_TASKS = {Task.NONE: "no task", Task.CACHE_COLLECTOR: "cache collector"}
"""Names of tasks for people, where they are not just the lower case of the code."""


def write_replays(path: str | Path, replays: Replay | Sequence[Replay], *, title: str | None = None) -> Path:
    """Write one replay, or several to be seen side by side, as a page; whole or not at all.

    Args:
        path: File to create or replace, by custom with the suffix .html; a missing folder is made.
        replays: At least one. Side by side makes sense for runs of one arena and seed.
        title: Headline; default the names of policies and scenarios.

    Returns:
        The path written.

    Raises:
        ConfigError: there is no replay.
    """
    replays = (replays,) if isinstance(replays, Replay) else tuple(replays)
    if not replays:
        raise ConfigError("Expected at least one replay to write, got none.")
    path = Path(checked("path", path, str | Path))
    page = page_of(replays, title=title)
    with replacing(path) as draft:
        draft.write_text(page, encoding="utf-8")
    return path


def page_of(replays: Sequence[Replay], *, title: str | None = None) -> str:
    """Return the page that `write_replays` writes, as text."""
    replays = _told_apart(replays)
    if title is None and len(replays) == 1:
        title = f"{replays[0].label}, {replace(replays[0].spec.world, wrappers=()).title()}"
    looks = places_of(replay.label for replay in replays)
    packed = [_packed(replay, look) for replay, look in zip(replays, looks, strict=True)]
    title = title or ", ".join(replay.label for replay in replays)
    return build_replay_page(title, {"runs": [about for about, _ in packed]}, [block for _, block in packed])


def _told_apart(replays: Sequence[Replay]) -> list[Replay]:
    """Return the replays with labels that differ: of one policy, with what is other in the worlds, then a number."""
    labels = [_with_changes(replay, [one for one in replays if one.label == replay.label]) for replay in replays]
    seen = [labels[: index + 1].count(label) for index, label in enumerate(labels)]
    return [
        replace(replay, label=label if nth == 1 else f"{label} ({nth})")
        for replay, label, nth in zip(replays, labels, seen, strict=True)
    ]


def _with_changes(replay: Replay, namesakes: Sequence[Replay]) -> str:
    """Return the label of a replay with what not all of the same label have in their worlds."""
    common = set[str].intersection(*(set(one.spec.world.changes) for one in namesakes))
    words = ", ".join(change for change in replay.spec.world.changes if change not in common)
    return f"{replay.label} with {words}" if words else replay.label


def _packed(replay: Replay, look: int) -> tuple[dict[str, Any], bytes]:
    """Return the header of a run, and its block of bytes; `look` is the place of its colour among those of figures."""
    arrays: dict[str, np.ndarray] = {name: array for name in _ARRAYS if (array := getattr(replay, name)) is not None}
    arrays |= {f"{_SIGNAL}{name}": values for name, values in replay.signals.items()}
    places: list[dict[str, Any]] = []
    block = b""
    for name, array in arrays.items():
        packed = pack(array)
        where = {"name": name, "dtype": _ARRAYS.get(name, "f4"), "shape": list(array.shape)}
        places.append(where | {"offset": len(block), "size": len(packed)})
        block += packed
    return _about(replay) | {"look": look, "arrays": places}, block


def _about(replay: Replay) -> dict[str, Any]:
    spec, scenario = replay.spec, replay.scenario
    own = {name: getattr(replay, name) for name in _PLAIN}
    return own | {
        "run_id": spec.run_id,
        "scenario": replace(spec.world, wrappers=()).title(),
        "policy": spec.policy,
        "seed": spec.seed,
        "n_robots": scenario.robots.n_robots,
        "n_objects": scenario.objects.n_objects,
        "n_cache_slots": int(replay.cache_events[:, 1].max(initial=-1)) + 1,
        "n_frames": replay.n_frames,
        "dt_s": scenario.dt_s,
        "position_step_m": replay.position_step_m,
        "signals": [
            {"name": name, "title": title, "unit": unit}
            for name, (title, unit) in _SIGNALS.items()
            if name in replay.signals
        ],
        "disturbances": [config.in_words(scenario.dt_s) for config in spec.wrappers],
        "spec": spec.to_mapping(),
        **for_page(scenario),
    }


def for_page(scenario: ScenarioConfig) -> dict[str, Any]:
    """Return what the page must know of a scenario: codes, what counts, and geometry in m."""
    arena = scenario.arena
    column = scenario.performance if scenario.performance in TOTALS else "collected"
    sources: Iterable[tuple[int, ...]] = ()
    if not scenario.objects.is_drawn:
        sources = scenario.source_cells
    return {
        "tasks": [_TASKS.get(task, task.name.lower()) for task in Task],
        "counters": [counter.name.lower() for counter in Counter],
        "performance": {"counter": TOTALS[column].name.lower(), "words": performance_of(column).title},
        "world": {
            "width_m": arena.width_m,
            "height_m": arena.height_m,
            "wall_m": WALL_M,
            "cell_m": CELL_M,
            "interior_m": arena.interior_m,
            "nest_boxes_m": arena.nest_boxes_m,
            "obstacles_m": arena.obstacles,
            "lights_m": [[x, y] for x, y, _ in arena.lights_m],
            "sources_m": [[CELL_M * edge for edge in box] for box in sources],
            "robot_radius_m": scenario.robots.radius_m,
            "caches": scenario.caches,
            "cache_side_m": scenario.cache_side_cells * CELL_M,
        },
    }
