"""What follows the ticks of a batch of arenas: rewards, rows and observations, of all arenas by one compiled call."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from swarm_forage_env._internal.compiling import direct, is_compiled
from swarm_forage_env._internal.held import addresses, hold
from swarm_forage_env.contract.types import BoolArray, FloatArray, IntArray, ObsArray
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.views.learner_arena import LearnerArena
from swarm_forage_env.world.kernels.lockstep import Robots, book_each, pay_each
from swarm_forage_env.world.lockstep import are_others
from swarm_forage_env.world.rewards import RewardModel


def can_book_together() -> bool:
    """Whether the compiler is on: interpreted functions cannot find arrays by their addresses."""
    return is_compiled(book_each)


class Bookkeeping:
    """Compiled calls for all arenas of a batch. What they do is bit for bit what the arenas do one by one.

    Attributes:
        pays: Whether `pay` can be called: no wrapper, no function of Python and no window takes part in a step.
        copies: Whether `book` writes the observations: learners see the rows of the environment as they are.
    """

    def __init__(self, arenas: Sequence[LearnerArena]) -> None:
        """Take the arenas; all must have been reset, and have observations of one shape."""
        self._arenas = tuple(arenas)
        self._n_terminated = np.zeros(len(arenas), np.int64)
        self._all_seats = np.arange(len(arenas), dtype=np.int64)
        self._pay: Callable[..., None] | None = None
        self._book: Callable[..., None] | None = None
        self._note_addresses()

    def __getstate__(self) -> dict[str, Any]:
        """Return what copies are made from: addresses are of this process and of these arrays only."""
        return {"arenas": self._arenas}

    def __setstate__(self, state: dict[str, Any]) -> None:
        Bookkeeping.__init__(self, state["arenas"])

    def follow(self) -> None:
        """Find the arrays again where a reset or a snapshot has replaced them; call it before each step."""
        if are_others([arena.forage_env.arena.swarm for arena in self._arenas], self._swarms):
            self._note_addresses()

    def _note_addresses(self) -> None:
        environments = [arena.forage_env for arena in self._arenas]
        self._swarms = [env.swarm for env in environments]
        self._models: list[RewardModel] = [env.reward_model for env in environments]
        plain = all(type(arena.env) is ForageEnv and arena.env.render_mode != "human" for arena in self._arenas)
        payments = [payment for model in self._models if (payment := model.payment) is not None]
        self.pays = plain and len(payments) == len(environments)
        self._payments = payments[:1], addresses(payments)
        self.copies = plain and all(arena.shows_all for arena in self._arenas)
        self._held = [hold(Robots(env.swarm, env.terminated, env.last_obs)) for env in environments]
        self._robots = self._held[0], addresses(self._held)
        self._no_obs = np.empty((0, *environments[0].last_obs.shape), np.float32)

    def remember(self, seats: Sequence[int]) -> None:
        """Keep what rewards need of the world before a tick."""
        for seat in seats:
            self._models[seat].remember()

    def pay(self, seats: Sequence[int], rewards: ObsArray) -> None:
        """Add the rewards of a tick to `rewards` (A, N) float32, for the arenas that were stepped."""
        (payment,), places = self._payments
        rows = self._all_seats if len(seats) == len(self._arenas) else np.array(seats, np.int64)
        arguments = payment, places, rows, rewards
        if self._pay is None:
            self._pay = direct(pay_each, *arguments)
        self._pay(*arguments)

    def book(
        self,
        rewards: ObsArray,
        rows: tuple[BoolArray, BoolArray, FloatArray, IntArray],
        flags: tuple[BoolArray, BoolArray],
        obs: ObsArray,
    ) -> list[int]:
        """Book a step and, where `copies`, write the observations; returns how many rows of each arena terminate.

        Args:
            rewards: (A, N) of the step.
            rows: absent, present, returns, lengths, each (A, N); see `world.kernels.reward.book_rows`.
            flags: terminated, active, each (A, N), are written.
            obs: (A, N, D).
        """
        n_terminated = self._n_terminated
        arguments = (*self._robots, rewards, *rows, *flags, n_terminated, obs if self.copies else self._no_obs)
        if self._book is None:
            self._book = direct(book_each, *arguments)
        self._book(*arguments)
        return n_terminated.tolist()
