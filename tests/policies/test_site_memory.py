"""Site memory of learners: against a slow twin along runs, and its rules by hand."""

import copy
import pickle

import numpy as np
import pytest

from swarm_forage_env import RunSpec, load_policy, run_policy
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.policies.learned import LearnedPolicy
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.views.learner_arena import LearnerArena
from swarm_forage_env.views.plans import plan_arena
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import World
from tests.reference.learner import RobotSites, tell
from tests.support.stage import cell_centre, lay, load, put, tidy_world

INTERFACE = {"observation": "compact", "actions": "discrete", "automatic_gripper": True, "decision_ticks": 5,
             "site_memory": True}  # fmt: skip
PLACE = cell_centre((60, 40))


def remembering(env: ForageEnv, **choices) -> LearnerInterface:
    return LearnerInterface(InterfaceConfig(site_memory=True, **choices), env.swarm_spec)


def seen(interface: LearnerInterface, env: ForageEnv, name: str) -> np.ndarray:
    """What robot 0 remembers of a site, (4,): forward, left, known, distance."""
    return interface.observe(env.arena.observe())[0, interface.layout[name]]


@pytest.mark.parametrize("hearing_m", [0.0, 3.0])
def test_sites_match_their_twin_along_a_run(hearing_m):
    env = ForageEnv(scenario("search_and_rescue", n_robots=30, side_m=16.0, physics="compiled"))
    stack = parse_wrapper("sensor_noise:sigma=0.02").wrap(env)
    policy = load_policy("dpo")
    policy.reset(env.swarm_spec, stream_rng(0, Stream.POLICY))
    interface = remembering(env, observation="compact", hearing_m=hearing_m)
    twins = [RobotSites() for _ in range(30)]
    columns = slice(interface.layout["pickup_site"].start, interface.layout["sighting_site"].stop)
    obs, columns_used = stack.reset_batch(3), np.zeros(8)
    for tick in range(1500):
        obs, *_ = stack.step_batch(policy.act(obs, env.active))
        if tick == 1000:
            away = np.arange(30) % 7 == 3
            env.set_population(active=~away, present=~away)
        if tick % 5 == 0:
            decision = tick // 5
            rows = interface.observe(obs, decision=decision)[:, columns]
            for twin, row in zip(twins, obs, strict=True):
                twin.look(row, env.layout, decision)
            tell(twins, hearing_m)
            expected = [twin.columns(row, env.layout) for twin, row in zip(twins, obs, strict=True)]
            np.testing.assert_allclose(rows, expected, atol=1e-5)
            if not hearing_m:  # news travel from robot to robot, one way for each look
                again = interface.observe(obs, decision=decision)[:, columns]
                np.testing.assert_array_equal(again, rows, "looking twice changes nothing")
            columns_used += np.abs(rows).sum(axis=0)
    assert columns_used.all(), "every column is put to the test"
    interface.forget()
    assert not interface.memory().is_known.any()


def test_a_robot_remembers_where_it_picked_up_until_it_comes_back_and_finds_nothing():
    env = tidy_world(n_robots=1)
    interface = remembering(env, observation="compact")
    put(env, 0, *PLACE)
    assert not seen(interface, env, "pickup_site").any()
    load(env, 0, 0)
    np.testing.assert_allclose(seen(interface, env, "pickup_site"), [0, 0, 1, 0], atol=1e-6)
    put(env, 0, PLACE[0] - 4.0, PLACE[1], np.pi / 2)  # the place lies to the right
    np.testing.assert_allclose(seen(interface, env, "pickup_site"), [0, -1, 1, 0.2], atol=1e-6)
    env.swarm.carried_object[0] = -1
    assert seen(interface, env, "pickup_site")[2] == 1.0, "a delivery changes nothing"
    lay(env, 1, (61, 40))
    put(env, 0, *PLACE)
    assert seen(interface, env, "pickup_site")[2] == 1.0, "there is another one"
    lay(env, 1, (10, 10))
    assert seen(interface, env, "pickup_site")[2] == 0.0


