"""Compile what most tests need, before they are spread over several processes: `python -m tests.support.first_kernels`.

Two processes do it, one for each engine, the argument. Each keeps what it compiles where the other one finds it.
"""

import sys

from swarm_forage_env import parse_wrapper, plan_run, scenario
from swarm_forage_env.runs.run import warm_up

POLICIES = {"random": "none", "crw": "none", "dpo": "none", "cpfa": "none", "stochm": "static", "stochx": "dynamic"}
"""Policy -> caches of its world."""
DISTURBED = ("sensor_noise:sigma=0.1", "actuator_noise:sigma=0.1", "throttle:waveform=constant,amplitude=0.3")


def main(physics: str) -> None:
    """Step every kind of world a few ticks."""
    for policy, caches in POLICIES.items():
        warm_up(plan_run(scenario("warehouse_small", physics=physics, caches=caches, n_robots=10), policy))
    world = scenario("warehouse_small", physics=physics, n_robots=10)
    warm_up(plan_run(world, "crw", wrappers=[parse_wrapper(text) for text in DISTURBED]))


if __name__ == "__main__":
    main(sys.argv[1])
