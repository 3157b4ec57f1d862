"""Batches of arenas in separate processes: the same interface as `ArenaBatch`, for machines with many cores."""

import contextlib
import multiprocessing
import pickle
import signal
import traceback
from collections.abc import Iterable, Mapping, Sequence
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.contract.types import BoolArray, ObsArray
from swarm_forage_env.policies.interface import GivenInterface, LearnerInterface
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.views.arenas import ArenaBatch, ArenaStep, checked_rows, closed_error
from swarm_forage_env.views.plans import ArenaPlan, plan_arena
from swarm_forage_env.views.sampler import ScenarioSampler
from swarm_forage_env.wrappers.base import WrapperConfig

_CLOSE = "close"
_GOODBYE_S = 10.0
"""Seconds that a process gets to end by itself before it is terminated."""


class ArenaProcessError(RuntimeError):
    """A process with arenas failed or is gone; the message holds its traceback or exit code."""


def _serve(pipe: Connection, plan: ArenaPlan, n_arenas: int, first_arena: int, n_arenas_in_all: int) -> None:
    """Main function of a process: answer numbered calls of `ArenaBatch` methods until told to close."""
    # Ctrl-C reaches every process of a terminal. Only the parent handles it, and closes this process if needed.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    batch: ArenaBatch | None = None
    while True:
        try:
            number, method, args, kwargs = pipe.recv()
        except EOFError:  # the parent is gone
            return
        try:
            if batch is None:
                batch = ArenaBatch(plan, n_arenas, first_arena=first_arena, n_arenas_in_all=n_arenas_in_all)
            pipe.send((number, getattr(batch, method)(*args, **kwargs), None))
        except BrokenPipeError:  # the parent no longer waits for the answer
            return
        except Exception as error:  # noqa: BLE001 - the parent raises it, whatever it is
            pipe.send((number, None, (_portable(error), traceback.format_exc())))
        if method == _CLOSE:
            return


