"""The compiled controllers against the slow ones, on random observations that visit every state."""

import math

import numpy as np
import pytest

from baselines.cpfa import CPFAPolicy
from baselines.crw import CRWPolicy
from baselines.dpo import DPOPolicy
from baselines.robots import DRAWS, VectorState
from swarm_forage_env.contract.codes import Event
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.quirks import AUTHORS_PROGRAM, Quirks
from tests.reference.controllers import ObjectDictionary, ReferenceRobot
from tests.support.memories import objects_of
from tests.support.observations import GREYS, Observations, make_spec

N_ROBOTS = 6
STATES = ["acquire", "wait for pick-up", "homing", "homing in nest", "wait for drop", "leave nest"]


class Fuzz:
    """Random observations whose parts stay for a while."""

    def __init__(self, task, seed: int) -> None:
        self.seen = Observations(task)
        self.rng = np.random.default_rng(seed)

    def perturb(self, i: int, goal: tuple[float, float] | None) -> None:
        rng, seen = self.rng, self.seen
        if rng.random() < 0.08:
            seen.ground(rng.choice(list(GREYS)), i)
        elif rng.random() < 0.02:
            seen.set("ground", rng.random(4), i)
        if rng.random() < 0.3:
            seen.obstacle(rng.uniform(-math.pi, math.pi) if rng.random() < 0.25 else None, i)
            # Two equal beams would point exactly at the edge between soft and hard turns, which rounding decides.
            seen.set("proximity", seen.get("proximity", i) * rng.uniform(0.9, 1.0, 24), i)
        seen.set("light", rng.random(24), i)
        seen.set("wheel_speed", rng.choice([-0.5, 0.0, 0.0004, 0.45], 2), i)
        cell = rng.integers(40, 46, 2)
        seen.pose(*((cell + rng.random(2)) * 0.2), rng.uniform(-math.pi, math.pi), i)
        if rng.random() < 0.3:
            seen.believed_position(*rng.uniform((1.0, 1.0), (31.0, 15.0)), i)
        elif goal is not None and rng.random() < 0.3:
            seen.believed_position(goal[0] + rng.choice([0.01, 0.1]), goal[1], i)
        if rng.random() < 0.03:
            seen.carry(None if seen.get("carrying", i)[0] else int(rng.integers(200)), i)
        seen.event(Event(int(rng.integers(1, 10))) if rng.random() < 0.1 else Event.NONE, i)
        shown = rng.choice(200, 2, replace=False) if rng.random() < 0.1 else []
        seen.window({(int(rng.integers(-2, 3)), k): int(row) for k, row in enumerate(shown)}, i)


@pytest.mark.parametrize("quirks", [Quirks(), AUTHORS_PROGRAM], ids=["as described", "authors' program"])
@pytest.mark.parametrize("policy_class", [CRWPolicy, DPOPolicy])
def test_compiled_controller_acts_like_the_slow_one(policy_class, quirks):
    task = make_spec(N_ROBOTS, quirks=quirks)
    has_memory = policy_class is DPOPolicy
    fuzz = Fuzz(task, seed=1)
    policy = policy_class()
    policy.reset(task, np.random.default_rng(2))
    draws_again = np.random.default_rng(2)
    twins = [ReferenceRobot(task, ObjectDictionary() if has_memory else None) for _ in range(N_ROBOTS)]
    activities: set[int] = set()
    stages: set[int] = set()
    for _ in range(600):
        for i, twin in enumerate(twins):
            fuzz.perturb(i, twin.goal if has_memory else None)
        active = fuzz.rng.random(N_ROBOTS) < 0.95
        actions = policy.act(fuzz.seen.array, active)
        draws = draws_again.random((N_ROBOTS, DRAWS))
        for i in np.flatnonzero(active):
            expected = twins[i].act(fuzz.seen.array[i], draws[i])
            assert np.abs(actions[i] - expected).max() <= 2e-6
        assert [STATES[code] for code in policy.activity] == [twin.state for twin in twins]
        activities |= set(policy.activity.tolist())
        stages |= set(policy._robots["vector_state"].tolist())
    # Only the authors' program has a walk out of the nest.
    assert activities == set(range(len(STATES) if quirks.nest_left_at_random else len(STATES) - 1))
    if isinstance(policy, DPOPolicy):
        assert stages == set(VectorState)
        for i, twin in enumerate(twins):
            assert set(objects_of(policy, i)) == set(twin.memory.known)


