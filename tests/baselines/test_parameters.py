"""Controller parameters refuse nonsense and reach the policies by name."""

import dataclasses

import numpy as np
import pytest

from baselines.cpfa import CPFAPolicy
from baselines.crw import CRWPolicy
from baselines.dpo import DPOPolicy
from baselines.object_choice import MemoryParameters
from baselines.parameters import ControllerParameters, ParameterError
from baselines.stochm import STOCHMPolicy
from baselines.stochx import STOCHXPolicy
from baselines.tasks import NO_TAB, ROOTED_TAB, STOCHM_PARAMETERS, STOCHX_PARAMETERS
from swarm_forage_env.contract.codes import TAB_CHILDREN, TAB_ROOT, Tab, Task
from swarm_forage_env.contract.kernel_policy import ObservationError
from tests.support.observations import make_spec


def test_unknown_parameter_names_the_nearest_one():
    with pytest.raises(ParameterError, match="Did you mean 'wander_speed_mps'"):
        CRWPolicy(wander_speed=0.1)


NUMBERS = [field.name for field in dataclasses.fields(MemoryParameters) if not isinstance(field.default, bool)]


@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf"), True, "1"])
def test_every_parameter_must_be_a_finite_number_from_zero(value):
    for field in NUMBERS:
        with pytest.raises(ParameterError, match=field):
            MemoryParameters(**{field: value})


@pytest.mark.parametrize("policy_class", [CRWPolicy, DPOPolicy, CPFAPolicy, STOCHMPolicy, STOCHXPolicy])
def test_observations_of_another_swarm_are_refused(policy_class):
    policy = policy_class()
    policy.reset(make_spec(4), np.random.default_rng(0))
    for rows, columns in ((3, policy._spec.layout.size), (4, 10)):
        with pytest.raises(ObservationError, match=rf"\(n_robots, columns\) = \(4, .*got \({rows}, {columns}\)"):
            policy.act(np.zeros((rows, columns), np.float32), np.ones(rows, np.bool_))
    with pytest.raises(ObservationError, match=r"active with shape \(n_robots,\) = \(4,\), got \(5,\)"):
        policy.act(np.zeros((4, policy._spec.layout.size), np.float32), np.ones(5, np.bool_))


@pytest.mark.parametrize(
    ("policy_class", "parameters", "message"),
    [
        (CRWPolicy, {"wander_speed_mps": 0.1}, "to be ControllerParameters, got dict; give single numbers by name"),
        (DPOPolicy, ControllerParameters(), "to be MemoryParameters, got ControllerParameters"),
        (CPFAPolicy, MemoryParameters(), "to be CPFAParameters, got MemoryParameters"),
        (STOCHXPolicy, MemoryParameters(), "to be TaskParameters, got MemoryParameters"),
    ],
)
def test_parameters_of_another_controller_are_refused(policy_class, parameters, message):
    with pytest.raises(ParameterError, match=message):
        policy_class(parameters)


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
@pytest.mark.parametrize("max_speed_mps", [0.05, 0.1, 0.2])
def test_speeds_are_shares_of_the_robots_own(policy_class, max_speed_mps):
    policy = policy_class()
    policy.reset(dataclasses.replace(make_spec(4), max_speed_mps=max_speed_mps), np.random.default_rng(0))
    constants = policy._constants[0]
    assert constants.wander_speed_mps == 0.09 * (max_speed_mps / 0.1)
    assert constants.wander_wheel_share == constants.wander_speed_mps / 0.2
    assert constants.slowing_radius_m == 0.2
