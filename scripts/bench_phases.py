"""What the phases of a tick take; `scripts/bench --phases` runs this.

    python scripts/bench_phases.py EFFORT POLICY,... ROBOTS,...

A run is made phase by phase: Python calls each compiled phase of `world.kernels.tick` by itself and looks at the clock
in between. What calls and clock take is measured, too, and left out. So a phase sees what it sees in a run: where
robots are, what they carry, how busy they are. Times are processor time of one core.
"""

import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from swarm_forage_env import load_policy, plan_run, run_one, scenario
from swarm_forage_env._internal.compiling import direct, kernel
from swarm_forage_env._internal.held import hold
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.runs.run import LiveRun, build_env
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.world.bodies import Bodies
from swarm_forage_env.world.kernels.bodies import move_bodies, tell_poses
from swarm_forage_env.world.kernels.counting import mark
from swarm_forage_env.world.kernels.interact import serve
from swarm_forage_env.world.kernels.placement import place_displaced
from swarm_forage_env.world.kernels.tick import look, sense, set_out
from swarm_forage_env.world.kernels.walk import walk

ROBOT_TICKS, LEAST_TICKS = 1_000_000, 50
"""Of a measurement with effort 1; what it has at least."""
WARM_UP_TICKS, WARM_UP_OF_LARGE_TICKS = 500, 50
"""What is left out, because robots have not spread yet; the second for large swarms, whose ticks are few and long."""
SENSES = ("light", "ground", "line_of_sight")
SUM, WHOLE = "all phases", "a run, in one piece"
ROWS = (
    "random numbers",
    "policy",
    "drive, press",
    "bodies",
    "poses from bodies",
    "look around: proximity",
    "mark interference",
    "pick up, drop",
    "place objects",
    "place the rest, in Python",
    "objects walk",
    "own state",
    *SENSES,
    SUM,
    WHOLE,
)
"""Of the table: the phases in the order of a tick, and the whole."""


@kernel
def nothing(_arguments: tuple[Any, ...]) -> None:
    """Do nothing: what is left is the call."""


class Stopwatch:
    """Sums up the processor time of phases."""

    def __init__(self) -> None:
        self.spent_ns: dict[str, float] = {}
        self._calls: dict[str, tuple[Callable[..., Any], float]] = {}

    def kernel(self, phase: str, function: Callable[..., Any], *arguments: Any) -> Any:
        """Call a kernel, whose arguments have the same types in every tick."""
        if phase not in self._calls:
            own, idle = direct(function, *arguments), direct(nothing, arguments)
            self._calls[phase] = own, min(spent_ns(idle, arguments)[0] for _ in range(200))
        own, call_ns = self._calls[phase]
        found_ns, answer = spent_ns(own, *arguments)
        self.spent_ns[phase] = self.spent_ns.get(phase, 0.0) + found_ns - call_ns
        return answer

    def python(self, phase: str, function: Callable[..., Any], *arguments: Any) -> Any:
        """Call a function of Python."""
        found_ns, answer = spent_ns(function, *arguments)
        self.spent_ns[phase] = self.spent_ns.get(phase, 0.0) + found_ns
        return answer


def spent_ns(function: Callable[..., Any], *arguments: Any) -> tuple[float, Any]:
    """Return the nanoseconds of processor time of a call, and what it returns."""
    started = time.process_time_ns()
    answer = function(*arguments)
    return time.process_time_ns() - started, answer