def test_long_turns_are_as_in_the_slow_one():
    """Lights that stay to one side for long; the runs above change them in every tick."""
    task = make_spec(N_ROBOTS)
    seen, policy, draws_again = Observations(task), CRWPolicy(), np.random.default_rng(9)
    policy.reset(task, np.random.default_rng(9))
    twins = [ReferenceRobot(task) for _ in range(N_ROBOTS)]
    for i in range(N_ROBOTS):
        seen.carry(i, i)
        seen.light(math.radians(17.0 + 10.0 * i), i)
    driving = 0
    for _ in range(60):
        actions = policy.act(seen.array, np.ones(N_ROBOTS, bool))
        draws = draws_again.random((N_ROBOTS, DRAWS))
        for i, twin in enumerate(twins):
            assert np.abs(actions[i] - twin.act(seen.array[i], draws[i])).max() <= 2e-6
        driving += np.count_nonzero(actions[:, 0] + actions[:, 1] > 0.0)
    assert 5 < driving < 60


def test_detours_are_as_in_the_slow_one():
    """Robots that carry among obstacles and come no further; now and then they see nothing, or are elsewhere."""
    task = make_spec(N_ROBOTS, has_obstacles=True)
    seen, policy, draws_again = Observations(task), CRWPolicy(), np.random.default_rng(9)
    policy.reset(task, np.random.default_rng(9))
    twins, chance = [ReferenceRobot(task) for _ in range(N_ROBOTS)], np.random.default_rng(10)
    on_the_way = set()
    for i in range(N_ROBOTS):
        seen.carry(i, i)
        seen.light(math.radians(20.0 * i), i)
    for tick in range(700):
        for i in range(N_ROBOTS):
            seen.set("proximity", chance.random(24) * chance.integers(2), i)
            if chance.random() < 0.002:
                seen.pose(*chance.uniform((10.0, 5.0), (20.0, 10.0)), robots=i)
            if chance.random() < 0.002:
                seen.carry(None if seen.get("carrying", i)[0] else i, i)
        actions = policy.act(seen.array, np.ones(N_ROBOTS, bool))
        draws = draws_again.random((N_ROBOTS, DRAWS))
        for i, twin in enumerate(twins):
            assert np.abs(actions[i] - twin.act(seen.array[i], draws[i])).max() <= 2e-6, (tick, i)
            on_the_way.add((twin.detour > 0) * twin.side)
    assert on_the_way == {-1, 0, 1}


@pytest.mark.parametrize(("policy", "caches"), [("crw", "none"), ("dpo", "none"), ("stochm", "static")])
def test_objects_come_home_round_a_wide_wall(policy, caches):
    """Without detours hardly an object does: light and avoidance cancel before the wall."""
    walled = scenario("warehouse_small", n_robots=20, horizon_s=3000.0, obstacles=((7.0, 3.0, 7.4, 13.0),))
    delivered = [
        run_one(plan_run(walled, policy, seed=1, caches=caches, parameters=parameters))["performance"].sum()
        for parameters in ({}, {"detour_after_s": 10_000.0})
    ]
    assert delivered[0] >= 2 > delivered[1]


@pytest.mark.parametrize("policy_class", [CRWPolicy, DPOPolicy, CPFAPolicy])
def test_only_declared_slices_are_read(policy_class):
    task = make_spec(N_ROBOTS)
    fuzz = Fuzz(task, seed=3)
    garbage = np.random.default_rng(4)
    plain, fooled = policy_class(), policy_class()
    for policy in (plain, fooled):
        policy.reset(task, np.random.default_rng(5))
    light, carrying = task.layout["light"], task.layout["carrying"].start
    unread = [task.layout[name] for name in task.layout.names if name not in (*policy_class.reads, "light")]
    assert unread
    assert "light if carrying" in policy_class.reads
    active = np.ones(N_ROBOTS, bool)
    for _ in range(150):
        for i in range(N_ROBOTS):
            fuzz.perturb(i, None)
        expected = plain.act(fuzz.seen.array, active).copy()
        other = fuzz.seen.array.copy()
        for columns in unread:
            other[:, columns] = garbage.uniform(-1, 1, other[:, columns].shape)
        dark = np.flatnonzero(other[:, carrying] < 0.5)
        other[dark, light] = garbage.uniform(0, 1, other[dark, light].shape)
        np.testing.assert_array_equal(fooled.act(other, active), expected)


@pytest.mark.parametrize("policy_class", [CRWPolicy, DPOPolicy, CPFAPolicy])
def test_actions_repeat_with_the_seed_and_stay_in_range(policy_class):
    task = make_spec(N_ROBOTS)

    def actions(seed: int) -> np.ndarray:
        fuzz = Fuzz(task, seed=6)
        policy = policy_class()
        policy.reset(task, np.random.default_rng(seed))
        history = []
        for _ in range(100):
            for i in range(N_ROBOTS):
                fuzz.perturb(i, None)
            history.append(policy.act(fuzz.seen.array, np.ones(N_ROBOTS, bool)).copy())
        return np.array(history)

    first = actions(7)
    np.testing.assert_array_equal(first, actions(7))
    assert not np.array_equal(first, actions(8))
    assert first.dtype == np.float32
    assert np.abs(first).max() <= 1.0
