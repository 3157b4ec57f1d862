"""Swarms predicted from the scenario alone by `random_search`, and compared with runs."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swarm_forage_env._internal.wording import number, percent, plain
from swarm_forage_env.contract.detection import OBSTACLE_ANGLE_RAD
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.rendering.figures import SCREEN, FigureStyle, looks, saved_panels, size_axis
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.runs.policy_spec import PolicySpec, policy_specs
from swarm_forage_env.runs.record import RunRecord
from swarm_forage_env.runs.table import Table
from swarm_forage_env.scenarios.floor import CELL_M
from swarm_forage_env.world.kernels.floor import GROUND_X_M, GROUND_Y_M
from swarm_forage_env.world.sensors import PROXIMITY_RANGE_M
from swarm_forage_env.wrappers.world import SIZE, World, WorldLike, world_of

from ..checks import CurveError
from ..curves import FloatArray
from ..emergence import spatial_emergence, task_emergence
from ..random_search import SearchCurves, SearchFloor, Walker, heading_diffusion, search_curves, seen_strip
from ..scaling import scalability
from ..statistics import aggregate
from .prediction import fit_sizes, with_robots
from .question import Question, plan_totals

if TYPE_CHECKING:
    from swarm_forage_env.scenarios.config import ScenarioConfig

KNOWN_PERFORMANCES = ("collected", "first_picked")
"""Performances that the model knows: in the long run robots deliver as many objects as they pick up."""
_WALK = (
    "wander_speed_mps",
    "wander_max_change_deg",
    "wander_circle_distance",
    "wander_circle_radius",
    "soft_turn_deg",
    "exploration_lock_s",
    "phototaxis_speed_mps",
)
"""Parameters of a random walk and of the way home."""
_MEASURES = {"E_S": "spatial self-organisation", "E_T": "task self-organisation", "C": "scalability"}
_NOTE = "The model knows robots that search at random and remember nothing; nothing is fitted, and no run is used."

_NOT_ITS_OWN = (
    "It is not a model of {policy}, which does more than search at random: it says what {policy} would deliver without "
    "that. Runs of dpo deliver up to 2.6 times as much."
)


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredRuns:
    """What the runs of one swarm size show, (R, T) each."""

    performance: FloatArray
    interference: FloatArray
    search_s: float
    """Robot time searching per pick-up; NaN without any, or in records of before."""
    home_s: float
    """Robot time homing per delivery; likewise."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ScenarioPrediction(Answer):
    """The prediction for one policy, and the results of its runs."""

    policy: str
    scenario: str
    horizon_s: float
    predicted: Mapping[int, SearchCurves]
    """By swarm size, rising."""
    runs: Mapping[int, MeasuredRuns]
    """Of the sizes that were run."""
    failures: tuple[str, ...] = ()
    """Why runs failed, a line per reason."""

    def error(self, n_robots: int) -> float:
        """Return by what share predicted performance is above the mean of the runs; NaN without runs."""
        runs = self.runs.get(n_robots)
        mean = math.nan if runs is None else float(runs.performance.sum(axis=-1).mean())
        return float(self.predicted[n_robots].performance.sum()) / mean - 1.0 if mean else math.nan

    def measures(self, smaller: int, larger: int, *, of_runs: bool = False) -> dict[str, float]:
        """Return E_S, E_T and C from one size to another, by the model or by the mean curves of the runs."""
        sizes = (1, smaller, larger)
        curves = {n: self._curves(n, of_runs=of_runs) for n in sizes}
        if any(curve is None for curve in curves.values()):
            return {}
        one, first, second = (curve for n in sizes if (curve := curves[n]) is not None)
        return {
            "E_S": float(spatial_emergence(*first, smaller, *second, larger, *one)),
            "E_T": float(task_emergence(first[0], smaller, second[0], larger)),
            "C": float(scalability(first[0], smaller, second[0], larger)),
        }

    def _curves(self, n_robots: int, *, of_runs: bool) -> tuple[FloatArray, FloatArray] | None:
        """Performance and interference over the run, (T,) each."""
        if not of_runs:
            found = self.predicted.get(n_robots)
            return None if found is None else (found.performance, found.interference)
        runs = self.runs.get(n_robots)
        return None if runs is None else (runs.performance.mean(axis=0), runs.interference.mean(axis=0))

    @property
    def is_random_searcher(self) -> bool:
        """Whether the model is one of the policy, which is CRW; others remember, and it is of them without memory."""
        return self.policy == "crw"

    @property
    def _who(self) -> str:
        return self.policy if self.is_random_searcher else f"model of a random searcher, for {self.policy},"

    def sheets(self) -> tuple[Sheet, ...]:
        """Return one row per size, one per pair of sizes, and runs that failed."""
        pairs = [pair for pair in pairwise(self.predicted) if 1 in self.predicted]
        words = ", ".join(f"{letter}: {meaning}" for letter, meaning in _MEASURES.items())
        sizes = self._sheet(
            f"{self._who} in {self.scenario}, {self.horizon_s:,g} s, from the scenario alone",
            ("robots", "objects", "runs", "error", "time lost", "runs", "search", "runs", "way home", "runs"),
            [self._row(n) for n in self.predicted],
            _NOTE if self.is_random_searcher else f"{_NOTE} {_NOT_ITS_OWN.format(policy=self.policy)}",
        )
        measured = self._sheet(
            "measures",
            ("robots", *(word for measure in _MEASURES for word in (measure, "runs"))),
            [self._pair(*pair) for pair in pairs],
            f"{words}.",
        )
        failed = Sheet(notes=[f"failed: {failure}" for failure in self.failures])
        return (sizes, *((measured,) if pairs else ()), failed)

    def _sheet(self, title: str, header: tuple[str, ...], rows: list[tuple[str, ...]], note: str) -> Sheet:
        """Return a table, without the columns about runs where there are none."""
        kept = [k for k, word in enumerate(header) if self.runs or word not in ("runs", "error")]
        return Sheet(
            title=title,
            header=tuple(header[k] for k in kept),
            rows=[tuple(row[k] for k in kept) for row in rows],
            notes=(note,),
        )

    def _row(self, n_robots: int) -> tuple[str, ...]:
        found, runs = self.predicted[n_robots], self.runs.get(n_robots)
        row = [
            number(float(found.performance.sum())),
            "",
            "",
            percent(float(found.interference.mean())),
            "",
            f"{found.search_s.mean():.0f} s",
            "",
            f"{found.home_s.mean():.0f} s",
            "",
        ]
        if runs is not None:
            total = aggregate(runs.performance.sum(axis=-1))
            row[1] = number(total.mean) + (f" ± {number(total.upper - total.mean)}" if total.n_used > 1 else "")
            row[2] = f"{100.0 * self.error(n_robots):+.0f} %"
            row[4] = percent(float(runs.interference.mean()))
            row[6], row[8] = ("-" if math.isnan(value) else f"{value:.0f} s" for value in (runs.search_s, runs.home_s))
        return str(n_robots), *row

    def _pair(self, smaller: int, larger: int) -> tuple[str, ...]:
        model, runs = self.measures(smaller, larger), self.measures(smaller, larger, of_runs=True)
        told = (number(values.get(letter, math.nan)) for letter in _MEASURES for values in (model, runs))
        return f"{smaller} to {larger}", *told

    def to_mapping(self) -> dict[str, Any]:
        """Return everything as plain values, ready for JSON; numbers that do not exist are null."""
        return {
            "policy": self.policy,
            "scenario": self.scenario,
            "horizon_s": self.horizon_s,
            "sizes": [self._size_mapping(n) for n in self.predicted],
            "measures": [
                {
                    "robots": list(pair),
                    "model": {name: plain(value) for name, value in self.measures(*pair).items()},
                    "runs": {name: plain(value) for name, value in self.measures(*pair, of_runs=True).items()},
                }
                for pair in pairwise(self.predicted)
            ],
            "failures": list(self.failures),
        }

    def _size_mapping(self, n_robots: int) -> dict[str, Any]:
        found, runs = self.predicted[n_robots], self.runs.get(n_robots)
        return {
            "n_robots": n_robots,
            "performance": float(found.performance.sum()),
            "interference": float(found.interference.mean()),
            "search_s": float(found.search_s.mean()),
            "home_s": float(found.home_s.mean()),
            "avoidances_per_s": float(found.encounters.mean()),
            "runs": None
            if runs is None
            else {
                "performance": runs.performance.sum(axis=-1).tolist(),
                "interference": float(runs.interference.mean()),
                "search_s": plain(runs.search_s),
                "home_s": plain(runs.home_s),
                "error": plain(self.error(n_robots)),
            },
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class ScenarioPredictions(Answer):
    """The predictions for several policies."""

    tables: tuple[ScenarioPrediction, ...]

    def sheets(self) -> tuple[Sheet, ...]:
        """Return those of all policies."""
        return tuple(sheet for table in self.tables for sheet in table.sheets())

    def to_mapping(self) -> dict[str, Any]:
        """Return all predictions as plain values."""
        return {"tables": [table.to_mapping() for table in self.tables]}

    @property
    def has_picture(self) -> bool:
        """Always."""
        return True

    def draw(self, path: str | Path, *, style: FigureStyle = SCREEN) -> None:
        """Draw deliveries per robot and time lost over sizes, a dashed line for the model; see `saved_figure`."""
        with saved_panels(path, 2, (4.2, 3.4), style=style) as (left, right):
            sizes = np.array([*self.tables[0].predicted])  # the same of all
            for table, look in zip(self.tables, looks(table.policy for table in self.tables), strict=True):
                found = table.predicted.values()
                told = f"{look.name}, model" if table.is_random_searcher else f"random searcher, for {look.name}"
                left.plot(sizes, [one.performance.sum() for one in found] / sizes, "--", color=look.colour, label=told)
                right.plot(sizes, [100.0 * one.interference.mean() for one in found], "--", color=look.colour)
                for n, runs in table.runs.items():
                    told = f"{look.name}, runs" if n == min(table.runs) else None
                    per_robot = runs.performance.sum(axis=-1) / n
                    left.plot([n] * len(per_robot), per_robot, "o", color=look.colour, label=told)
                    right.plot([n], [100.0 * runs.interference.mean()], "o", color=look.colour)
            left.set_ylabel("objects per robot")
            right.set_ylabel("time lost, %")
            for panel in (left, right):
                size_axis(panel, sizes)
                panel.set_ylim(bottom=0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class ScenarioQuestion(Question[ScenarioPredictions]):
    """The runs that predictions are compared with; the answer is a table per policy."""

    world: World
    sizes: tuple[int, ...]

    def answer(self, table: Table) -> ScenarioPredictions:
        """Return one prediction per policy."""
        return ScenarioPredictions(tables=tuple(self._table(table, policy) for policy in self.plan.policies))

    def _table(self, table: Table, policy: PolicySpec) -> ScenarioPrediction:
        runs = {
            condition.world.n_robots: measured(records)
            for condition in self.plan.of_policy(policy.label)
            if (records := table.of(condition))
        }
        return _table_of(policy, self.world, self.sizes, runs, table.failure_lines(policy.label))


def predict_from_scenario(
    policies: Sequence[str],
    world: WorldLike = "warehouse_small",
    sizes: Sequence[int] | None = None,
    *,
    caches: str | None = None,
) -> ScenarioPredictions:
    """Predict swarms from the scenario alone, without any run.

    Args:
        policies: Names of controllers that search by a random walk with the parameters of `crw`. For a controller with
            a memory, the prediction is what it would do without this memory.
        world: As in `predict_policy`, but without wrappers, obstacles, further nests and caches.
        sizes: Swarm sizes; default those of `predict_policy` and one robot.
        caches: As there.

    Raises:
        CurveError: a policy or a world that the model cannot describe, or sizes that do not exist.
    """
    chosen = world_of(world)
    specs = policy_specs(list(policies), caches=caches)
    found = _chosen_sizes(chosen.scenario, sizes, ())
    return ScenarioPredictions(tables=tuple(_table_of(policy, chosen, found, {}, ()) for policy in specs))


def scenario_question(
    policies: Sequence[str],
    world: WorldLike = "warehouse_small",
    sizes: Sequence[int] | None = None,
    *,
    hold: Sequence[int],
    seeds: int | Sequence[int] = 4,
    caches: str | None = None,
) -> ScenarioQuestion:
    """Return the question that compares predictions with runs of the sizes in `hold`.

    Arguments and errors as in `predict_from_scenario` and `predict_policy`.
    """
    chosen = world_of(world)
    found = _chosen_sizes(chosen.scenario, sizes, hold)
    worlds = [World(with_robots(chosen.scenario, n), criterion=SIZE, value=n) for n in sorted(set(hold))]
    plan = plan_totals(list(policies), worlds, seeds=seeds, caches=caches)
    for policy in plan.policies:  # before any run is made
        walker_of(policy, chosen.scenario)
    floor_of(chosen)
    return ScenarioQuestion(plan=plan, world=chosen, sizes=found)


def measured(records: Sequence[RunRecord]) -> MeasuredRuns:
    """Return what runs of one swarm size show."""
    columns = [record.columns() for record in records]

    def time_per(share: str, events: str) -> float:
        if not all(share in one for one in columns):
            return math.nan
        seconds = sum(float(one[share].sum()) for one in columns) * records[0].horizon_s / records[0].n_intervals
        count = sum(int(one[events].sum()) for one in columns)
        return seconds / count if count else math.nan

    return MeasuredRuns(
        performance=np.stack([record.performance for record in records]),
        interference=np.stack([one["interference_fraction"] for one in columns]),
        search_s=time_per("n_searching", "free_pickups"),
        home_s=time_per("n_homing", "collected"),
    )


def walker_of(policy: PolicySpec, scenario: "ScenarioConfig") -> Walker:
    """Return what a robot of a policy does, in numbers.

    Raises:
        CurveError: a policy that has no parameters of a random walk, or drives other curves than the model knows.
    """
    given: Any = None if policy.factory else getattr(load_policy(policy.policy, policy.parameters), "parameters", None)
    missing = [name for name in _WALK if not hasattr(given, name)]
    if missing:
        raise CurveError(
            f"Expected a policy that searches by the random walk of crw, as crw and dpo do, got {policy.label}, which "
            f"has no parameter {missing[0]}."
        )
    if (policy.caches or scenario.caches) != "none":
        raise CurveError(f"Expected a policy that needs no caches, as crw and dpo, got {policy.label}.")
    robots, dt_s = scenario.robots, scenario.dt_s
    speed = min(float(given.wander_speed_mps), robots.max_speed_mps)
    change, soft = math.radians(given.wander_max_change_deg), math.radians(given.soft_turn_deg)
    # The force points a little further aside than its angle on the circle; up to soft_turn_deg a turn is in proportion.
    aside = 1.0 + given.wander_circle_distance / given.wander_circle_radius
    if change * aside > soft:
        raise CurveError(f"Expected a walk that never turns on the spot, got changes above {given.soft_turn_deg} deg.")
    per_tick = aside * 2.0 * speed * dt_s / (soft * robots.wheel_base_m)
    home = float(given.phototaxis_speed_mps)
    return Walker(
        search_mps=speed,
        turning_per_s=heading_diffusion(change * per_tick, dt_s),
        strip_m=seen_strip(CELL_M, (abs(float(GROUND_X_M[0])), abs(float(GROUND_Y_M[0]))), speed * dt_s),
        blind_s=float(given.exploration_lock_s),
        home_mps=min(home, robots.max_speed_mps),
        nest_mps=min(home + speed, robots.max_speed_mps),
        handling_s=(scenario.objects.pickup_ticks + scenario.objects.drop_ticks) * dt_s,
        seen_m=2.0 * robots.radius_m + PROXIMITY_RANGE_M,
        turn_rad=OBSTACLE_ANGLE_RAD,
        turn_rad_per_s=2.0 * robots.max_speed_mps / robots.wheel_base_m,
    )


def floor_of(world: World) -> SearchFloor:
    """Return where a swarm searches.

    Raises:
        CurveError: a world with something that the model does not know.
    """
    scenario = world.scenario
    unknown = {
        "wrappers": world.wrappers,
        "obstacles": scenario.arena.obstacles,
        "further nests": scenario.arena.further_nests,
        "kinds of robots": scenario.robots.robot_kinds,
        f"performance {scenario.performance}": scenario.performance not in KNOWN_PERFORMANCES,
    }
    found = [words for words, is_there in unknown.items() if is_there]
    if found:
        raise CurveError(
            f"Expected a world that can be predicted from the scenario, without {found[0]}; leave --from-scenario out."
        )
    boxes = (tuple(edge * CELL_M for edge in box) for box in scenario.source_cells)
    return SearchFloor(
        interior=scenario.arena.interior_m,
        nest=scenario.arena.nest_box_m,
        sources=tuple((x_low, y_low, x_high, y_high) for x_low, y_low, x_high, y_high in boxes),
        n_objects=scenario.objects.n_objects,
    )


def _chosen_sizes(scenario: "ScenarioConfig", sizes: Sequence[int] | None, hold: Sequence[int]) -> tuple[int, ...]:
    wanted = sorted({*(fit_sizes(scenario) if sizes is None else sizes), *hold})
    if not wanted or wanted[0] < 1:
        raise CurveError(f"Expected swarms of 1 robot or more, got {', '.join(map(str, wanted)) or 'none'}.")
    return tuple(wanted)


def _table_of(
    policy: PolicySpec,
    world: World,
    sizes: Sequence[int],
    runs: Mapping[int, MeasuredRuns],
    failures: tuple[str, ...],
) -> ScenarioPrediction:
    return ScenarioPrediction(
        policy=policy.label,
        scenario=world.title(),
        horizon_s=world.scenario.horizon_s,
        predicted=dict(_by_size(policy, world, sizes)),
        runs=runs,
        failures=failures,
    )


def _by_size(policy: PolicySpec, world: World, sizes: Sequence[int]) -> Iterator[tuple[int, SearchCurves]]:
    for n_robots in sizes:
        scenario = with_robots(world.scenario, n_robots)
        floor = floor_of(World(scenario, world.wrappers))
        yield n_robots, search_curves(walker_of(policy, scenario), floor, n_robots, scenario.horizon_s)
