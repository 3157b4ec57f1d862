"""The metadata of entries for others: search engines, and programs that compare entries without this package.

describe_entries("docs/benchmark")  # writes docs/benchmark/croissant.json
"""

from pathlib import Path
from typing import Any

from swarm_forage_env._internal.croissant import (
    JSON_FORMAT,
    Field,
    file_object,
    file_set,
    record_set,
    write_croissant,
)
from swarm_forage_env._internal.wording import counted

from .board import entry_files, protocol_of
from .entry import read_entry
from .protocol import BenchmarkError, Protocol

_FILES = "entry_files"
_UNITS = {
    "performance": "Performance per 1,000 s: deliveries, or first pick-ups in search and rescue.",
    "interference": "Share of the robots' active time that they lose to avoiding others.",
}


def describe_entries(folder: str | Path) -> Path:
    """Write `croissant.json` into a folder of entries: their files with digests, and the numbers of every run.

    Args:
        folder: A folder of entry files of one version of the benchmark.

    Returns:
        The file.

    Raises:
        BenchmarkError: there is no entry, one that cannot be read, or entries of two versions.
    """
    folder = Path(folder)
    files = entry_files([folder])
    if not files:
        raise BenchmarkError(f"Expected entry files in {folder}, found none.")
    protocol = protocol_of([read_entry(file) for file in files])
    names = [file.name for file in files]  # a pattern would also find those of other versions in folders below
    return write_croissant(
        folder,
        distribution=[
            *(file_object(file, JSON_FORMAT) for file in files),
            file_set(_FILES, "One file per entry; it also has measures of swarm engineering.", JSON_FORMAT, names),
        ],
        record_sets=[
            _entries(protocol),
            *(_numbers(protocol, name, unit) for name, unit in _UNITS.items()),
            _worlds(protocol),
        ],
        about={
            "name": f"Entries of the benchmark of swarm_forage_env, version {protocol.version}",
            "description": f"Policies of swarms that forage, run in {counted(len(protocol.worlds), 'world')}, "
            f"{counted(len(protocol.seeds), 'seed')}, {protocol.horizon_s:,g} s per run: "
            f"{len(protocol.scored)} held-out worlds count for the score.",
            "version": f"{protocol.version}.0.0",
            "isLiveDataset": True,
        },
    )


def _entries(protocol: Protocol) -> dict[str, Any]:
    def one(name: str, place: str, kind: str, description: str) -> Field:
        return Field(name=name, description=description, data_type=kind, extract={"jsonPath": f"$.{place}"})

    fields = [
        one("name", "name", "sc:Text", "Name of the entry."),
        one("command", "command", "sc:Text", "Command that ran it."),
        one("core_hours", "core_hours", "sc:Float", "Core-hours of its runs; empty if unknown."),
        one("trained_in", "training.worlds", "sc:Text", "given: in the training worlds; other; nothing; unknown."),
        one("training", "training.command", "sc:Text", "Command that trained its policies."),
        one("library", "training.library", "sc:Text", "Library that trained them."),
        one("training_core_hours", "training.core_hours", "sc:Float", "Core-hours of all trainings, if known."),
        one("digest", "digest", "sc:Text", "Hash of all that the entry holds."),
    ]
    if protocol.tracks:
        fields += [
            one("track", "training.track", "sc:Text", "Most decisions of a training: 10M, 40M, or open."),
            one("decisions", "training.decisions", "sc:Integer", "Decisions of the longest training, if known."),
        ]
    return record_set("entries", "An entry: policies of one method.", fields, files=_FILES)


def _numbers(protocol: Protocol, name: str, unit: str) -> dict[str, Any]:
    entry = Field(name="entry", description="Name of the entry.", data_type="sc:Text", extract={"jsonPath": "$.name"})
    fields = [
        Field(
            name=world.name,
            description=f"Runs in this world, {len(protocol.seeds)} seeds of each policy.",
            data_type="sc:Float",
            extract={"jsonPath": f"$.runs['{world.name}'].{name}"},
            shape=(None, len(protocol.seeds)),
        )
        for world in protocol.worlds
    ]
    return record_set(name, f"An entry. {unit} Axes: policies, seeds.", [entry, *fields], files=_FILES)


def _worlds(protocol: Protocol) -> dict[str, Any]:
    records = protocol.to_mapping()["worlds"]
    meanings = {
        "world": "Name of the world.",
        "scenario": "Preset that it comes from.",
        "robots": "Number of robots.",
        "objects": "Number of objects.",
        "arena": "Width and height.",
        "disturbed by": "What disturbs the swarm.",
        "counts": "Whether its runs count for the score.",
    }
    fields = [
        Field(
            name=name,
            description=meaning,
            data_type="sc:Integer" if isinstance(records[0][name], int) else "sc:Text",
        )
        for name, meaning in meanings.items()
    ]
    return record_set("worlds", "A world of the benchmark.", fields, records=records)
