"""The protocol of the benchmark: which worlds, which seeds, how long, read from `benchmark.toml`.

protocol = load_protocol()
protocol.worlds[0].name             # "training: small warehouse"
load_protocol(quick=True)           # the same worlds, shorter and with fewer seeds: for a look
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarm_forage_env.scenarios.floor import CELL_M, POSITIONS
from swarm_forage_env.wrappers.registry import wrappers_from_mapping
from swarm_forage_env.wrappers.world import World

if TYPE_CHECKING:
    from swarm_forage_env.scenarios.config import ScenarioConfig

FOLDER = Path(__file__).parent
"""Where the protocol is, and in `scripted` the entries of the scripted controllers."""
OPEN = "open"
"""The track without a budget."""


class BenchmarkError(ValueError):
    """An entry that cannot be made or used; the message says why, and what to do."""


@dataclass(frozen=True, eq=False)
class ProtocolWorld:
    """A world where every policy is run once per seed."""

    world: World
    """With a unique name: "corridor, long", "late, slow wheels"."""
    group: str = ""
    """The group of held-out worlds it belongs to; empty for a world to train in."""
    is_scored: bool = True
    """Whether its performance counts; that of a lone robot does not."""

    @property
    def name(self) -> str:
        """Name of the world."""
        return self.world.name

    @property
    def is_disturbed(self) -> bool:
        """Whether something disturbs the swarm."""
        return bool(self.world.wrappers)

    @property
    def counts(self) -> bool:
        """Whether its performance is part of the score: it is held out, and no lone robot is in it."""
        return bool(self.group) and self.is_scored


@dataclass(frozen=True, kw_only=True, eq=False)
class Protocol:
    """Everything that decides what an entry has to run."""

    identity: str
    """Short hash of what the file says: two protocols with the same one ask for the same runs."""
    is_quick: bool
    seeds: tuple[int, ...]
    worlds: tuple[ProtocolWorld, ...]
    """The worlds to train in first."""
    tracks: Mapping[str, int]
    """Track with a budget -> the most decisions that one training may take."""
    n_trainings: int
    """Number of trainings that an entry with a budget needs."""

    @property
    def scored(self) -> tuple[ProtocolWorld, ...]:
        """The held-out worlds whose performance counts."""
        return tuple(world for world in self.worlds if world.counts)


def load_protocol(file: Path | None = None, *, quick: bool = False) -> Protocol:
    """Read a protocol.

    Args:
        file: Default that of the package.
        quick: Shorter runs with fewer seeds, as the file says; no entry can be made of them.
    """
    from swarm_forage_env._internal.files import parse_toml
    from swarm_forage_env.runs.spec import identity_of

    content = parse_toml((file or FOLDER / "benchmark.toml").read_text(encoding="utf-8"))
    chosen = {name: content[name] for name in ("physics", "horizon_s", "interval_s", "seeds")}
    chosen |= content["quick"] if quick else {}
    seeds = tuple(chosen.pop("seeds"))
    worlds = [
        ProtocolWorld(World(_scenario(entry, chosen), name=f"training: {entry['name']}"))
        for entry in content["training"]
    ]
    for entry in content["group"]:
        worlds += _of_group(entry, chosen)
    return Protocol(
        identity=identity_of({**content, "is_quick": quick}),
        is_quick=quick,
        seeds=seeds,
        worlds=tuple(worlds),
        tracks=content["tracks"],
        n_trainings=content["trainings"],
    )


def _scenario(entry: Mapping[str, Any], of_all: Mapping[str, Any]) -> "ScenarioConfig":
    from swarm_forage_env.scenarios.presets import scenario

    settings = {**of_all, **entry.get("set", {})}
    if "sources" in settings:
        settings |= {"placement": POSITIONS, "object_positions_m": _cell_middles(settings.pop("sources"))}
    return scenario(entry["scenario"], **settings)


def _cell_middles(boxes: Sequence[Sequence[float]]) -> list[tuple[float, float]]:
    """The middles of all cells in boxes (x low, y low, x high, y high), in m."""
    return [
        ((x + 0.5) * CELL_M, (y + 0.5) * CELL_M)
        for x_low, y_low, x_high, y_high in boxes
        for x in range(round(x_low / CELL_M), round(x_high / CELL_M))
        for y in range(round(y_low / CELL_M), round(y_high / CELL_M))
    ]


def _of_group(entry: Mapping[str, Any], of_all: Mapping[str, Any]) -> Iterator[ProtocolWorld]:
    """Yield the worlds of a group: variants of one scenario, some sizes of it, and what disturbs it."""
    name, base = entry["name"], _scenario(entry, of_all)
    for what, fields in entry.get("variants", {}).items():
        varied = _scenario({**entry, "set": {**entry.get("set", {}), **fields}}, of_all)
        yield ProtocolWorld(World(varied, name=f"{name}, {what}"), name)
    for size in entry.get("sizes", ()):
        sized = replace(base, robots=replace(base.robots, n_robots=size))
        called = f"{name}, {size} robot{'s' if size > 1 else ''}"
        yield ProtocolWorld(World(sized, name=called), name, is_scored=size > 1)
    for what, tables in entry.get("disturbed", {}).items():
        yield ProtocolWorld(World(base, wrappers_from_mapping(tables), name=f"{name}, {what}"), name)
