"""Task allocation: every equation by worked numbers, the procedures step by step, and the long run of both."""

import numpy as np
import pytest

from baselines import stoch_n1
from baselines.robots import Activity
from baselines.task_policy import task_constants
from baselines.tasks import STOCHM_PARAMETERS, STOCHX_PARAMETERS
from swarm_forage_env.contract.codes import Tab, Task
from swarm_forage_env.scenarios.quirks import Quirks
from tests.support.observations import make_spec

M_PARTITION = (4.0, 1.25, 1.75)
X_PARTITION = (1.0, 1.25, 1.0)


# Equations


@pytest.mark.parametrize(
    ("root", "subtasks", "stochm", "stochx"),
    [
        (3000, 2900, 0.52, 0.446),
        (3000, 6000, 0.083, 0.321),
        (3000, 2999.9, 0.471, 0.438),
        (3000, 3000, 1.0, 0.562),
        (3000, 0, 0.875, 0.5),
        (0, 3000, 0.875, 0.5),
    ],
)
def test_partition_probability_in_real_numbers(root, subtasks, stochm, stochx):
    assert stoch_n1.partition_probability(root, subtasks, *M_PARTITION, False) == pytest.approx(stochm, abs=6e-4)
    assert stoch_n1.partition_probability(root, subtasks, *X_PARTITION, False) == pytest.approx(stochx, abs=6e-4)


@pytest.mark.parametrize(
    ("root", "subtasks", "stochm", "stochx"),
    [
        (3000, 2900, 0.875, 0.5),
        (3000, 999, 1.0, 0.731),
        (1000, 3000, 0.0315, 0.269),
        (1000, 4999, 0.0006, 0.119),
        (3000, 3000, 0.875, 0.5),
    ],
)
def test_partition_probability_in_whole_numbers(root, subtasks, stochm, stochx):
    assert stoch_n1.partition_probability(root, subtasks, *M_PARTITION, True) == pytest.approx(stochm, abs=6e-4)
    assert stoch_n1.partition_probability(root, subtasks, *X_PARTITION, True) == pytest.approx(stochx, abs=6e-4)


@pytest.mark.parametrize(
    ("ratio", "stochm", "stochx"),
    [(1.0, 0.352, 0.438), (0.75, 0.328, 0.378), (0.5, 0.306, 0.321), (0.25, 0.283, 0.269)],
)
def test_switch_probability(ratio, stochm, stochx):
    assert stoch_n1.switch_probability(ratio * 2000, 2000, 0.5, 1.25, 0.75) == pytest.approx(stochm, abs=6e-4)
    assert stoch_n1.switch_probability(ratio * 2000, 2000, 1.0, 1.25, 1.0) == pytest.approx(stochx, abs=6e-4)


@pytest.mark.parametrize(("ratio", "expected"), [(1, 0.0002), (2, 0.009), (3, 0.25), (4, 0.491)])
def test_move_probability_by_ratio_of_imbalances(ratio, expected):
    # Imbalances of ratio / 10 and 1 / 10 of a root of 1000 ticks.
    p = stoch_n1.move_probability(1000, 1000 + 100 * ratio, 1000, 900, 4.0, 3.0, 0.5, False)
    assert p == pytest.approx(expected, abs=6e-4)
    unknown = stoch_n1.move_probability(0, 100 * ratio, 0, 100, 4.0, 3.0, 0.5, False)
    assert unknown == pytest.approx(expected, abs=6e-4), "without estimates of roots, by those of subtasks"


@pytest.mark.parametrize("blocks", [(0, 300, 1000, 900), (1000, 900, 0, 300), (1000, 1000, 1000, 900)])
def test_a_balanced_or_unknown_block_is_left_or_entered_by_a_coin(blocks):
    assert stoch_n1.move_probability(*blocks, 4.0, 3.0, 0.5, False) == 0.5


@pytest.mark.parametrize(
    ("ratio", "expected"),
    [
        (0, 6.1e-06),
        (2.5, 0.12),
        (3, 0.5),
        (3.5, 0.12),
        (5, 0.00034),
    ],
)
def test_abort_probability_is_a_bump(ratio, expected):
    assert stoch_n1.abort_probability(1000 * ratio, 1000, 4.0, 3.0, 1.0, 1e-4) == pytest.approx(expected, rel=0.02)


def test_moving_average():
    assert stoch_n1.new_estimate(1500, 2001, 0.5, True) == 1750
    assert stoch_n1.new_estimate(1500, 2001, 0.5, False) == 1750.5


# Procedures


def test_first_block_estimates_and_coins():
    n = 4000
    a = stoch_n1.new_allocation(n, STOCHX_PARAMETERS, Quirks(), 3, np.random.default_rng(3))
    assert (a.task == Task.NONE).all()
    assert np.mean(a.tab == Tab.HARVESTER) == pytest.approx(0.5, abs=0.04)
    assert np.mean(a.tab == Tab.COLLECTOR) == pytest.approx(0.5, abs=0.04)
    assert np.mean(a.last_child, axis=0) == pytest.approx([0.5] * 3, abs=0.04)
    np.testing.assert_array_equal(a.last_child[:, Tab.HARVESTER], a.last_child[:, Tab.COLLECTOR])
    whole = a.estimate[:, 1:]
    np.testing.assert_array_equal(whole, np.floor(whole))
    assert (whole.min(axis=0) >= [2000] + [1000] * 6).all()
    assert (whole.max(axis=0) <= [4000] + [2000] * 6).all()
    assert whole.mean(axis=0) == pytest.approx([3000] + [1500] * 6, rel=0.02)
    m = stoch_n1.new_allocation(n, STOCHM_PARAMETERS, Quirks(), 1, np.random.default_rng(3))
    assert (m.tab == Tab.GENERALIST).all()


def test_quirk_transferer_interface_is_entered_with_the_transport_and_never_left():
    spec = make_spec(quirks=Quirks(transferer_interface_never_leaves=True))
    constants = task_constants(STOCHX_PARAMETERS, spec, 3)[0]
    has_interface, seen = False, []
    for activity in (Activity.ACQUIRE, Activity.WAIT_PICKUP, Activity.TRANSPORT, Activity.WAIT_DROP, Activity.ACQUIRE):
        has_interface = stoch_n1.interface_after(has_interface, Task.TRANSFERER, activity, constants)
        seen.append(has_interface)
    assert seen == [False, False, True, True, True]
    assert not stoch_n1.interface_after(True, Task.HARVESTER, Activity.WAIT_DROP, constants)
