"""From a run to its replay. Looking reads the state and never writes it, so it does not change the run."""

import math
from collections.abc import Callable
from typing import Any, cast

import numpy as np

from swarm_forage_env._internal.fields import number
from swarm_forage_env.contract.codes import Counter, Event
from swarm_forage_env.contract.policy import Memories, Policy, RobotStates
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.inspect.replay.frames import (
    HEADING_STEPS,
    TASK_SHIFT,
    Replay,
    ReplayError,
    Status,
    position_step_m,
)
from swarm_forage_env.policies.registry import load_policy, policy_label
from swarm_forage_env.rendering.view import refusing
from swarm_forage_env.runs.record import Record
from swarm_forage_env.runs.run import LiveRun, Started, build_stack, record_of_run
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.versions import software_versions
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.wrappers.handling import HandlingCostConfig
from swarm_forage_env.wrappers.throttle import ThrottleConfig

MOST_POSES = 5_000_000
"""Frames times robots that a replay has by default at most: about 12 MB in the page, and 40 MB where it is opened."""
FRAME_STEPS_S = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)
"""Times between frames to choose from (our choice: a robot drives half its diameter in the first)."""
REMEMBERED_FRAMES = 5
"""The size of memories is looked at in every frame of this number."""

Progress = Callable[[int, int], None]
"""Called with (ticks done, ticks in all)."""


def record_replay(
    spec: RunSpec,
    *,
    policy: Policy | None = None,
    seconds: float | None = None,
    frame_s: float | None = None,
    progress: Progress | None = None,
) -> tuple[Replay, Record | None]:
    """Run a specification and keep what happened.

    Args:
        spec: The run.
        policy: A fresh policy object; default the policy that `spec` names.
        seconds: Simulated time to keep; default the whole run.
        frame_s: Simulated time between frames; default the shortest of `FRAME_STEPS_S` with at most `MOST_POSES`.
        progress: Called after every frame.

    Returns:
        The replay; and the record of the run, the same as without a replay, or None if only a part was run.

    Raises:
        ReplayError: `seconds` is longer than the run, or `frame_s` is no whole number of ticks.
        RenderError: `seconds` or `frame_s` is no positive number.
        ValueError: no installed policy has the name, or it refuses its parameters.
    """
    started = Started.now()
    scenario = spec.scenario
    end = _last_tick(scenario, seconds)
    step = ticks_between_frames(scenario, end, frame_s)
    policy = load_policy(spec.policy, spec.parameters) if policy is None else policy
    recorder = build_stack(scenario, spec.wrappers, reads=getattr(policy, "reads", None))
    run = LiveRun(recorder, policy, spec.seed, by_ticks=True)
    capture = Capture(run, policy, end_tick=end, frame_ticks=step)
    while capture.tick < end and not run.over:
        for _ in range(min(step, end - capture.tick)):
            capture.advance()
        if progress is not None:
            progress(capture.tick, end)
    recorder.close()
    replay = capture.replay(spec, signals=_signals(spec, capture.ticks))
    return replay, record_of_run(recorder, spec, started) if recorder.complete else None


def _last_tick(scenario: ScenarioConfig, seconds: float | None) -> int:
    if seconds is None:
        return scenario.horizon_ticks
    with refusing():
        number("seconds", seconds, above=0.0)
    if seconds > scenario.horizon_s:
        raise ReplayError(
            f"Expected seconds <= {scenario.horizon_s:g}, the scenario's horizon_s, got {seconds:g}; "
            "keep less or give the scenario a longer horizon."
        )
    return max(1, round(seconds / scenario.dt_s))


def ticks_between_frames(scenario: ScenarioConfig, end: int, frame_s: float | None = None) -> int:
    """Return the ticks between two frames of a replay of `end` ticks; `frame_s` and errors as in `record_replay`."""
    if frame_s is not None:
        with refusing():
            number("frame_s", frame_s, at_least=scenario.dt_s)
        step = round(frame_s / scenario.dt_s)
        if not math.isclose(step * scenario.dt_s, frame_s):
            low = math.floor(frame_s / scenario.dt_s)
            nearest = " or ".join(f"{ticks * scenario.dt_s:g}" for ticks in (low, low + 1))
            raise ReplayError(
                f"Expected frame_s as whole ticks of {scenario.dt_s:g} s, got {frame_s:g}; take {nearest}."
            )
        return step
    n_robots = scenario.robots.n_robots
    for seconds in FRAME_STEPS_S:
        step = max(1, round(seconds / scenario.dt_s))
        if n_robots * (1 + math.ceil(end / step)) <= MOST_POSES:
            return step
    return math.ceil(n_robots * end / MOST_POSES)


