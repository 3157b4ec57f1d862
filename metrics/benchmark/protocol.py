"""The protocol of the benchmark: which worlds, which seeds, how long, read from a TOML file that never changes.

protocol = load_protocol()          # version 1
protocol.worlds[0].name             # "training: small warehouse"
load_protocol(version=2)            # held-out worlds that ask for more, and tracks of equal budget
load_protocol(version=3)            # worlds in which coordination pays, each also without it
load_protocol(quick=True)           # the same worlds, shorter and with fewer seeds: for a look
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.scenarios.floor import CELL_M, POSITIONS
from swarm_forage_env.studies.ladders import wrappers_at
from swarm_forage_env.wrappers.registry import wrappers_from_mapping
from swarm_forage_env.wrappers.world import SIZE, World

if TYPE_CHECKING:
    from swarm_forage_env.scenarios.config import ScenarioConfig
    from swarm_forage_env.wrappers.base import WrapperConfig

USUAL = 1
"""Version of the protocol that is run where none is asked for: commands that entries have stored name none."""
OPEN = "open"
"""The track without a budget, of every protocol that has tracks."""
_KEYS = (
    "version",
    "physics",
    "horizon_s",
    "interval_s",
    "seeds",
    "trainings",
    "tracks",
    "quick",
    "set",
    "training",
    "group",
)
_QUICK_KEYS = ("horizon_s", "seeds")
_TRAINING_KEYS = ("name", "scenario", "set")
_GROUP_KEYS = ("name", "scenario", "set", "sizes", "levels", "disturbed", "variants", "without")
_LEVEL_WORDS = {"handling_cost": "handling", "population_dynamics": "failures"}
"""Criterion -> its word in the name of a world, where that is another."""


class BenchmarkError(ValueError):
    """A protocol or an entry that cannot be used; the message says why, and what to do."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ProtocolWorld:
    """A world where every policy is run once per seed, and what its runs are for."""

    world: World
    """With a unique name: "small warehouse, 8 robots", "small warehouse, noise 0.03"."""
    group: str
    """The group of worlds it belongs to; empty for a world to train in."""
    is_scored: bool = True
    """Whether its performance counts; if not, measures use it as their reference."""
    lacks: str = ""
    """Name of the world that is the same but for what robots coordinate by, which they lack here; empty for others."""

    @property
    def name(self) -> str:
        """Name of the world."""
        return self.world.name

    @property
    def is_held_out(self) -> bool:
        """Whether nobody is to train in it."""
        return bool(self.group)

    @property
    def is_disturbed(self) -> bool:
        """Whether something disturbs the swarm."""
        return bool(self.world.wrappers)

    @property
    def counts(self) -> bool:
        """Whether its performance is part of the score."""
        return self.is_held_out and self.is_scored

    @property
    def role(self) -> str:
        """Whether it counts, in words."""
        if self.lacks:
            return "no, to compare with"
        return "yes" if self.counts else "reference of measures" if self.is_held_out else "no, to train in"


@dataclass(frozen=True, kw_only=True, eq=False)
class Group:
    """Worlds that measures compare with each other: one scenario at several sizes, undisturbed and disturbed."""

    name: str
    roles: tuple[tuple[str, World], ...]
    """Name of a world of the protocol, and that world as it is to the measures, with criterion and value. A world can
    have two roles: a swarm size, and undisturbed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Protocol(Answer):
    """Everything that decides what an entry has to run; printed, it shows its worlds."""

    version: int
    identity: str
    """Short hash of what the file says: two protocols with the same one ask for the same runs."""
    is_quick: bool
    horizon_s: float
    interval_s: float
    seeds: tuple[int, ...]
    worlds: tuple[ProtocolWorld, ...]
    """The worlds to train in first."""
    groups: tuple[Group, ...]
    tracks: Mapping[str, int]
    """Track with a budget -> the most decisions that one training may take. Empty where there are no tracks."""
    n_trainings: int
    """Number of trainings that an entry with a budget needs."""

    @property
    def scored(self) -> tuple[ProtocolWorld, ...]:
        """The held-out worlds whose performance counts."""
        return tuple(world for world in self.worlds if world.counts)

    @property
    def pairs(self) -> tuple[tuple[ProtocolWorld, ProtocolWorld], ...]:
        """Worlds in which robots can coordinate, each with the one in which they lack what they do it by."""
        by_name = {world.name: world for world in self.worlds}
        return tuple((by_name[world.lacks], world) for world in self.worlds if world.lacks)

    @property
    def name(self) -> str:
        """Name for people."""
        return f"version {self.version}" + (", quick" if self.is_quick else "")

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the worlds: those to train in, and those that are held out."""
        title = (
            f"Benchmark, {self.name}: seeds {', '.join(map(str, self.seeds))}, {self.horizon_s:,g} s per run, "
            f"{len(self.scored)} worlds that count"
        )
        header = ("world", "scenario", "robots", "objects", "arena", "disturbed by", "counts")
        rows = [(world.name, *map(str, scenario_fields(world).values()), world.role) for world in self.worlds]
        notes = [
            f"track {track}: {self.n_trainings} trainings of at most {budget:,} decisions, in the worlds to train in"
            for track, budget in self.tracks.items()
        ]
        if notes:
            notes.append(f"track {OPEN}: any training, or none")
        return (Sheet(title=title, header=header, rows=rows, notes=notes),)

    def to_mapping(self) -> dict[str, Any]:
        """Return what there is to run as plain values."""
        return {
            "version": self.version,
            "is_quick": self.is_quick,
            "horizon_s": self.horizon_s,
            "seeds": list(self.seeds),
            "tracks": dict(self.tracks),
            "worlds": [{"world": world.name, **scenario_fields(world), "counts": world.role} for world in self.worlds],
        }