class PhasedRun:
    """A run whose ticks are made of single phases, in the order of `world.kernels.tick`; compiled bodies only."""

    def __init__(self, policy: str, scene: ScenarioConfig, seed: int = 0) -> None:
        """Start it."""
        self.policy: Any = load_policy(policy)
        env = build_env(scene, reads=getattr(self.policy, "reads", None))
        self.arena = LiveRun(env, self.policy, seed).forage_env.arena
        assert isinstance(self.arena._physics, Bodies), "set_out, move_bodies and meet would be other functions"
        self._bodies = self.arena._physics
        self._senses = {"own state": self._held_with()}
        read = (name for name in SENSES if getattr(self.arena._arrays.sensors, f"reads_{name}"))
        self._senses |= {name: self._held_with(name) for name in read}
        state, source = self.arena._arrays.state, self.arena._arrays.source
        parts = state, self.arena._arrays.rules, state.swarm, state.caches, state.events
        self._held = [hold(part) for part in parts]
        draws = self.arena._arrays.placement_draws
        self._placing = [hold(part) for part in (state.requests, state.objects, source, draws)]
        self._drawn: list[Any] = [()]
        self.watch = Stopwatch()

    def _held_with(self, *names: str) -> Any:
        """Return the arrays of the arena, with no other senses than these, and own state."""
        sensors = self.arena._arrays.sensors._replace(**{f"reads_{name}": name in names for name in SENSES})
        return hold(self.arena._arrays._replace(sensors=sensors))

    def tick(self) -> None:
        """Make a tick."""
        arena, policy, watch = self.arena, self.policy, self.watch
        a, tick = arena._arrays, arena.tick + 1
        policy.n_ticks += 1
        if min(map(len, self._drawn)) == 0:
            self._drawn = watch.python("random numbers", self._draws, tick)
        draws, picks, walks = (rows[0] for rows in self._drawn)
        self._drawn = [rows if rows is arena._nothing else rows[1:] for rows in self._drawn]
        inputs = arena.obs, arena.swarm.active, draws, policy._state, policy.n_ticks
        watch.kernel("policy", policy._kernel, *inputs)
        actions = policy._state[-1]
        gain, look_first = arena._unit_gain, arena.has_changed
        watch.kernel("drive, press", set_out, arena._held, actions, gain, tick, look_first)
        swarm, bodies = a.state.swarm, self._bodies
        moving = a.motion.twist, swarm.present, a.motion.dt_s
        while not watch.kernel("bodies", move_bodies, bodies.held, *moving):
            bodies.make_room()
        poses = bodies.state.poses, swarm.present, swarm.position, swarm.heading, swarm.facing
        watch.kernel("poses from bodies", tell_poses, *poses)
        self._meet(actions, tick, picks)
        self._close(walks)
        arena.tick, arena.has_changed = tick, False
        a.sensors.kept[0] = True

    def _draws(self, tick: int) -> list[Any]:
        """Return random numbers of a tick and some after it: of the policy, for pick-ups, for objects that walk."""
        return [self.policy._chance.rows(tick), *self.arena.draws(tick)]

    def _meet(self, actions: Any, tick: int, chance: Any) -> None:
        """Make the part of `world.kernels.tick.meet`, and what Python adds."""
        a, watch = self.arena._arrays, self.watch
        watch.kernel("look around: proximity", look, self.arena._held)
        sensors, (state, rules, swarm, caches, events) = a.sensors, self._held
        seen = sensors.obs, sensors.columns.proximity, sensors.near, sensors.behind_counts
        marked = *seen, swarm, caches, events
        watch.kernel("mark interference", mark, *marked)
        watch.kernel("pick up, drop", serve, state, rules, actions, tick, chance)
        requests, objects, source, draws = self._placing
        creates = a.state.requests.creators[-1] > 0
        if not creates:
            placing = requests, objects, source, a.wandering.area, draws
            watch.kernel("place objects", place_displaced, *placing)
        missing = np.count_nonzero(a.state.caches.alive) < a.n_static_caches
        if creates or missing or a.state.requests.displaced[-1] > 0:
            watch.python("place the rest, in Python", self._place)

    def _place(self) -> None:
        arena = self.arena
        arena._create_dynamic_caches()
        arena._replace_displaced()
        arena._restore_caches(getattr(self.policy, "task", None))

    def _close(self, chance: Any) -> None:
        """Make the part of `world.kernels.tick.close`."""
        a, watch = self.arena._arrays, self.watch
        objects, wandering, counters = a.state.objects, a.wandering, a.state.events.counters
        if wandering.probability > 0.0:
            where = wandering.probability, wandering.area, wandering.self_conflict
            floor = objects.floor, objects.status, objects.cell
            counters[Counter.OBJECTS_MOVED] += watch.kernel("objects walk", walk, *floor, chance, *where)
        counters[Counter.CACHES_ALIVE] += np.count_nonzero(a.state.caches.alive)
        counters[Counter.OBJECTS_CACHED] += a.state.caches.count.sum()
        # A sense at a time, each with what all need: wheels, pose, cargo, events.
        a.sensors.light_is_due[0] = self.policy.n_ticks % self.policy.decision_ticks == 0
        for name, held in self._senses.items():
            watch.kernel(name, sense, held)
        a.sensors.light_is_due[0] = True


def world_of(policy: str, n_robots: int, n_ticks: int) -> ScenarioConfig:
    """Return `warehouse_medium` with the caches of a policy, in one recording interval; 0.05 robots per m2."""
    seconds, caches = n_ticks * 0.2, getattr(load_policy(policy), "caches", "none")
    swarm = {} if n_robots == 200 else {"n_robots": n_robots, "density": 0.05}
    return scenario("warehouse_medium", horizon_s=seconds, interval_s=seconds, caches=caches, **swarm)


def phases(policy: str, n_robots: int, effort: float) -> dict[str, float]:
    """Return the nanoseconds per robot-tick of each phase, and of a run in one piece."""
    n_ticks = max(LEAST_TICKS, round(ROBOT_TICKS * effort / n_robots))
    warm_up = WARM_UP_TICKS if n_ticks > WARM_UP_TICKS else WARM_UP_OF_LARGE_TICKS
    scene = world_of(policy, n_robots, warm_up + n_ticks)
    run = PhasedRun(policy, scene)
    for _ in range(warm_up):
        run.tick()
    run.watch.spent_ns.clear()
    for _ in range(n_ticks):
        run.tick()
    n_robot_ticks = n_ticks * scene.robots.n_robots
    found = {phase: spent / n_robot_ticks for phase, spent in run.watch.spent_ns.items()}
    for name in SENSES:
        if name in found:
            found[name] -= found["own state"]
    found[SUM] = sum(found.values())
    short, long = (spent_on_run(policy, n_robots, ticks) for ticks in (warm_up, warm_up + n_ticks))
    found[WHOLE] = (long - short) / n_robot_ticks
    return found


def spent_on_run(policy: str, n_robots: int, n_ticks: int) -> float:
    """Return the nanoseconds of processor time of a run as studies make it, once everything is compiled."""
    spec = plan_run(world_of(policy, n_robots, n_ticks), policy, seed=0)
    run_one(spec)
    return spent_ns(run_one, spec)[0]


if __name__ == "__main__":
    effort, policies, sizes = sys.argv[1:]
    robots = [int(size) for size in sizes.split(",")]
    tables = {
        policy if len(robots) == 1 else f"{policy}, {n_robots:,} robots": phases(policy, n_robots, float(effort))
        for policy in policies.split(",")
        for n_robots in robots
    }
    print(f"| ns per robot-tick | {' | '.join(tables)} |\n|---|{'--:|' * len(tables)}")
    for phase in ROWS:
        cells = [f"{table[phase]:.0f}" if phase in table else "" for table in tables.values()]
        if any(cells):
            print(f"| {phase.replace('_', ' ')} | {' | '.join(cells)} |")