def _signals(spec: RunSpec, ticks: list[int]) -> dict[str, np.ndarray]:
    """Return the waveforms of time that disturb the swarm, at the frames."""
    return {
        config.name: np.array([signal(tick) for tick in ticks], np.float32)
        for config in spec.wrappers
        if isinstance(config, ThrottleConfig | HandlingCostConfig)
        for signal in [config.waveform.signal(spec.scenario.dt_s)]
    }


class Capture:
    """Collects frames of a run while it goes on.

    Attributes:
        ticks: Ticks of the frames so far.
    """

    def __init__(self, run: LiveRun, policy: Policy, *, end_tick: int, frame_ticks: int) -> None:
        """Look at the start of a run.

        Args:
            run: The run, which has not gone on yet.
            policy: The policy that drives it.
            end_tick: Tick in which the run ends, or in which the last frame is wanted.
            frame_ticks: Ticks between frames.
        """
        env = run.forage_env
        most_frames = 1 + math.ceil(end_tick / frame_ticks)
        self._run = run
        self._end_tick, self._frame_ticks = end_tick, frame_ticks
        self._env = env
        self._policy = policy
        self._tell = cast("Callable[[], RobotStates] | None", getattr(policy, "describe_robots", None))
        self._step_m = position_step_m(env.scenario)
        self._activities: tuple[str, ...] = ()
        n_robots = env.scenario.robots.n_robots
        self._position = np.zeros((most_frames, n_robots, 2), np.uint16)
        self._heading = np.zeros((most_frames, n_robots), np.uint8)
        self._status = np.zeros((most_frames, n_robots), np.uint8)
        self._activity = None if self._tell is None else np.zeros((most_frames, n_robots), np.uint8)
        self._remembered: list[np.ndarray] = []
        self._counters = np.zeros((most_frames, len(env.events.counters)), np.int32)
        self._first_counters = env.events.counters.copy()
        self._deliveries: list[np.ndarray] = []
        self._n_delivered = int(self._first_counters[Counter.COLLECTED])
        self._objects = _Changes(env.scenario.objects.n_objects)
        self._caches = _Changes(len(env.caches.alive))
        self._remember = cast("Callable[[], Memories] | None", getattr(policy, "describe_memories", None))
        self._memories = _MemoryChanges()
        self.ticks: list[int] = []

        self._look()

    @property
    def tick(self) -> int:
        """Ticks that the run has done."""
        return self._env.tick

    def advance(self) -> None:
        """Let the run go on for one tick, if it is not over; at the end of it there may be a frame."""
        if self._run.over:
            return
        self._run.advance(to_tick=self._env.tick + 1)
        self._note_deliveries()
        if self._env.tick % self._frame_ticks == 0 or self._env.tick == self._end_tick or self._run.over:
            self._look()

    def counted(self, counter: Counter) -> np.ndarray:
        """Return what a counter has counted since the start, (F,) at the frames so far."""
        return self._counters[: len(self.ticks), counter]

    def latest_deliveries(self, after_tick: int) -> np.ndarray:
        """Return the rows of `Replay.deliveries` of later ticks."""
        recent: list[np.ndarray] = []
        for rows in reversed(self._deliveries):
            if rows[0, 0] <= after_tick:
                break
            recent.append(rows)
        return np.concatenate((np.zeros((0, 4), np.int32), *reversed(recent)))

    def replay(self, spec: RunSpec, *, signals: dict[str, np.ndarray], label: str = "") -> Replay:
        """Return what was kept up to the last frame.

        Args:
            spec: The run.
            signals: As in `Replay`.
            label: As in `Replay`; default the policy's.

        Raises:
            ReplayError: nothing but the start has been seen.
        """
        if len(self.ticks) < 2:
            raise ReplayError(
                f"Expected a run of {self._frame_ticks * self._env.scenario.dt_s:g} s or more to make a replay of, "
                "got its start; let it go on."
            )
        return Replay(
            spec=spec,
            label=label or policy_label(spec.policy),
            frame_ticks=self._frame_ticks,
            end_tick=self.ticks[-1],
            signals=signals,
            versions=software_versions(),
            **self._arrays(),
        )

    def _look(self) -> None:
        """Keep the state as it is now."""
        env, frame = self._env, len(self.ticks)
        self.ticks.append(env.tick)
        self._keep_poses(frame)
        self._keep_states(frame)
        self._counters[frame] = env.events.counters - self._first_counters
        self._objects.look(frame, objects_now(env))
        self._caches.look(frame, caches_now(env))
        if self._remember is not None:
            self._memories.look(frame, self._remember(), self._step_m)

    def _note_deliveries(self) -> None:
        """Keep the deliveries of the tick that has just passed; what happened is told for one tick only."""
        env = self._env
        n_delivered = int(env.events.counters[Counter.COLLECTED])
        if n_delivered == self._n_delivered:
            return
        self._n_delivered = n_delivered
        robots = np.flatnonzero(env.events.code == Event.DELIVERED)
        ticks = np.full(len(robots), env.tick)
        self._deliveries.append(np.column_stack((ticks, robots, self._steps()[robots])).astype(np.int32))

    def _steps(self) -> np.ndarray:
        """Return where robots are, (N, 2) in steps."""
        limit = np.iinfo(np.uint16).max
        return np.clip(np.rint(self._env.swarm.position / self._step_m), 0, limit).astype(np.uint16)

    def _keep_poses(self, frame: int) -> None:
        swarm = self._env.swarm
        steps = self._steps()
        turns = np.rint(swarm.heading * (HEADING_STEPS / (2.0 * np.pi))).astype(np.int64).astype(np.uint8)
        absent = ~swarm.present
        if frame and absent.any():  # parked bodies are nowhere
            steps = np.where(absent[:, None], self._position[frame - 1], steps)
            turns = np.where(absent, self._heading[frame - 1], turns)
        self._position[frame], self._heading[frame] = steps, turns

    def _keep_states(self, frame: int) -> None:
        self._status[frame] = status_now(self._env, self._policy)
        if self._tell is None or self._activity is None:
            return
        states = self._tell()
        self._activities = states.words
        self._activity[frame] = states.activity
        if states.n_remembered is not None and frame % REMEMBERED_FRAMES == 0:
            self._remembered.append(np.minimum(states.n_remembered, np.iinfo(np.uint16).max).astype(np.uint16))

    def _arrays(self) -> dict[str, Any]:
        """Return what was kept, as fields of `Replay`."""
        end = len(self.ticks)
        deliveries = np.concatenate((np.zeros((0, 4), np.int32), *self._deliveries))
        return {
            "position": self._position[:end],
            "heading": self._heading[:end],
            "status": self._status[:end],
            "activity": None if self._activity is None else self._activity[:end],
            "activities": self._activities,
            "remembered": np.array(self._remembered) if self._remembered else None,
            "remembered_frames": REMEMBERED_FRAMES,
            "counters": self._counters[:end],
            "object_events": self._objects.events(),
            "memory_events": None if self._remember is None else self._memories.events(),
            "deliveries": deliveries[deliveries[:, 0] <= self.ticks[-1]],
            "cache_events": self._caches.events(),
            "has_tasks": getattr(self._policy, "task", None) is not None,
        }


