"""The task graph is consistent, and the numbers of both controllers are those of the study."""

import numpy as np
import pytest

from baselines.parameters import ParameterError
from baselines.stochm import STOCHMPolicy
from baselines.stochx import STOCHXPolicy
from baselines.tasks import DROP_GRIP, NO_TAB, ROOTED_TAB, STOCHM_PARAMETERS, STOCHX_PARAMETERS
from swarm_forage_env.contract.codes import DESTINATION, SOURCE, TAB_CHILDREN, TAB_ROOT, Goal, Grip, Tab, Task


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


@pytest.mark.parametrize("tab", list(Tab))
def test_both_subtasks_together_do_the_work_of_their_root(tab):
    first, second = TAB_CHILDREN[tab]
    assert SOURCE[first] == SOURCE[TAB_ROOT[tab]]
    assert DESTINATION[second] == DESTINATION[TAB_ROOT[tab]] or tab is Tab.HARVESTER
    assert DESTINATION[first] in (Goal.CACHE, Goal.SITE)


def test_only_tasks_that_make_caches_lay_objects_on_the_floor():
    laying = {Task(code) for code in np.flatnonzero(np.float32(Grip.DELIVER) != DROP_GRIP)}
    assert laying == {Task.STARTER, Task.FINISHER}
    assert DROP_GRIP[Task.STARTER] == np.float32(Grip.SITE)
    assert DROP_GRIP[Task.FINISHER] == np.float32(Grip.CREATE_CACHE)


def test_numbers_that_the_two_controllers_do_not_share():
    names = ("partition_reactivity", "partition_gamma", "subtask_reactivity", "subtask_gamma", "smallest_cache")
    assert [getattr(STOCHM_PARAMETERS, name) for name in names] == [4.0, 1.75, 0.5, 0.75, 0.0]
    assert [getattr(STOCHX_PARAMETERS, name) for name in names] == [1.0, 1.0, 1.0, 1.0, 3.0]
    assert STOCHMPolicy().parameters == STOCHM_PARAMETERS
    assert STOCHXPolicy().parameters == STOCHX_PARAMETERS
    assert STOCHXPolicy(estimate_weight=0.25).parameters.estimate_weight == 0.25


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"estimate_weight": 1.5}, "estimate_weight"),
        ({"least_abort_probability": 2.0}, "least_abort_probability"),
        ({"generalist_estimate_low_ticks": 5000.0}, "generalist_estimate_low_ticks"),
        ({"subtask_estimate_low_ticks": 1000.2, "subtask_estimate_high_ticks": 1000.8}, "whole number"),
        ({"site_offset_low_m": 0.6}, "site_offset_low_m"),
        ({"evaporation_per_tick": 1.0}, "evaporation_per_tick"),
        ({"tab_gamma": -0.1}, "tab_gamma"),
        ({"tab_gama": 0.1}, "Did you mean 'tab_gamma'"),
    ],
)
def test_values_that_make_no_sense_are_refused(values, complaint):
    with pytest.raises(ParameterError, match=complaint):
        STOCHXPolicy(**values)
