"""Population dynamics: the event clock, the four processes, robots that are dead, in repair or not yet born."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import Grip, ObjectStatus
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.layer import at_rest
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.views.gymnasium import JointForageEnv
from swarm_forage_env.wrappers.population import PopulationConfig, PopulationDynamics, malfunction_levels
from swarm_forage_env.wrappers.population_process import (
    EventClocks,
    EventRates,
    EventTally,
    PopulationState,
    advance_population,
)
from swarm_forage_env.wrappers.recorder import RunRecorder
from tests.reference.adversity import SlowPopulation
from tests.support.engines import in_each_engine
from tests.support.stage import assert_same_world, begin, load, put, snapshot, stand, tidy_world


def simulate_population(
    rates: EventRates, n_robots: int, ticks: int, seed: int, initial_robots: int | None = None
) -> tuple[np.ndarray, EventTally]:
    """Robots at work in each tick of a run with this seed in which births always have room, and its totals."""
    state = PopulationState.start(n_robots, initial_robots=initial_robots, max_robots=None)
    clocks, n_active, tick = EventClocks(rates, seed), np.zeros(ticks, np.int32), 1
    while tick <= ticks:
        advance_population(state, clocks, tick)
        following = int(min(max(clocks.next_tick, tick + 1), ticks + 1))
        n_active[tick - 1 : following - 1] = np.count_nonzero(state.active)  # nothing changes until the next event
        tick = following
    return n_active, state.tally


def due(state_ticks: dict[str, float]) -> EventClocks:
    """Clocks whose next events are set by hand; later ones are far away."""
    clocks = EventClocks(EventRates(death=1e-9, birth=1e-9, malfunction=1e-9, repair=1e-9), seed=0)
    for name in ("death", "birth", "malfunction", "repair"):
        getattr(clocks, name).next_tick = state_ticks.get(name, np.inf)
    return clocks


# The four processes


def test_stays_and_absences_are_measured_in_ticks():
    state, clocks = PopulationState.start(1), due({"malfunction": 11})
    advance_population(state, clocks, 11)
    assert (state.tally.stays, state.tally.stay_ticks) == (1, 10), "at work in the ticks 1 to 10"
    clocks.malfunction.next_tick, clocks.repair.next_tick = np.inf, 15
    advance_population(state, clocks, 15)
    assert (state.tally.repairs, state.tally.absence_ticks) == (1, 4), "away in the ticks 11 to 14"
    clocks.death.next_tick = 20
    advance_population(state, clocks, 20)
    assert (state.tally.stays, state.tally.stay_ticks, state.tally.deaths) == (2, 15, 1)


@given(
    seed=st.integers(0, 2**32),
    death=st.sampled_from([0.0, 0.01, 0.2]),
    birth=st.sampled_from([0.0, 0.05]),
    malfunction=st.sampled_from([0.0, 0.1, 3.0]),
    repair=st.sampled_from([0.0, 0.1, 3.0]),
    initial=st.integers(1, 8),
    most=st.integers(1, 8),
)
def test_equals_the_slow_twin_in_every_tick(seed, death, birth, malfunction, repair, initial, most):
    rates = EventRates(death=death, birth=birth, malfunction=malfunction, repair=repair)
    fast = PopulationState.start(8, initial_robots=initial, max_robots=most)
    clocks = EventClocks(rates, seed)
    slow = SlowPopulation(rates, 8, seed, initial=initial, most=most)
    for tick in range(1, 81):
        before = (fast.present.copy(), fast.active.copy())
        changed = advance_population(fast, clocks, tick)
        slow.tick(tick)
        assert fast.repair_queue == list(slow.in_repair)
        assert set(np.flatnonzero(fast.active)) == slow.at_work
        assert set(np.flatnonzero(fast.dead)) == slow.dead
        np.testing.assert_array_equal(fast.present, ~fast.dead & (np.arange(8) < fast.born))
        assert changed or np.array_equal(before, (fast.present, fast.active))


# Other rates during a run

PROCESSES = ("death", "birth", "malfunction", "repair")


@pytest.mark.parametrize("changed", PROCESSES)
def test_a_process_that_keeps_its_rate_keeps_its_clock(changed):
    rates = dict.fromkeys(PROCESSES, 0.01)
    clocks = EventClocks(EventRates(**rates), 5)
    before = {process: getattr(clocks, process) for process in PROCESSES}
    clocks.change(EventRates(**rates | {changed: 0.02}), 5, 3)
    assert [process for process in PROCESSES if getattr(clocks, process) is not before[process]] == [changed]
    clocks.change(EventRates(**rates | {changed: 0.0}), 5, 4)
    assert getattr(clocks, changed).next_tick == np.inf


# In an environment


def at_hand(env: ForageEnv, *, deaths: str = "terminate", **fields) -> PopulationDynamics:
    """Population dynamics whose events a test makes due; by itself next to nothing happens."""
    rates = dict.fromkeys(("death_per_tick", "malfunction_per_tick", "repair_per_tick"), 1e-12)
    stack = PopulationDynamics(env, PopulationConfig(**{**rates, **fields}, deaths=deaths))
    if env.seed_value is not None:
        begin(stack)  # a world arranged by hand is not reset again
    return stack


def make_due(stack: PopulationDynamics, process: str) -> None:
    getattr(stack._clocks, process).next_tick = stack._next_tick = stack.unwrapped.tick + 1


def hold(env: ForageEnv, wheels: float = 0.0, grip: float = Grip.GRASP) -> np.ndarray:
    actions = np.full((len(env.active), 3), wheels, np.float32)
    actions[:, 2] = grip
    return actions


def strike(stack: PopulationDynamics, process: str, actions: np.ndarray | None = None):
    """Make one event due and step; returns what the step returns."""
    make_due(stack, process)
    return stack.step_batch(hold(stack.unwrapped) if actions is None else actions)


# Repair


@in_each_engine
def test_a_robot_in_repair_stops_but_stays(physics):
    env = tidy_world(n_robots=1, physics=physics)
    stand(env, 0, (60, 40))
    load(env, 0, 0)
    lone_carrier = at_hand(env)
    lone_carrier.step_batch(hold(env, 0.5))
    where = env.swarm.position.copy()
    obs, _, terminated, _ = strike(lone_carrier, "malfunction", hold(env, 0.5))
    assert not env.active[0]
    assert env.swarm.present[0]
    assert not terminated[0]
    for _ in range(3):
        np.testing.assert_array_equal(env.swarm.position, where)
        assert env.swarm.wheel_speed[0].tolist() == [0.0, 0.0]
        assert env.swarm.carried_object[0] == 0, "even if the policy lets go"
        assert obs[0, env.layout["active"]] == 0.0
        assert obs[0, env.layout["carrying"]] == 1.0
        assert obs[0, env.layout["position"]].any(), "true sensors"
        obs, *_ = lone_carrier.step_batch(hold(env, 0.5, Grip.RELEASE))
    strike(lone_carrier, "repair", hold(env, 0.5))
    assert env.active[0]
    assert env.swarm.carried_object[0] == 0
    assert env.swarm.position[0, 0] > where[0, 0]


@in_each_engine
def test_a_robot_in_repair_is_seen_and_in_the_way_but_never_interferes(physics):
    env = tidy_world(n_robots=2, physics=physics)
    put(env, 0, 16.0, 8.0)
    put(env, 1, 16.0 + 2 * 0.085036758 + 0.02, 8.0, np.pi)
    stack = at_hand(env)
    stack.step_batch(hold(env))
    assert env.events.interfering.tolist() == [True, True]
    obs, *_ = strike(stack, "malfunction")
    broken = int(np.flatnonzero(~env.active)[0])
    assert env.events.interfering.tolist() == [broken != 0, broken != 1]
    assert obs[:, env.layout["proximity"]].max(axis=1) == pytest.approx([0.5] * 2, abs=0.2), "both see each other"
    for _ in range(20):
        stack.step_batch(hold(env, 0.5))
    assert np.hypot(*(env.swarm.position[0] - env.swarm.position[1])) > 2 * 0.085036758 - 0.004


CONTINUOUS = {"decision_ticks": 5}
NUMBERED = {"decision_ticks": 5, "actions": "discrete"}


@pytest.mark.parametrize(("interface", "fills"), [(None, (0.0, np.nan)), (CONTINUOUS, (0.0, 1.0)), (NUMBERED, (0, 8))])
def test_rows_of_robots_that_are_away_never_act(interface, fills):
    """Nor when the robot comes back within the tick, or the decision."""
    seen = []
    for fill in fills:
        words = ["population:malfunction_per_tick=0.5,repair_per_tick=0.5"]
        env = JointForageEnv("classroom", n_robots=6, wrappers=words, interface=interface)
        env.reset(seed=3)
        env.action_space.seed(0)
        for _ in range(30):
            actions = env.action_space.sample()
            actions[~env.forage_env.active] = fill
            env.step(actions)
        seen.append(env.forage_env.swarm.position.copy())
    for other in seen[1:]:
        np.testing.assert_array_equal(other, seen[0])


def test_robots_that_are_away_hold_what_they_carry():
    away, carrying = np.array([True, True, False]), np.array([True, False, True])
    interface = LearnerInterface(InterfaceConfig(), SwarmSpec.of(scenario("classroom", n_robots=3)))
    for rest in (at_rest, interface.resting):
        rested = rest(np.full((3, 3), 0.5, np.float32), away, carrying)
        np.testing.assert_array_equal(rested, [[0, 0, Grip.GRASP], [0, 0, Grip.RELEASE], [0.5, 0.5, 0.5]])


# Death


@pytest.mark.parametrize("deaths", ["terminate", "absorbing"])
def test_the_dead_lose_their_cargo_and_their_body(deaths):
    env = tidy_world(n_robots=1)
    stand(env, 0, (60, 5))  # where nothing may lie
    load(env, 0, 0)
    stack = at_hand(env, deaths=deaths)
    obs, reward, terminated, truncated = strike(stack, "death")
    assert env.swarm.carried_object[0] == -1
    assert env.objects.status[0] == ObjectStatus.FREE
    assert env.objects.cell[0, 0] >= 120, "in the source"
    assert not env.swarm.present[0]
    assert not env.active[0]
    assert not obs.any()
    assert reward.tolist() == [0.0]
    assert terminated.tolist() == [True], "the last one"
    assert not truncated
    assert np.all(env.arena._physics.poses()[0, :2] < 0.0), "parked outside"


@in_each_engine
@pytest.mark.parametrize("lives_on", [False, True])
def test_both_ways_of_death_are_the_same_world_and_record(lives_on, physics):
    world = {"n_robots": 6, "n_objects": 60, "caches": "static", "physics": physics}
    config = scenario("warehouse_small", **world, horizon_s=60.0, interval_s=10.0)
    rate = 0.01 if lives_on else 0.2
    results = []
    for deaths in ("terminate", "absorbing"):
        population = PopulationConfig(
            death_per_tick=rate, malfunction_per_tick=0.05, repair_per_tick=0.05, deaths=deaths
        )
        recorder = RunRecorder(population.wrap(ForageEnv(config)))
        obs = [recorder.reset_batch(4).copy()]
        rng = np.random.default_rng(0)
        while not recorder.complete:
            actions = rng.uniform(-1, 1, (6, 3)).astype(np.float32)
            obs.append(recorder.step_batch(actions)[0].copy())
        results.append((np.stack(obs), snapshot(recorder.unwrapped), recorder.columns()))
    (obs, world, record), (other_obs, other_world, other_record) = results
    np.testing.assert_array_equal(obs, other_obs)
    assert_same_world(world, other_world)
    assert_same_world(record, other_record)
    assert record["deaths"].sum() == 6 if not lives_on else 0 < record["deaths"].sum() < 6
    assert (len(obs) < 301) == (not lives_on), "the run ends with the last robot"
    if not lives_on:
        assert record["n_caches"][0] > 0
        assert record["n_caches"][-1] == record["n_present"][-1] == 0, "the rest of the record is zeros"


# Birth


def nursery(n_robots: int = 6, *, initial_robots: int = 2, physics: str = "compiled") -> PopulationDynamics:
    env = ForageEnv(scenario("warehouse_small", n_robots=n_robots, n_objects=50, physics=physics))
    return at_hand(env, initial_robots=initial_robots, birth_per_tick=1e-12)


def test_the_unborn_are_agents_without_a_body_from_the_reset_on():
    stack = nursery()
    env = stack.unwrapped
    observations, infos = stack.reset(seed=3)
    assert stack.agents == env.possible_agents
    unborn = [f"robot_{row}" for row in range(2, 6)]
    assert not any(observations[agent].any() for agent in unborn)
    assert [infos[agent]["active"] for agent in stack.agents] == [True, True, False, False, False, False]
    assert not env.state()[12:36].any()
    _, _, terminations, _, _ = stack.step({agent: np.ones(3, np.float32) for agent in stack.agents})
    assert not any(terminations.values())
    assert env.swarm.present.tolist() == [True, True, False, False, False, False]


@in_each_engine
def test_births_bring_working_robots_at_free_places(physics):
    stack = nursery(n_robots=20, initial_robots=1, physics=physics)
    env = stack.unwrapped
    stack.reset_batch(1)
    for born in range(1, 20):
        obs, *_ = strike(stack, "birth", hold(env))
        assert env.active.sum() == born + 1
        assert env.active[born]
        x, y = env.swarm.position[born]
        assert 2.0 <= x <= 30.0
        assert 2.0 <= y <= 14.0
        assert env.swarm.heading[born] == 0.0
        assert obs[born, env.layout["heading"]].tolist() == [1.0, 0.0]
        others = np.delete(env.swarm.position[: born + 1], born, axis=0)
        assert np.hypot(*(others - (x, y)).T).min() > 2 * 0.085
    before = env.swarm.position.copy()
    free = ~obs[:, env.layout["proximity"]].any(axis=1)
    stack.step_batch(hold(env, 0.5, Grip.RELEASE))
    assert np.hypot(*(env.swarm.position - before)[free].T) == pytest.approx(np.full(free.sum(), 0.02))
    make_due(stack, "birth")
    stack.step_batch(hold(env))
    assert env.active.all(), "nobody is left to be born"


def test_births_come_as_near_to_the_border_as_starts_where_that_is_less():
    """The classroom starts robots 0.8 m from its border; the study's births keep 2 m."""
    stack = at_hand(ForageEnv(scenario("classroom", n_robots=60)), initial_robots=1, birth_per_tick=1e-12)
    stack.reset_batch(1)
    for _ in range(59):
        strike(stack, "birth")
    places = stack.unwrapped.swarm.position
    nearest = np.minimum(places, (8.0, 6.0) - places).min(axis=1)[1:]
    assert 0.8 <= nearest.min() < 1.0


