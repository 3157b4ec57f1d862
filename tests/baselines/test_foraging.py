"""The scripted controllers in whole runs: they forage, use caches, and come home round walls."""

import numpy as np
import pytest

from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.codes import Counter, ObjectStatus
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.presets import scenario

CACHES = {"stochm": "static", "stochx": "dynamic"}


class Run:
    """A run of one policy, with what each fifth of it counted."""

    def __init__(self, scenario_name: str, policy_name: str, ticks: int, seed: int, **overrides) -> None:
        self.policy = load_policy(policy_name)
        self.env = ForageEnv(scenario(scenario_name, caches=CACHES.get(policy_name, "none"), **overrides))
        obs = self.env.reset_batch(seed)
        self.policy.reset(self.env.swarm_spec, stream_rng(seed, Stream.POLICY))
        self.tasks: set[int] = set()
        self.fifths: list[np.ndarray] = []
        before = self.counters
        for tick in range(1, ticks + 1):
            tasks = getattr(self.policy, "task", None)
            obs, *_ = self.env.step_batch(self.policy.act(obs, self.env.active), tasks=tasks)
            self.tasks |= set() if tasks is None else set(tasks.tolist())
            if tick % (ticks // 5) == 0:
                self.fifths.append(self.counters - before)
                before = self.counters

    @property
    def counters(self) -> np.ndarray:
        return self.env.events.counters.copy()


@pytest.mark.parametrize(
    ("policy_name", "scenario_name", "ticks", "deliveries"),
    [
        ("crw", "search_and_rescue", 2500, 15),
        ("dpo", "warehouse_medium", 1500, 40),
        ("cpfa", "warehouse_medium", 1500, 40),
        ("stochm", "warehouse_medium", 1500, 10),
        ("stochx", "warehouse_medium", 2000, 10),
    ],
)
def test_swarms_deliver_and_use_caches(policy_name, scenario_name, ticks, deliveries):
    run = Run(scenario_name, policy_name, ticks, seed=1)
    counters = run.counters
    assert counters[Counter.COLLECTED] >= deliveries
    if policy_name in CACHES:
        assert counters[Counter.CACHE_PICKUPS] >= 20
        assert counters[Counter.CACHE_DROPS] >= 10
        assert run.tasks - {0} == (set(range(1, 8)) if policy_name == "stochx" else {1, 2, 3})
    held = np.count_nonzero(run.env.objects.status == ObjectStatus.CARRIED)
    taken = counters[Counter.FREE_PICKUPS] + counters[Counter.CACHE_PICKUPS]
    left = counters[Counter.COLLECTED] + counters[Counter.CACHE_DROPS] + counters[Counter.FLOOR_DROPS]
    assert taken == left + held, "every object that is picked up is dropped once"


@pytest.mark.parametrize(("policy", "caches"), [("dpo", "none"), ("stochm", "static")])
def test_objects_come_home_round_a_wide_wall(policy, caches):
    """Without detours hardly an object does: light and avoidance cancel before the wall. Two runs of 3,000 s."""
    walled = scenario("warehouse_small", n_robots=20, horizon_s=3000.0, obstacles=((7.0, 3.0, 7.4, 13.0),))
    delivered = [
        run_one(plan_run(walled, policy, seed=1, caches=caches, parameters=parameters))["performance"].sum()
        for parameters in ({}, {"detour_after_s": 10_000.0})
    ]
    assert delivered[0] >= 2 > delivered[1]


@pytest.mark.slow
@pytest.mark.parametrize("scenario_name", ["warehouse_small", "warehouse_medium", "search_and_rescue"])
@pytest.mark.parametrize("policy_name", CACHES)
def test_nobody_starves_and_caches_are_used_to_the_end(scenario_name, policy_name):
    """A full run of 10,000 s delivers and takes from caches in its last fifth."""
    run = Run(scenario_name, policy_name, ticks=50_000, seed=10)
    assert len(run.fifths) == 5
    deliveries = [int(fifth[Counter.COLLECTED]) for fifth in run.fifths]
    assert deliveries[-1] >= max(deliveries) // 2
    assert run.fifths[-1][Counter.CACHE_PICKUPS] > 0
    assert run.fifths[-1][Counter.CACHE_DROPS] > 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario_name", "n_objects", "low", "high"), [("warehouse_medium", 800, 31, 47), ("warehouse_small", 177, 14, 17)]
)
def test_one_robot_with_a_memory_delivers_as_a_simple_model_predicts(scenario_name, n_objects, low, high):
    """A model with perfect homing and nobody and nothing in the way gives 31 to 47 and 14 to 17 deliveries in 10,000 s.

    Its robot leaves the nest at random, as in the authors' program.
    """
    world = {"n_robots": 1, "n_objects": n_objects, "quirks": "AUTHORS_PROGRAM"}
    runs = [Run(scenario_name, "dpo", 50_000, seed, **world).counters[Counter.COLLECTED] for seed in range(8)]
    assert low <= np.mean(runs) <= high
