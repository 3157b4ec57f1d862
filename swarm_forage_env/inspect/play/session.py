"""The session behind the page to play with: commands in, frames out, plain values both. It knows no HTTP.

Walls, robots, policy, scenario and seed are a run's from its first tick, so a change of them starts the run again, with
the same seed. Noise, throttle and rates change while the run goes on, and a run that is started again has them from
its first tick. So a run that nobody has touched since its start is the one that `run_one` makes.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from threading import Lock
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, known_keys, known_name, number, table, whole
from swarm_forage_env._internal.files import as_file_name
from swarm_forage_env._internal.wording import shown
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.inspect.play.levels import LEVELS, Levels, with_idle
from swarm_forage_env.inspect.replay.capture import (
    Capture,
    caches_now,
    objects_now,
    status_now,
    ticks_between_frames,
)
from swarm_forage_env.inspect.replay.files import for_page, page_of
from swarm_forage_env.policies.registry import POLICIES, load_policy, policy_label
from swarm_forage_env.rendering.figures import places_of
from swarm_forage_env.runs.run import LiveRun, build_env
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.obstacles import MIN_SIDE_M, Rectangle
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.scenarios.presets import PRESETS, scenario
from swarm_forage_env.wrappers.world import World

SPEEDS = (0.2, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
"""Simulated seconds per second; our choice."""
LONGEST_S = 0.1
"""Ticks of one frame take at most this long, so that the page gets an answer even if the run is slower than its
speed."""
LONGEST_WAIT_S = 0.1
"""A page that asks for its next frame later than this finds the run as if it had asked then: one that sleeps pauses."""
FLASH_S = 0.7
"""Seconds of the reader for which the page shows a delivery, as in `draw.js`."""
MOST_FLASHES = 200
MOST_BINS, FEWEST_BINS, SHORTEST_BIN_S = 50, 10, 40.0
"""Of curves over time, as in `curves.js`."""
WALL_M = 0.4
"""What a wall that was drawn thinner than `MIN_SIDE_M` becomes; our choice: it is seen, and a robot goes round it."""
MOST_ROBOTS = 4
"""The slider ends at so many times the robots of the scenario; our choice: crowded, but there is room."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Setting:
    """What a run is made of."""

    world: World
    policy: str
    seed: int = 0
    caches: str | None = None
    """Which caches were asked for; None = the policy's, or else the scenario's."""