def test_robots_in_earshot_hear_where_an_object_was():
    env = tidy_world(n_robots=3)
    interface = remembering(env, observation="compact", hearing_m=5.0)

    def known(decision: int) -> list[bool]:
        interface.observe(env.arena.observe(), decision=decision)
        return interface.memory().is_known[:, 0].tolist()

    for robot, metres in enumerate((0.0, 4.0, 8.5)):
        put(env, robot, PLACE[0] - metres, PLACE[1])
    assert known(1) == [False, False, False]
    load(env, 0, 0)
    assert known(2) == [True, True, False], "4.5 m from one who does not know it yet"
    assert known(3) == [True, True, True], "who tells it now"
    np.testing.assert_allclose(interface.memory().place[2], interface.memory().place[0])
    env.swarm.carried_object[0] = -1
    put(env, 0, *PLACE)
    assert known(4) == [False, True, True]
    assert known(5) == [False, True, True], "what it found empty itself counts more than older news"
    load(env, 1, 1)
    assert known(6) == [True, True, True]


def test_a_new_run_begins_without_memory_and_a_copy_has_it():
    plan = plan_arena("warehouse_small", n_robots=2, physics="compiled", interface=INTERFACE)
    arena = LearnerArena(plan)
    sites = slice(arena.interface.layout["pickup_site"].start, arena.interface.layout["sighting_site"].stop)
    arena.reset(0)
    for part, value in zip(arena.interface.translation.sites, (3.0, True, True, 2, 3.0), strict=True):
        part[...] = value
    other, shown = copy.deepcopy(arena), arena.interface.memory()
    arena.reset()
    assert not arena.observe()[:, sites].any()
    for part, kept in zip(other.interface.memory(), shown, strict=True):
        np.testing.assert_array_equal(part, kept)


def test_a_policy_sees_in_a_run_what_it_saw_in_training():
    """The same actions along the same run: arenas of learners and policies remember alike."""
    world = scenario("search_and_rescue", n_robots=8, side_m=16.0, physics="compiled", horizon_s=200.0)
    rng = np.random.default_rng(0)
    actions = np.repeat(rng.choice(6, (100, 8), p=[0, 0.6, 0.15, 0.15, 0.05, 0.05]), 2, axis=0)
    arena = LearnerArena(plan_arena(world, interface=INTERFACE))
    arena.reset(5)
    trained_on, looked_at = [], []
    for chosen in actions:
        trained_on.append(arena.observe())
        arena.step(chosen, np.zeros(8))

    def choose(rows, _rng):
        looked_at.append(rows.copy())
        return actions[len(looked_at) - 1]

    run_policy(
        LearnedPolicy(InterfaceConfig(**INTERFACE), choose),
        RunSpec(world=World(world), policy="mine", seed=5),
    )
    np.testing.assert_array_equal(looked_at, trained_on)
    assert np.array(trained_on)[..., arena.interface.layout["pickup_site"]].any()


def still(rows, _rng):
    return np.zeros(len(rows), np.int64)


def test_a_policy_with_site_memory_tells_its_places_from_the_corner_of_the_arena():
    env = tidy_world(n_robots=2)
    policy = LearnedPolicy(InterfaceConfig(**INTERFACE), still)
    policy.reset(env.swarm_spec, np.random.default_rng(0))
    put(env, 1, *PLACE)
    load(env, 1, 0)
    policy.act(env.arena.observe(), env.active)
    for asked in (policy, pickle.loads(pickle.dumps(policy))):  # noqa: S301 - what was pickled here
        told = asked.describe_memories()
        assert (told.robot.tolist(), told.is_cache.tolist()) == ([1], [False])
        np.testing.assert_allclose(told.place_m, [PLACE], atol=1e-4)
