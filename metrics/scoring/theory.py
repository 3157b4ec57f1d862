"""Figures that need no runs: three sketches of what measures mean, the task graph, and the paper's availability curves.

The curves are laws and measures of `metrics`, the graph is that of the controllers. Each figure has its numbers as a
table. Drawing needs matplotlib (the optional extra "plots").
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swarm_forage_env.contract.codes import DESTINATION, SOURCE, TAB_CHILDREN, TAB_ROOT, Goal, Task
from swarm_forage_env.rendering.figures import (
    COLOURS,
    SCREEN,
    FigureStyle,
    legend_below,
    saved_figure,
    saved_panels,
    size_axis,
)
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.scenarios.presets import warehouse_small
from swarm_forage_env.studies.study import StudySpec
from swarm_forage_env.wrappers.world import SIZE

from ..curves import FloatArray
from ..emergence import task_emergence
from ..environment import environment_scaling, waveform
from ..flexibility import adaptability, reactivity
from ..laws import SizeLaw
from ..population import availability_curves, ratio_for_team
from ..queues import PopulationRates, queue_statistics

if TYPE_CHECKING:
    import polars as pl

SIZES = 2.0 ** np.arange(8)
SKETCHED = {
    "superlinear: robots help each other": SizeLaw(name="power", a=1.0, exponent=1.15),
    "linear: robots do not affect each other": SizeLaw(name="linear", a=1.0),
    "sublinear: robots get in each other's way": SizeLaw(name="contention", a=1.0, contention=0.01),
}
"""What the curve says -> the law; its parameters are our choice, so that the curves can be told apart."""

STUDIED = warehouse_small()
ENDS = np.arange(1, STUDIED.horizon_ticks // STUDIED.interval_ticks + 1) * STUDIED.interval_ticks
"""Ticks at which the study's intervals end."""
IDEAL_CONDITIONS = 0.1
CONDITIONS = waveform("square", ENDS, frequency=4e-5, amplitude=0.3, offset=0.3)
"""Speed lost: two periods in a run, a level of the paper's sweeps."""
IDEAL_PERFORMANCE = 20.0
"""Objects per interval under ideal conditions (our choice)."""
FOLLOWED = {"perfectly reactive": 1.0, "perfectly adaptable": 0.0, "between the two": 0.5}
"""Swarm -> which share of the change of the conditions its performance follows; the last is our choice."""

