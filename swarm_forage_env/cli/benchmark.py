"""The commands `benchmark`, `benchmark show` and `benchmark verify`."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, Parameter
from cyclopts.types import NonNegativeInt, PositiveInt

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.cli import EXIT_FAILURE
from swarm_forage_env.cli.options import Jobs, Names, Picture, Policies
from swarm_forage_env.cli.printer import note, say

app = App(name="benchmark")
FOLDER = Path("results", "benchmark")


@app.default
def run(
    policies: Policies,
    /,
    *,
    name: str | None = None,
    file: Path | None = None,
    out: Path = FOLDER / "records",
    trained_in: Literal["given", "other", "held-out", "nothing", "unknown"] = "unknown",
    training_command: Annotated[str, Parameter(name="--training")] = "",
    decisions: NonNegativeInt | None = None,
    jobs: Jobs = None,
) -> None:
    """Run policies in all worlds of the benchmark, write one entry file, and show its score.

    Several policies count as training seeds of one method. The command does not repeat runs that the folder of records
    holds: after Ctrl-C, the same command does the rest.

    Args:
        name: Name of the entry; default the policy's.
        file: Entry to write; default NAME.json in results/benchmark.
        out: Folder for records of runs.
        trained_in: given: only in the training worlds; other: also elsewhere; held-out: also in held-out worlds;
            nothing: not trained; unknown.
        training_command: Command that trained the policies.
        decisions: Decisions of the longest training, of all its robots.
    """
    first, *others = policies
    if name is None and others:
        raise ConfigError("Expected --name for an entry of several policies.")
    from metrics.benchmark import Training, board_of, run_benchmark
    from swarm_forage_env._internal.files import as_file_name, check_file
    from swarm_forage_env.policies.registry import policy_label

    called = name or policy_label(first)
    training = Training(worlds=trained_in, command=training_command, decisions=decisions)
    entry_file = file or FOLDER / f"{as_file_name(called)}.json"
    check_file(entry_file)
    entry = run_benchmark([*policies], name=called, training=training, out=out, jobs=jobs)
    entry.write(entry_file)
    note(f"entry {entry_file}")
    say(board_of([entry]).text())


@app.command(name="show")
def show_entries(entries: tuple[Path, ...] = (), /, *, picture: Picture = None) -> None:
    """Show the scores of entries, beside the scripted controllers.

    Args:
        entries: Entry files; the scripted four are always shown, too.
    """
    from metrics.benchmark import board_of, read_entry
    from swarm_forage_env.rendering.figures import check_picture

    board = board_of([read_entry(file) for file in entries])
    if picture is not None:
        check_picture(picture)
        board.draw(picture)
    say(board.text())


@app.command
def verify(entry: Path, /, *, policy: Names = (), worlds: PositiveInt = 8) -> int:
    """Make runs of an entry again and say whether its numbers come out; exit code 1 if not.

    Args:
        entry: Entry file.
        policy: Policies of the entry in their order; default those installed under their names.
        worlds: How many worlds to draw, counted for each policy.
    """
    from metrics.benchmark import SAME, verify_entry

    again = verify_entry(entry, policy, n_worlds=worlds)
    say(again.text())
    return EXIT_FAILURE if (again.frame["answer"] != SAME).any() else 0
