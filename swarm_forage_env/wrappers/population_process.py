"""Population dynamics: when robots die, are born, break down and are repaired. It uses rows and ticks, not the arena.

Four processes act on the swarm as a whole, each with its own clock; their rates do not depend on the number of robots.
After an event at tick t the next is due at t + floor(w), where w is exponential with the rate of the process; a run
starts as if an event had happened at tick 0. An event for which there is no robot stays due and is tried again in every
tick. In a tick each process has at most one event, in this order:

    death         a robot drawn from all present ones, those in repair included, leaves for good
    birth         the next row that is not yet born enters, if there is room for it
    malfunction   a robot drawn from the active ones joins the end of the repair queue
    repair        the robot at the head of the queue is active again; on an empty queue the event is lost

Source: section on population dynamics of the paper; the clocks are those of the study's program.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.types import BoolArray, IntArray

FindPlace: TypeAlias = Callable[[int, np.random.Generator], bool]
"""Places the robot that is to be born, drawing from the generator; returns False if there is no room now."""


class EventRates(NamedTuple):
    """Events per tick of the whole swarm; 0 = never."""

    death: float = 0.0
    birth: float = 0.0
    malfunction: float = 0.0
    repair: float = 0.0


class EventClock:
    """When the next event of one process is due, and the draws that belong to the event.

    Each process has two generators, one for times and one for choices.
    """

    def __init__(self, rate: float, times: np.random.Generator, choices: np.random.Generator, *, tick: int = 0) -> None:
        """Start at a tick; `rate` in events per tick."""
        self.rate = rate
        self._times = times
        self.choices = choices
        self.next_tick = np.inf
        """First tick at which the next event may happen."""
        if rate > 0.0:
            self.restart(tick)

    def restart(self, tick: int) -> None:
        """Draw when the next event is due, after one at `tick`."""
        self.next_tick = tick + float(np.floor(self._times.standard_exponential() / self.rate))

    def choose(self, candidates: BoolArray) -> int:
        """Draw one row of `candidates` (N,), of which there is at least one.

        A number is drawn for every row, and the highest among the candidates wins. So the number of a robot does not
        depend on which other robots are candidates.
        """
        lots = self.choices.random(len(candidates))
        return int(np.argmax(np.where(candidates, lots, -1.0)))


class EventClocks:
    """The clocks of the four processes.

    Runs with the same seed and other rates have another history. If they shared one, few seeds with many failures would
    make every level of a sweep look worse than its rates are.
    """

    def __init__(self, rates: EventRates, seed: int, *, tick: int = 0) -> None:
        """Start all clocks of the run with `seed` at a tick; those of each tick have chance of their own."""
        level = (*rates, tick) if tick else rates
        sources = iter(stream_rng(seed, Stream.POPULATION, level).spawn(8))
        self.death, self.birth, self.malfunction, self.repair = (
            EventClock(rate, next(sources), next(sources), tick=tick) for rate in rates
        )

    def change(self, rates: EventRates, seed: int, tick: int) -> None:
        """Go on under other rates; processes that keep their rate keep their clock.

        The next event of the others is drawn anew, which changes nothing of its distribution: how long one has waited
        says nothing about an exponential. What is due already and waits stays due, unless its rate is 0 now.

        Args:
            rates: Events per tick.
            seed: Seed of the run.
            tick: The tick that is about to be executed.
        """
        anew = EventClocks(rates, seed, tick=tick)
        for process in EventRates._fields:
            old, new = getattr(self, process), getattr(anew, process)
            if new.rate == old.rate:
                continue
            if new.rate > 0.0 and old.next_tick < tick:
                new.next_tick = old.next_tick
            setattr(self, process, new)

    @property
    def next_tick(self) -> float:
        """First tick at which anything may happen."""
        return min(getattr(self, process).next_tick for process in EventRates._fields)


@dataclass(slots=True)
class EventTally:
    """What happened since the tally was started."""

    deaths: int = 0
    births: int = 0
    malfunctions: int = 0
    repairs: int = 0
    """Robots that returned; repair events on an empty queue are not counted."""
    stays: int = 0
    """Times at work that ended, by malfunction or by the death of an active robot."""
    stay_ticks: int = 0
    """Sum of their lengths."""
    absence_ticks: int = 0
    """Sum of the lengths of absences that ended by repair."""


@dataclass(slots=True)
class PopulationState:
    """State of every robot; only `advance_population` edits it."""

    present: BoolArray
    """(N,) born and not dead."""
    active: BoolArray
    """(N,) present and not in repair."""
    dead: BoolArray
    """(N,) dead for good."""
    born: int
    """Rows below are born."""
    max_present: int
    """No births while this many robots are present."""
    repair_queue: list[int]
    """Rows in repair, longest wait first."""
    since: IntArray
    """(N,) first tick of the current stay or absence."""
    tally: EventTally

    @classmethod
    def start(
        cls, n_robots: int, *, initial_robots: int | None = None, max_robots: int | None = None
    ) -> "PopulationState":
        """All robots active (or the first `initial_robots`), none in repair.

        Args:
            n_robots: Rows N, all robots that can ever appear.
            initial_robots: Robots at the start; default all.
            max_robots: Most robots that may be present at once; default N.

        """
        born = n_robots if initial_robots is None else initial_robots
        present = np.arange(n_robots) < born
        return cls(
            present=present,
            active=present.copy(),
            dead=np.zeros(n_robots, np.bool_),
            born=born,
            max_present=n_robots if max_robots is None else max_robots,
            repair_queue=[],
            since=np.ones(n_robots, np.int32),
            tally=EventTally(),
        )


def advance_population(
    state: PopulationState, clocks: EventClocks, tick: int, find_place: FindPlace | None = None
) -> bool:
    """Carry out the events that are due at `tick`; ticks without due events may be skipped.

    Args:
        state: Edited.
        clocks: Advanced by the events that happen.
        tick: The tick that is about to be executed; the first is 1.
        find_place: Places a row that is to be born; default: there is always room.

    Returns:
        Whether the state of any robot has changed.
    """
    changed = False
    if tick >= clocks.death.next_tick and state.present.any():
        die(state, clocks.death.choose(state.present), tick)
        clocks.death.restart(tick)
        changed = True
    if (
        tick >= clocks.birth.next_tick
        and _has_room(state)
        and (find_place is None or find_place(state.born, clocks.birth.choices))
    ):
        _enter(state, tick)
        clocks.birth.restart(tick)
        changed = True
    if tick >= clocks.malfunction.next_tick and state.active.any():
        break_down(state, clocks.malfunction.choose(state.active), tick)
        clocks.malfunction.restart(tick)
        changed = True
    if tick >= clocks.repair.next_tick:
        if state.repair_queue:
            come_back(state, state.repair_queue[0], tick)
            changed = True
        clocks.repair.restart(tick)
    return changed


def die(state: PopulationState, row: int, tick: int) -> None:
    """Let a robot that is present leave for good; `tick` is the tick that is about to be executed."""
    if state.active[row]:
        _end_stay(state, row, tick)
    else:
        state.repair_queue.remove(row)
    state.present[row] = False
    state.dead[row] = True
    state.tally.deaths += 1


def _has_room(state: PopulationState) -> bool:
    return state.born < len(state.present) and int(np.count_nonzero(state.present)) < state.max_present


def _enter(state: PopulationState, tick: int) -> None:
    row = state.born
    state.present[row] = state.active[row] = True
    state.since[row] = tick
    state.born += 1
    state.tally.births += 1


def break_down(state: PopulationState, row: int, tick: int) -> None:
    """Let a robot at work join the end of the repair queue; `tick` as in `die`."""
    _end_stay(state, row, tick)
    state.since[row] = tick
    state.repair_queue.append(row)
    state.tally.malfunctions += 1


def _end_stay(state: PopulationState, row: int, tick: int) -> None:
    state.active[row] = False
    state.tally.stays += 1
    state.tally.stay_ticks += tick - int(state.since[row])


def come_back(state: PopulationState, row: int, tick: int) -> None:
    """Let a robot in repair, wherever in the queue, be active again; `tick` as in `die`."""
    state.repair_queue.remove(row)
    state.active[row] = True
    state.tally.repairs += 1
    state.tally.absence_ticks += tick - int(state.since[row])
    state.since[row] = tick
