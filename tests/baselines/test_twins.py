"""The compiled controllers against the slow ones, on random observations that visit every state and task."""

import math

import numpy as np
import pytest

from baselines.cpfa import CPFA_DRAWS, CPFAParameters, CPFAPolicy, Stage
from baselines.crw import CRWPolicy
from baselines.dpo import DPOPolicy
from baselines.robots import DRAWS, Activity, VectorState
from baselines.stochm import STOCHMPolicy
from baselines.stochx import STOCHXPolicy
from baselines.tasks import TASK_DRAWS
from swarm_forage_env.contract.codes import Event, Goal, Task
from swarm_forage_env.scenarios.quirks import AUTHORS_PROGRAM, Quirks
from tests.reference.controllers import CPFARobot, ObjectDictionary, ReferenceRobot
from tests.reference.task_controllers import CHILDREN, TASKS, ReferenceTaskRobot
from tests.support.observations import GREYS, Observations, make_spec
from tests.support.task_robot import caches_of, estimates_of, objects_of

N_ROBOTS = 6
STATES = ["acquire", "wait for pick-up", "homing", "homing in nest", "wait for drop", "leave nest"]
TASK_STATES = [*STATES, "transport", "finished", "let go"]
OFTEN = {"search_per_tick": 0.1, "give_up_per_tick": 0.02, "site_fidelity_rate": 0.5, "informed_decay_per_tick": 0.05}
PLACES = [(38, 38), (38, 46), (46, 38), (48, 46), (43, 43)]
"""Centre cells of small caches around the cells where the robots are."""


class Fuzz:
    """Random observations whose parts stay for a while."""

    def __init__(self, task, seed: int) -> None:
        self.seen = Observations(task)
        self.rng = np.random.default_rng(seed)

    def surround(self, i: int) -> None:
        """Change obstacles, light, wheels and pose."""
        rng, seen = self.rng, self.seen
        if rng.random() < 0.3:
            seen.obstacle(rng.uniform(-math.pi, math.pi) if rng.random() < 0.25 else None, i)
            # Two equal beams would point exactly at the edge between soft and hard turns, which rounding decides.
            seen.set("proximity", seen.get("proximity", i) * rng.uniform(0.9, 1.0, 24), i)
        seen.set("light", rng.random(24), i)
        seen.set("wheel_speed", rng.choice([-0.5, 0.0, 0.0004, 0.45], 2), i)
        cell = rng.integers(40, 46, 2)
        seen.pose(*((cell + rng.random(2)) * 0.2), rng.uniform(-math.pi, math.pi), i)

    def perturb(self, i: int, goal: tuple[float, float] | None) -> None:
        rng, seen = self.rng, self.seen
        if rng.random() < 0.08:
            seen.ground(rng.choice(list(GREYS)), i)
        elif rng.random() < 0.02:
            seen.set("ground", rng.random(4), i)
        self.surround(i)
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
    nests = ((1.6, 1.6, 4.8, 14.4), (11.0, 9.0, 13.0, 11.0))  # now the one and now the other is nearer
    task = make_spec(N_ROBOTS, quirks=quirks, nest_boxes_m=nests)
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


@pytest.mark.parametrize("quirks", [Quirks(), AUTHORS_PROGRAM], ids=["as described", "authors' program"])
def test_cpfa_is_as_the_slow_one(quirks):
    spec = make_spec(N_ROBOTS, quirks=quirks)
    parameters = CPFAParameters(**OFTEN)
    fuzz, policy = Fuzz(spec, seed=1), CPFAPolicy(parameters)
    policy.reset(spec, np.random.default_rng(2))
    draws_again = np.random.default_rng(2)
    twins = [CPFARobot(spec, parameters=parameters) for _ in range(N_ROBOTS)]
    met: set[tuple[str, str, bool]] = set()
    for _ in range(800):
        for i, twin in enumerate(twins):
            fuzz.perturb(i, twin.goal)
        active = fuzz.rng.random(N_ROBOTS) < 0.95
        actions = policy.act(fuzz.seen.array, active)
        draws = draws_again.random((N_ROBOTS, CPFA_DRAWS))
        for i in np.flatnonzero(active):
            assert actions[i, :3] == pytest.approx(twins[i].act(fuzz.seen.array[i], draws[i]), abs=2e-6)
        robots = policy._robots
        assert [Stage(int(code)).name.lower().replace("_", " ") for code in robots["stage"]] == [
            twin.stage for twin in twins
        ]
        assert robots["has_site"].tolist() == [twin.site is not None for twin in twins]
        met |= {(twin.stage, twin.vector, twin.informed) for twin in twins if twin.state == "acquire"}
    found, told = policy.describe_memories(), policy.describe_robots()
    assert dict(zip(found.robot.tolist(), found.place_m.tolist(), strict=True)) == {
        i: pytest.approx(twin.site[0], abs=1e-5) for i, twin in enumerate(twins) if twin.site
    }
    assert [told.words[code] == "searching" for code in told.activity] == [
        (twin.state, twin.stage) == ("acquire", "search") for twin in twins
    ]
    for informed in (False, True):
        assert met >= {("search", "idle", informed), ("search", "vector", informed), ("travel", "vector", informed)}
    assert {stage for stage, _, _ in met} >= {"give up", "search", "travel"}


