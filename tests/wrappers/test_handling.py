"""HandlingCost: how long pick-ups and drops take under it, and what it records."""

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import Event, Grip
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.wrappers.handling import HandlingCost, HandlingCostConfig
from swarm_forage_env.wrappers.recorder import RunRecorder
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.throttle import ThrottleConfig
from swarm_forage_env.wrappers.waveform import Waveform
from tests.support.foraging import quick_world
from tests.support.stage import NEST_CELL, OPEN_CELL, begin, lay, load, stand, tidy_world


def cost(values: tuple[float, ...]) -> HandlingCostConfig:
    """V(t) = `values` at the ticks 1, 2, ... and the last of them from then on."""
    times = tuple(0.2 * tick for tick in range(1, len(values) + 1))
    return HandlingCostConfig(waveform=Waveform(kind="table", times_s=times, values=values))


def constant(ticks: float) -> HandlingCostConfig:
    return HandlingCostConfig(waveform=Waveform(kind="constant", amplitude=ticks))


def ticks_until(event: Event, config: HandlingCostConfig, *, ask_from: int = 1, **options: int) -> int:
    """Ticks from the start of a pick-up or a delivery to its effect, when the robot first asks in tick `ask_from`."""
    env = tidy_world(**options)
    stack = HandlingCost(env, config)
    begin(stack)
    stand(env, 0, NEST_CELL if event == Event.DELIVERED else OPEN_CELL)
    if event == Event.DELIVERED:
        load(env, 0, 0)
    else:
        lay(env, 0, OPEN_CELL)
    asks, waits = (Grip.DELIVER, Grip.GRASP) if event == Event.DELIVERED else (Grip.GRASP, Grip.RELEASE)
    actions = np.zeros((4, 3), np.float32)
    actions[:, 2] = Grip.RELEASE
    while env.events.code[0] != event:
        actions[0, 2] = asks if env.tick + 1 >= ask_from else waits
        stack.step_batch(actions)
        assert env.tick < 100
    return env.tick - ask_from


@pytest.mark.parametrize("event", [Event.PICKED_UP, Event.DELIVERED])
@pytest.mark.parametrize(
    ("value", "ticks"), [(-3.0, 1), (0.0, 1), (0.9, 1), (1.0, 1), (1.99, 1), (2.0, 2), (5.7, 5), (20.0, 20)]
)
def test_the_integer_part_counts_and_at_least_one_tick(event, value, ticks):
    assert ticks_until(event, constant(value)) == ticks


def test_the_waveform_at_the_start_counts_not_later_values():
    # V = 2, 6, 3, 1, 1, ... at the ticks 1, 2, 3, 4, 5, ...
    config = cost((2.0, 6.0, 3.0, 1.0))
    assert [ticks_until(Event.PICKED_UP, config, ask_from=tick) for tick in (1, 2, 3, 4, 5)] == [2, 6, 3, 1, 1]


def test_nothing_gets_faster_than_the_scenario_says():
    slow = {"pickup_ticks": 5, "drop_ticks": 3}
    assert ticks_until(Event.PICKED_UP, constant(4.0), **slow) == 5
    assert ticks_until(Event.DELIVERED, constant(4.0), **slow) == 4


def recorded(*configs, **options: int) -> RunRecorder:
    env = tidy_world(n_robots=1, horizon_s=3.0, interval_s=1.0, **options)
    stack = env
    for config in configs:
        stack = config.wrap(stack)
    recorder = RunRecorder(stack)
    for seed in (0, 1):  # a second run starts afresh
        recorder.reset_batch(seed)
        while not recorder.complete:
            recorder.step_batch(np.zeros((1, 3), np.float32))
    return recorder


RAMP = HandlingCostConfig(waveform=Waveform(kind="table", times_s=(0.0, 3.0), values=(0.0, 15.0)))
"""V(t) = t for the 15 ticks of the recorded run, in three intervals of five."""


def test_last_value_and_mean_are_recorded_and_the_mean_is_the_adversity():
    recorder = recorded(RAMP)
    contributed = recorder.contributed()
    assert contributed["handling_cost"].tolist() == pytest.approx([5.0, 10.0, 15.0])
    assert contributed["handling_cost_mean"].tolist() == pytest.approx([3.0, 8.0, 13.0])
    assert recorder.columns()["adversity"].tolist() == contributed["handling_cost_mean"].tolist()


