"""The metadata of a data set for others: search engines, and places where data sets are published."""

from pathlib import Path
from typing import Any

from swarm_forage_env._internal.croissant import (
    JSON_FORMAT,
    NPZ_FORMAT,
    Field,
    file_object,
    file_set,
    record_set,
    type_of,
    write_croissant,
)
from swarm_forage_env._internal.wording import counted
from swarm_forage_env.contract.layout import ObservationLayout
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.policies.interface import learner_layout
from swarm_forage_env.policies.registry import policy_label
from swarm_forage_env.training.datasets.layout import (
    ARRAYS,
    CARD_FILE,
    Card,
    DatasetError,
    chunk_file,
    chunk_kinds,
    summary_file,
)
from swarm_forage_env.training.datasets.reading import TrajectoryDataset

_MEANINGS = {
    "observations": "What each robot saw before each of n decisions, and after the last one. Axes: n + 1, robots, "
    "columns; the record set columns says what those are.",
    "rewards": "Reward of each robot, summed over the ticks of a decision. Axes: n, robots. It has no unit.",
    "terminated": "Whether a robot died in this decision. Axes: n, robots.",
    "truncated": "Whether a robot could have gone on when the run ended. Axes: n, robots.",
    "active": "Whether a robot was at work when the observation was made; others do not act. Axes: n + 1, robots.",
}


def describe_dataset(folder: str | Path, **about: Any) -> Path:
    """Write `croissant.json` into the folder of a data set: its files with digests, its arrays with types and shapes.

        person = {"@type": "Person", "name": "Ada Lovelace"}
        describe_dataset("results/dpo_small", creator=person, license="https://spdx.org/licenses/CC-BY-4.0")

    Args:
        folder: A data set of `record_dataset`; its runs that are whole are described.
        about: Properties of the data set in the words of Croissant, such as `creator`, `license`, `url`, `version`,
            `description`, `citeAs`. Creator, license and address stay those of an earlier call; else they are those
            of this package.

    Returns:
        The file.

    Raises:
        DatasetError: the folder holds no data set, no whole run, or one with columns of another version.
    """
    dataset = TrajectoryDataset(folder)
    card, runs = dataset.card, dataset.runs
    if not runs:
        raise DatasetError(f"Expected a run in {folder} that is whole, found none; record it to its end.")
    distribution = [file_object(dataset.folder / CARD_FILE, JSON_FORMAT)]
    for run in runs:
        chunks = [chunk_file(dataset.folder, run.seed, number) for number in range(len(run.chunks))]
        distribution.append(file_object(summary_file(dataset.folder, run.seed), JSON_FORMAT))
        distribution += [file_object(chunk, NPZ_FORMAT) for chunk in chunks]
    distribution += [
        file_set("summaries", "One file per run.", JSON_FORMAT, ["seed_*.json"]),
        file_set("chunks", "NumPy archives (.npz) of arrays, parts of runs.", NPZ_FORMAT, ["seed_*.npz"]),
    ]
    return write_croissant(
        dataset.folder,
        distribution=distribution,
        record_sets=[_runs(), _decisions(card), _columns(_layout(card, dataset.folder))],
        about={**_about(card, len(runs)), **about},
    )


def _about(card: Card, n_runs: int) -> dict[str, Any]:
    spec, interface = card.spec, card.interface
    scenario, label = spec.scenario, policy_label(spec.policy)
    decision = f"{counted(interface.decision_ticks, 'tick')} of {scenario.dt_s:g} s"
    frames = ", in frames of robots' own, turned and mirrored" if interface.frame_decisions else ""
    return {
        "name": f"{label} in {spec.world.title()}",
        "description": f"What {counted(scenario.robots.n_robots, 'robot')} of a foraging swarm saw, did and were "
        f"rewarded with{frames}: {counted(n_runs, 'run')} of the policy {label} in {spec.world.title()}, at most "
        f"{scenario.horizon_s:g} s each, with a decision in every {decision}. Simulated with swarm_forage_env "
        f"{card.versions.get('swarm-forage-env', '')}.",
        "version": "1.0.0",
    }


def _layout(card: Card, folder: Path) -> ObservationLayout:
    layout = learner_layout(SwarmSpec.of(card.spec.scenario).layout, card.interface)
    if tuple(part.name for part in layout for _ in range(part.size)) != card.columns:
        raise DatasetError(
            f"Expected observations with the columns of this version in {folder}, got others; describe the data set "
            "with the version that recorded it."
        )
    return layout


def _runs() -> dict[str, Any]:
    def one(name: str, kind: str, description: str, shape: tuple[None] | None = None) -> Field:
        extract = {"jsonPath": f"$.{name}"}
        return Field(name=name, description=description, data_type=kind, extract=extract, shape=shape)

    fields = (
        one("seed", "sc:Integer", "Seed of the run."),
        one("chunks", "sc:Integer", "Number of decisions in each of its chunks.", (None,)),
        one("truncated", "sc:Boolean", "Whether the horizon was reached; if not, all robots died before."),
        one("collected", "sc:Integer", "Objects delivered."),
        one("first_picked", "sc:Integer", "Objects picked up for the first time."),
    )
    return record_set("runs", "A run.", fields, files="summaries")


def _decisions(card: Card) -> dict[str, Any]:
    kinds, meanings = chunk_kinds(card), {**_MEANINGS, "actions": _meaning_of_actions(card)}
    name = "Name of the file: the seed of the run, and the number of the chunk from 0."
    fields = [Field(name="file", description=name, data_type="sc:Text", extract={"fileProperty": "filename"})]
    for array in ARRAYS:
        dtype, shape = kinds[array]
        fields.append(
            Field(
                name=array,
                description=meanings[array],
                data_type=type_of(dtype),
                extract={"column": array},
                shape=shape,
            )
        )
    words = "Successive decisions of all robots of a run; the columns of a file are the arrays of its archive."
    return record_set("decisions", words, fields, files="chunks")


def _meaning_of_actions(card: Card) -> str:
    if card.n_actions is not None:
        return f"Which of {card.n_actions} actions each robot chose, counted from 0. Axes: n, robots."
    n_messages = card.interface.message_size or 0
    driven = ["left wheel", "right wheel", "gripper"][: card.action_shape[-1] - n_messages]
    said = [counted(n_messages, "number") + " of a message"] if n_messages else []
    return f"Commands of each robot, from -1 to 1: {', '.join(driven + said)}. Axes: n, robots, commands."


def _columns(layout: ObservationLayout) -> dict[str, Any]:
    fields = (
        Field(name="name", description="What the columns are called.", data_type="sc:Text"),
        Field(name="first", description="The first of the columns, counted from 0.", data_type="sc:Integer"),
        Field(name="size", description="How many columns there are.", data_type="sc:Integer"),
        Field(name="meaning", description="What they hold.", data_type="sc:Text"),
        Field(
            name="scale",
            description="What 1.0 stands for in each of the columns: m, m/s, or how many.",
            data_type="sc:Float",
            shape=(None,),
        ),
    )
    records = [
        {
            "name": part.name,
            "first": part.start,
            "size": part.size,
            "meaning": part.meaning,
            "scale": [float(unit) for unit in part.scale],
        }
        for part in layout
    ]
    return record_set("columns", "Columns of an observation that belong together.", fields, records=records)
