"""The task graph is consistent, and the numbers of both controllers are those of the study."""

import numpy as np

from baselines.stochm import STOCHMPolicy
from baselines.stochx import STOCHXPolicy
from baselines.tasks import NO_TAB, ROOTED_TAB, STOCHM_PARAMETERS, STOCHX_PARAMETERS
from swarm_forage_env.contract.codes import TAB_CHILDREN, TAB_ROOT, Tab, Task


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
