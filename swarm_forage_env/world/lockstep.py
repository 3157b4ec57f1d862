"""Arenas of one scenario, stepped together by one compiled call: for learners, whose actions come for all at once."""

from collections.abc import Callable, Mapping, Sequence
from operator import is_not
from typing import Any

import numpy as np

from swarm_forage_env._internal.compiling import direct, is_compiled
from swarm_forage_env._internal.held import addresses
from swarm_forage_env.contract.policy import ActionError
from swarm_forage_env.contract.types import ActionArray, FloatArray
from swarm_forage_env.world.arena import ForagingArena
from swarm_forage_env.world.kernels.lockstep import whole_each


def can_go_in_lockstep(arenas: Sequence[ForagingArena]) -> bool:
    """Whether arenas can be stepped together: one scenario, compiled bodies, the same `reads`, the compiler on."""
    first = arenas[0]
    return (
        first.config.physics == "compiled"
        and is_compiled(whole_each)
        and all(arena.config == first.config and arena.reads == first.reads for arena in arenas)
    )


class Lockstep:
    """Steps arenas together. What each does is bit for bit what it does alone.

    The arenas stay whole: each can be reset, be stepped alone or go back to a snapshot at any time.

    Attributes:
        arenas: The arenas, a seat for each. All must have been reset before a step.
    """

    def __init__(self, arenas: Sequence[ForagingArena]) -> None:
        """Give every arena a seat; raises ValueError unless they `can_go_in_lockstep`."""
        if not can_go_in_lockstep(arenas):
            raise ValueError(
                'Expected arenas of one scenario with physics "compiled" that read the same slices, and a compiler '
                "that is switched on."
            )
        config = arenas[0].config
        n_seats, n_robots = len(arenas), config.robots.n_robots
        self.arenas = tuple(arenas)
        self._draws_picks = config.caches != "none"
        self._draws_walks = config.objects.walk_probability > 0.0
        self._seated: list[object] = []
        self._has_gain = [False] * n_seats
        self._gain = np.ones((n_seats, n_robots, 2))
        self._ticks = np.zeros(n_seats, np.int64)
        self._has_changed = np.zeros(n_seats, np.bool_)
        self._picks = np.zeros((n_seats, n_robots))
        self._walks = np.zeros((n_seats, config.objects.n_objects if self._draws_walks else n_robots))
        self._outcomes = np.zeros(n_seats, np.int64)
        self._rows = self._gain, self._ticks, self._has_changed, self._picks, self._walks, self._outcomes
        self._all_seats = np.arange(n_seats, dtype=np.int64)
        self._step_each: Callable[..., None] | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Return what copies are made from: addresses are of this process and of these arrays only."""
        return {"arenas": self.arenas}

    def __setstate__(self, state: dict[str, Any]) -> None:
        Lockstep.__init__(self, state["arenas"])

    def step(self, gains: Mapping[int, FloatArray | None], actions: ActionArray) -> dict[int, ActionError]:
        """Advance arenas by one tick; their observations are in `ForagingArena.obs`.

        Args:
            gains: Seat of each arena to be stepped -> (N, 2) factor on the wheels' speeds, or None. The others stay;
                there may be nothing to step.
            actions: (B, N, A) float32, contiguous, for all B seats; see `ForagingArena.step`.

        Returns:
            Seat -> why the arena was not stepped: an active robot's action or gain is NaN or infinite.
        """
        if are_others([part for arena in self.arenas for part in arena.parts], self._seated):
            self._note_addresses()
        for seat, gain in gains.items():
            self._prepare(seat, gain)
        seats = self._all_seats if len(gains) == len(self.arenas) else np.array(list(gains), np.int64)
        arguments = (*self._places, seats, actions, *self._rows)
        if self._step_each is None:
            self._step_each = direct(whole_each, *arguments)
        self._step_each(*arguments)
        refused: dict[int, ActionError] = {}
        outcomes = self._outcomes.tolist()
        for seat in gains:
            try:
                self.arenas[seat].conclude(outcomes[seat], actions[seat], self._gain[seat])
            except ActionError as error:
                refused[seat] = error
        return refused

    def _prepare(self, seat: int, gain: FloatArray | None) -> None:
        """Write down what an arena is stepped with."""
        arena = self.arenas[seat]
        if gain is not None or self._has_gain[seat]:
            self._gain[seat] = 1.0 if gain is None else gain
            self._has_gain[seat] = gain is not None
        self._ticks[seat], self._has_changed[seat] = arena.tick + 1, arena.has_changed
        if self._draws_picks or self._draws_walks:
            picks, walks = arena.draws(arena.tick + 1)
            self._picks[seat], self._walks[seat] = picks[0], walks[0]

    def _note_addresses(self) -> None:
        """Note where the arrays of all arenas are: at first, after a reset, and where one has taken other arrays."""
        self._seated = [part for arena in self.arenas for part in arena.parts]
        self._places = *self._seated[:2], addresses(self._seated).reshape(-1, 2)


def are_others(now: Sequence[object], noted: Sequence[object]) -> bool:
    """Whether arenas have other objects now than when their addresses were noted."""
    return len(now) != len(noted) or any(map(is_not, now, noted))
