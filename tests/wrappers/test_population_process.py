"""Population dynamics without an arena: the event clock, the four processes, and the study's expected numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from swarm_forage_env.wrappers.population import death_levels
from swarm_forage_env.wrappers.population_process import (
    EventClock,
    EventClocks,
    EventRates,
    PopulationState,
    advance_population,
)
from tests.reference.adversity import SlowPopulation
from tests.support.population import simulate_population

RUN_TICKS = 50_000
SURE = 0.001
"""Tests of chance have fixed seeds; one in a thousand choices of seeds would fail."""


def clock(rate: float, seed: int = 0) -> EventClock:
    return EventClock(rate, np.random.default_rng([seed, 1]), np.random.default_rng([seed, 2]))


def due(state_ticks: dict[str, float]) -> EventClocks:
    """Clocks whose next events are set by hand; later ones are far away."""
    clocks = EventClocks(EventRates(death=1e-9, birth=1e-9, malfunction=1e-9, repair=1e-9), seed=0)
    for name in ("death", "birth", "malfunction", "repair"):
        getattr(clocks, name).next_tick = state_ticks.get(name, np.inf)
    return clocks


# The clock


@pytest.mark.parametrize("rate", [0.01, 2.0])
def test_waiting_times_are_floored_exponentials(rate):
    events = clock(rate)
    waits = []
    for _ in range(10_000):
        events.restart(100)
        waits.append(int(events.next_tick) - 100)
    longest = int(np.ceil(6.0 / rate))  # exp(-6) of 10,000 waits are longer: 25
    edges = np.unique(np.linspace(0, longest, 25).astype(int))
    counts, _ = np.histogram(waits, bins=[*edges, np.inf])
    survival = np.exp(-rate * edges)
    expected = np.append(survival[:-1] - survival[1:], survival[-1]) * len(waits)
    assert stats.chisquare(counts, expected).pvalue > SURE


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


# The study


def test_deaths_per_run_of_search_and_rescue():
    n_runs = 30
    expected = [5, 15, 25, 35, 45, 55, 65, 75]
    for config, mean in zip(death_levels(), expected, strict=True):
        deaths = [simulate_population(config.rates, 115, RUN_TICKS, seed).tally.deaths for seed in range(n_runs)]
        # Poisson but for the floor, which lengthens no wait by more than a tick in a thousand.
        assert np.mean(deaths) == pytest.approx(mean, abs=3.5 * np.sqrt(mean / n_runs))
        assert np.var(deaths, ddof=1) == pytest.approx(mean, rel=0.6)


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


@pytest.mark.parametrize("seed", [0])
def test_a_rate_that_changes_in_every_tick_has_as_many_events_as_one_that_stays(seed):
    """Who moves a slider meets no wait a second time."""
    rate, ticks = 0.2, 1_000
    state, clocks = PopulationState.start(1_000), EventClocks(EventRates(death=rate), seed)
    for tick in range(1, ticks + 1):
        clocks.change(EventRates(death=rate * (1.0 + tick % 2 / 1e6)), seed, tick)
        advance_population(state, clocks, tick)
    gap = 1.0 / np.expm1(rate) - np.expm1(-rate)  # mean floor, and a tick where it is 0
    assert state.tally.deaths == pytest.approx(ticks / gap, abs=3.3 * np.sqrt(ticks / gap))
