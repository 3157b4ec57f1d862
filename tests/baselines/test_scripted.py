"""Scripted controllers: copies in the middle of a run, arrays of any layout, worked numbers, parameters."""

import copy
import dataclasses
import pickle

import numpy as np
import pytest
from scipy import stats

from baselines.cpfa import CPFAPolicy, poisson_cdf
from baselines.crw import CRWPolicy
from baselines.dpo import DPOPolicy
from baselines.object_choice import MemoryParameters, object_utility
from baselines.parameters import ParameterError, kernel_constants
from baselines.robots import Activity
from baselines.stochm import STOCHMPolicy
from baselines.stochx import STOCHXPolicy
from baselines.tasks import NO_TAB, ROOTED_TAB, STOCHM_PARAMETERS, STOCHX_PARAMETERS
from swarm_forage_env.contract.codes import TAB_CHILDREN, TAB_ROOT, Tab, Task
from swarm_forage_env.scenarios.quirks import Quirks
from tests.support.observations import Observations, make_spec
from tests.support.stage import OPEN_CELL, load, stand, tidy_world
from tests.support.task_robot import TaskRobot

N_ROBOTS = 5
each_policy = pytest.mark.parametrize("policy_class", [CRWPolicy, DPOPolicy, CPFAPolicy, STOCHMPolicy, STOCHXPolicy])


def started(policy_class):
    """A policy in the middle of a run, and observations in which robots carry, avoid and remember."""
    spec = make_spec(N_ROBOTS, caches="dynamic")
    seen = Observations(spec)
    seen.obstacle(0.5, 1)
    seen.carry(3, 2)
    seen.window({(1, 1): 7}, 3)
    policy = policy_class()
    policy.reset(spec, np.random.default_rng(1))
    for _ in range(40):
        policy.act(seen.array, np.ones(N_ROBOTS, np.bool_))
    return policy, seen.array


@each_policy
def test_a_copy_continues_as_the_original_does_in_whatever_layout(policy_class):
    """A pickle takes no compiled function along: another process would compile a copy of it anew, for a minute."""
    policy, obs = started(policy_class)
    assert b"numba" not in pickle.dumps(policy)
    copies = copy.deepcopy(policy), pickle.loads(pickle.dumps(policy))  # noqa: S301 - made here
    wide = np.full((2 * N_ROBOTS, 2 * obs.shape[1]), np.nan, np.float32)
    wide[::2, ::2] = obs
    shown, active = (wide[::2, ::2], np.asfortranarray(obs)), np.array([True, False, True, True, True])
    expected = [policy.act(obs, active).copy() for _ in range(80)]
    for twin, rows in zip(copies, shown, strict=True):
        np.testing.assert_array_equal([twin.act(rows, active).copy() for _ in range(80)], expected)
        np.testing.assert_array_equal(twin.activity, policy.activity)
    assert len({actions.tobytes() for actions in expected}) > 1, "they do something"


@each_policy
def test_a_robot_keeps_its_cargo_when_it_comes_back_to_work(policy_class):
    """It does so in a step that policies do not foresee: for them the robot is still in repair."""
    env = tidy_world(caches=policy_class.caches)
    policy, at_work = policy_class(), np.ones(4, np.bool_)
    policy.reset(env.swarm_spec, np.random.default_rng(0))
    for robot in range(3):
        load(env, robot, robot)
        stand(env, robot, (OPEN_CELL[0] + 4 * robot, OPEN_CELL[1]))
    actions = policy.act(env.arena.observe(), at_work & False)
    env.step_batch(actions)
    assert env.swarm.carried_object.tolist() == [0, 1, 2, -1]
    assert not env.swarm.wheel_speed.any()


# Worked numbers


def utility(anchor_x: float, pheromone: float = 1.0) -> float:
    parameters = MemoryParameters()
    c = kernel_constants(parameters, make_spec(), **parameters.derived())[0]
    return object_utility(anchor_x, 8.0, 24.0, 8.0, pheromone, c)


def test_utility_of_the_worked_example():
    assert utility(25.0) == pytest.approx(59.26, abs=0.005)
    assert utility(26.0) == pytest.approx(30.99, abs=0.005)


