"""Pictures of the arena of a study: where its runs begin, and maps of the floor per condition.

For maps a condition's runs are made again, since records hold no positions.
"""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env._internal.fields import ConfigError, known_keys, whole
from swarm_forage_env.inspect.maps import FloorMaps, map_run, mean_maps, same_proportions
from swarm_forage_env.rendering.frame import render_frame
from swarm_forage_env.runs.record import RunRecord
from swarm_forage_env.runs.run import build_env
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import DONE
from swarm_forage_env.runs.workers import Tell, map_runs
from swarm_forage_env.studies.study import Place, StudySpec, Value, value_words
from swarm_forage_env.studies.study_table import StudyTable

MOST_PLACES = 8
"""Conditions that are mapped at once (our choice: with their differences they are fifteen rows of a picture)."""
DEFAULT_SEEDS = 4
"""Runs made again per condition (our choice: a density averages over thousands of moments in each run already)."""
_COMPARED = "collected"
"""Column of a stored run that must come out the same when the run is made again."""

SIZE_PX = 700
"""Longer side of the arena in pixels, in the picture of a beginning."""

Advance = Callable[[float], None]
"""Called with the robot-ticks of all conditions that are done."""


def snapshot_place(spec: StudySpec) -> Place:
    """Return the condition that a picture is of: first rules, last policy, the middle value of each axis."""
    middle = tuple(axis.values[(len(axis.values) - 1) // 2] for axis in spec.axes)
    wanted = (spec.rules[0], spec.policies[-1].label, middle)
    return next(place for place in spec.places if (place.rules, place.policy, place.values) == wanted)


def snapshot(spec: StudySpec) -> NDArray[np.uint8]:
    """Draw the first run of that condition before its first tick.

    Returns:
        (H, W, 3) picture, first row at the top.

    Raises:
        ImportError: Pillow is not installed.
    """
    place = snapshot_place(spec)
    run = spec.specs_of(place)[0]
    env = build_env(run.scenario)
    env.reset_batch(run.seed)
    world = run.scenario
    values = spec.place_words()[place][2:]
    places = [f"{axis.name.replace('_', ' ')} {word}" for axis, word in zip(spec.axes, values, strict=True)]
    title = ", ".join([f"{spec.name}: {world.arena.width_m:g} x {world.arena.height_m:g} m", *places])
    return render_frame(
        world, env.swarm, env.objects, env.caches, env.events, tick=0, size_px=SIZE_PX, title=title, theme="light"
    )


def choose_places(spec: StudySpec, words: Sequence[str]) -> tuple[Place, ...]:
    """Return the conditions that words name, in their order; without words all conditions.

    Args:
        spec: The study.
        words: "KEY=VALUE,KEY=VALUE" each, as "policy=dpo,population_size=16". Keys are `rules`, `policy` and the axes
            of the study; a word names every condition that has all of its values.

    Raises:
        ConfigError: an unknown key or value, or more than `MOST_PLACES` conditions.
    """
    found = dict.fromkeys(place for word in words for place in _named(spec, word)) if words else spec.places
    if len(found) > MOST_PLACES:
        example = ",".join(
            f"{key}={value_words(values)[values[0]]}" for key, values in _values(spec).items() if len(values) > 1
        )
        raise ConfigError(
            f"Expected at most {MOST_PLACES} conditions, got {len(found)} of study {spec.name}; choose some by their "
            f"values, such as --condition {example}. There are {_known(spec)}."
        )
    return tuple(found)


def maps_of_places(
    table: StudyTable,
    places: Sequence[Place],
    *,
    n_seeds: int | None = None,
    side_m: float = 0.4,
    jobs: int | None = 1,
    advance: Advance | None = None,
) -> tuple[tuple[FloorMaps, ...], tuple[str, ...]]:
    """Make runs of conditions again and return the mean of their maps.

    Args:
        table: The study.
        places: Which ones; their arenas must have one shape.
        n_seeds: How many runs per condition, the first ones; default at most `DEFAULT_SEEDS`.
        side_m: Side of a square in the smallest arena. In larger ones squares are larger, so that all have as many.
        jobs: As in `runs.workers.map_runs`, and so is `advance`.
        advance: Called with the robot-ticks that are done.

    Returns:
        One per condition; and the run_ids of those runs that came out different from what the study holds.

    Raises:
        ConfigError: arenas of several shapes, more seeds than the study has, a side that does not fit the arena, or a
            run that cannot be made.
    """
    spec = table.spec
    if n_seeds is not None:
        whole("the number of seeds", n_seeds, at_least=1, at_most=len(spec.seeds))
    n_seeds = n_seeds or min(DEFAULT_SEEDS, len(spec.seeds))
    arenas = [spec.world(place).scenario.arena for place in places]
    sizes_m = [(arena.width_m, arena.height_m) for arena in arenas]
    if not all(same_proportions(size_m, sizes_m[0]) for size_m in sizes_m):
        raise ConfigError(
            f"Expected conditions whose arenas have one shape, got {sorted({*sizes_m})} m; choose others."
        )
    smallest_m = min(size_m[0] for size_m in sizes_m)
    runs = {place: spec.specs_of(place)[:n_seeds] for place in places}
    made = map_runs(
        partial(_map_of, side_m, smallest_m), [run for of in runs.values() for run in of], jobs=jobs, advance=advance
    )
    maps: list[FloorMaps] = []
    changed: list[str] = []
    for (place, of_place), label in zip(runs.items(), _labels(spec, places), strict=True):
        found = [next(made) for _ in of_place]
        maps.append(mean_maps([one for one, _ in found], label))
        changed += [
            run.run_id
            for run, (_, record) in zip(of_place, found, strict=True)
            if not _is_same(table, place, run, record)
        ]
    return tuple(maps), tuple(changed)


def robot_ticks(spec: StudySpec, places: Sequence[Place], n_seeds: int | None) -> int:
    """Return how much `maps_of_places` has to do."""
    n_runs = n_seeds or min(DEFAULT_SEEDS, len(spec.seeds))
    return sum(run.robot_ticks for place in places for run in spec.specs_of(place)[:n_runs])


def _map_of(side_m: float, in_width_m: float, run: RunSpec, tell: Tell | None) -> tuple[FloorMaps, RunRecord]:
    try:
        return map_run(side_m, in_width_m, run, tell)
    except ConfigError:
        raise
    except ValueError as error:  # a policy that is not installed here, or a file that has changed
        raise ConfigError(str(error)) from error


def _is_same(table: StudyTable, place: Place, run: RunSpec, record: RunRecord) -> bool:
    """Return whether a run came out as the study has it; one that it has not is as good."""
    rows = table.rows(place)
    stored = rows.filter((rows["run_id"] == run.run_id) & (rows["state"] == DONE))
    return not len(stored) or np.array_equal(stored[_COMPARED].to_numpy(), record.columns()[_COMPARED])


def _values(spec: StudySpec) -> dict[str, tuple[Value, ...]]:
    """Return everything by which conditions differ: key -> its values."""
    return {
        "rules": spec.rules,
        "policy": tuple(policy.label for policy in spec.policies),
        **{axis.name: axis.values for axis in spec.axes},
    }


def _by_key(spec: StudySpec, place: Place) -> dict[str, Value]:
    return dict(zip(_values(spec), (place.rules, place.policy, *place.values), strict=True))


def _named(spec: StudySpec, word: str) -> list[Place]:
    """Return the conditions that one word names."""
    pairs = [part.partition("=") for part in word.split(",")]
    if not all(equals for _, equals, _ in pairs):
        raise ConfigError(f"Expected a condition as KEY=VALUE,KEY=VALUE, got {word!r}. There are {_known(spec)}.")
    wanted = {key.strip(): text.strip() for key, _, text in pairs}
    values = _values(spec)
    known_keys(wanted, values, f"key of the conditions of study {spec.name}")
    meant: dict[str, list[Value]] = {}
    for key, text in wanted.items():
        words = value_words(values[key])
        meant[key] = [value for value, word in words.items() if _is(value, word, text)]
        if not meant[key]:
            there = ", ".join(words.values())
            raise ConfigError(f"Expected {key} to be one of {there} in study {spec.name}, got {text!r}.")
    return [place for place in spec.places if all(_by_key(spec, place)[key] in those for key, those in meant.items())]


def _is(value: Value, word: str, text: str) -> bool:
    """Whether a user means this value: as it is shown, or any other way to write it."""
    if text == word:
        return True
    if isinstance(value, str | bool):
        return str(value).lower() == text.lower()
    try:
        return float(text) == value
    except ValueError:
        return False


def _known(spec: StudySpec) -> str:
    return "; ".join(f"{key} {', '.join(value_words(values).values())}" for key, values in _values(spec).items())


def _labels(spec: StudySpec, places: Sequence[Place]) -> list[str]:
    """Name each condition by its policy and what differs between them."""
    keyed = [_by_key(spec, place) for place in places]
    differing = [key for key in _values(spec) if key != "policy" and len({one[key] for one in keyed}) > 1]
    words = {key: value_words(values) for key, values in _values(spec).items()}
    return [" ".join([str(one["policy"]), *(f"{key}={words[key][one[key]]}" for key in differing)]) for one in keyed]