# Controllers with tasks


def crowded_task(**changes):
    """A world of small caches, five cells wide, and short distances."""
    return make_spec(
        N_ROBOTS,
        caches="dynamic",
        cache_side_m=1.0,
        cache_side_nominal_m=1.01,  # no distance between cells, so that rounding decides nothing
        min_dist_m=1.0,
        cache_proximity_m=2.0,
        **changes,
    )


def is_on(cell, robot: np.record) -> bool:
    """Whether a robot's goal lies on the square of a cache."""
    return max(abs((cell[0] + 0.5) * 0.2 - robot.goal_x_m), abs((cell[1] + 0.5) * 0.2 - robot.goal_y_m)) <= 0.5


class TaskFuzz(Fuzz):
    """Random observations whose parts stay for a while, and which often grant what a robot waits for."""

    def perturb(self, i: int, robot: np.record) -> None:
        rng, seen = self.rng, self.seen
        activity, carrying = Activity(int(robot.activity)), bool(seen.get("carrying", i)[0])
        if rng.random() < 0.15:
            seen.ground(rng.choice(list(GREYS)), i)
        self.surround(i)
        if rng.random() < 0.1:
            seen.believed_position(*rng.uniform((1.0, 1.0), (31.0, 15.0)), i)
        elif rng.random() < 0.4:
            seen.believed_position(robot.goal_x_m + rng.choice([0.01, 0.1]), robot.goal_y_m, i)
        caches = [(int(10 * k + rng.integers(1, 4)), PLACES[k], int(rng.integers(2, 6))) for k in rng.permutation(5)]
        if rng.random() < 0.1:
            seen.caches(*caches[: rng.integers(0, 5)], robots=i)
        if robot.goal_kind == Goal.CACHE and activity is Activity.WAIT_PICKUP and rng.random() < 0.3:
            # The cache that it waits in, now and then with too few objects.
            within = [cell for cell in PLACES if is_on(cell, robot)]
            seen.caches(*((int(robot.target), cell, int(rng.integers(2, 4))) for cell in within), robots=i)
        event = Event(int(rng.integers(1, 10))) if rng.random() < 0.05 else Event.NONE
        served = activity in (Activity.WAIT_PICKUP, Activity.WAIT_DROP, Activity.LET_GO) and rng.random() < 0.4
        if served or rng.random() < 0.005:
            seen.carry(None if carrying else int(rng.integers(200)), i)
            event = Event.JOINED_CACHE if carrying else Event.PICKED_FROM_CACHE
        object_row, cache = int(rng.integers(200)), caches[4]
        if (
            robot.goal_kind in (Goal.SITE, Goal.ISOLATED_OBJECT)
            and activity is Activity.WAIT_DROP
            and rng.random() < 0.3
        ):
            # Refused by a cache farther off than robots keep; and beside the nest, where a site is near.
            seen.believed_position(*rng.uniform((4.0, 7.5), (4.8, 8.5)), i)
            event, cache = Event.CACHE_TOO_NEAR, (77, (int(robot.goal_x_m / 0.2) + 7, int(robot.goal_y_m / 0.2)), 4)
        seen.event(event, i, object_row if rng.random() < 0.8 else None, cache if rng.random() < 0.8 else None)
        if rng.random() < 0.1:
            rows = rng.choice(200, 2, replace=False)
            seen.window({(int(rng.integers(-2, 3)), k): int(row) for k, row in enumerate(rows)}, i)
        elif rng.random() < 0.5:
            seen.window({}, i)


