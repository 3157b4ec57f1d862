"""Estimate what runs of several seeds could save at most if they were stepped as one batch, tick by tick.

    python scripts/batch_gain.py
    python scripts/batch_gain.py --seeds 4 --ticks 200

This is asked for runs that need Python between the ticks: those of a learned policy and those under wrappers. (Bare
scripted policies run without Python between the ticks; there is nothing to save.) Two things could be done once for all
seeds: stepping the arenas (`world.rack`), and asking the policy, with the robots of all arenas in one array. Both are
timed beside what is done now, arena by arena, on the same worlds. The difference, over what whole runs take, is the
most that could be saved: rewards, wrappers, records and the work of handing rows around would stay. Times are
microseconds of processor time per robot-tick.
"""

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from arguments import whole
from speed_cases import WRAPPERS

from swarm_forage_env import build_stack, load_policy, parse_wrapper, scenario
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.study.run import LiveRun
from swarm_forage_env.world.rack import Rack

CASES: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("learned", "ppo_warehouse_small", ()),
    ("CRW, four wrappers", "crw", WRAPPERS),
)
SIZES = 8, 50
ROUNDS = 3
"""The fastest counts."""


def fastest(ways: Sequence[Callable[[], object]], times: int) -> list[float]:
    """Return the processor time of each way, called so many times, of its fastest round; ways take turns."""
    found = [float("inf")] * len(ways)
    for _ in range(ROUNDS):
        for number, way in enumerate(ways):
            started = time.process_time()
            for _ in range(times):
                way()
            found[number] = min(found[number], time.process_time() - started)
    return found


def row(label: str, policy_name: str, wrappers: Sequence[str], n_robots: int, n_seeds: int, ticks: int) -> str:
    """Time one case; returns its row of the table."""
    world = scenario("warehouse_small", physics="compiled", n_robots=n_robots)
    configs = [parse_wrapper(text) for text in wrappers]
    policies = [load_policy(policy_name) for _ in range(n_seeds)]
    reads = getattr(policies[0], "reads", None)
    stacks = [build_stack(world, configs, reads=reads) for _ in range(n_seeds)]
    runs = [LiveRun(stack, policy, seed) for seed, (stack, policy) in enumerate(zip(stacks, policies, strict=True))]
    ends = iter(range(ticks, (ROUNDS + 2) * ticks, ticks))

    def advance() -> None:
        end = next(ends)
        for run in runs:
            run.advance(to_tick=end)

    advance()  # everything is compiled, and robots are at work
    (of_runs,) = fastest([advance], 1)

    envs: list[ForageEnv] = [stack.unwrapped for stack in stacks]
    arenas = [env.arena for env in envs]
    together = load_policy(policy_name)
    together.reset(replace(envs[0].swarm_spec, n_robots=n_seeds * n_robots), np.random.default_rng(0))
    obs = np.concatenate([arena.obs for arena in arenas])
    active = np.ones(len(obs), np.bool_)
    actions = np.array(together.act(obs, active), np.float32).reshape(n_seeds, n_robots, 3)
    rack, nobody = Rack(arenas), dict.fromkeys(range(n_seeds))

    def step_each() -> None:
        for arena, rows in zip(arenas, actions, strict=True):
            arena.step(rows)

    def ask_each() -> None:
        for policy, arena in zip(policies, arenas, strict=True):
            policy.act(arena.obs, active[:n_robots])

    ways = (
        step_each,
        lambda: rack.step(nobody, actions),
        ask_each,
        lambda: together.act(obs, active),
    )
    for way in ways:
        way()  # compiled
    of_ways = fastest(ways, ticks)
    run, step, step_together, ask, ask_together = np.array([of_runs, *of_ways]) / (ticks * n_seeds * n_robots) * 1e6
    share = (step - step_together + ask - ask_together) / run
    return (
        f"| {label} | {n_robots} | {run:.2f} | {step:.2f} | {step_together:.2f} | {ask:.2f} | {ask_together:.2f} "
        f"| {100 * share:.0f} % |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=whole(at_least=1), default=16)
    parser.add_argument("--ticks", type=whole(at_least=1), default=500, help="per round, of which there are three")
    given = parser.parse_args()
    print(
        "| runs | robots | whole run | steps, one by one | together | policy, one by one | together | saved at most |"
    )
    print("|---|--:|--:|--:|--:|--:|--:|--:|")
    for label, policy_name, wrappers in CASES:
        for n_robots in SIZES:
            print(row(label, policy_name, wrappers, n_robots, given.seeds, given.ticks), flush=True)


if __name__ == "__main__":
    main()
