"""HandlingCost: how long pick-ups and drops take under it, and what it records."""

import numpy as np
import pytest

from swarm_forage_env.contract.codes import Event, Grip
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.wrappers.handling import HandlingCost, HandlingCostConfig
from swarm_forage_env.wrappers.recorder import RunRecorder
from swarm_forage_env.wrappers.waveform import Waveform
from tests.support.foraging import quick_world
from tests.support.stage import NEST_CELL, OPEN_CELL, begin, lay, load, stand, tidy_world


def constant(ticks: float) -> HandlingCostConfig:
    return HandlingCostConfig(waveform=Waveform(kind="constant", amplitude=ticks))


def ticks_until(event: Event, config: HandlingCostConfig) -> int:
    """Ticks from the start of a pick-up or a delivery to its effect."""
    env = tidy_world()
    stack = HandlingCost(env, config)
    begin(stack)
    stand(env, 0, NEST_CELL if event == Event.DELIVERED else OPEN_CELL)
    if event == Event.DELIVERED:
        load(env, 0, 0)
    else:
        lay(env, 0, OPEN_CELL)
    actions = np.zeros((4, 3), np.float32)
    actions[:, 2] = Grip.RELEASE
    actions[0, 2] = Grip.DELIVER if event == Event.DELIVERED else Grip.GRASP
    while env.events.code[0] != event:
        stack.step_batch(actions)
        assert env.tick < 100
    return env.tick - 1


@pytest.mark.parametrize("event", [Event.PICKED_UP, Event.DELIVERED])
@pytest.mark.parametrize(("value", "ticks"), [(-3.0, 1), (1.99, 1), (2.0, 2), (5.7, 5)])
def test_the_integer_part_counts_and_at_least_one_tick(event, value, ticks):
    assert ticks_until(event, constant(value)) == ticks


def test_last_value_and_mean_are_recorded_and_the_mean_is_the_adversity():
    """V(t) = t for the 15 ticks of a run, in three intervals of five; a second run starts afresh."""
    ramp = HandlingCostConfig(waveform=Waveform(kind="table", times_s=(0.0, 3.0), values=(0.0, 15.0)))
    recorder = RunRecorder(ramp.wrap(tidy_world(n_robots=1, horizon_s=3.0, interval_s=1.0)))
    for seed in (0, 1):
        recorder.reset_batch(seed)
        while not recorder.complete:
            recorder.step_batch(np.zeros((1, 3), np.float32))
    contributed = recorder.contributed()
    assert contributed["handling_cost"].tolist() == pytest.approx([5.0, 10.0, 15.0])
    assert contributed["handling_cost_mean"].tolist() == pytest.approx([3.0, 8.0, 13.0])
    assert recorder.columns()["adversity"].tolist() == contributed["handling_cost_mean"].tolist()


def test_a_world_with_slow_handling_equals_the_wrapper_that_makes_it_slow():
    world = quick_world("warehouse_small", n_robots=20, horizon_s=60.0, interval_s=60.0)
    slow = with_overrides(world, pickup_ticks=7, drop_ticks=7)
    fields = run_one(plan_run(slow, "crw", seed=2))
    wrapped = run_one(plan_run(world, "crw", wrappers=(constant(7.4),), seed=2))
    assert fields["free_pickups"].sum() > 0
    for name in ("collected", "free_pickups", "interference_ticks"):
        assert fields[name].tolist() == wrapped[name].tolist()
