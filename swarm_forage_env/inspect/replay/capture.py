"""From a run to its replay. Looking reads the state and never writes it, so it does not change the run."""

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, instance, number
from swarm_forage_env.contract.codes import Counter, Event
from swarm_forage_env.contract.policy import Memories, Policy
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.inspect.replay.frames import HEADING_STEPS, TASK_SHIFT, Replay, Status, position_step_m
from swarm_forage_env.policies.registry import load_policy, policy_label
from swarm_forage_env.runs.run import LiveRun, build_env
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.versions import software_versions
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.wrappers.base import WrapperConfig
from swarm_forage_env.wrappers.handling import IDEAL_COST, HandlingCostConfig
from swarm_forage_env.wrappers.throttle import ThrottleConfig

MOST_POSES = 5_000_000
"""Frames times robots that a replay has by default at most: about 12 MB in the page, and 40 MB where it is opened."""
FRAME_STEPS_S = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)
"""Times between frames to choose from (our choice: a robot drives half its diameter in the first)."""
_MOST_STEPS = 2**16 - 1
_STILL = {ThrottleConfig.name: 0.0, HandlingCostConfig.name: IDEAL_COST}
"""Wrapper with a waveform of time -> what this is while it changes nothing."""


def record_replay(
    spec: RunSpec,
    *,
    policy: Policy | None = None,
    seconds: float | None = None,
    frame_s: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Replay:
    """Run a specification and keep what happened; `run_one` makes the same run and returns its record.

    Args:
        spec: The run.
        policy: A fresh policy object; default the policy that `spec` names.
        seconds: Simulated time to keep; default the whole run.
        frame_s: Simulated time between frames; default the shortest of `FRAME_STEPS_S` with at most `MOST_POSES`.
        progress: Called with (ticks done, ticks in all) after every frame.

    Raises:
        ConfigError: `seconds` is longer than the run, or `frame_s` is no whole number of ticks.
        ValueError: no installed policy has the name, or it refuses its parameters.
    """
    instance("spec", spec, RunSpec, hint="; plan_run(world, policy) makes one")
    scenario, end = spec.scenario, spec.scenario.horizon_ticks
    if seconds is not None:
        number("seconds (of a run of horizon_s)", seconds, above=0.0, at_most=scenario.horizon_s)
        end = max(1, round(seconds / scenario.dt_s))
    step = ticks_between_frames(scenario, end, frame_s)
    policy = load_policy(spec.policy, spec.parameters) if policy is None else policy
    stack = build_env(scenario, spec.wrappers, reads=getattr(policy, "reads", None))
    run = LiveRun(stack, policy, spec.seed)
    capture = Capture(run, policy, end_tick=end, frame_ticks=step, disturbances=lambda: spec.wrappers)
    while run.forage_env.tick < end and not run.over:
        capture.advance()
        if progress is not None and capture.ticks[-1] == run.forage_env.tick:
            progress(capture.ticks[-1], end)
    return capture.replay(spec)


def ticks_between_frames(scenario: ScenarioConfig, end: int, frame_s: float | None = None) -> int:
    """Return the ticks between two frames of a replay of `end` ticks; `frame_s` and errors as in `record_replay`."""
    dt_s, n_robots = scenario.dt_s, scenario.robots.n_robots
    if frame_s is not None:
        number("frame_s", frame_s, at_least=dt_s)
        ticks = round(frame_s / dt_s)
        if not math.isclose(ticks * dt_s, frame_s):
            raise ConfigError(f"Expected frame_s as whole ticks of {dt_s:g} s, got {frame_s:g}.")
        return ticks
    for seconds in FRAME_STEPS_S:
        ticks = max(1, round(seconds / dt_s))
        if n_robots * (1 + math.ceil(end / ticks)) <= MOST_POSES:
            return ticks
    return math.ceil(n_robots * end / MOST_POSES)


class Capture:
    """Collects frames of a run while it goes on.

    Attributes:
        ticks: Ticks of the frames so far.
        counters: What the world has counted since the start, at the frames so far.
        step_m: Metres per step of places.
    """

    def __init__(
        self,
        run: LiveRun,
        policy: Policy,
        *,
        end_tick: int,
        frame_ticks: int,
        disturbances: Callable[[], Iterable[WrapperConfig]],
    ) -> None:
        """Look at the start of a run.

        Args:
            run: The run, which has not gone on yet.
            policy: The policy that drives it.
            end_tick: Tick in which the run ends, or in which the last frame is wanted.
            frame_ticks: Ticks between frames.
            disturbances: Returns what disturbs the swarm at the time.
        """
        env = run.forage_env
        self.ticks: list[int] = []
        self.counters: list[np.ndarray] = []
        self.step_m = position_step_m(env.scenario)
        self._run, self._env, self._policy = run, env, policy
        self._end_tick, self._frame_ticks = end_tick, frame_ticks
        self._disturbances = disturbances
        self._tell: Any = getattr(policy, "describe_robots", None)
        self._remember: Any = getattr(policy, "describe_memories", None)
        self._first_counters = env.events.counters.copy()
        self._n_delivered = int(self._first_counters[Counter.COLLECTED])
        self._position: list[np.ndarray] = []
        self._heading: list[np.ndarray] = []
        self._status: list[np.ndarray] = []
        self._activity: list[np.ndarray] = []
        self._signals: list[dict[str, float]] = []
        self._deliveries: list[np.ndarray] = [np.zeros((0, 4), np.int32)]
        self._activities: tuple[str, ...] = ()
        self._objects = _Changes(env.scenario.objects.n_objects)
        self._caches = _Changes(len(env.caches.alive))
        self._memories = _MemoryChanges()
        self._look()

    def advance(self) -> None:
        """Let the run go on for one tick, if it is not over; at the end of it there may be a frame."""
        if self._run.over:
            return
        tick = self._env.tick + 1
        self._run.advance(to_tick=tick)
        self._note_deliveries()
        if tick % self._frame_ticks == 0 or tick == self._end_tick or self._run.over:
            self._look()

    def latest_deliveries(self, after_tick: int) -> np.ndarray:
        """Return the rows of `Replay.deliveries` of later ticks."""
        first = len(self._deliveries)
        while first > 1 and self._deliveries[first - 1][0, 0] > after_tick:
            first -= 1
        return np.concatenate((self._deliveries[0], *self._deliveries[first:]))

    def replay(self, spec: RunSpec, *, label: str = "") -> Replay:
        """Return what was kept up to the last frame.

        Args:
            spec: The run.
            label: As in `Replay`; default the policy's.

        Raises:
            ConfigError: nothing but the start has been seen.
        """
        if len(self.ticks) < 2:
            least_s = self._frame_ticks * self._env.scenario.dt_s
            raise ConfigError(f"Expected a run of {least_s:g} s or more to make a replay of; let it go on.")
        deliveries = np.concatenate(self._deliveries)
        waves = {name: np.array([one[name] for one in self._signals], np.float32) for name in self._signals[0]}
        return Replay(
            spec=spec,
            label=label or policy_label(spec.policy),
            frame_ticks=self._frame_ticks,
            end_tick=self.ticks[-1],
            position=np.array(self._position),
            heading=np.array(self._heading),
            status=np.array(self._status),
            activity=np.array(self._activity) if self._activity else None,
            activities=self._activities,
            counters=np.array(self.counters, np.int32),
            object_events=self._objects.events(),
            deliveries=deliveries[deliveries[:, 0] <= self.ticks[-1]],
            cache_events=self._caches.events(),
            memory_events=None if self._remember is None else self._memories.events(),
            signals={name: values for name, values in waves.items() if (values != _STILL[name]).any()},
            versions=software_versions(),
            has_tasks=getattr(self._policy, "task", None) is not None,
        )

    def _look(self) -> None:
        """Keep the state as it is now."""
        env, frame = self._env, len(self.ticks)
        self.ticks.append(env.tick)
        self.counters.append(env.events.counters - self._first_counters)
        self._keep_poses()
        self._status.append(status_now(env, self._policy))
        self._objects.look(frame, objects_now(env))
        self._caches.look(frame, caches_now(env))
        dt_s = env.scenario.dt_s
        waves: list[Any] = [one for one in self._disturbances() if one.name in _STILL]
        self._signals.append({one.name: one.waveform.signal(dt_s)(env.tick) for one in waves})
        if self._tell is not None:
            states = self._tell()
            self._activities = states.words
            self._activity.append(states.activity.astype(np.uint8))
        if self._remember is not None:
            self._memories.look(frame, self._remember(), self.step_m)

    def _note_deliveries(self) -> None:
        """Keep the deliveries of the tick that has just passed; what happened is told for one tick only."""
        events = self._env.events
        n_delivered = int(events.counters[Counter.COLLECTED])
        if n_delivered == self._n_delivered:
            return
        self._n_delivered = n_delivered
        robots = np.flatnonzero(events.code == Event.DELIVERED)
        ticks = np.full(len(robots), self._env.tick)
        self._deliveries.append(np.column_stack((ticks, robots, self._steps()[robots])).astype(np.int32))

    def _steps(self) -> np.ndarray:
        """Return where robots are, (N, 2) in steps."""
        return _in_steps(self._env.swarm.position, self.step_m).astype(np.uint16)

    def _keep_poses(self) -> None:
        swarm = self._env.swarm
        steps = self._steps()
        turns = np.rint(swarm.heading * (HEADING_STEPS / (2.0 * np.pi))).astype(np.int64).astype(np.uint8)
        if self._position and not swarm.present.all():  # parked bodies are nowhere
            steps = np.where(swarm.present[:, None], steps, self._position[-1])
            turns = np.where(swarm.present, turns, self._heading[-1])
        self._position.append(steps)
        self._heading.append(turns)


def _in_steps(place_m: np.ndarray, step_m: float) -> np.ndarray:
    return np.clip(np.rint(place_m / step_m), 0, _MOST_STEPS)


def status_now(env: ForageEnv, policy: Policy) -> np.ndarray:
    """Return (N,) bits of `Status` and the codes of tasks, as in `Replay.status`."""
    swarm = env.swarm
    status = np.zeros(len(swarm.active), np.uint8)
    for flag, rows in (
        (Status.CARRYING, swarm.carried_object >= 0),
        (Status.INTERFERING, env.events.interfering & swarm.active),
        (Status.REPAIR, swarm.present & ~swarm.active),
        (Status.ABSENT, ~swarm.present),
        (Status.HANDLING, swarm.pending_kind != 0),
    ):
        status[rows] |= np.uint8(flag)
    tasks = getattr(policy, "task", None)
    return status if tasks is None else status | np.asarray(tasks, np.uint8) << TASK_SHIFT


def objects_now(env: ForageEnv) -> np.ndarray:
    """Return (M, 3): status, and the cell; of a carried object the robot that carries it and -1."""
    objects, carried = env.objects, env.swarm.carried_object
    now = np.column_stack((objects.status, objects.cell)).astype(np.int32)
    robots = np.flatnonzero(carried >= 0)
    now[carried[robots], 1] = robots
    return now


def caches_now(env: ForageEnv) -> np.ndarray:
    """Return (K, 3): number of objects (0 = no cache), and the centre cell, -1 where there is no cache."""
    caches = env.caches
    return np.column_stack((caches.count, np.where(caches.alive[:, None], caches.cell, -1)))


class _Changes:
    """Keeps rows of a table when they change."""

    def __init__(self, n_rows: int) -> None:
        # No row of a table looks like this, so that the first look finds all rows changed.
        self._last = np.full((n_rows, 3), np.iinfo(np.int32).min, np.int32)
        self._found = [np.zeros((0, 5), np.int32)]

    def look(self, frame: int, now: np.ndarray) -> None:
        rows = np.flatnonzero((now != self._last).any(axis=1))
        self._found.append(np.column_stack((np.full(len(rows), frame), rows, now[rows])).astype(np.int32))
        self._last[rows] = now[rows]

    def events(self) -> np.ndarray:
        return np.concatenate(self._found)


class _MemoryChanges:
    """Keeps which places robots begin and cease to remember. A place is one whole number: robot, kind, x, y."""

    def __init__(self) -> None:
        self._last = np.zeros(0, np.int64)
        self._found = [np.zeros((0, 5), np.int32)]

    def look(self, frame: int, memories: Memories, step_m: float) -> None:
        x, y = _in_steps(memories.place_m, step_m).astype(np.int64).T
        now = np.unique((2 * memories.robot.astype(np.int64) + memories.is_cache) << 32 | x << 16 | y)
        for some, others, sign in ((self._last, now, -1), (now, self._last, 1)):
            new = np.setdiff1d(some, others, assume_unique=True)
            kind = sign * (1 + (new >> 32 & 1))
            places = (np.full(len(new), frame), new >> 33, kind, new >> 16 & _MOST_STEPS, new & _MOST_STEPS)
            self._found.append(np.column_stack(places).astype(np.int32))
        self._last = now

    def events(self) -> np.ndarray:
        every = np.concatenate(self._found)
        return every[np.lexsort((every[:, 0], every[:, 1]))]
