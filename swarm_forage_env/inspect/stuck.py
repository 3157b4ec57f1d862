"""Which robots of a run get stuck: active, hardly moved for minutes, and not waiting by rule."""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any, cast

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.wording import counted, plain
from swarm_forage_env.contract.codes import Task
from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.contract.types import BoolArray, FloatArray
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.runs.run import LiveRun, build_env
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.workers import Tell, map_runs

SAMPLE_S = 5.0
"""Positions are looked at this often; our choice: within it a robot in motion drives 0.4 m, so none is missed."""


@dataclass(frozen=True, kw_only=True, slots=True)
class StuckRobot:
    """One stretch of time in which a robot stayed where it was. The last fields are as of when it was found out."""

    robot: int
    """Row of the robot."""
    from_s: float
    to_s: float
    """Last time at which it was still there."""
    place_m: tuple[float, float]
    carrying: bool
    interfering: bool
    """Whether it senses an obstacle."""
    wheels_mps: tuple[float, float]
    """Speeds of the left and the right wheel: both are zero if it stands, opposite if it turns on the spot."""
    neighbour_m: float
    """Distance between its centre and that of the nearest other robot; infinite if there is none."""
    task: str
    """Name of its `Task`, lower case; empty where the policy has no tasks."""
    state: str
    """What the policy says of it in `describe_robot(row)`; empty where the policy has no such method."""


class StillnessWatch:
    """Keeps the positions of one window and finds the robots that hardly moved in it.

    Attributes:
        open: Stretches that still last, by robot.
        closed: Stretches that have ended, in order of their end.
    """

    def __init__(self, n_robots: int, n_samples: int, moved_m: float, report: Callable[[int], StuckRobot]) -> None:
        """Prepare for a run.

        Args:
            n_robots: N.
            n_samples: Samples in a window, its first and its last included.
            moved_m: A robot that gets this far from where it was when the window began has moved.
            report: Describes one robot, asked for when a stretch is found; `from_s` and `to_s` are filled in here.
        """
        self._places = np.full((n_samples, n_robots, 2), np.nan)  # a ring; NaN is near to nothing
        self._times_s = np.zeros(n_samples)
        self._next = 0
        self._moved_m = moved_m
        self._report = report
        self.open: dict[int, StuckRobot] = {}
        self.closed: list[StuckRobot] = []

    def look(self, time_s: float, position: FloatArray, counts: BoolArray) -> None:
        """Take one sample.

        Args:
            time_s: Since the start of the run.
            position: (N, 2) m.
            counts: (N,) whether the robot is expected to move; one that is not begins a new window.
        """
        self._places[self._next] = np.where(counts[:, None], position, np.nan)
        self._times_s[self._next] = time_s
        self._next = (self._next + 1) % len(self._times_s)
        oldest = self._places[self._next]
        near_start = np.linalg.norm(position - oldest, axis=1) < self._moved_m
        candidates = np.flatnonzero(near_start)  # few: only for these is the whole window looked at
        offsets = np.linalg.norm(self._places[:, candidates] - oldest[candidates], axis=2)
        still = set(candidates[(offsets < self._moved_m).all(axis=0)].tolist())
        for robot in sorted(self.open.keys() - still):
            self.closed.append(self.open.pop(robot))
        for robot in still:
            known = self.open.get(robot) or replace(self._report(robot), from_s=float(self._times_s[self._next]))
            self.open[robot] = replace(known, to_s=time_s)


@dataclass(frozen=True, kw_only=True, eq=False)
class StuckRobots(Answer):
    """The robots that got stuck in several runs."""

    found: tuple[tuple[RunSpec, StuckRobot], ...]
    n_runs: int

    def sheets(self) -> tuple[Sheet, ...]:
        """Return one row per stretch of time."""
        if not self.found:
            return (Sheet(title=f"nobody is stuck in {counted(self.n_runs, 'run')}"),)
        header = ("policy", "seed", "robot", "from s", "to s", "place m", "wheels m/s", "near m", "what it does")
        return (Sheet(header=header, rows=[_row(spec, one) for spec, one in self.found]),)

    def to_mapping(self) -> dict[str, Any]:
        """Return all stretches as plain values."""
        found = [
            {"policy": spec.policy, "seed": spec.seed, **asdict(one), "neighbour_m": plain(one.neighbour_m)}
            for spec, one in self.found
        ]
        return {"runs": self.n_runs, "stuck": found}