def protocol_folder() -> Path:
    """Return where the files of all versions are."""
    return Path(__file__).parent


def folder_of(version: int, folder: Path) -> Path:
    """Return where a folder of entries holds those of a version: version 1 came first and lies in the folder itself."""
    return folder if version == 1 else folder / f"v{version}"


def protocol_versions() -> tuple[int, ...]:
    """Return the versions that there are, the oldest first."""
    found = (path.stem.removeprefix("benchmark_v") for path in protocol_folder().glob("benchmark_v*.toml"))
    return tuple(sorted(int(number) for number in found))


def known_versions() -> str:
    """Return the versions that there are, for messages: "1, 2 or 3"."""
    *others, last = map(str, protocol_versions())
    return f"{', '.join(others)} or {last}"


def load_protocol(file: str | Path | None = None, *, version: int = USUAL, quick: bool = False) -> Protocol:
    """Read a protocol.

    Args:
        file: Default that of the version.
        version: One of `protocol_versions`.
        quick: Shorter runs with fewer seeds, as the file says; no entry can be made of them.

    Raises:
        BenchmarkError: there is no such version, or the file cannot be read or describes no protocol; the message names
            it.
    """
    from swarm_forage_env._internal.files import parse_toml

    if file is None and version not in protocol_versions():
        raise BenchmarkError(f"Expected version {known_versions()} of the benchmark, got {version}.")
    path = protocol_folder() / f"benchmark_v{version}.toml" if file is None else Path(file)
    try:
        return _protocol(parse_toml(path.read_text(encoding="utf-8")), quick=quick)
    except OSError as error:
        raise BenchmarkError(f"Cannot read the protocol {path}: {error.strerror or error}.") from error
    except (ValueError, KeyError, TypeError) as error:
        reason = f"missing key {error}" if isinstance(error, KeyError) else str(error)
        raise BenchmarkError(f"Cannot use the protocol {path}: {reason}") from error


def _protocol(content: Mapping[str, Any], *, quick: bool) -> Protocol:
    from swarm_forage_env._internal.fields import known_keys, unique_names
    from swarm_forage_env.runs.spec import identity_of

    known_keys(content, _KEYS, "key of a protocol")
    chosen = {name: content[name] for name in ("physics", "horizon_s", "interval_s", "seeds")} | content.get("set", {})
    if quick:
        known_keys(content["quick"], _QUICK_KEYS, prefix="quick.")
        chosen |= content["quick"]
    seeds = tuple(chosen.pop("seeds"))
    worlds: list[ProtocolWorld] = []
    for entry in content.get("training", []):
        known_keys(entry, _TRAINING_KEYS, prefix="training.")
        world = World(_scenario(entry, chosen), name=f"training: {entry['name']}")
        worlds.append(ProtocolWorld(world=world, group=""))
    groups: list[Group] = []
    for entry in content["group"]:
        known_keys(entry, _GROUP_KEYS, prefix="group.")
        group, of_group = _group(entry, _scenario(entry, chosen), chosen)
        groups.append(group)
        worlds += of_group
    unique_names("worlds", tuple(world.name for world in worlds))
    return Protocol(
        version=content["version"],
        identity=identity_of({**content, "is_quick": quick}),
        is_quick=quick,
        horizon_s=chosen["horizon_s"],
        interval_s=chosen["interval_s"],
        seeds=seeds,
        worlds=tuple(worlds),
        groups=tuple(groups),
        tracks=content.get("tracks", {}),
        n_trainings=content.get("trainings", 1),
    )


