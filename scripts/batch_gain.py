"""Estimate what runs of several seeds could save at most if they were stepped as one batch, tick by tick.

    python scripts/batch_gain.py
    python scripts/batch_gain.py --seeds 4 --ticks 200

This is asked for runs that need Python between the ticks: those of a learned policy and those under wrappers. (Bare
scripted policies run without Python between the ticks; there is nothing to save.) Two things could be done once for all
seeds: stepping the arenas (`world.lockstep`), and asking the policy, with the robots of all arenas in one array. Both
are timed beside what is done now, arena by arena, on copies of the same worlds. The difference, over what whole runs
take, is the most that could be saved: rewards, wrappers, records and the work of handing rows around would stay. All
ways take turns. Times are microseconds of processor time per robot-tick, medians of the rounds. Shares are worked out
round by round; the table has the median, the smallest and the largest.
"""

import argparse
import copy
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from arguments import whole
from speed_cases import WRAPPERS

from swarm_forage_env import build_stack, load_policy, parse_wrapper, scenario
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.runs.run import LiveRun
from swarm_forage_env.world.lockstep import Lockstep

CASES: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("learned", "ppo_warehouse_small", ()),
    ("CRW, four wrappers", "crw", WRAPPERS),
)
SIZES = 8, 50


def rounds_of(ways: Sequence[Callable[[], object]], rounds: int) -> np.ndarray:
    """Return the processor time of each way in each round, (rounds, ways); the first round is thrown away."""
    times = np.empty((rounds + 1, len(ways)))
    for taken in times:
        for number, way in enumerate(ways):
            started = time.process_time()
            way()
            taken[number] = time.process_time() - started
    return times[1:]


def row(label: str, policy_name: str, wrappers: Sequence[str], n_robots: int, given: argparse.Namespace) -> str:
    """Time one case; returns its row of the table."""
    n_seeds, ticks = given.seeds, given.ticks
    world = scenario("warehouse_small", physics="compiled", n_robots=n_robots)
    configs = [parse_wrapper(text) for text in wrappers]
    policies = [load_policy(policy_name) for _ in range(n_seeds)]
    reads = getattr(policies[0], "reads", None)
    stacks = [build_stack(world, configs, reads=reads) for _ in range(n_seeds)]
    runs = [LiveRun(stack, policy, seed) for seed, (stack, policy) in enumerate(zip(stacks, policies, strict=True))]
    ends = iter(range(ticks, (given.rounds + 3) * ticks, ticks))

    def advance() -> None:
        end = next(ends)
        for run in runs:
            run.advance(to_tick=end)

    advance()  # robots are at work
    envs: list[ForageEnv] = [stack.unwrapped for stack in stacks]
    # Copies, so that each way meets the same worlds in each round.
    alone, seated = (copy.deepcopy([env.arena for env in envs]) for _ in range(2))
    asked, together = copy.deepcopy(policies), load_policy(policy_name)
    spec = envs[0].swarm_spec
    reach = {name: n_seeds * getattr(spec, name) for name in ("object_reach_cells", "cache_reach_cells")}
    together.reset(replace(spec, n_robots=n_seeds * n_robots, **reach), np.random.default_rng(0))
    obs = np.concatenate([arena.obs for arena in alone])
    active = np.ones(len(obs), np.bool_)
    actions = np.array(together.act(obs, active), np.float32).reshape(n_seeds, n_robots, 3)
    lockstep, nobody = Lockstep(seated), dict.fromkeys(range(n_seeds))

    def step_each() -> None:
        for _ in range(ticks):
            for arena, rows in zip(alone, actions, strict=True):
                arena.step(rows)

    def step_together() -> None:
        for _ in range(ticks):
            lockstep.step(nobody, actions)

    def ask_each() -> None:
        for _ in range(ticks):
            for policy, rows in zip(asked, obs.reshape(n_seeds, n_robots, -1), strict=True):
                policy.act(rows, active[:n_robots])

    def ask_together() -> None:
        for _ in range(ticks):
            together.act(obs, active)

    rounds = rounds_of((advance, step_each, step_together, ask_each, ask_together), given.rounds)
    rounds *= 1e6 / (ticks * n_seeds * n_robots)
    cells = [f"{time:.2f}" for time in np.median(rounds, axis=0)]
    run, step, step_all, ask, ask_all = rounds.T
    saved = [share_cell(each / run) for each in (step - step_all, step - step_all + ask - ask_all)]
    return f"| {label} | {n_robots} | {' | '.join(cells + saved)} |"


def share_cell(shares: np.ndarray) -> str:
    """Return the median, smallest and largest share in percent: "6 % (3 to 9)"."""
    middle, low, high = (round(100 * float(share)) for share in (np.median(shares), shares.min(), shares.max()))
    return f"{middle} % ({low} to {high})"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=whole(at_least=1), default=16)
    parser.add_argument("--ticks", type=whole(at_least=1), default=200, help="per round")
    parser.add_argument("--rounds", type=whole(at_least=1), default=7)
    given = parser.parse_args()
    print(
        "| runs | robots | whole run | steps, one by one | together | policy, one by one | together "
        "| saved at most, steps alone | with the policy |"
    )
    print("|---|--:|--:|--:|--:|--:|--:|--:|--:|")
    for label, policy_name, wrappers in CASES:
        for n_robots in SIZES:
            print(row(label, policy_name, wrappers, n_robots, given), flush=True)


if __name__ == "__main__":
    main()
