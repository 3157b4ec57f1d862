"""The command `replay`."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarm_forage_env.cli.options import PolicyOptions, Seed, WorldOptions, refuse_others
from swarm_forage_env.cli.printer import notes, progress_bar

if TYPE_CHECKING:
    from swarm_forage_env.inspect.replay.frames import Replay
    from swarm_forage_env.runs.record import RunRecord
    from swarm_forage_env.runs.spec import RunSpec

RESULTS = Path("results")
"""Where the runs of a run id are looked for: the folder that `swarm-forage run` stores them in."""
PAGES = (".html", ".htm")
"""Endings of a page that browsers open."""
_RUN_ID = re.compile(r"[0-9a-f]{16}")
_OPTIONS_OF_STORED_RUNS = ("policies", "named_policies", "file", "seconds", "frame")


def replay(
    context: typer.Context,
    policies: PolicyOptions,
    described: WorldOptions,
    file: Annotated[
        Path | None, typer.Option("--file", help="File to write; default results/SCENARIO_POLICY.html.")
    ] = None,
    seconds: Annotated[float | None, typer.Option(help="Simulated seconds to keep; default the whole run.")] = None,
    frame: Annotated[
        float | None,
        typer.Option(help="Simulated seconds between frames; default 1, or more for large swarms."),
    ] = None,
    seed: Seed = 0,
) -> None:
    """Write a run as one HTML file, with play, zoom, every robot's state, and curves.

    The page shows several policies side by side, in the same world with the same seed. In place of a policy, you can
    name a stored run (file.parquet, or the id of one in results/), which the command makes again. The file needs no
    network.
    """
    from swarm_forage_env._internal.files import check_file

    words = policies.names()
    if _stored_run(words[0]) is not None:
        refuse_others(
            context,
            "a stored run",
            _OPTIONS_OF_STORED_RUNS,
            "which describe another one; leave them out, or name a policy",
        )
    with _complaints():
        runs = _planned(words, described, seed)
        path = file or _default_file(runs[0], described)
        check_file(path)
        if path.suffix.lower() not in PAGES:
            raise typer.BadParameter(
                f"Expected a page that ends in {', '.join(PAGES)}, got {str(path)!r}; 'record' makes films."
            )
        _write(path, [_recorded(spec, record, seconds, frame) for spec, record in runs])


def _write(path: Path, replays: "Sequence[Replay]") -> None:
    from swarm_forage_env.inspect.replay.files import write_replays

    written = write_replays(path, replays)
    typer.echo(f"wrote {written} ({written.stat().st_size / 1e6:.1f} MB)")


def _planned(words: Sequence[str], options: WorldOptions, seed: int) -> "list[tuple[RunSpec, RunRecord | None]]":
    """Return a specification for each run or policy, and the record of stored ones; the first decides the world."""
    from swarm_forage_env.cli.scenario_options import plan_runs
    from swarm_forage_env.runs.spec import RunSpec, plan_run

    runs: list[tuple[RunSpec, RunRecord | None]] = []
    for word in words:
        record = _stored_run(word)
        if record is not None:
            runs.append((RunSpec.from_json(record.spec), record))
        elif runs and runs[0][1] is not None:
            first = runs[0][0]
            with _refusing_policies():
                runs.append((plan_run(first.world, word, seed=first.seed), None))
        else:
            runs.append((plan_runs(options, (word,), n_seeds=1, first_seed=seed)[0], None))
    return runs


def _stored_run(word: str) -> "RunRecord | None":
    """Return the record that a word names, or None if it names a policy."""
    from swarm_forage_env.runs.record import RecordError, RunRecord

    if Path(word).suffix == ".parquet":
        return RunRecord.read(word)
    if not _RUN_ID.fullmatch(word):
        return None
    found = sorted(RESULTS.glob(f"**/{word}.parquet"))
    if not found:
        raise RecordError(f"Expected the run {word} below {RESULTS}/, found none; give the path of its file.")
    return RunRecord.read(found[0])


def _recorded(spec: "RunSpec", stored: "RunRecord | None", seconds: float | None, frame_s: float | None) -> "Replay":
    from swarm_forage_env.inspect.replay.capture import record_replay
    from swarm_forage_env.policies.registry import load_policy

    with _refusing_policies():
        policy = load_policy(spec.policy, spec.parameters)
    with progress_bar(f"{spec.policy}, seed {spec.seed}") as progress:
        made, record = record_replay(spec, policy=policy, seconds=seconds, frame_s=frame_s, progress=progress)
    if stored is not None and record is not None and not record.same_columns(stored):
        notes().print(
            f"The run {spec.run_id} comes out different from its record, which other versions made; "
            "the replay shows the run as it is now.",
        )
    return made


@contextmanager
def _complaints() -> Iterator[None]:
    """Turn what is wrong with the words into a complaint about them."""
    from swarm_forage_env.inspect.replay.frames import ReplayError
    from swarm_forage_env.policies.model_files import ModelError
    from swarm_forage_env.policies.network import NetworkError
    from swarm_forage_env.rendering.view import RenderError

    try:
        yield
    except (ReplayError, RenderError, ModelError, NetworkError) as error:
        raise typer.BadParameter(str(error)) from error


@contextmanager
def _refusing_policies() -> Iterator[None]:
    """Turn what is wrong with a policy's name or file into a complaint; a ValueError of its run is none."""
    try:
        yield
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error


def _default_file(run: "tuple[RunSpec, RunRecord | None]", described: WorldOptions) -> Path:
    from swarm_forage_env._internal.files import as_file_name
    from swarm_forage_env.cli.scenario_options import described_world
    from swarm_forage_env.policies.registry import policy_label

    spec, record = run
    world = described_world(described)[0] if record is None else spec.world
    return RESULTS / f"{world.file_name}_{as_file_name(policy_label(spec.policy))}.html"