AVAILABILITY_SIZES, AVAILABILITY_TEAMS = (50, 200), (5.0, 10.0, 20.0)
"""Swarm sizes and mean teams of the paper's availability figure."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TheoryFigure:
    """A figure with the numbers in it."""

    kind: str
    """self_organisation, flexibility, availability or task_graph."""
    title: str
    numbers: "pl.DataFrame"
    draw: Callable[[Sequence[Path], FigureStyle], None]
    """Draws it into picture files; its errors are those of `saved_figure`."""

    @property
    def name(self) -> str:
        """Name of its files."""
        return f"theory_{self.kind}"


def theory_figures() -> tuple[TheoryFigure, ...]:
    """Return all of them, as in the paper."""
    return (self_organisation(), flexibility(), availability_figure(AVAILABILITY_SIZES), task_graph())


def theory_of(spec: StudySpec) -> tuple[TheoryFigure, ...]:
    """Return the figures that explain what a study varies: sizes, conditions, or the population."""
    axes = {axis.name for axis in spec.axes}
    found: list[TheoryFigure] = []
    if SIZE in axes:
        found.append(self_organisation())
    if "throttle" in axes:
        found.append(flexibility())
    if "population_dynamics" in axes:
        sizes = {spec.specs_of(place)[0].scenario.robots.n_robots for place in spec.places}
        found.append(availability_figure(sorted(sizes)))
    if {policy.policy for policy in spec.policies} & {"stochm", "stochx"}:
        found.append(task_graph())
    return tuple(found)


def self_organisation() -> TheoryFigure:
    """Performance per robot over the size, and what each size achieves beyond twice the next smaller one (E_T)."""
    rows: list[dict[str, Any]] = []
    for words, law in SKETCHED.items():
        performance = law.performance(SIZES)
        beyond = [None] + [
            float(task_emergence([small], int(n), [large], int(2 * n)))
            for n, small, large in zip(SIZES, performance, performance[1:], strict=False)
        ]
        for size, each, gained in zip(SIZES, performance / SIZES, beyond, strict=True):
            rows.append({"curve": words, "robots": int(size), "per_robot": float(each), "task_emergence": gained})
    frame = _frame(rows)

    def draw(paths: Sequence[Path], style: FigureStyle) -> None:
        with saved_panels(paths, 2, (4.2, 2.7), style=style) as (left, right):
            for colour, words in zip(COLOURS, SKETCHED, strict=False):
                mine = frame.filter(frame["curve"] == words)
                left.plot(mine["robots"], mine["per_robot"], color=colour, marker="o", label=words)
                right.plot(mine["robots"][1:], mine["task_emergence"][1:], color=colour, marker="o")
            left.set_ylabel("performance per robot")
            right.set_ylabel("task self-organisation, E_T")
            for place in (left, right):
                size_axis(place, SIZES)

    title = "Theory: what self-organisation means (sketched laws, no runs)"
    return TheoryFigure(kind="self_organisation", title=title, numbers=frame, draw=draw)


def flexibility() -> TheoryFigure:
    """Conditions that change, and what three swarms achieve under them, with the R and A of each."""
    seconds = ENDS * STUDIED.dt_s
    ideal = np.full(len(ENDS), IDEAL_PERFORMANCE)
    change = environment_scaling(CONDITIONS, IDEAL_CONDITIONS) - 1.0
    labels: dict[str, str] = {}
    rows: list[dict[str, Any]] = []
    for name, share in FOLLOWED.items():
        performance = (1.0 + share * change) * ideal
        r = float(reactivity(ideal, performance, CONDITIONS, IDEAL_CONDITIONS))
        a = float(adaptability(ideal, performance))
        labels[name] = f"{name}: R {r:.0f}, A {a:.0f}"
        rows += [
            {"swarm": name, "time_s": float(t), "conditions": float(v), "performance": float(p), "R": r, "A": a}
            for t, v, p in zip(seconds, CONDITIONS, performance, strict=True)
        ]
    frame = _frame(rows)

    def draw(paths: Sequence[Path], style: FigureStyle) -> None:
        with saved_figure(paths, (9.0, 4.6), style=style) as picture:
            above, below = picture.subplots(2, 1, sharex=True, height_ratios=(1, 2))
            above.step(seconds, CONDITIONS, where="pre", color="0.2", label="applied conditions, V(t)")
            above.axhline(IDEAL_CONDITIONS, color="0.2", linestyle="--", label="ideal conditions, I_ec")
            above.set_ylabel("share of\nspeed lost")
            above.set_ylim(-0.05, 0.95)
            for colour, (name, label) in zip(COLOURS, labels.items(), strict=False):
                mine = frame.filter(frame["swarm"] == name)
                below.step(mine["time_s"], mine["performance"], where="pre", color=colour, label=label)
            below.set_ylim(0.0, 1.3 * IDEAL_PERFORMANCE)
            below.set_ylabel("performance,\nobjects per interval")
            below.set_xlabel("time, s")
            legend_below(picture)

    title = "Theory: an example of reactivity R and adaptability A (sketched swarms, no runs)"
    return TheoryFigure(kind="flexibility", title=title, numbers=frame, draw=draw)


def availability_figure(sizes: Sequence[int], teams: Sequence[float] = AVAILABILITY_TEAMS) -> TheoryFigure:
    """How likely enough robots are at work, over how many are needed; computed in equilibrium."""
    rows = [
        {"robots": size, "mean_team": team, "needed": needed, "availability": value}
        for size in sizes
        for team, curve in zip(teams, availability_curves(size, teams).tolist(), strict=True)
        for needed, value in enumerate(curve, 1)
    ]
    frame = _frame(rows)

    def draw(paths: Sequence[Path], style: FigureStyle) -> None:
        with saved_panels(paths, len(sizes), (4.0, 3.2), sharey=True, style=style) as places:
            for place, size in zip(places, sizes, strict=True):
                for index, team in enumerate(teams):
                    mine = frame.filter((frame["robots"] == size) & (frame["mean_team"] == team))
                    colour = COLOURS[index % len(COLOURS)]
                    place.plot(mine["needed"], mine["availability"], color=colour, label=f"mean team {team:g}")
                place.axvline(size / 10.0, color="0.5", linestyle=":", linewidth=1)
                place.set(title=f"{size} robots (dotted: a tenth)", xlabel="robots needed at work", xlim=(0, size))
            places[0].set(ylabel="availability", ylim=(0, 1))

    title = "Theory: availability, how likely enough robots are at work (no runs)"
    return TheoryFigure(kind="availability", title=title, numbers=frame, draw=draw)


@dataclass(frozen=True, kw_only=True, eq=False)
class Availability(Answer):
    """How likely enough robots are at work; computed in equilibrium, without runs."""

    sizes: tuple[int, ...]
    teams: tuple[float, ...]
    """Mean numbers of robots at work."""
    needed: tuple[int, ...]
    curves: FloatArray
    """(sizes, teams, needed) probability that at least so many are at work."""

    def at_work(self, size: int, team: float) -> float:
        """Return the mean number at work of a swarm, which cannot have more than its size there."""
        away = queue_statistics(PopulationRates(lambda_bd=ratio_for_team(team), mu_bd=1.0), size).truncated_length
        assert away is not None, "it is there whenever a size is given"
        return size - away

    def _rows(self) -> Iterator[tuple[int, float, list[float]]]:
        for size, of_size in zip(self.sizes, self.curves.tolist(), strict=True):
            for team, curve in zip(self.teams, of_size, strict=True):
                yield size, team, curve

    def sheets(self) -> tuple[Sheet, ...]:
        """Return one row per swarm size and team."""
        rows = [
            (str(size), f"{team:g}", f"{self.at_work(size, team):.1f}", *(f"{value:.3f}" for value in curve))
            for size, team, curve in self._rows()
        ]
        header = ("robots", "mean team", "mean at work", *map(str, self.needed))
        return (Sheet(title="probability that at least so many robots are at work", header=header, rows=rows),)

    def to_mapping(self) -> dict[str, Any]:
        """Return all curves as plain values."""
        needed = list(self.needed)
        return {
            "curves": [
                {
                    "robots": size,
                    "team": team,
                    "at_work": self.at_work(size, team),
                    "needed": needed,
                    "availability": curve,
                }
                for size, team, curve in self._rows()
            ]
        }

    def draw(self, path: str | Path, *, style: FigureStyle = SCREEN) -> None:
        """Draw a panel per swarm size, over all numbers needed; see `saved_figure` for errors."""
        availability_figure(self.sizes, self.teams).draw([Path(path)], style)


def availability(
    sizes: Sequence[int] = AVAILABILITY_SIZES,
    teams: Sequence[float] = AVAILABILITY_TEAMS,
    needed: Sequence[int] = (1, 5, 10, 20, 40),
) -> Availability:
    """Return how likely enough robots are at work.

    Args:
        sizes: Swarm sizes.
        teams: Mean teams, robots at work on average.
        needed: Numbers of robots needed.

    Raises:
        ValueError: a size or a team that cannot be.
    """
    curves = np.array([availability_curves(size, teams, needed) for size in sizes])
    return Availability(sizes=tuple(sizes), teams=tuple(teams), needed=tuple(needed), curves=curves)


def task_graph() -> TheoryFigure:
    """The tasks: a root above its two subtasks, each with its source and destination."""
    places = {int(TAB_ROOT[0]): (0.5, 2.0)}
    parents: dict[int, int] = {}
    for root, children in zip(TAB_ROOT.tolist(), TAB_CHILDREN.tolist(), strict=True):
        x, y = places[root]
        for side, child in zip((-1.0, 1.0), children, strict=True):
            places[child] = (x + side * 0.5 * 0.5 ** (3.0 - y), y - 1.0)
            parents[child] = root
    rows = [
        {
            "task": _words(Task(task).name),
            "part_of": _words(Task(parents[task]).name) if task in parents else None,
            "source": _words(Goal(int(SOURCE[task])).name),
            "destination": _words(Goal(int(DESTINATION[task])).name),
        }
        for task in places
    ]

    def draw(paths: Sequence[Path], style: FigureStyle) -> None:
        with saved_figure(paths, (9.0, 4.2), style=style) as picture:
            place = picture.subplots()
            blocks = TAB_ROOT.tolist()
            for child, root in parents.items():
                (x, y), (to_x, to_y) = places[root], places[child]
                place.plot([x, to_x], [y, to_y], color=COLOURS[blocks.index(root)], linewidth=2.0, zorder=1)
            for row, (x, y) in zip(rows, places.values(), strict=True):
                label = f"{row['task']}\n{row['source']} to {row['destination']}"
                box = {"boxstyle": "round,pad=0.5", "facecolor": "white", "edgecolor": "0.4"}
                place.text(x, y, label, ha="center", va="center", bbox=box, zorder=2)
            place.set_xlim(0.0, 1.0)
            place.set_ylim(-0.4, 2.4)
            place.set_axis_off()

    title = "The task graph of STOCHM (upper block) and STOCHX (all)"
    return TheoryFigure(kind="task_graph", title=title, numbers=_frame(rows), draw=draw)


def _words(name: str) -> str:
    return name.replace("_", " ").lower()


def _frame(rows: Iterable[dict[str, Any]]) -> "pl.DataFrame":
    import polars as pl

    return pl.DataFrame([*rows], infer_schema_length=None)
