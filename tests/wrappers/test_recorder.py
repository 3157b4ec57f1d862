"""RunRecorder: intervals as differences of counters."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm_forage_env.contract.codes import Task
from swarm_forage_env.world.kernels.counting import add_task_shares
from swarm_forage_env.wrappers.base import SwarmWrapper
from swarm_forage_env.wrappers.recorder import COUNTED, RunRecorder
from tests.reference.task_shares import task_shares
from tests.support.fake_arena import FakeArena, small_scenario

STILL = np.zeros((4, 3), np.float32)


def drive(recorder: RunRecorder, ticks: int = 15, tasks=None) -> RunRecorder:
    recorder.reset_batch(0)
    for _ in range(ticks):
        recorder.step_batch(STILL, tasks=tasks)
    return recorder


def told(recorder: RunRecorder) -> dict[str, np.ndarray]:
    """What not every record has, without counters of the world."""
    return {name: values for name, values in recorder.contributed().items() if name not in COUNTED}


class Contributor(SwarmWrapper):
    """Contributes the tick at the end of each interval."""

    stack_position = 3

    def interval_columns(self):
        return {"throttle": float(self.unwrapped.tick), "throttle_mean": self.unwrapped.tick / 2}


def test_totals_are_differences_and_means_are_over_ticks():
    columns = drive(RunRecorder(FakeArena())).columns()
    assert columns["collected"].tolist() == [1 + 2 + 3 + 4 + 5, 6 + 7 + 8 + 9 + 10, 11 + 12 + 13 + 14 + 15]
    assert columns["performance"].tolist() == [15.0, 40.0, 65.0]
    assert columns["objects_moved"].tolist() == [5, 5, 5]
    assert columns["interference_ticks"].tolist() == [5, 5, 5]
    assert columns["n_active"].tolist() == columns["n_present"].tolist() == [4.0, 4.0, 4.0]
    np.testing.assert_allclose(columns["interference_fraction"], 0.25)
    assert columns["interval"].tolist() == [0, 1, 2]
    np.testing.assert_allclose(columns["t_end_s"], [1.0, 2.0, 3.0])
    assert columns["adversity"].tolist() == [0.0, 0.0, 0.0]


def test_performance_may_be_any_column_and_what_is_computed_from_them():
    def performance(name, recorder=RunRecorder, **run):
        return drive(recorder(FakeArena(small_scenario(performance=name))), **run).columns()["performance"].tolist()

    assert performance("n_active") == [4.0, 4.0, 4.0]
    assert performance("1/interference_ticks") == [0.2, 0.2, 0.2]
    assert performance("throttle", lambda arena: RunRecorder(Contributor(arena))) == [5.0, 10.0, 15.0]
    assert performance("throttle") == [0.0, 0.0, 0.0]
    halves = performance("task_balance", tasks=np.array([1, 1, 2, 2], np.int8))
    np.testing.assert_allclose(halves, np.log(2) / np.log(7))


def test_robots_that_are_away_lower_the_mean():
    recorder = RunRecorder(FakeArena())
    recorder.reset_batch(0)
    for tick in range(15):
        if tick == 8:
            recorder.unwrapped.set_population(
                active=np.array([True, True, False, False]), present=np.array([True, True, True, False])
            )
        recorder.step_batch(STILL)
    assert recorder.columns()["n_active"].tolist() == [4.0, (3 * 4 + 2 * 2) / 5, 2.0]
    assert recorder.columns()["n_present"].tolist() == [4.0, (3 * 4 + 2 * 3) / 5, 3.0]


@pytest.mark.parametrize("further_ticks", [0, 8])
def test_after_the_last_death_the_rest_is_zero_even_if_the_world_is_stepped_on(further_ticks):
    world = FakeArena(dies_at=7)
    recorder = drive(RunRecorder(Contributor(world)), ticks=7 + further_ticks)
    assert recorder.complete
    columns = recorder.columns()
    assert columns["collected"].tolist() == [15, 6 + 7, 0]
    assert columns["n_active"].tolist() == [4.0, 2 * 4 / 5, 0.0]
    np.testing.assert_allclose(columns["interference_fraction"], [0.25, 2 * 0.25 / 5, 0.0])
    np.testing.assert_allclose(columns["t_end_s"], [1.0, 2.0, 3.0])
    assert recorder.contributed()["throttle"].tolist() == [5.0, 7.0, 0.0]


def test_task_shares_are_means_over_ticks_of_active_robots():
    recorder = RunRecorder(FakeArena())
    recorder.reset_batch(0)
    tasks = np.array([Task.HARVESTER, Task.HARVESTER, Task.COLLECTOR, Task.GENERALIST], np.int8)
    for tick in range(15):
        if tick == 5:
            recorder.unwrapped.set_population(active=np.array([True, False, True, False]), present=np.ones(4, np.bool_))
        recorder.step_batch(STILL, tasks=tasks)
    shares = told(recorder)
    assert set(shares) == {f"task_share_{task.name.lower()}" for task in Task}
    np.testing.assert_allclose(shares["task_share_harvester"], [0.5, 0.5, 0.5])
    np.testing.assert_allclose(shares["task_share_collector"], [0.25, 0.5, 0.5])
    np.testing.assert_allclose(shares["task_share_generalist"], [0.25, 0.0, 0.0])
    np.testing.assert_allclose(shares["task_share_none"], 0.0)


@given(st.lists(st.tuples(st.integers(0, 7), st.booleans()), min_size=1, max_size=30))
def test_task_share_kernel_agrees_with_its_twin(robots):
    tasks = np.array([code for code, _ in robots], np.int8)
    active = np.array([at_work for _, at_work in robots])
    shares = np.zeros(8)
    assert add_task_shares(tasks, active, shares)
    np.testing.assert_allclose(shares, task_shares(tasks, active, 8))
