"""Replays in files: pages that any browser shows, from which `read_replays` gets the arrays back.

The header of a page says what it holds: format, version, and per run the specification, units, geometry for the page,
and which array lies where in the run's block of bytes (`coding` says how). `docs/replay.md` has the table.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.files import replacing
from swarm_forage_env._internal.typed import Count, Name, Within, typed
from swarm_forage_env._internal.wording import shown
from swarm_forage_env.contract.codes import Counter, Task
from swarm_forage_env.inspect.replay.coding import pack, unpack
from swarm_forage_env.inspect.replay.frames import Replay, ReplayError
from swarm_forage_env.rendering.pages import PageError, build_replay_page, take_replay_page_apart
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M, WALL_M
from swarm_forage_env.scenarios.performance import performance_of
from swarm_forage_env.wrappers.recorder import TOTALS

FORMAT = "swarm_forage_env replay"
FORMAT_VERSION = 4
"""Raised whenever an array or a field is new, or changes its name, type or meaning."""
_ARRAYS = {
    "position": "u2",
    "heading": "u1",
    "status": "u1",
    "activity": "u1",
    "remembered": "u2",
    "counters": "i4",
    "object_events": "i4",
    "deliveries": "i4",
    "cache_events": "i4",
    "memory_events": "i4",
}
"""Arrays of a `Replay` and their types in a file; those that are None are left out."""
_ALWAYS = tuple(name for name in _ARRAYS if name not in ("activity", "remembered", "memory_events"))
"""Arrays that every replay has."""
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
        ReplayError: there is no replay.
    """
    replays = (replays,) if isinstance(replays, Replay) else tuple(replays)
    if not replays:
        raise ReplayError("Expected at least one replay to write, got none.")
    path = Path(path)
    page = page_of(replays, title=title)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as draft:
        draft.write_text(page, encoding="utf-8")
    return path


def page_of(replays: Sequence[Replay], *, title: str | None = None) -> str:
    """Return the page that `write_replays` writes, as text."""
    replays = _told_apart(replays)
    packed = [_packed(replay) for replay in replays]
    header = {"format": FORMAT, "version": FORMAT_VERSION, "runs": [about for about, _ in packed]}
    return build_replay_page(title or _headline(replays), header, [block for _, block in packed])


def read_replays(path: str | Path) -> tuple[Replay, ...]:
    """Read the replays of a page.

    Raises:
        ReplayError: the file is missing, no replay page, damaged, or of another version; the message names it.
    """
    try:
        header, blocks = take_replay_page_apart(Path(path).read_text(encoding="utf-8"))
        _check_version(header)
        return _replays_of(header, blocks)
    except OSError as error:
        raise ReplayError(f"Cannot read {path}: {error.strerror or error}.") from error
    except UnicodeDecodeError as error:
        raise ReplayError(f"Cannot read {path}: it is no text, so no replay page.") from error
    except PageError as error:
        raise ReplayError(f"Cannot read {path}: {error}.") from error
    except (ConfigError, ReplayError) as error:
        raise ReplayError(f"Cannot read {path}: its content is damaged ({str(error).rstrip('.')}).") from error


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


def _headline(replays: Sequence[Replay]) -> str:
    if len(replays) == 1:
        return f"{replays[0].label}, {replays[0].spec.world.title()}"
    return ", ".join(replay.label for replay in replays)


def _check_version(header: dict[str, Any]) -> None:
    if header.get("format") != FORMAT:
        raise PageError("it is no replay page of swarm_forage_env")
    if header.get("version") != FORMAT_VERSION:
        raise PageError(
            f"it has version {shown(header.get('version'))} of the format, this version of swarm_forage_env reads "
            f"{FORMAT_VERSION}; read it with the version that wrote it"
        )


def _packed(replay: Replay) -> tuple[dict[str, Any], bytes]:
    """Return the header of a run, and its block of bytes."""
    arrays: dict[str, np.ndarray] = {
        name: array for name in _ARRAYS if (array := getattr(replay, name)) is not None
    } | {f"{_SIGNAL}{name}": values for name, values in replay.signals.items()}
    places: list[dict[str, Any]] = []
    block = b""
    for name, array in arrays.items():
        packed = pack(array)
        places.append(
            {
                "name": name,
                "dtype": _ARRAYS.get(name, "f4"),
                "shape": list(array.shape),
                "offset": len(block),
                "size": len(packed),
            }
        )
        block += packed
    about = _about(replay) | {"arrays": places}
    return about | {"digest": _digest(about, block)}, block


