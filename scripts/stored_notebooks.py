"""Keep in the notebooks of docs/notebooks what their cells print and show, for readers who do not run them.

    scripts/build_docs                    compare what the cells printed with what is stored; exit 1 if it differs
    scripts/build_docs --store-notebooks  store what the cells printed and showed

scripts/build_docs executes the notebooks and calls this file with the folder of the executed ones. It stores texts and
PNG pictures, the number of each cell, a digest of the cells that made them, and the versions they were made with.
Texts are compared only where these versions are installed.
"""

import argparse
import hashlib
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scripts.update_docs import ROOT, made_with

FOLDER = ROOT / "docs/notebooks"
KEPT = ("text/plain", "image/png")
TRAINING = ("train_and_score",)
"""Not compared: what PPO learns depends on the processor, in the last bits and from there on."""

Notebook = dict[str, Any]
"""A notebook as its file has it."""


def code_cells(notebook: Notebook) -> list[dict[str, Any]]:
    """Return the cells that are executed."""
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def digest(notebook: Notebook) -> str:
    """Return what changes with the source of any cell that is executed."""
    return hashlib.sha256(json.dumps(["".join(cell["source"]) for cell in code_cells(notebook)]).encode()).hexdigest()


def outputs(cell: dict[str, Any], number: int) -> list[dict[str, Any]]:
    """Return what a cell printed and showed, without metadata and other forms of a picture.

    myst-nb adds what a cell prints later to the first output of the stream, and leaves the later ones where they are.
    """
    kept: list[dict[str, Any]] = []
    for output in cell["outputs"]:
        if output["output_type"] != "stream":
            data = {kind: output["data"][kind] for kind in KEPT if kind in output["data"]}
            counted = {"execution_count": number} if output["output_type"] == "execute_result" else {}
            kept.append({"output_type": output["output_type"], "data": data, "metadata": {}, **counted})
        elif output["name"] not in [one.get("name") for one in kept]:
            text = "".join(output["text"]).splitlines(keepends=True)
            kept.append({"output_type": "stream", "name": output["name"], "text": text})
    return kept


def printed(notebook: Notebook) -> list[list[str]]:
    """Return the texts of each cell; a picture is the text that stands for it."""
    return [
        ["".join(output.get("text") or output["data"]["text/plain"]) for output in outputs(cell, number)]
        for number, cell in enumerate(code_cells(notebook), start=1)
    ]


def stored(notebook: Notebook, executed: Notebook) -> Notebook:
    """Return a notebook with the outputs of the executed one, and nothing else of it.

    Raises:
        ValueError: The executed notebook has other cells.
    """
    if digest(notebook) != digest(executed):
        raise ValueError("expected the executed notebook to have the same cells, got others; build the site anew")
    numbered = {cell["id"]: (number, cell) for number, cell in enumerate(code_cells(executed), start=1)}
    cells = list(notebook["cells"])
    for place, cell in enumerate(cells):
        if cell["cell_type"] == "code":
            number, as_executed = numbered[cell["id"]]
            cells[place] = {**cell, "execution_count": number, "outputs": outputs(as_executed, number)}
    about = {**notebook["metadata"], "stored": {"cells": digest(notebook), "made_with": made_with()}}
    return {**notebook, "cells": cells, "metadata": about}


def differences(notebook: Notebook, executed: Notebook) -> list[str]:
    """Return the ids of the cells that printed other words than are stored; none where other versions are installed.

    Ends of lines do not count: myst-nb ends a line where an output was cut.
    """
    if notebook["metadata"]["stored"]["made_with"] != made_with():
        return []
    cells = zip(code_cells(notebook), printed(notebook), printed(executed), strict=True)
    return [cell["id"] for cell, was, now in cells if " ".join(was).split() != " ".join(now).split()]


def main(words: Sequence[str] | None = None) -> int:
    """Do what the options say, those of the command line where none are given; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("executed", type=Path, metavar="FOLDER", help="the executed notebooks")
    parser.add_argument("--store", action="store_true", help="store what they printed and showed")
    arguments = parser.parse_args(words)
    code = 0
    for file in sorted(FOLDER.glob("*.ipynb")):
        notebook = json.loads(file.read_text(encoding="utf-8"))
        executed = json.loads((arguments.executed / file.name).read_text(encoding="utf-8"))
        if arguments.store:
            text = json.dumps(stored(notebook, executed), indent=1, ensure_ascii=False, sort_keys=True)
            file.write_text(text + "\n", encoding="utf-8")
        elif file.stem not in TRAINING and (cells := differences(notebook, executed)):
            print(f"{file.relative_to(ROOT)}: {', '.join(cells)} printed other words than are stored; if that is meant "
                  "to be: scripts/build_docs --store-notebooks", file=sys.stderr)  # fmt: skip
            code = 1
    return code


if __name__ == "__main__":
    sys.exit(main())
