"""Batches of arenas in processes of their own: the same interface as `ArenaBatch`, for machines with many cores."""

import multiprocessing
import traceback
from collections.abc import Mapping, Sequence
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from swarm_forage_env.learning.arenas import ArenaBatch, ArenaStep
from swarm_forage_env.learning.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.learning.worlds import World, WorldPlan
from swarm_forage_env.types import BoolArray, ObsArray

_CLOSE = "close"


class ArenaProcessError(RuntimeError):
    """A process with arenas failed; the message holds its traceback."""


def _serve(pipe: Connection, plan: WorldPlan, interface: InterfaceConfig, n_arenas: int, first_arena: int) -> None:
    """Answer calls of `ArenaBatch` methods until told to close; the whole life of a process."""
    batch: ArenaBatch | None = None
    while True:
        try:
            method, args, kwargs = pipe.recv()
        except (EOFError, KeyboardInterrupt):  # the parent is gone, or the person at the keyboard wants an end
            return
        try:
            if batch is None:
                batch = ArenaBatch(plan, interface, n_arenas, first_arena=first_arena)
            pipe.send((getattr(batch, method)(*args, **kwargs), None))
        except Exception as error:  # noqa: BLE001 - whatever it is, the parent has to raise it
            pipe.send((None, (error, traceback.format_exc())))
        if method == _CLOSE:
            return