def test_starting_within_tolerance_is_an_arrival_unless_the_quirk_is_on():
    for quirk, activity in ((False, Activity.WAIT_PICKUP), (True, Activity.ACQUIRE)):
        quirks = Quirks(finisher_tolerance_mismatch=quirk)
        robot = TaskRobot(DPOPolicy(object_tolerance_m=0.5), quirks=quirks)
        robot.seen.window({(2, 0): 7})
        robot.seen.ground("object")
        robot.act()
        assert robot.activity is activity


@pytest.mark.parametrize("rate", [0.0, 4.0, 20.0])
def test_the_poisson_distribution_is_that_of_scipy(rate):
    for count in range(25):
        assert poisson_cdf(count, rate) == pytest.approx(stats.poisson.cdf(count, rate), rel=1e-12)


# Parameters


def test_parameters_that_make_no_sense_are_refused():
    with pytest.raises(ParameterError, match="Did you mean 'wander_speed_mps'"):
        CRWPolicy(wander_speed=0.1)
    for field in dataclasses.fields(MemoryParameters):
        if not isinstance(field.default, bool):
            for value in (-1.0, float("nan"), float("inf"), True, "1"):
                with pytest.raises(ParameterError, match=field.name):
                    MemoryParameters(**{field.name: value})
    with pytest.raises(ParameterError, match="otherwise the robot would wander backwards"):
        MemoryParameters(wander_circle_radius=4.0, wander_circle_distance=4.0)
    for policy_class, given, message in (
        (CRWPolicy, {"wander_speed_mps": 0.1}, "to be ControllerParameters, got dict; give single numbers by name"),
        (STOCHXPolicy, MemoryParameters(), "to be TaskParameters, got MemoryParameters"),
    ):
        with pytest.raises(ParameterError, match=message):
            policy_class(given)


@each_policy
def test_observations_of_another_swarm_are_refused(policy_class):
    policy = policy_class()
    policy.reset(make_spec(4), np.random.default_rng(0))
    size = policy._spec.layout.size
    for rows, columns, n_active in ((3, size, 3), (4, 10, 4), (4, size, 5)):
        told = rf"\(\(4, {size}\), \(4,\)\), got \(\({rows}, {columns}\), \({n_active},\)\); call reset"
        with pytest.raises(ValueError, match=told):
            policy.act(np.zeros((rows, columns), np.float32), np.ones(n_active, np.bool_))


def test_every_task_but_the_root_is_a_subtask_once():
    children = TAB_CHILDREN.ravel().tolist()
    assert sorted(children) == sorted(set(Task) - {Task.NONE, Task.GENERALIST})
    for tab in Tab:
        assert ROOTED_TAB[TAB_ROOT[tab]] == tab
    assert [Task(code) for code in np.flatnonzero(ROOTED_TAB != NO_TAB)] == [
        Task.GENERALIST,
        Task.HARVESTER,
        Task.COLLECTOR,
    ]


def test_numbers_that_the_two_controllers_do_not_share():
    names = ("partition_reactivity", "partition_gamma", "subtask_reactivity", "subtask_gamma", "smallest_cache")
    assert [getattr(STOCHM_PARAMETERS, name) for name in names] == [4.0, 1.75, 0.5, 0.75, 0.0]
    assert [getattr(STOCHX_PARAMETERS, name) for name in names] == [1.0, 1.0, 1.0, 1.0, 3.0]
    assert STOCHMPolicy().parameters == STOCHM_PARAMETERS
    assert STOCHXPolicy().parameters == STOCHX_PARAMETERS
    assert STOCHXPolicy(estimate_weight=0.25).parameters.estimate_weight == 0.25


@pytest.mark.parametrize("policy_class", [CRWPolicy, CPFAPolicy])
@pytest.mark.parametrize("max_speed_mps", [0.05, 0.2])
def test_speeds_are_shares_of_the_robots_own(policy_class, max_speed_mps):
    policy = policy_class()
    policy.reset(dataclasses.replace(make_spec(4), max_speed_mps=max_speed_mps), np.random.default_rng(0))
    constants = policy._constants[0]
    assert constants.wander_speed_mps == 0.09 * (max_speed_mps / 0.1)
    assert constants.wander_wheel_share == constants.wander_speed_mps / 0.2
    assert constants.slowing_radius_m == 0.2
