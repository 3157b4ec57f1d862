"""A population over a run without an arena around it, in milliseconds."""

from typing import NamedTuple

import numpy as np

from swarm_forage_env.wrappers.population_process import (
    EventClocks,
    EventRates,
    EventTally,
    PopulationState,
    advance_population,
)


class PopulationHistory(NamedTuple):
    """Robots at work and robots in the arena during each tick, (ticks,), and the totals of the run."""

    n_active: np.ndarray
    n_present: np.ndarray
    tally: EventTally


def simulate_population(
    rates: EventRates, n_robots: int, ticks: int, seed: int, initial_robots: int | None = None
) -> PopulationHistory:
    """Return what a run with this seed does where births always have room."""
    state = PopulationState.start(n_robots, initial_robots=initial_robots, max_robots=None)
    clocks = EventClocks(rates, seed)
    n_active, n_present = np.zeros(ticks, np.int32), np.zeros(ticks, np.int32)
    tick = 1
    while tick <= ticks:
        advance_population(state, clocks, tick)
        following = int(min(max(clocks.next_tick, tick + 1), ticks + 1))
        # Tick 1 is at index 0; nothing changes until the next event is due.
        n_active[tick - 1 : following - 1] = np.count_nonzero(state.active)
        n_present[tick - 1 : following - 1] = np.count_nonzero(state.present)
        tick = following
    return PopulationHistory(n_active, n_present, state.tally)