def twin_of(policy, i: int, task) -> ReferenceTaskRobot:
    """A slow robot with the first estimates, probabilities and coins of a compiled one."""
    a, p = policy._allocation, policy.parameters
    blocks = list(CHILDREN)[: policy.n_tabs]

    def site() -> tuple[float, float] | None:
        robot = policy._robots[i]
        return (float(robot.goal_x_m), float(robot.goal_y_m))

    def last_forgotten() -> tuple[int, int]:
        robot = policy._robots[i]
        return (int(robot.last_cache_x_m / 0.2), int(robot.last_cache_y_m / 0.2))

    return ReferenceTaskRobot(
        task,
        ObjectDictionary(),
        estimates={name: float(a.estimate[i, code]) for code, name in enumerate(TASKS) if name},
        partition={block: float(a.partition[i, k]) for k, block in enumerate(blocks)},
        last_child={block: CHILDREN[block][a.last_child[i, k]] for k, block in enumerate(blocks)},
        block=blocks[a.tab[i]],
        numbers=(p.partition_reactivity, p.partition_gamma, p.subtask_reactivity, p.subtask_gamma),
        smallest_cache=int(p.smallest_cache),
        site=site,
        last_forgotten=last_forgotten,
    )


@pytest.mark.parametrize(
    ("policy_class", "quirks", "ticks"),
    [(STOCHMPolicy, Quirks(), 1500), (STOCHXPolicy, Quirks(), 2500), (STOCHXPolicy, AUTHORS_PROGRAM, 2500)],
    ids=["STOCHM", "STOCHX", "STOCHX, authors' program"],
)
def test_tasks_are_as_in_the_slow_ones(policy_class, quirks, ticks):
    """Three seconds each: the slow robots need some thousand ticks to come through every task and state."""
    task = crowded_task(quirks=quirks)
    fuzz = TaskFuzz(task, seed=1)
    # Short estimates let robots give up, and a high probability of subtasks lets them do all, often enough.
    policy = policy_class(
        partition_gamma=1.5,
        generalist_estimate_low_ticks=20.0,
        generalist_estimate_high_ticks=200.0,
        subtask_estimate_low_ticks=20.0,
        subtask_estimate_high_ticks=200.0,
    )
    policy.reset(task, np.random.default_rng(2))
    twins = [twin_of(policy, i, task) for i in range(N_ROBOTS)]
    visited: set[tuple[Task, Activity]] = set()
    goals: set[int] = set()
    searching = 0
    for now in range(1, ticks + 1):
        for i in range(N_ROBOTS):
            fuzz.perturb(i, policy._robots[i])
        active = fuzz.rng.random(N_ROBOTS) < 0.95
        actions = policy.act(fuzz.seen.array, active)
        for i in np.flatnonzero(active):
            expected = twins[i].tick(fuzz.seen.array[i], policy._draws[i], now)
            assert [TASKS[policy.task[i]], TASK_STATES[policy.activity[i]]] == [twins[i].job, twins[i].state]
            assert np.abs(actions[i] - expected).max() <= 2e-6  # pytest.approx takes longer than the controller
            left_alone = zip(policy._memory.shunned[i], policy._memory.n_shunned[i], strict=True)
            assert [set(names[:n].tolist()) for names, n in left_alone] == [
                {row + 1 for row in twins[i].shunned},
                twins[i].not_to_take,
                twins[i].not_to_add,
            ]
            visited.add((Task(int(policy.task[i])), Activity(int(policy.activity[i]))))
            goals.add(int(policy._robots[i].goal_kind))
            searching += policy._robots[i].is_searching
    for i, twin in enumerate(twins):
        assert caches_of(policy, i) == {
            cache.serial: (*cell, cache.count, pytest.approx(cache.density, abs=1e-9))
            for cell, cache in twin.caches.items()
        }
        assert objects_of(policy, i) == {
            row: (*cell, pytest.approx(density, abs=1e-9)) for row, (cell, density) in twin.memory.known.items()
        }
        estimates = estimates_of(policy, i)
        assert {name: estimates[code] for code, name in enumerate(TASKS) if name} == pytest.approx(twin.estimates)
    tasks = list(Task)[1:] if policy_class is STOCHXPolicy else list(Task)[1:4]
    assert {task for task, _ in visited} == set(tasks)
    moving = {Activity.HOMING, Activity.HOMING_IN_NEST, Activity.TRANSPORT}
    waiting = {Activity.WAIT_PICKUP, Activity.WAIT_DROP, Activity.LET_GO}
    assert {activity for _, activity in visited} == {Activity.ACQUIRE} | moving | waiting
    assert goals == ({Goal.OBJECT, Goal.CACHE} if policy_class is STOCHMPolicy else set(Goal) - {Goal.NONE, Goal.NEST})
    # The quirk compares metres with cells, which lie so far apart here that no cache is ever forgotten.
    assert (searching > 20) != quirks.cache_forget_unit_mismatch
    assert policy._draws.shape == (N_ROBOTS, TASK_DRAWS)