def _about(replay: Replay) -> dict[str, Any]:
    spec, scenario = replay.spec, replay.scenario
    return {
        "label": replay.label,
        "run_id": spec.run_id,
        "scenario": replace(spec.world, wrappers=()).title(),
        "policy": spec.policy,
        "seed": spec.seed,
        "n_robots": scenario.robots.n_robots,
        "n_objects": scenario.objects.n_objects,
        "n_cache_slots": int(replay.cache_events[:, 1].max(initial=-1)) + 1,
        "n_frames": replay.n_frames,
        "frame_ticks": replay.frame_ticks,
        "end_tick": replay.end_tick,
        "dt_s": scenario.dt_s,
        "position_step_m": replay.position_step_m,
        "remembered_frames": replay.remembered_frames,
        "has_tasks": replay.has_tasks,
        "tasks": task_names(),
        "activities": list(replay.activities),
        "counters": [counter.name.lower() for counter in Counter],
        "performance": counted_performance(scenario),
        "signals": [
            {"name": name, "title": title, "unit": unit}
            for name, (title, unit) in _SIGNALS.items()
            if name in replay.signals
        ],
        "disturbances": [config.in_words(scenario.dt_s) for config in spec.wrappers],
        "world": geometry(scenario),
        "versions": dict(replay.versions),
        "spec": spec.to_mapping(),
    }


def task_names() -> list[str]:
    """Return what tasks are called in the page, by code."""
    return [_TASKS.get(task, task.name.lower()) for task in Task]


def counted_performance(scenario: ScenarioConfig) -> dict[str, str]:
    """Return what the page counts: performance if it is something that the world counts, else deliveries."""
    column = scenario.performance if scenario.performance in TOTALS else "collected"
    return {"counter": TOTALS[column].name.lower(), "words": performance_of(column).title}


def geometry(scenario: ScenarioConfig) -> dict[str, Any]:
    """Return the geometry that the page draws, in m."""
    arena = scenario.arena
    sources: Iterable[tuple[int, ...]] = ()
    if scenario.objects.placement != "power_law":  # its clusters differ from run to run
        sources = scenario.source_cells
    return {
        "width_m": arena.width_m,
        "height_m": arena.height_m,
        "wall_m": WALL_M,
        "cell_m": CELL_M,
        "interior_m": list(arena.interior_m),
        "nest_boxes_m": [list(box) for box in arena.nest_boxes_m],
        "obstacles_m": [list(box) for box in arena.obstacles],
        "lights_m": [[x, y] for x, y, _ in arena.lights_m],
        "sources_m": [[CELL_M * edge for edge in box] for box in sources],
        "robot_radius_m": scenario.robots.radius_m,
        "caches": scenario.caches,
        "cache_side_m": scenario.cache_side_cells * CELL_M,
    }


@dataclass(frozen=True, kw_only=True)
class _Place:
    """Where an array lies in a block, and what it is."""

    name: str
    dtype: str
    shape: tuple[Count, ...]
    offset: Count
    size: Count


@dataclass(frozen=True, kw_only=True)
class _Run:
    """What of the header of a run becomes a `Replay`; all else is for the page."""

    spec: Mapping[str, Any]
    label: Name
    frame_ticks: Annotated[int, Within(at_least=1)]
    end_tick: Annotated[int, Within(at_least=1)]
    activities: tuple[str, ...]
    remembered_frames: Annotated[int, Within(at_least=1)]
    has_tasks: bool
    versions: Mapping[str, str]
    arrays: tuple[_Place, ...]
    digest: str


def _replays_of(header: dict[str, Any], blocks: list[bytes]) -> tuple[Replay, ...]:
    given: tuple[Mapping[str, Any], ...] = typed(tuple[Mapping[str, Any], ...], header.get("runs"), "runs")
    if len(given) != len(blocks):
        raise ReplayError(f"Expected one block of numbers for each of {len(given)} runs, got {len(blocks)}.")
    own = _Run.__dataclass_fields__
    runs: list[_Run] = [
        typed(_Run, {name: value for name, value in about.items() if name in own}, f"runs[{k}]")
        for k, about in enumerate(given)
    ]
    for run, about, block in zip(runs, given, blocks, strict=True):
        if _digest({name: value for name, value in about.items() if name != "digest"}, block) != run.digest:
            raise ReplayError("it does not match its digest")
    return tuple(map(_replay_of, runs, blocks))


def _replay_of(run: _Run, block: bytes) -> Replay:
    arrays = {
        place.name: unpack(block[place.offset : place.offset + place.size], place.dtype, place.shape)
        for place in run.arrays
    }
    missing = [name for name in _ALWAYS if name not in arrays]
    if missing:
        raise ReplayError(f"Expected an array {missing[0]}, got none.")
    own: dict[str, Any] = {name: arrays.get(name) for name in _ARRAYS}
    signals = {name.removeprefix(_SIGNAL): array for name, array in arrays.items() if name not in _ARRAYS}
    return Replay(
        spec=RunSpec.from_mapping(run.spec),
        label=run.label,
        frame_ticks=run.frame_ticks,
        end_tick=run.end_tick,
        activities=run.activities,
        remembered_frames=run.remembered_frames,
        versions=run.versions,
        has_tasks=run.has_tasks,
        signals=signals,
        **own,
    )


def _digest(about: dict[str, Any], block: bytes) -> str:
    state = hashlib.blake2b(json.dumps(about, sort_keys=True).encode(), digest_size=16)
    state.update(block)
    return state.hexdigest()
