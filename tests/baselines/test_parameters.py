"""Controller parameters refuse nonsense and reach the policies by name."""

import dataclasses

import numpy as np
import pytest

from baselines.cpfa import CPFAPolicy
from baselines.crw import CRWPolicy
from baselines.dpo import DPOPolicy
from baselines.object_choice import MemoryParameters
from baselines.parameters import ControllerParameters, ParameterError, kernel_constants
from baselines.stochm import STOCHMPolicy
from baselines.stochx import STOCHXPolicy
from swarm_forage_env.contract.kernel_policy import ObservationError
from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.scenarios.quirks import Quirks
from tests.support.observations import make_spec


@pytest.mark.parametrize("name", ["crw", "dpo"])
def test_controllers_are_found_by_name(name):
    policy = load_policy(name, {"wander_speed_mps": 0.07})
    assert isinstance(policy, Policy)
    assert isinstance(policy, CRWPolicy | DPOPolicy)
    assert policy.parameters.wander_speed_mps == 0.07


def test_overrides_build_on_given_parameters():
    policy = DPOPolicy(MemoryParameters(object_priority=2.0), evaporation_per_tick=0.1)
    assert policy.parameters == MemoryParameters(object_priority=2.0, evaporation_per_tick=0.1)


def test_unknown_parameter_names_the_nearest_one():
    with pytest.raises(ParameterError, match="Did you mean 'wander_speed_mps'"):
        CRWPolicy(wander_speed=0.1)


NUMBERS = [field.name for field in dataclasses.fields(MemoryParameters) if not isinstance(field.default, bool)]


@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf"), True, "1"])
def test_every_parameter_must_be_a_finite_number_from_zero(value):
    for field in NUMBERS:
        with pytest.raises(ParameterError, match=field):
            MemoryParameters(**{field: value})


def test_durations_become_ticks_and_quirks_reach_the_kernels():
    constants = kernel_constants(ControllerParameters(), make_spec(dt_s=0.1))[0]
    assert (constants.exploration_lock_ticks, constants.recovery_ticks) == (100, 20)
    assert constants.explore_double_start == 0
    task = make_spec(quirks=Quirks(explore_double_start=True))
    assert kernel_constants(ControllerParameters(), task)[0].explore_double_start == 1


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
