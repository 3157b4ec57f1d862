"""Time each phase of a compiled tick alone, and the whole tick, in nanoseconds of processor time per robot.

    python scripts/tick_phases.py                             DPO in warehouse_medium
    python scripts/tick_phases.py --policy crw --scenario warehouse_small

A run is let go for some ticks first. Then each phase is called again and again on the world as it stands, and the
fastest of several rounds counts. Phases alone are cheaper than in a run, where no processor can foresee which robot is
near another, carries, or stands over an object. What the whole tick takes beyond their sum is that, and what is left
out here: objects that walk, caches that are placed.

The last lines tell what share of a tick the bodies are, compiled ones and Chipmunk's. Chipmunk's are the difference of
two whole ticks, so they hold what Python does between the parts of the tick, too.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from swarm_forage_env import SCENARIO_NAMES, build_stack, load_policy, scenario
from swarm_forage_env._internal.compiling import direct
from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.runs.run import LiveRun
from swarm_forage_env.world.arena import ForagingArena
from swarm_forage_env.world.kernels import bodies, counting, drive, floor, interact, proprioception, tick

ROUNDS, CALLS = 7, 200
RUN_IN_TICKS = 2_000


def ns_per_robot(act: Callable[[], object], calls: int, n_robots: int) -> float:
    """Return the nanoseconds per robot of a call, those of the fastest round."""
    rounds = []
    for _ in range(ROUNDS):
        started = time.process_time()
        for _ in range(calls):
            act()
        rounds.append(time.process_time() - started)
    return min(rounds) / calls / n_robots * 1e9


def bound(kernel: Callable[..., Any], *arguments: Any) -> Callable[[], Any]:
    """Return a call of a kernel with these arguments."""
    compiled = direct(kernel, *arguments)
    return lambda: compiled(*arguments)


def phases(arena: ForagingArena, policy: Policy) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Yield the phases of a tick that cost anything, in their order."""
    world, body_state = arena.parts
    state, sensors = world.state, world.sensors
    columns = sensors.columns
    n_robots, now = len(world.present), arena.tick + 1
    gain, chance = np.ones((n_robots, 2)), np.zeros(n_robots)
    actions = policy.act(sensors.obs, state.active).copy()
    yield "policy", lambda: policy.act(sensors.obs, state.active)
    wheels = actions, gain, state.active, state.pending_kind, world.facing, world.drive_limits, world.dt_s
    yield "wheels", bound(drive.drive, *wheels, world.wheel_speed, world.twist)
    yield "wheels and pushing", bound(tick.set_out, world, actions, gain, now, False)
    yield "bodies", bound(bodies.move_bodies, body_state, world.twist, world.present, world.dt_s)
    poses = body_state.poses, world.present, state.position, world.heading, world.facing
    yield "poses", bound(bodies.tell_poses, *poses)
    yield "looking around", bound(tick.look, world)
    seen = sensors.obs, columns.proximity, sensors.near, sensors.behind_counts, state.active, world.present
    marked = state.carried_object, world.interfering, state.counters, world.interference_sum
    yield "interference", bound(counting.mark, *seen, *marked)
    yield "pick-ups and drops", bound(interact.serve, state, world.rules, actions, now, chance)
    place = state.position, world.facing, world.present
    if sensors.reads_light:
        lamps = sensors.lights, sensors.intensity, state.carried_object, sensors.light_of_carriers_only
        yield "light", bound(floor.light, *place, *lamps, sensors.obs, columns.light)
    if sensors.reads_ground:
        yield "ground", bound(floor.ground, *place, state.floor, sensors.obs, columns.ground)
    if sensors.reads_line_of_sight:
        caches = state.cache_alive, state.cache_cell, state.cache_serial, state.cache_count
        window = state.floor, sensors.shares, caches, sensors.cache_half_side, sensors.obs
        starts = columns.los_cell, columns.los_object, columns.los_cache
        yield "line of sight", bound(floor.line_of_sight, state.position, world.present, *window, starts)
    motion = state.position, world.facing, world.wheel_speed, world.present, sensors.scales, sensors.obs
    yield "own motion", bound(proprioception.own_motion, *motion, columns.wheel_speed)


def started_run(name: str, policy_name: str, physics: str) -> tuple[LiveRun, ForageEnv, Policy]:
    """Return a run that has gone on for some ticks."""
    policy = load_policy(policy_name)
    world = scenario(name, physics=physics, caches=getattr(policy, "caches", "none"))
    stack = build_stack(world, reads=getattr(policy, "reads", None))
    run = LiveRun(stack, policy, 0)
    run.advance(to_tick=RUN_IN_TICKS)
    return run, stack.unwrapped, policy


def whole_tick(run: LiveRun, env: ForageEnv, n_ticks: int = 300) -> float:
    """Return the nanoseconds per robot of a tick of the run that goes on."""
    return ns_per_robot(lambda: run.advance(to_tick=env.tick + n_ticks), 1, n_ticks * env.scenario.robots.n_robots)


def main() -> None:
    """Print the phases of one scenario and policy."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", choices=SCENARIO_NAMES, default="warehouse_medium")
    parser.add_argument("--policy", default="dpo", help="a scripted one: crw, dpo, stochm, stochx (default dpo)")
    chosen = parser.parse_args()
    run, env, policy = started_run(chosen.scenario, chosen.policy, "compiled")
    n_robots = env.scenario.robots.n_robots
    whole = whole_tick(run, env)
    spent = {name: ns_per_robot(act, CALLS, n_robots) for name, act in phases(env.arena, policy)}
    spent["pushing"] = spent.pop("wheels and pushing") - spent["wheels"]
    table = Table(title=f"{chosen.policy}, {chosen.scenario}, {n_robots} robots: ns per robot")
    table.add_column("phase, alone")
    table.add_column("ns", justify="right")
    table.add_column("of the whole tick", justify="right")
    for name, ns in sorted(spent.items(), key=lambda item: -item[1]):
        table.add_row(name, f"{ns:.0f}", f"{ns / whole:.0%}")
    table.add_section()
    table.add_row("whole tick, in the run", f"{whole:.0f}", "")
    console = Console()
    console.print(table)
    slow_run, slow_env, _ = started_run(chosen.scenario, chosen.policy, "chipmunk")
    slow = whole_tick(slow_run, slow_env)
    compiled, chipmunk = spent["bodies"], slow - whole + spent["bodies"]
    console.print(f"bodies, compiled: {compiled:.0f} ns, {compiled / whole:.0%} of a tick of {whole:.0f} ns")
    console.print(f"bodies, Chipmunk: {chipmunk:.0f} ns, {chipmunk / slow:.0%} of a tick of {slow:.0f} ns")


if __name__ == "__main__":
    main()
