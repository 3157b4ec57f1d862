"""The protocol of the benchmark: which worlds, which seeds, how long, read from `benchmark.toml`.

protocol = load_protocol()
protocol.held_out[0].name  # "turned and mirrored, source in the west"
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarm_forage_env._internal.files import parse_toml
from swarm_forage_env.runs.spec import identity_of
from swarm_forage_env.scenarios.floor import CELL_M, POSITIONS
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.registry import wrappers_from_mapping
from swarm_forage_env.wrappers.world import World

if TYPE_CHECKING:
    from swarm_forage_env.scenarios.config import ScenarioConfig

FOLDER = Path(__file__).parent
"""Where the protocol is, and in `scripted` the entries that all others are compared with."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Protocol:
    """What an entry has to run: every policy in every world, once per seed."""

    identity: str
    """Short hash of what the file says: two protocols with the same one ask for the same runs."""
    seeds: tuple[int, ...]
    training: tuple[World, ...]
    """The worlds to train in."""
    held_out: tuple[World, ...]
    """The worlds that count, named after their group: "corridor, long"."""

    @property
    def groups(self) -> tuple[str, ...]:
        """Group of each held-out world; what they have in common is in `benchmark.toml`."""
        return tuple(world.name.partition(", ")[0] for world in self.held_out)

    @property
    def worlds(self) -> tuple[World, ...]:
        """All worlds, those to train in first."""
        return self.training + self.held_out


def load_protocol(file: Path | None = None) -> Protocol:
    """Read a protocol; default that of the package."""
    content = parse_toml((file or FOLDER / "benchmark.toml").read_text(encoding="utf-8"))
    runs = {name: content[name] for name in ("physics", "horizon_s", "interval_s")}
    return Protocol(
        identity=identity_of(content),
        seeds=tuple(content["seeds"]),
        training=tuple(World(_scenario(one, runs), name=f"training: {one['name']}") for one in content["training"]),
        held_out=tuple(world for group in content["group"] for world in _of_group(group, runs)),
    )


def _of_group(group: Mapping[str, Any], runs: Mapping[str, Any]) -> Iterator[World]:
    """Yield the worlds of a group: variants of one scenario, some sizes of it, and what disturbs it."""
    base = _scenario(group, runs)
    for what, fields in group.get("variants", {}).items():
        varied = _scenario({**group, "set": {**group.get("set", {}), **fields}}, runs)
        yield World(varied, name=f"{group['name']}, {what}")
    for size in group.get("sizes", ()):
        sized = replace(base, robots=replace(base.robots, n_robots=size))
        yield World(sized, name=f"{group['name']}, {size} robots")
    for what, tables in group.get("disturbed", {}).items():
        yield World(base, wrappers_from_mapping(tables), name=f"{group['name']}, {what}")


def _scenario(entry: Mapping[str, Any], runs: Mapping[str, Any]) -> "ScenarioConfig":
    settings = {**runs, **entry.get("set", {})}
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