def status_now(env: ForageEnv, policy: Policy) -> np.ndarray:
    """Return (N,) bits of `Status` and the codes of tasks, as in `Replay.status`."""
    swarm = env.swarm
    status = np.zeros(len(swarm.active), np.uint8)
    flags = (
        (Status.CARRYING, swarm.carried_object >= 0),
        (Status.INTERFERING, env.events.interfering & swarm.active),
        (Status.REPAIR, swarm.present & ~swarm.active),
        (Status.ABSENT, ~swarm.present),
        (Status.HANDLING, swarm.pending_kind != 0),
    )
    for flag, rows in flags:
        status |= np.where(rows, np.uint8(flag), np.uint8(0))
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
        self._found: list[np.ndarray] = []

    def look(self, frame: int, now: np.ndarray) -> None:
        rows = np.flatnonzero((now != self._last).any(axis=1))
        if len(rows):
            self._found.append(np.column_stack((np.full(len(rows), frame), rows, now[rows])).astype(np.int32))
            self._last[rows] = now[rows]

    def events(self) -> np.ndarray:
        return np.concatenate(self._found) if self._found else np.zeros((0, 5), np.int32)


class _MemoryChanges:
    """Keeps which places robots begin and cease to remember."""

    def __init__(self) -> None:
        self._last = np.zeros((0, 4), np.int32)
        self._found: list[np.ndarray] = []

    def look(self, frame: int, memories: Memories, step_m: float) -> None:
        steps = np.clip(np.rint(memories.place_m / step_m), 0, np.iinfo(np.uint16).max)
        now = np.column_stack((memories.robot, 1 + memories.is_cache, steps)).astype(np.int32)
        now = now[np.unique(_as_numbers(now), return_index=True)[1]]
        new, old = _as_numbers(now), _as_numbers(self._last)
        for rows, sign in ((self._last[~np.isin(old, new)], -1), (now[~np.isin(new, old)], 1)):
            if len(rows):
                self._found.append(np.column_stack((np.full(len(rows), frame), rows)).astype(np.int32))
                self._found[-1][:, 2] *= sign
        self._last = now

    def events(self) -> np.ndarray:
        every = np.concatenate((np.zeros((0, 5), np.int32), *self._found))
        return every[np.lexsort((every[:, 0], every[:, 1]))]


def _as_numbers(places: np.ndarray) -> np.ndarray:
    """Return one whole number for each row: robot, 1 or 2, x, y, of which the last two are below 2^16."""
    robot, kind, x, y = places.T.astype(np.int64)
    return (((2 * robot + kind - 1) << 16 | x) << 16) | y