class PlaySession:
    """One run at a time, and who looks at it. Several threads may ask; they take turns.

    Attributes:
        setting: What the run is made of.
        spec: The run as it was planned.
        run: The run, which goes on by frames and commands only.
        world: Its environment; only read it.
        levels: What can be changed by hand.
        paused: Whether the clock stands still.
        speed: Simulated seconds per second.
    """

    def __init__(self, setting: Setting, *, clock: Callable[[], float] = time.monotonic) -> None:
        """Start a run.

        Args:
            setting: What it is made of.
            clock: The reader's time, s.

        Raises:
            ValueError: see `plan_run`; or a policy that does not fit the scenario.
        """
        self._lock, self._clock = Lock(), clock
        self._policies = tuple(dict.fromkeys((*POLICIES, setting.policy)))
        self._serial = 0
        self.speed, self.paused = 10.0, False
        self._begin(setting)

    def _begin(self, setting: Setting) -> None:
        """Start a run; if it cannot be, all stays as it is."""
        spec = plan_run(setting.world, setting.policy, caches=setting.caches, seed=setting.seed)
        here, end = spec.scenario, spec.scenario.horizon_ticks
        policy: Any = load_policy(spec.policy, spec.parameters)
        stack = build_env(here, with_idle(spec.wrappers), reads=getattr(policy, "reads", None))
        levels, run = Levels(stack), LiveRun(stack, policy, spec.seed)
        self._capture = Capture(
            run,
            policy,
            end_tick=end,
            frame_ticks=ticks_between_frames(here, end),
            disturbances=lambda: levels.all_configs,
        )
        self.setting, self.spec, self.run, self.levels, self.world = setting, spec, run, levels, run.forage_env
        self._policy, self._owed_ticks = policy, 0.0
        self._serial += 1
        self._seen_s = self._clock()

    def _advance(self, seconds: float) -> None:
        """Let the run go on for what is due after `seconds` of the reader's time; less if it takes too long."""
        if self.paused:
            return
        self._owed_ticks += seconds * self.speed / self.spec.scenario.dt_s
        until = time.perf_counter() + LONGEST_S
        while self._owed_ticks >= 1.0 and not self.run.over:
            self._owed_ticks -= 1.0
            self._capture.advance()
            if time.perf_counter() > until:
                self._owed_ticks %= 1.0

    def carry_out(self, command: Any) -> str:
        """Do what a command asks for; returns one line about it. A command that is refused changes nothing.

        Args:
            command: A table; "do" names the command, the rest are its arguments.

        Raises:
            ConfigError: no such table, command or arguments.
            ValueError: a run that cannot be.
        """
        with self._lock:
            arena = self.setting.world.scenario.arena
            walls = arena.obstacles
            match command:
                case {"do": "play"}:
                    self.paused, self._seen_s = False, self._clock()
                case {"do": "pause"}:
                    self.paused = True
                case {"do": "step"}:
                    self.paused = True
                    self._capture.advance()
                    return "one tick"
                case {"do": "speed", "value": value}:
                    number("speed", value, above=0.0, at_most=SPEEDS[-1])
                    self.speed = float(value)
                case {"do": "level", "name": name, "value": value}:
                    known_name("level", name, LEVELS)
                    return self.levels.set(name, value)
                case {"do": "kill" | "break" | "repair" as deed, "robot": robot}:
                    self._check_robot(robot)
                    return self.levels.treat(deed, robot)
                case {"do": "start", **changes}:
                    return self._start_again(changes)
                case {"do": "wall", "box": [float() | int(), float() | int(), float() | int(), float() | int()] as box}:
                    return self._with_walls((*walls, wall_of(box, arena.width_m, arena.height_m)))
                case {"do": "remove_wall", "index": index}:
                    whole("the number of a wall", index, at_least=0, at_most=len(walls) - 1)
                    return self._with_walls((*walls[:index], *walls[index + 1 :]))
                case {"do": "remove_walls"}:
                    return self._with_walls(())
                case _:
                    raise ConfigError(f"Expected a command of the page with its arguments, got {shown(command)}.")
            return ""

    def _start_again(self, changes: dict[str, Any]) -> str:
        """Start a run, the same or another one, with the levels of now; a chosen scenario begins as its preset."""
        known_keys(changes, ("scenario", "policy", "robots", "seed"))
        now = self.setting
        world = replace(now.world, wrappers=self.levels.configs)
        policy, seed = changes.get("policy", now.policy), changes.get("seed", now.seed)
        known_name("policy", policy, self._policies)
        if "scenario" in changes:
            known_name("scenario", changes["scenario"], PRESETS)
            world = replace(world, scenario=scenario(changes["scenario"]), name="")
        if "robots" in changes:
            whole("robots", changes["robots"], at_least=1, at_most=most_robots(world.scenario))
            world = replace(world, scenario=with_overrides(world.scenario, n_robots=changes["robots"]))
        self._begin(replace(now, world=world, policy=policy, seed=seed))
        return f"started again with seed {seed}"

    def _with_walls(self, walls: tuple[Rectangle, ...]) -> str:
        """Start the run again with other walls."""
        world = self.setting.world
        try:
            here = with_overrides(world.scenario, obstacles=walls)
        except ConfigError as error:
            raise ConfigError(
                "A wall cannot stand there: it must be clear of the nest and of caches, and leave room for all objects."
            ) from error
        self._begin(replace(self.setting, world=replace(world, scenario=here, wrappers=self.levels.configs)))
        return f"started again with {len(walls)} wall{'' if len(walls) == 1 else 's'}"

    def replay_page(self) -> tuple[str, str]:
        """Return the name of a file and the replay page of the run so far.

        Raises:
            ConfigError: the run has not gone on for one frame.
        """
        changes = f", changed by hand: {self.levels.changes_in_words}" if self.levels.changes else ""
        name = policy_label(self.spec.policy)
        with self._lock:
            replay = self._capture.replay(self.spec, label=f"{name}{changes}")
        return f"{self.spec.world.file_name}_{as_file_name(name)}.html", page_of([replay])

    def summary(self) -> str:
        """Return one line about the run so far, without waiting for one that is being started."""
        changes = f"; changed by hand: {self.levels.changes_in_words}" if self.levels.changes else ""
        delivered = self.world.events.counters[Counter.COLLECTED]
        time_s = self.world.tick * self.spec.scenario.dt_s
        return f"{policy_label(self.spec.policy)}: {time_s:,.0f} s, {delivered:,} delivered{changes}"

    def frame(self, asked: Any = None) -> dict[str, Any]:
        """Let the run go on for what is due, and return what is to be seen.

        Args:
            asked: A table, or None; "robot" is the row of the chosen robot, "run" the number of the run that the page
                shows. If that is another one, the answer has "about", too.

        Raises:
            ConfigError: no such table, or no such robot.
        """
        words = table("a frame", {} if asked is None else asked)
        with self._lock:
            now = self._clock()
            passed, self._seen_s = now - self._seen_s, now
            self._advance(min(max(passed, 0.0), LONGEST_WAIT_S))
            frame = self._swarm() | self._floor() | self._numbers()
            if words.get("run") != self._serial:
                frame["about"] = self._about()
            elif "robot" in words:
                frame["robot"] = self._robot(words["robot"])
            return frame

    def _check_robot(self, robot: Any) -> None:
        whole("robot", robot, at_least=0, at_most=self.spec.scenario.robots.n_robots - 1)

    def _swarm(self) -> dict[str, Any]:
        world, policy, swarm = self.world, self._policy, self.world.swarm
        told: dict[str, Any] = {}
        if hasattr(policy, "describe_robots"):
            states = policy.describe_robots()
            told = {"activity": states.activity.tolist(), "words": list(states.words)}
        return told | {
            "x": np.round(swarm.position[:, 0], 3).tolist(),
            "y": np.round(swarm.position[:, 1], 3).tolist(),
            "turn": np.round(swarm.heading, 2).tolist(),
            "status": status_now(world, policy).tolist(),
            "dead": np.flatnonzero(swarm.dead).tolist(),
        }

    def _floor(self) -> dict[str, Any]:
        world = self.world
        lasts_s = max(2.0, FLASH_S * self.speed)
        fresh = self._capture.latest_deliveries(world.tick - math.ceil(lasts_s / world.scenario.dt_s))[-MOST_FLASHES:]
        return {
            "objects": objects_now(world).ravel().tolist(),
            "caches": caches_now(world).ravel().tolist(),
            "deliveries": fresh[:, [0, 2, 3]].tolist(),
        }

    def _numbers(self) -> dict[str, Any]:
        counters = self.world.events.counters
        time_s = self.world.tick * self.spec.scenario.dt_s
        active = int(counters[Counter.ACTIVE])
        return {
            "run": self._serial,
            "time_s": round(time_s, 3),
            "paused": self.paused,
            "over": self.run.over,
            "speed": self.speed,
            "counters": counters.tolist(),
            "per_1000_s": 1000.0 * int(counters[Counter.COLLECTED]) / time_s if time_s else 0.0,
            "interference": int(counters[Counter.INTERFERING]) / active if active else 0.0,
            "curve": self._curve(),
            "levels": {name: self.levels.level(name) for name in LEVELS},
            "changes": self.levels.changes_in_words,
        }

    def _curve(self) -> dict[str, list[float]]:
        """Return deliveries per 1,000 s and the share of time in interference, over equal parts of the run so far."""
        capture, dt_s = self._capture, self.spec.scenario.dt_s
        last = len(capture.ticks) - 1
        wanted = min(MOST_BINS, max(FEWEST_BINS, round(capture.ticks[-1] * dt_s / SHORTEST_BIN_S)))
        edges = np.round(np.linspace(0, last, min(wanted, last) + 1)).astype(int).tolist()
        seconds = np.array([capture.ticks[edge] for edge in edges]) * dt_s
        counted = np.diff([capture.counters[edge] for edge in edges], axis=0).reshape(-1, len(Counter))
        return {
            "time_s": ((seconds[1:] + seconds[:-1]) / 2).tolist(),
            "per_1000_s": (1000.0 * counted[:, Counter.COLLECTED] / np.diff(seconds)).tolist(),
            "interference": (counted[:, Counter.INTERFERING] / np.maximum(counted[:, Counter.ACTIVE], 1)).tolist(),
        }

    def _robot(self, robot: int) -> dict[str, Any]:
        self._check_robot(robot)
        left, right = (100.0 * self.world.swarm.wheel_speed[robot]).tolist()
        tell = getattr(self._policy, "describe_memories", None)
        remembered: tuple[Any, ...] = () if tell is None else tell().of_robot(robot)
        return {
            "row": robot,
            "wheels": f"{left:.1f}, {right:.1f} cm/s",
            "places": [[kind, *place] for kind, places_m in enumerate(remembered, 1) for place in places_m.tolist()],
        }

    def _about(self) -> dict[str, Any]:
        """Return what stays the same during a run."""
        here, name = self.spec.scenario, policy_label(self.setting.policy)
        return {
            "disturbances": [config.in_words(here.dt_s) for config in self.spec.wrappers],
            "place": self.setting.world.place,
            "scenarios": list(dict.fromkeys((*PRESETS, here.name))),
            "policies": list(self._policies),
            "policy": self.setting.policy,
            "most_robots": most_robots(here),
            "speeds": list(SPEEDS),
            "sliders": [
                {"name": name, "title": one.title, "most": one.most, "step": one.step} for name, one in LEVELS.items()
            ],
            "header": {
                "label": name,
                "look": places_of([name])[0],
                "scenario": here.name,
                "seed": self.setting.seed,
                "n_robots": here.robots.n_robots,
                "n_objects": here.objects.n_objects,
                "n_cache_slots": len(self.world.caches.alive),
                "dt_s": here.dt_s,
                "position_step_m": self._capture.step_m,
                "has_tasks": getattr(self._policy, "task", None) is not None,
                "signals": [],
                **for_page(here),
            },
        }


def most_robots(here: ScenarioConfig) -> int:
    """Return with how many robots a scenario can be started again; no fewer than it has."""
    preset = PRESETS[here.name]().robots.n_robots if here.name in PRESETS else here.robots.n_robots
    return max(here.robots.n_robots, MOST_ROBOTS * preset)


def wall_of(box: Sequence[float], width_m: float, height_m: float) -> Rectangle:
    """Return the wall that somebody drew from one corner to the other: inside the arena, and thick enough.

    Args:
        box: x, y of the two corners, m.
        width_m: Extent of the arena along x, m.
        height_m: Along y, m.
    """
    x_low, x_high = _side(box[0], box[2], width_m)
    y_low, y_high = _side(box[1], box[3], height_m)
    return x_low, y_low, x_high, y_high


def _side(one: float, other: float, extent_m: float) -> tuple[float, float]:
    """Return the ends of a side in cm, in order."""
    low, high = (round(min(max(edge, 0.0), extent_m), 2) for edge in sorted((one, other)))
    if high - low >= MIN_SIDE_M:
        return low, high
    start = round(min(max((low + high - WALL_M) / 2, 0.0), extent_m - WALL_M), 2)
    return start, round(start + WALL_M, 2)
