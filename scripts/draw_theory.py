"""Draw the paper's two sketches of theory: self-organisation over swarm sizes, and the graph of tasks.

    python scripts/draw_theory.py [FOLDER]    self_organisation.png and task_graph.png; default docs/images

No run is needed: the curves are laws of `metrics`, the graph is that of the controllers. Needs the plots extra.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from baselines.tasks import DESTINATION, SOURCE, TAB_CHILDREN, TAB_ROOT, Goal
from metrics import task_emergence
from metrics.laws import SizeLaw
from metrics.scoring.plots import COLOURS
from swarm_forage_env.contract.codes import Task

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
SIZES = 2.0 ** np.arange(8)
SKETCHED = {
    "superlinear: robots help each other": SizeLaw(name="power", a=1.0, exponent=1.15),
    "linear: robots do not affect each other": SizeLaw(name="linear", a=1.0),
    "sublinear: robots get in each other's way": SizeLaw(name="contention", a=1.0, contention=0.01),
}
"""What the curve says -> the law; its parameters are our choice, so that the curves can be told apart."""


def self_organisation(folder: Path) -> None:
    """Draw performance per robot over the size, and what each size achieves beyond twice the next smaller one (E_T)."""
    figure: Any = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    for colour, (words, law) in zip(COLOURS, SKETCHED.items(), strict=False):
        performance = law.performance(SIZES)
        beyond = [
            float(task_emergence([small], int(n), [large], int(2 * n)))
            for n, small, large in zip(SIZES, performance, performance[1:], strict=False)
        ]
        left.plot(SIZES, performance / SIZES, color=colour, marker="o", markersize=3, label=words)
        right.plot(SIZES[1:], beyond, color=colour, marker="o", markersize=3)
    left.set_ylabel("performance per robot")
    right.set_ylabel("task self-organisation, E_T")
    for place in (left, right):
        place.set_xscale("log", base=2)
        place.set_xticks(SIZES, [f"{size:g}" for size in SIZES])
        place.set_xlabel("robots")
        place.grid(alpha=0.3)
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=1, frameon=False, fontsize=9)
    figure.savefig(folder / "self_organisation.png", dpi=120)


def task_graph(folder: Path) -> None:
    """Draw the tasks: a root above its two subtasks, each with its source and destination."""
    places = {int(TAB_ROOT[0]): (0.5, 2.0)}
    for root, children in zip(TAB_ROOT, TAB_CHILDREN, strict=True):
        x, y = places[int(root)]
        for side, child in zip((-1.0, 1.0), children, strict=True):
            places[int(child)] = (x + side * 0.5 * 0.5 ** (3.0 - y), y - 1.0)
    figure: Any = Figure(figsize=(9.0, 4.2), layout="constrained")
    place = figure.subplots()
    for colour, root, children in zip(COLOURS, TAB_ROOT, TAB_CHILDREN, strict=False):
        for child in children:
            (x, y), (to_x, to_y) = places[int(root)], places[int(child)]
            place.plot([x, to_x], [y, to_y], color=colour, linewidth=2.0, zorder=1)
    for task, (x, y) in places.items():
        words = (Task(task).name.replace("_", " ").lower(), *(Goal(int(of[task])).name for of in (SOURCE, DESTINATION)))
        label = "{}\n{} to {}".format(*(word.replace("_", " ").lower() for word in words))
        box = {"boxstyle": "round,pad=0.5", "facecolor": "white", "edgecolor": "0.4"}
        place.text(x, y, label, ha="center", va="center", fontsize=9, bbox=box, zorder=2)
    place.set_xlim(0.0, 1.0)
    place.set_ylim(-0.4, 2.4)
    place.set_axis_off()
    figure.savefig(folder / "task_graph.png", dpi=120)


if __name__ == "__main__":
    chosen = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES
    self_organisation(chosen)
    task_graph(chosen)