def _scenario(entry: Mapping[str, Any], of_all: Mapping[str, Any]) -> "ScenarioConfig":
    from swarm_forage_env.scenarios.presets import scenario
    from swarm_forage_env.studies.study import plain_settings

    settings = {**of_all, **entry.get("set", {})}
    if "sources" in settings:
        settings |= {"placement": POSITIONS, "object_positions_m": _cell_middles(settings.pop("sources"))}
    return scenario(entry["scenario"], **plain_settings(settings))


def _cell_middles(boxes: Sequence[Sequence[float]]) -> list[tuple[float, float]]:
    """The middles of all cells in boxes (x low, y low, x high, y high), in m."""
    return [
        ((x + 0.5) * CELL_M, (y + 0.5) * CELL_M)
        for x_low, y_low, x_high, y_high in boxes
        for x in range(round(x_low / CELL_M), round(x_high / CELL_M))
        for y in range(round(y_low / CELL_M), round(y_high / CELL_M))
    ]


def _group(
    entry: Mapping[str, Any], base: "ScenarioConfig", of_all: Mapping[str, Any]
) -> tuple[Group, list[ProtocolWorld]]:
    """The worlds of a group, and what they are to the measures."""
    name: str = entry["name"]
    worlds: dict[str, ProtocolWorld] = {}
    roles: list[tuple[str, World]] = []

    def add(what: str, scenario: "ScenarioConfig", wrappers: "tuple[WrapperConfig, ...]" = (), **told: Any) -> str:
        world = World(scenario, wrappers, name=f"{name}, {what}")
        if world.name in worlds:
            raise BenchmarkError(f"Expected worlds of different names, got {world.name!r} twice.")
        worlds[world.name] = ProtocolWorld(world=world, group=name, **told)
        return world.name

    def variant(fields: Mapping[str, Any]) -> "ScenarioConfig":
        return _scenario({**entry, "set": {**entry.get("set", {}), **fields}}, of_all)

    for what, fields in entry.get("variants", {}).items():
        whole = add(what, variant(fields))
        for lack, lacking in entry.get("without", {}).items():
            add(f"{what}, {lack}", variant({**fields, **lacking}), is_scored=False, lacks=whole)
    for size in entry.get("sizes", ()):
        sized = replace(base, robots=replace(base.robots, n_robots=size))
        place = add(f"{size} robot{'s' if size > 1 else ''}", sized, is_scored=size > 1)
        roles.append((place, World(sized, criterion=SIZE, value=size)))
        if size == base.robots.n_robots:
            roles.append((place, World(sized)))
    for what, role, is_reference in _disturbances(entry.get("levels", {}), base):
        place = add(what, base, role.wrappers, is_scored=not is_reference)
        roles.append((place, role))
    for what, tables in entry.get("disturbed", {}).items():
        add(what, base, wrappers_from_mapping(tables))
    return Group(name=name, roles=tuple(roles)), list(worlds.values())


def _disturbances(levels: Mapping[str, Any], base: "ScenarioConfig") -> Iterator[tuple[str, World, bool]]:
    """Yield the name, the world and whether it is only a reference, of each level of each criterion."""
    for criterion, values in levels.items():
        # Only what varies over time has a reference of its own; others are held against the undisturbed run.
        own_reference = [0.0] if wrappers_at(base, criterion, 0.0) else []
        for value in (*own_reference, *values):
            role = World(base, wrappers_at(base, criterion, value), criterion=criterion, value=value)
            is_deadly = role.population is not None and role.population.death_per_tick > 0.0
            word = "deaths" if is_deadly else _LEVEL_WORDS.get(criterion, criterion)
            yield f"{word} {value:g}", role, value == 0.0


def scenario_fields(world: ProtocolWorld) -> dict[str, Any]:
    """Return what people want to know of a world: its scenario, robots, objects and arena."""
    scenario = world.world.scenario
    return {
        "scenario": scenario.name,
        "robots": scenario.robots.n_robots,
        "objects": scenario.objects.n_objects,
        "arena": f"{scenario.arena.width_m:g} x {scenario.arena.height_m:g} m",
        "disturbed by": ", ".join(config.name for config in world.world.wrappers),
    }
