"""PopulationDynamics: robots that die, are born, break down and are repaired during a run."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np

from swarm_forage_env._internal.fields import Amount, ConfigError, Whole
from swarm_forage_env.contract.types import BoolArray
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.obstacles import distances_m
from swarm_forage_env.wrappers.base import SwarmWrapper, WrapperConfig
from swarm_forage_env.wrappers.population_process import (
    EventClocks,
    EventRates,
    EventTally,
    PopulationState,
    advance_population,
    break_down,
    come_back,
    die,
)

BIRTH_MARGIN_M = 2.0
"""Robots are born at least this far from the border of the arena (study configuration), or the start margin if less."""
BIRTH_TRIALS = 1000
"""Positions that are tried in one tick (study configuration)."""
_RATES = ("death_per_tick", "birth_per_tick", "malfunction_per_tick", "repair_per_tick")

_STUDY_REPAIR_PER_TICK = {50: 0.001022222, 200: 0.001005556}
"""Swarm size -> lowest repair rate of the study."""


class PopulationDynamics(SwarmWrapper):
    """Lets the robots of a run die, be born, break down and be repaired, as `population_process` describes.

    A robot in repair stays where it is with its wheels stopped, visible to others, keeping cargo and memory; it stays
    an agent, with `active` at 0. A robot that dies loses its cargo where it stands and its body disappears: its agent
    terminates, or stays as a row of zeros (`deaths="absorbing"`, for trainers that need a fixed number of agents). In
    both cases the run and its record are the same, and the episode ends when the last robot is dead. A row that is
    not yet born is an agent without a body, a row of zeros; it enters at a uniform position, heading along +x.

    Records `deaths`, `births`, `malfunctions`, `repairs`, `n_in_repair`, `time_at_work_s`, `time_in_repair_s`.
    """

    stack_position: ClassVar[int] = 2

    def __init__(self, env: ForageEnv | SwarmWrapper, config: "PopulationConfig") -> None:
        """Wrap `env`.

        Raises:
            ConfigError: more robots at the start than the scenario has, or births although all robots are there.
        """
        super().__init__(env, config)
        scenario = self.unwrapped.scenario
        n_robots = scenario.robots.n_robots
        initial = n_robots if config.initial_robots is None else config.initial_robots
        if initial > n_robots:
            raise ConfigError(
                f"Expected population.initial_robots <= {n_robots}, the robots of the scenario, got {initial}."
            )
        _check_births(config, n_robots)
        self._config = config
        self._seed = 0
        margin = min(BIRTH_MARGIN_M, scenario.robots.start_margin_m)
        self._birth_low = np.array([margin, margin])
        self._birth_high = np.array([scenario.arena.width_m, scenario.arena.height_m]) - margin
        self._body_m = 2.0 * scenario.robots.radius_m

    def on_reset(self, seed: int) -> None:
        """Start the clocks; robots that are not yet born leave the arena before the first observation."""
        config = self._config
        self._seed = seed
        n_robots = self.unwrapped.scenario.robots.n_robots
        self._state = PopulationState.start(
            n_robots, initial_robots=config.initial_robots, max_robots=config.max_robots
        )
        self._clocks = EventClocks(config.rates, seed)
        self._next_tick = self._clocks.next_tick
        self._repair_ticks = 0
        if not self._state.present.all():
            self._apply()
            self.unwrapped.swarm.dead[:] = False  # they are not born yet
            self.unwrapped.arena.observe()

    def before_step(self) -> None:
        """Carry out the events that are due in the coming tick."""
        tick = self.unwrapped.tick + 1
        if tick >= self._next_tick:
            if advance_population(self._state, self._clocks, tick, self._find_place):
                self._apply()
            self._next_tick = self._clocks.next_tick
        self._repair_ticks += len(self._state.repair_queue)

    def ahead(self, n_ticks: int) -> tuple[int, dict[str, Any]]:
        """Return how long nothing happens."""
        return int(min(n_ticks, max(0, self._next_tick - 1 - self.unwrapped.tick))), {}

    def count_ticks(self, n_ticks: int) -> None:
        """Count ticks of robots in repair."""
        self._repair_ticks += n_ticks * len(self._state.repair_queue)

    def reconfigure(self, config: "PopulationConfig") -> None:
        """Go on under other rates from the next tick on.

        Processes whose rate stays the same are not touched; see `EventClocks.change`. Robots that are there, dead or
        not yet born stay so.

        Raises:
            ConfigError: another field than the rates is to change, or births although all robots were there.
        """
        others = replace(config, **{field: getattr(self._config, field) for field in _RATES})
        if others != self._config:
            raise ConfigError(f"Expected other rates only, {', '.join(_RATES)}, got {config}; start another run.")
        _check_births(config, self.unwrapped.scenario.robots.n_robots)
        self.made_from = self._config = config
        self._clocks.change(config.rates, self._seed, self.unwrapped.tick + 1)
        self._next_tick = self._clocks.next_tick

    def kill(self, row: int) -> bool:
        """Let one robot die now, between two ticks; returns whether it was alive."""
        return self._change_by_hand(die, row, self._state.present)

    def break_down(self, row: int) -> bool:
        """Let one robot wait for repair from now on, between two ticks; returns whether it was at work."""
        return self._change_by_hand(break_down, row, self._state.active)

    def repair(self, row: int) -> bool:
        """Let one robot come back from repair now, between two ticks; returns whether it was there."""
        return self._change_by_hand(come_back, row, self._state.present & ~self._state.active)

    def _change_by_hand(self, event: Callable[[PopulationState, int, int], None], row: int, able: BoolArray) -> bool:
        if not able[row]:
            return False
        event(self._state, row, self.unwrapped.tick + 1)
        self._apply()
        return True

    def interval_columns(self) -> dict[str, float]:
        """Return the events since the last call, the mean repair queue, and how long stays and absences were."""
        scenario, tally = self.unwrapped.scenario, self._state.tally
        counted = ("deaths", "births", "malfunctions", "repairs")
        columns = {
            **{name: float(getattr(tally, name)) for name in counted},
            "n_in_repair": self._repair_ticks / scenario.interval_ticks,
            "time_at_work_s": tally.stay_ticks * scenario.dt_s / max(1, tally.stays),
            "time_in_repair_s": tally.absence_ticks * scenario.dt_s / max(1, tally.repairs),
        }
        self._state.tally = EventTally()
        self._repair_ticks = 0
        return columns

    def _apply(self) -> None:
        """Tell the environment which robots are present, active and terminated."""
        state = self._state
        gone = state.dead
        if self._config.deaths == "absorbing":
            gone = np.full(len(state.dead), bool(state.dead.all()))
        self.unwrapped.set_population(active=state.active, present=state.present, terminated=gone)

    def _find_place(self, row: int, rng: np.random.Generator) -> bool:
        """Place a robot that is to be born at a uniform position clear of robots and obstacles, if one is found."""
        swarm = self.unwrapped.swarm
        others = swarm.position[swarm.present]
        places = rng.uniform(self._birth_low, self._birth_high, (BIRTH_TRIALS, 2))
        is_free = distances_m(self.unwrapped.scenario.arena.obstacles, places) >= 0.5 * self._body_m
        for x, y in places[is_free].tolist():
            if np.all(np.hypot(others[:, 0] - x, others[:, 1] - y) > self._body_m):
                swarm.position[row] = x, y
                swarm.heading[row] = 0.0
                return True
        return False


@dataclass(frozen=True, kw_only=True, slots=True)
class PopulationConfig(WrapperConfig):
    """A `PopulationDynamics` as data. Rates are events per tick of the whole swarm; 0 = never.

    Raises:
        ConfigError: a rate that is negative or no number, swarm sizes that make no sense, or an unknown `deaths`.
    """

    name: ClassVar[str] = "population"
    wrapper: ClassVar[type[SwarmWrapper]] = PopulationDynamics

    death_per_tick: Amount = 0.0
    birth_per_tick: Amount = 0.0
    malfunction_per_tick: Amount = 0.0
    repair_per_tick: Amount = 0.0
    initial_robots: Whole | None = None
    """Robots at the start of a run, the first rows; the others wait to be born. Default: all of the scenario."""
    max_robots: Whole | None = None
    """No births while this many robots are present. Default: all of the scenario."""
    deaths: Literal["terminate", "absorbing"] = "terminate"
    """Whether the agent of a dead robot terminates, or stays until the end ("absorbing")."""
    example: ClassVar[str] = "death_per_tick=0.0005"

    @property
    def rates(self) -> EventRates:
        """The four rates."""
        return EventRates(*(getattr(self, name) for name in _RATES))

    def in_words(self, dt_s: float) -> str:
        """Return how often what happens to the swarm; see `WrapperConfig.in_words`."""
        words = [
            f"a {what} every {dt_s / rate:,.4g} s on average"
            for what, rate in zip(EventRates._fields, self.rates, strict=True)
            if rate > 0.0
        ]
        if self.initial_robots is not None:
            words.append(f"{self.initial_robots} robots at the start")
        if self.max_robots is not None:
            words.append(f"at most {self.max_robots}")
        return f"population: {', '.join(words) or 'no changes'}"


def _check_births(config: PopulationConfig, n_robots: int) -> None:
    """Refuse births where all robots are there from the start."""
    if config.birth_per_tick > 0.0 and config.initial_robots in (None, n_robots):
        raise ConfigError(
            f"Expected population.initial_robots below {n_robots}, the robots of the scenario, so that a robot "
            f"can be born, got {config.initial_robots}."
        )


def malfunction_levels(n_robots: int) -> tuple[PopulationConfig, ...]:
    """Return the population dynamics of scenario 1: malfunctions and repairs at x + 1 times a base rate, x = 0 ... 7.

    The ratio of the rates is that of the study, which wanted a tenth of the swarm at work. That holds for a queue
    without limit; in equilibrium 29.7 of 50 robots are at work, and a run is too short to reach it. (The study has no
    level without malfunctions, x = 0 is the reference.)

    Args:
        n_robots: 50 (small warehouse) or 200 (medium).

    Raises:
        ConfigError: another swarm size; the study has rates for these two only.
    """
    if n_robots not in _STUDY_REPAIR_PER_TICK:
        raise ConfigError(f"Expected 50 or 200 robots, for which the study has repair rates, got {n_robots!r}.")
    repair = _STUDY_REPAIR_PER_TICK[n_robots]
    return tuple(
        PopulationConfig(malfunction_per_tick=factor / 1000, repair_per_tick=repair * factor) for factor in range(1, 9)
    )


def death_levels() -> tuple[PopulationConfig, ...]:
    """Return the population dynamics of scenario 2: 0.0001, 0.0003, ..., 0.0015 deaths per tick.

    5, 15, ..., 75 deaths are expected in a run (study configuration; the paper says up to 0.0007).
    """
    return tuple(PopulationConfig(death_per_tick=factor / 10_000) for factor in range(1, 16, 2))
