"""STOCHM and STOCHX in whole runs: caches are created and used, and deliveries go on to the end."""

import numpy as np
import pytest

from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.codes import Counter, ObjectStatus
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.scenarios.presets import scenario
from tests.support.memories import caches_of

SCENARIOS = ["warehouse_small", "warehouse_medium", "search_and_rescue"]
CACHES = {"stochm": "static", "stochx": "dynamic"}


class Run:
    """A run of one policy, with counters after every fifth."""

    def __init__(
        self, scenario_name: str, policy_name: str, ticks: int, seed: int, *, declared_only: bool = False
    ) -> None:
        self.policy = load_policy(policy_name)
        reads = self.policy.reads if declared_only else None
        self.env = ForageEnv(scenario(scenario_name, caches=CACHES[policy_name]), reads=reads)
        obs = self.env.reset_batch(seed)
        self.policy.reset(self.env.swarm_spec, stream_rng(seed, Stream.POLICY))
        self.seen: set[int] = set()
        self.fifths: list[np.ndarray] = []
        self.cells_of_caches: dict[int, list[int]] = {}  # serial -> centre cell, of all that have ever been
        before = self.counters
        for tick in range(1, ticks + 1):
            obs, *_ = self.env.step_batch(self.policy.act(obs, self.env.active), tasks=self.policy.task)
            self.seen |= set(self.policy.task.tolist())
            caches = self.env.caches
            self.cells_of_caches |= dict(
                zip(caches.serial[caches.alive].tolist(), caches.cell[caches.alive].tolist(), strict=True)
            )
            if tick % (ticks // 5) == 0:
                self.fifths.append(self.counters - before)
                before = self.counters
        self.obs = obs

    @property
    def counters(self) -> np.ndarray:
        return self.env.events.counters.copy()


@pytest.mark.parametrize("policy_name", CACHES)
def test_swarms_deliver_and_use_caches(policy_name):
    run = Run("warehouse_medium", policy_name, ticks=2000, seed=1)
    counters = run.counters
    assert counters[Counter.COLLECTED] >= 10
    assert counters[Counter.CACHE_PICKUPS] >= 20
    assert counters[Counter.CACHE_DROPS] >= 10
    assert run.seen == (set(range(1, 8)) if policy_name == "stochx" else {1, 2, 3})
    held = np.count_nonzero(run.env.objects.status == ObjectStatus.CARRIED)
    taken = counters[Counter.FREE_PICKUPS] + counters[Counter.CACHE_PICKUPS]
    left = counters[Counter.COLLECTED] + counters[Counter.CACHE_DROPS] + counters[Counter.FLOOR_DROPS]
    assert taken == left + held, "every object that is picked up is dropped once"


def test_what_robots_remember_of_caches_was_true_and_is_while_they_see_them():
    run = Run("warehouse_small", "stochm", ticks=3000, seed=6)
    run.policy.act(run.obs, run.env.active)  # takes note of what is seen now
    remembered = [caches_of(run.policy, robot) for robot in range(50)]
    assert sum(len(known) for known in remembered) == run.policy._robots["n_caches"].sum() > 0
    for known in remembered:
        for serial, (x, y, count, density) in known.items():
            assert [x, y] == run.cells_of_caches[serial]
            assert count >= 2
            assert 0.9 < density <= 1.0
    sees_cache = run.obs[:, run.env.layout["los_cache"]][:, 0] > 0
    assert 5 < np.count_nonzero(sees_cache) < 50
    caches = run.env.caches
    (slot,) = np.flatnonzero(caches.alive)
    present = (*caches.cell[slot].tolist(), int(caches.count[slot]))
    for robot in np.flatnonzero(sees_cache):
        assert remembered[robot][int(caches.serial[slot])][:3] == present


@pytest.mark.slow
@pytest.mark.parametrize("scenario_name", SCENARIOS)
@pytest.mark.parametrize("policy_name", CACHES)
def test_nobody_starves_and_caches_are_used_to_the_end(scenario_name, policy_name):
    """A full run of 10,000 s delivers and takes from caches in its last fifth."""
    run = Run(scenario_name, policy_name, ticks=50_000, seed=10)
    assert len(run.fifths) == 5
    deliveries = [int(fifth[Counter.COLLECTED]) for fifth in run.fifths]
    assert deliveries[-1] >= max(deliveries) // 2
    assert run.fifths[-1][Counter.CACHE_PICKUPS] > 0
    assert run.fifths[-1][Counter.CACHE_DROPS] > 0