class ArenaProcesses:
    """Arenas spread evenly over processes; rows and arenas count as if they were one `ArenaBatch`.

    Results are those of one `ArenaBatch` bit for bit: arenas know nothing of each other. Attributes as there.
    """

    def __init__(
        self, plan: WorldPlan, interface: InterfaceConfig, n_arenas: int, n_processes: int, *, context: str = "spawn"
    ) -> None:
        """Start the processes.

        Args:
            plan: What every arena is made from.
            interface: What learners see and do.
            n_arenas: How many, at least one per process.
            n_processes: How many processes.
            context: How processes start, see `multiprocessing.get_context`; "spawn" works beside threads and
                everywhere, but needs the usual `if __name__ == "__main__"` in the starting script.

        Raises:
            ValueError: fewer arenas than processes.
        """
        if not 1 <= n_processes <= n_arenas:
            raise ValueError(f"Expected n_processes from 1 to n_arenas = {n_arenas}, got {n_processes}.")
        self.n_arenas = n_arenas
        self.n_robots = plan.scenario.robots.n_robots
        self.n_rows = n_arenas * self.n_robots
        self.interface = LearnerInterface(interface, World(plan).base.task)
        self._shares = [part.tolist() for part in np.array_split(np.arange(n_arenas), n_processes)]
        starter = multiprocessing.get_context(context)
        self._pipes: list[Connection] = []
        self._processes = []
        for share in self._shares:
            ours, theirs = starter.Pipe()
            arguments = (theirs, plan, interface, len(share), share[0])
            process = starter.Process(target=_serve, args=arguments, daemon=True)  # type: ignore[attr-defined]
            process.start()
            theirs.close()
            self._pipes.append(ours)
            self._processes.append(process)

    def _ask(self, process: int, method: str, *args: Any, **kwargs: Any) -> None:
        self._pipes[process].send((method, args, kwargs))

    def _answers(self, processes: Sequence[int]) -> list[Any]:
        """Wait for one answer of each; every answer is taken before the first failure is raised."""
        answers = []
        for process in processes:
            try:
                answers.append(self._pipes[process].recv())
            except EOFError as error:
                raise ArenaProcessError(
                    f"The process of arenas {self._shares[process]} ended with exit code "
                    f"{self._processes[process].exitcode}."
                ) from error
        for _, failure in answers:
            if failure is not None:
                error, trace = failure
                raise error from ArenaProcessError(trace)
        return [result for result, _ in answers]

    def _ask_all(self, method: str, parts: Sequence[tuple[Any, ...]]) -> list[Any]:
        for process, part in enumerate(parts):
            self._ask(process, method, *part)
        return self._answers(range(len(parts)))

    def reset(
        self, seeds: Sequence[int | None], options: Sequence[Mapping[str, Any] | None]
    ) -> tuple[ObsArray, BoolArray]:
        """Start a run in every arena; see `ArenaBatch.reset`."""
        parts = [([seeds[a] for a in share], [options[a] for a in share]) for share in self._shares]
        results = self._ask_all("reset", parts)
        return np.concatenate([obs for obs, _ in results]), np.concatenate([active for _, active in results])

    def step(self, actions: np.ndarray) -> ArenaStep:
        """Step every arena by one decision, all processes at once; see `ArenaBatch.step`."""
        if len(actions) != self.n_rows:
            raise ValueError(
                f"Expected actions for {self.n_rows} rows ({self.n_arenas} arenas of {self.n_robots} robots), "
                f"got shape {actions.shape}."
            )
        n_robots = self.n_robots
        parts = [(actions[share[0] * n_robots : (share[-1] + 1) * n_robots],) for share in self._shares]
        steps: list[ArenaStep] = self._ask_all("step", parts)
        firsts = [share[0] * n_robots for share in self._shares]
        names = ("obs", "rewards", "terminated", "truncated", "active", "final_obs", "is_episode", "returns", "lengths")
        joined = {name: np.concatenate([getattr(step, name) for step in steps]) for name in names}
        ended = [step.ended + np.int32(first) for step, first in zip(steps, firsts, strict=True)]
        outcomes = tuple(outcome for step in steps for outcome in step.outcomes)
        return ArenaStep(**joined, ended=np.concatenate(ended), outcomes=outcomes)

    def action_masks(self) -> BoolArray:
        """Return which discrete actions make sense now; see `ArenaBatch.action_masks`."""
        return np.concatenate(self._ask_all("action_masks", [()] * len(self._shares)))

    def render(self) -> list[np.ndarray | None]:
        """Return one picture per arena."""
        return [picture for part in self._ask_all("render", [()] * len(self._shares)) for picture in part]

    def get_attribute(self, name: str, arenas: Sequence[int]) -> list[Any]:
        """Return an attribute of the environments of some arenas; it must be picklable."""
        return self._ask_some(arenas, "get_attribute", name)

    def set_attribute(self, name: str, value: Any, arenas: Sequence[int]) -> None:
        """Set an attribute of the environments of some arenas."""
        self._ask_some(arenas, "set_attribute", name, value)

    def call_method(self, name: str, arenas: Sequence[int], *args: Any, **kwargs: Any) -> list[Any]:
        """Call a method of the environments of some arenas, once each; arguments and results must be picklable."""
        return self._ask_some(arenas, "call_method", name, rest=args, **kwargs)

    def _ask_some(
        self, arenas: Sequence[int], method: str, *first: Any, rest: tuple[Any, ...] = (), **kwargs: Any
    ) -> list[Any]:
        """Call a method that takes arena numbers after `first`; returns one result per arena, in their order."""
        asked: list[tuple[int, list[int]]] = []
        for process, share in enumerate(self._shares):
            mine = [arena for arena in arenas if arena in share]
            if mine:
                self._ask(process, method, *first, [arena - share[0] for arena in mine], *rest, **kwargs)
                asked.append((process, mine))
        found: dict[int, Any] = {}
        for (_, mine), results in zip(asked, self._answers([process for process, _ in asked]), strict=True):
            found.update(zip(mine, results or [None] * len(mine), strict=True))
        return [found[arena] for arena in arenas]

    def close(self) -> None:
        """End all processes."""
        for process, pipe in enumerate(self._pipes):
            if self._processes[process].is_alive():
                pipe.send((_CLOSE, (), {}))
        for process, pipe in zip(self._processes, self._pipes, strict=True):
            process.join()
            pipe.close()
        self._pipes = []
