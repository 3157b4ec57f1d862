"""Objects never appear, vanish or lie in two places, whatever robots do and whichever robots come and go."""

from itertools import cycle

import numpy as np
import pytest

from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.quirks import AUTHORS_PROGRAM
from tests.support.crowded_runs import DENSE, RUNS, BusyPolicy, change_population, fresh, make, side
from tests.support.stage import assert_conserved


def run_conserved(env: ForageEnv, policy, ticks: int, *, seed: int, population: bool = False) -> None:
    """Run and check the whole world after every tick."""
    rng = np.random.default_rng(seed)
    policy.reset(env.swarm_spec, stream_rng(seed, Stream.POLICY))
    obs = env.reset_batch(seed)
    assert_conserved(env)
    for tick in range(ticks):
        if population and tick % 5 == 0:
            change_population(env, rng)
            assert_conserved(env)
        obs = env.step_batch(policy.act(obs, env.active), tasks=getattr(policy, "task", None))[0]
        assert_conserved(env)


@pytest.mark.parametrize(("policy", "name", "caches"), RUNS)
def test_objects_are_conserved(policy, name, caches):
    run_conserved(make(name, caches), fresh(policy), 60, seed=3)


COMING_AND_GOING = (("none", 0.2), ("static", 0.03), ("dynamic", 0.03), ("dynamic", 0.2))
"""Caches, and their side as a share of the arena's."""


@pytest.mark.parametrize(
    ("name", "caches", "side_share"),
    [(name, *caches) for name, caches in zip([*DENSE, *DENSE], cycle(COMING_AND_GOING), strict=False)],
)
def test_objects_are_conserved_when_robots_come_and_go(name, caches, side_share):
    config = scenario(
        name,
        n_robots=40,
        caches=caches,
        n_objects=DENSE[name],
        side_share=side_share,
        walk_probability=0.02,
        **side(name),
    )
    run_conserved(ForageEnv(config), BusyPolicy(), 100, seed=8, population=True)


@pytest.mark.parametrize("caches", ["static", "dynamic"])
def test_objects_are_conserved_as_the_authors_program_does_it(caches):
    config = scenario(
        "search_and_rescue", side_m=32.0, n_robots=40, caches=caches, walk_probability=0.05, quirks=AUTHORS_PROGRAM
    )
    run_conserved(ForageEnv(config), BusyPolicy(), 150, seed=2, population=True)