def _row(spec: RunSpec, one: StuckRobot) -> tuple[str, ...]:
    x, y = one.place_m
    left, right = one.wheels_mps
    signs = [sign for sign, is_so in (("carrying", one.carrying), ("obstacle", one.interfering)) if is_so]
    return (
        spec.policy,
        str(spec.seed),
        str(one.robot),
        f"{one.from_s:g}",
        f"{one.to_s:g}",
        f"{x:.2f}, {y:.2f}",
        f"{left:.2f}, {right:.2f}",
        f"{one.neighbour_m:.2f}",
        "; ".join(filter(None, [*signs, one.task, one.state])),
    )


def find_stuck_in(
    specs: Sequence[RunSpec], *, window_s: float = 600.0, moved_m: float = 0.05, jobs: int | None = 1
) -> StuckRobots:
    """Find the robots that get stuck in several runs; arguments as in `find_stuck` and `runs.workers.map_runs`."""
    found = map_runs(partial(_stuck_in, window_s, moved_m), specs, jobs=jobs)
    pairs = [(spec, one) for spec, robots in zip(specs, found, strict=True) for one in robots]
    return StuckRobots(found=tuple(pairs), n_runs=len(specs))


def _stuck_in(window_s: float, moved_m: float, spec: RunSpec, _: Tell | None) -> tuple[StuckRobot, ...]:
    return find_stuck(spec, window_s=window_s, moved_m=moved_m)


def find_stuck(spec: RunSpec, *, window_s: float = 600.0, moved_m: float = 0.05) -> tuple[StuckRobot, ...]:
    """Run a specification and find the robots that get stuck.

    A robot is stuck from s to s + window_s if it is active all that time, never farther than `moved_m` from where it
    was at s, and the world does not keep it waiting, as it does during the ticks of a pick-up or a drop. Consecutive
    windows are one stretch. Positions are compared every `SAMPLE_S` seconds.

    Args:
        spec: The run.
        window_s: Seconds in which every robot should get away; at most the run's length less `SAMPLE_S`.
        moved_m: How far that is.

    Returns:
        All stretches, in order of their start, then of robots.

    Raises:
        ValueError: no installed policy has the name, or it refuses its parameters; a window or distance that is not
            positive; a window that does not fit into the run.
    """
    return find_stuck_under(load_policy(spec.policy, spec.parameters), spec, window_s=window_s, moved_m=moved_m)


def find_stuck_under(
    policy: Policy, spec: RunSpec, *, window_s: float = 600.0, moved_m: float = 0.05
) -> tuple[StuckRobot, ...]:
    """As `find_stuck`, for a policy object, which must be fresh; `spec.policy` does not matter."""
    if not (window_s > 0.0 and moved_m > 0.0):
        raise ConfigError(f"Expected window_s > 0 and moved_m > 0, got {window_s} and {moved_m}.")
    longest_s = spec.scenario.horizon_s - SAMPLE_S
    if window_s > longest_s:
        raise ConfigError(
            f"Expected a window of at most {longest_s:g} s in a run of {spec.scenario.horizon_s:g} s, "
            f"got {window_s:g} s. Give a longer run or a shorter window."
        )
    stack = build_env(spec.scenario, spec.wrappers, reads=getattr(policy, "reads", None))
    run = LiveRun(stack, policy, spec.seed)
    env = run.forage_env
    n_samples = 1 + math.ceil(window_s / SAMPLE_S)
    sample_ticks = max(1, round(SAMPLE_S / spec.scenario.dt_s))
    watch = StillnessWatch(
        spec.scenario.robots.n_robots, n_samples, moved_m, lambda robot: _describe(env, policy, robot)
    )
    while not run.over:
        swarm = env.swarm
        watch.look(env.tick * spec.scenario.dt_s, swarm.position, env.active & (swarm.pending_kind == 0))
        run.advance(to_tick=env.tick + sample_ticks)
    return tuple(sorted([*watch.closed, *watch.open.values()], key=lambda found: (found.from_s, found.robot)))


def _describe(env: ForageEnv, policy: Policy, robot: int) -> StuckRobot:
    """Return what can be said of a robot now; its times are filled in by the watch."""
    swarm = env.swarm
    x, y = swarm.position[robot].tolist()
    left, right = swarm.wheel_speed[robot].tolist()
    others = swarm.present.copy()
    others[robot] = False
    distances = np.linalg.norm(swarm.position[others] - swarm.position[robot], axis=1)
    tell = cast("Callable[[int], str] | None", getattr(policy, "describe_robot", None))
    tasks = getattr(policy, "task", None)
    return StuckRobot(
        robot=robot,
        from_s=0.0,
        to_s=0.0,
        place_m=(x, y),
        carrying=bool(swarm.carried_object[robot] >= 0),
        interfering=bool(env.events.interfering[robot]),
        wheels_mps=(left, right),
        neighbour_m=float(distances.min(initial=math.inf)),
        task="" if tasks is None else Task(int(tasks[robot])).name.lower(),
        state="" if tell is None else tell(robot),
    )