def test_the_integer_part_is_recorded_and_at_least_one_tick():
    half = HandlingCostConfig(waveform=Waveform(kind="table", times_s=(0.0, 3.0), values=(0.0, 7.5)))
    # V = 0.5, 1, 1.5, ..., 7.5 takes 1, 1, 1, 2, 2 | 3, 3, 4, 4, 5 | 5, 6, 6, 7, 7 ticks.
    contributed = recorded(half).contributed()
    assert contributed["handling_cost"].tolist() == [2.0, 5.0, 7.0]
    assert contributed["handling_cost_mean"].tolist() == pytest.approx([1.4, 3.8, 6.2])


@pytest.mark.parametrize(
    ("options", "last", "mean"),
    [
        ({"pickup_ticks": 10, "drop_ticks": 10}, [10.0, 10.0, 15.0], [10.0, 10.0, 13.0]),
        # A pick-up takes 10, 10, 10, 10, 10, a drop 1, 2, 3, 4, 5 ticks: 6.5 on average, 7.5 at last.
        ({"pickup_ticks": 10}, [7.5, 10.0, 15.0], [6.5, 9.0, 13.0]),
    ],
)
def test_what_the_scenario_takes_by_itself_is_recorded(options, last, mean):
    contributed = recorded(RAMP, **options).contributed()
    assert contributed["handling_cost"].tolist() == last
    assert contributed["handling_cost_mean"].tolist() == pytest.approx(mean)


def test_under_a_throttle_as_well_the_adversity_is_the_throttle():
    throttle = ThrottleConfig(waveform=Waveform(kind="constant", amplitude=0.25))
    recorder = recorded(RAMP, throttle)
    assert recorder.columns()["adversity"].tolist() == [0.25] * 3
    assert recorder.contributed()["handling_cost_mean"].tolist() == pytest.approx([3.0, 8.0, 13.0])


@pytest.mark.compiled
@pytest.mark.parametrize("policy", ["crw", "dpo", "stochm", "ppo_warehouse_small"])
def test_policies_wait_and_deliver_less(policy):
    """Pick-ups and drops of 20 s each: policies send their band until the event comes.

    STOCHX is left out: it delivers nothing within these 180 s, with or without a cost.
    """
    world = quick_world("warehouse_small", interval_s=60.0)
    word = "handling_cost:waveform=constant,amplitude=100"
    easy, hard = (
        run_one(plan_run(world, policy, caches="none", wrappers=wrappers, seed=3))
        for wrappers in ((), (parse_wrapper(word),))
    )
    assert hard.free_pickups.sum() > 0
    assert 0 < hard.collected.sum() < easy.collected.sum()


@pytest.mark.compiled
def test_a_world_with_slow_handling_equals_the_wrapper_that_makes_it_slow():
    world = quick_world("warehouse_small", n_robots=20, horizon_s=60.0, interval_s=60.0)
    slow = with_overrides(world, pickup_ticks=7, drop_ticks=7)
    fields = run_one(plan_run(slow, "crw", seed=2))
    wrapped = run_one(plan_run(world, "crw", wrappers=(constant(7.4),), seed=2))
    assert fields.free_pickups.sum() > 0
    for name in ("collected", "free_pickups", "interference_ticks"):
        assert getattr(fields, name).tolist() == getattr(wrapped, name).tolist()


@pytest.mark.parametrize(
    ("waveform", "message"),
    [
        (30, "handling_cost.waveform to be a Waveform, got 30; for example Waveform.kind='constant'"),
        (Waveform(kind="constant", amplitude=2e6), "at most 1,000,000 ticks, got a waveform that reaches 2e.06"),
    ],
)
def test_nonsense_is_refused(waveform, message):
    with pytest.raises(ConfigError, match=message):
        HandlingCostConfig(waveform=waveform)


def test_it_is_named_on_a_command_line():
    word = "handling_cost:waveform=square,amplitude=8,offset=9,period_s=5000"
    expected = Waveform(kind="square", amplitude=8, offset=9, period_s=5000)
    assert parse_wrapper(word) == HandlingCostConfig(waveform=expected)
