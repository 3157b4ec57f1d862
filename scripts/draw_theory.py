"""Draw the paper's three sketches of theory: self-organisation over sizes, an example of flexibility, the task graph.

    python scripts/draw_theory.py [FOLDER]    one PNG each; default docs/images

No run is needed: the curves are laws of `metrics`, the graph is that of the controllers. Needs the plots extra.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from baselines.tasks import DESTINATION, SOURCE, TAB_CHILDREN, TAB_ROOT, Goal
from metrics import adaptability, environment_scaling, reactivity, task_emergence, waveform
from metrics.laws import SizeLaw
from metrics.scoring.plots import COLOURS
from swarm_forage_env import scenario
from swarm_forage_env.contract.codes import Task

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
SIZES = 2.0 ** np.arange(8)
SKETCHED = {
    "superlinear: robots help each other": SizeLaw(name="power", a=1.0, exponent=1.15),
    "linear: robots do not affect each other": SizeLaw(name="linear", a=1.0),
    "sublinear: robots get in each other's way": SizeLaw(name="contention", a=1.0, contention=0.01),
}
"""What the curve says -> the law; its parameters are our choice, so that the curves can be told apart."""

STUDIED = scenario("warehouse_small")
ENDS = np.arange(1, STUDIED.horizon_ticks // STUDIED.interval_ticks + 1) * STUDIED.interval_ticks
"""Ticks at which the study's intervals end."""
IDEAL_CONDITIONS = 0.1
CONDITIONS = waveform("square", ENDS, frequency=4e-5, amplitude=0.3, offset=0.3)
"""Speed lost: two periods in a run, a level of the paper's sweeps."""
FOLLOWED = {"perfectly reactive": 1.0, "perfectly adaptable": 0.0, "between the two": 0.5}
"""Swarm -> which share of the change of the conditions its performance follows; the last is our choice."""


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


def flexibility(folder: Path) -> None:
    """Draw conditions that change, and what three swarms achieve under them, with the R and A of each."""
    figure: Any = Figure(figsize=(9.0, 4.6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1, 2))
    seconds = ENDS * STUDIED.dt_s
    above.step(seconds, CONDITIONS, where="pre", color="0.2", label="applied, V(t)")
    above.axhline(IDEAL_CONDITIONS, color="0.2", linestyle="--", label="ideal, $I_{ec}$")
    above.set_ylabel("share of\nspeed lost")
    above.legend(frameon=False, fontsize=9, loc="upper right", ncols=2)
    above.set_ylim(-0.05, 0.95)
    ideal = np.full(len(ENDS), 20.0)
    change = environment_scaling(CONDITIONS, IDEAL_CONDITIONS) - 1.0
    for colour, (name, share) in zip(COLOURS, FOLLOWED.items(), strict=False):
        performance = (1.0 + share * change) * ideal
        r = float(reactivity(ideal, performance, CONDITIONS, IDEAL_CONDITIONS))
        a = float(adaptability(ideal, performance))
        below.step(seconds, performance, where="pre", color=colour, label=f"{name}: R {r:.0f}, A {a:.0f}")
    below.set_ylim(0.0, 36.0)
    below.set_ylabel("performance,\nobjects per interval")
    below.set_xlabel("time, s")
    below.legend(frameon=False, fontsize=9, loc="upper right", ncols=3)
    figure.savefig(folder / "flexibility.png", dpi=120)


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
    flexibility(chosen)
    task_graph(chosen)