def _portable(error: Exception) -> Exception:
    """Return the error if it can be pickled and unpickled, else one with the same text."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301 - what was pickled right here
    except Exception:  # noqa: BLE001 - errors of others can fail to pickle in any way
        return ArenaProcessError(f"{type(error).__name__}: {error}")
    return error


class ArenaProcesses:
    """Arenas spread evenly over processes; rows and arenas are numbered as in one `ArenaBatch`.

    Results equal those of one `ArenaBatch` bit for bit, because arenas are independent. Attributes as there.
    """

    def __init__(self, plan: ArenaPlan, n_arenas: int, n_processes: int, *, context: str = "spawn") -> None:
        """Start the processes.

        Args:
            plan: What every arena is made from.
            n_arenas: How many, at least one per process.
            n_processes: How many processes.
            context: How processes start, see `multiprocessing.get_context`; "spawn" works beside threads and
                everywhere, but needs the usual `if __name__ == "__main__"` in the starting script.

        Raises:
            ValueError: fewer arenas than processes, or a plan that cannot be built.
            ArenaProcessError: the first process ended while it started.
        """
        if not 1 <= n_processes <= n_arenas:
            raise ValueError(f"Expected n_processes from 1 to n_arenas = {n_arenas}, got {n_processes}.")
        self.n_arenas = n_arenas
        self.n_robots = plan.world.n_robots
        self.n_rows = n_arenas * self.n_robots
        self.render_mode = plan.render_mode
        self.interface = LearnerInterface(plan.interface, SwarmSpec.of(plan.world.scenario))
        self._shares = [part.tolist() for part in np.array_split(np.arange(n_arenas), n_processes)]
        starter: Any = multiprocessing.get_context(context)  # the declared type lacks Process, but every context has it
        self._pipes: list[Connection] = []
        self._processes = []
        self._n_asked = [0] * n_processes
        self._has_answered = [False] * n_processes
        for share in self._shares:
            ours, theirs = starter.Pipe()
            arguments = (theirs, plan, len(share), share[0], n_arenas)
            process = starter.Process(target=_serve, args=arguments, daemon=True)
            process.start()
            theirs.close()
            self._pipes.append(ours)
            self._processes.append(process)
        try:
            # The first call makes a process build its arenas. If one process can build the plan, all can.
            self.get_attribute("tick", [0])
        except BaseException:
            self.close()
            raise

    def _ask(self, process: int, method: str, *args: Any, **kwargs: Any) -> None:
        if not self._pipes:
            raise closed_error()
        self._n_asked[process] += 1
        try:
            self._pipes[process].send((self._n_asked[process], method, args, kwargs))
        except OSError:
            raise self._gone(process) from None

    def _gone(self, process: int) -> ArenaProcessError:
        self._processes[process].join(_GOODBYE_S)  # the exit code is known a moment after the pipe breaks
        exit_code = self._processes[process].exitcode
        told = f"The process of arenas {self._shares[process]} ended with exit code {exit_code}"
        if exit_code == 1 and not self._has_answered[process]:  # an exception while it started
            return ArenaProcessError(
                f"{told} while it started. A script that uses n_processes must do its work under "
                "`if __name__ == '__main__':`, because each process imports it; n_processes=0 needs no other process."
            )
        return ArenaProcessError(f"{told}.")

    def _answer(self, process: int) -> tuple[Any, tuple[Exception, str] | None]:
        """Wait for the answer to the last call; answers to earlier calls that were left unread (Ctrl-C) are skipped."""
        try:
            while True:
                number, result, failure = self._pipes[process].recv()
                self._has_answered[process] = True
                if number == self._n_asked[process]:
                    return result, failure
        except (EOFError, OSError):
            raise self._gone(process) from None

    def _answers(self, processes: Sequence[int]) -> list[Any]:
        """Wait for one answer of each; every answer is taken before the first failure is raised."""
        answers = [self._answer(process) for process in processes]
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
        actions = checked_rows(actions, self)
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
        """End all processes; unread answers are dropped. Closing twice is allowed."""
        pipes, self._pipes = self._pipes, []
        for pipe in pipes:
            with contextlib.suppress(OSError):  # it ended by itself
                pipe.send((0, _CLOSE, (), {}))
        for process, pipe in zip(self._processes, pipes, strict=False):
            # A process that is still sending can only end when its answer is read.
            with contextlib.suppress(EOFError, OSError):
                while pipe.poll(_GOODBYE_S):
                    pipe.recv_bytes()
            pipe.close()
            process.join(_GOODBYE_S)
            if process.is_alive():
                process.kill()
                process.join()


def open_arenas(
    scenario: str | ScenarioConfig | None = None,
    *,
    num_envs: int = 1,
    n_arenas: int | None = None,
    n_processes: int = 0,
    sampler: ScenarioSampler | None = None,
    interface: GivenInterface = None,
    wrappers: Iterable[WrapperConfig | str] = (),
    max_cycles: int | None = None,
    render_mode: str | None = None,
    snapshots: bool = False,
    turned: bool = False,
    **overrides: Any,
) -> ArenaBatch | ArenaProcesses:
    """Build arenas in this process or in others.

    Args:
        scenario: Name of a preset, or a complete configuration; default warehouse_small.
        num_envs: Robots in all arenas together, a multiple of the scenario's number. 1, the default of
            `gymnasium.make_vec`, leaves the choice to `n_arenas`.
        n_arenas: Arenas that run side by side; default as many as `num_envs` needs, at least one.
        n_processes: Processes that the arenas are spread over; 0 = all in this process.
        sampler: Draws the world of each run, instead of `scenario`, `wrappers` and `overrides`.
        interface: What a learner sees and does, an `InterfaceConfig` or its fields by name; default full observations
            and continuous actions.
        wrappers: What disturbs the swarm, in any order: configurations, or words as on the command line
            ("population:death_per_tick=0.01").
        max_cycles: Ticks until truncation; default the scenario's horizon.
        render_mode: None or "rgb_array".
        snapshots: Keep what copies and snapshots need; see `ForageEnv`.
        turned: Show each run turned or mirrored, see `plan_arena`.
        overrides: Scenario fields by name (`n_robots=20`, `nest_progress=0.1`).

    Raises:
        ConfigError: as `plan_arena`, or n_arenas below 1.
        ValueError: num_envs and n_arenas that do not fit together, more processes than arenas, or a window.
    """
    plan = plan_arena(
        scenario,
        sampler=sampler,
        interface=interface,
        wrappers=wrappers,
        max_cycles=max_cycles,
        render_mode=render_mode,
        snapshots=snapshots,
        turned=turned,
        **overrides,
    )
    if render_mode == "human":
        raise ValueError(
            "Expected render_mode None or 'rgb_array' for a vector environment, got 'human'; a window shows one arena, "
            "of parallel_env or JointForageEnv."
        )
    n_arenas = _number_of_arenas(num_envs, n_arenas, plan.world.n_robots)
    if n_processes:
        return ArenaProcesses(plan, n_arenas, n_processes)
    return ArenaBatch(plan, n_arenas)


def _number_of_arenas(num_envs: int, n_arenas: int | None, n_robots: int) -> int:
    if n_arenas is not None and num_envs not in (1, n_arenas * n_robots):
        raise ValueError(
            f"Expected num_envs = {n_arenas * n_robots} for n_arenas = {n_arenas} of n_robots = {n_robots} (one "
            f"sub-environment per robot), got {num_envs}; leave num_envs or n_arenas away."
        )
    if n_arenas is not None:
        return n_arenas
    if num_envs == 1:
        return 1
    if num_envs < 1 or num_envs % n_robots:
        raise ValueError(
            f"Expected num_envs to be a multiple of n_robots = {n_robots} (one sub-environment per robot), got "
            f"{num_envs}; choose another n_robots, or give n_arenas instead."
        )
    return num_envs // n_robots