# Events and record


def test_a_run_has_the_events_of_its_simulation_and_records_them():
    """The queue alone says who is at work in each tick."""
    config = scenario("warehouse_small", n_robots=12, n_objects=20, horizon_s=60.0, interval_s=20.0)
    population = PopulationConfig(
        death_per_tick=0.01, birth_per_tick=0.01, malfunction_per_tick=0.05, repair_per_tick=0.05, initial_robots=8
    )
    recorder = RunRecorder(population.wrap(ForageEnv(config)))
    recorder.reset_batch(2)
    while not recorder.complete:
        recorder.step_batch(hold(recorder.unwrapped))
    record = recorder.columns()
    n_active, tally = simulate_population(population.rates, 12, 300, 2, initial_robots=8)
    np.testing.assert_allclose(record["n_active"], n_active.reshape(3, 100).mean(axis=1))
    for name in ("deaths", "births", "malfunctions", "repairs"):
        assert record[name].sum() == getattr(tally, name) > 0
    np.testing.assert_allclose(record["n_active"] + record["n_in_repair"], record["n_present"])
    assert record["n_present"].max() <= 12
    # Means per interval, weighted by what ended in it, give the totals of the run; all stays end in one of two ways.
    assert record["time_in_repair_s"] @ record["repairs"] == pytest.approx(tally.absence_ticks * 0.2)
    assert 0 < record["time_at_work_s"].max() <= 60.0


# Configuration


def test_levels_of_other_sizes_are_refused():
    with pytest.raises(ConfigError, match="Expected 50 or 200 robots"):
        malfunction_levels(100)


def test_rates_change_while_a_run_goes_on_and_nothing_else():
    env = PopulationConfig().wrap(ForageEnv(scenario("warehouse_small", n_robots=4, n_objects=9)))
    env.reset_batch(3)
    env.reconfigure(PopulationConfig(malfunction_per_tick=50.0))
    env.step_batch(np.zeros((4, 3), np.float32))
    assert np.count_nonzero(env.unwrapped.active) == 3
    assert env.made_from.malfunction_per_tick == 50.0
    with pytest.raises(ConfigError, match="Expected other rates only"):
        env.reconfigure(PopulationConfig(initial_robots=2))
    with pytest.raises(ConfigError, match=r"initial_robots below 4.*a robot can be born, got None"):
        env.reconfigure(PopulationConfig(birth_per_tick=0.1))
    assert env.made_from.malfunction_per_tick == 50.0
