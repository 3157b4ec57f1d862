"""The command `study verdict`: the paper's claims and intuitions held against studies."""

from pathlib import Path
from typing import Annotated

import typer

Places = Annotated[list[Path], typer.Argument(metavar="DIR|FILE...", help="Folders of studies, or their packed files.")]


def verdict(
    places: Places,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write all of it as JSON.")] = None,
) -> None:
    """Hold the claims of the paper against runs of its sets: what they support, contradict or leave open.

    Below them the same for its intuitions, what it expected of each algorithm before the experiments.
    """
    from metrics import verdict as verdict_of
    from swarm_forage_env._internal.files import check_file, replacing
    from swarm_forage_env.cli.terminal import notes, show_boxed
    from swarm_forage_env.studies.study_table import read_study

    aside = notes()
    tables = [read_study(place) for place in places]
    if json_file is not None:
        check_file(json_file)
    found = verdict_of(*tables, tell=aside.print)
    for remark in found.remarks:
        aside.print(f"note: {remark}")
    show_boxed(found)
    if json_file is not None:
        with replacing(json_file) as draft:
            draft.write_text(f"{found.json()}\n", encoding="utf-8")
        aside.print(f"written {json_file}")
