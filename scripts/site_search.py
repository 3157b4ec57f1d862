"""What share of a run STOCHX's search for cache sites takes; for `scripts/bench.py`.

The search is compiled into the policy's kernel, so no stopwatch can be put around it. A run is therefore made twice:
once as ever, for its time, and once tick by tick, in which the inputs of all searches are noted. The search alone is
then timed on these inputs. In the run it is somewhat slower, because what it reads has not been read just before.
"""

import statistics
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from baselines.cache_memory import OneTaskMemory, TaskMemory, task_memory_of
from baselines.cache_sites import select_site
from baselines.robots import ACQUIRE, TRANSPORT, VECTOR_IDLE, Senses
from baselines.tasks import Goal
from swarm_forage_env._internal.compiling import direct, kernel
from swarm_forage_env.contract.types import BoolArray, FloatArray, ObsArray
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import LiveRun, build_stack, run_one, warm_up
from swarm_forage_env.runs.spec import RunSpec

MOST_KEPT = 20_000
"""Searches whose inputs are kept; of more, evenly spaced ones."""


@dataclass
class Searches:
    """The searches of a run. Lists hold one entry per search that is kept."""

    n_done: int = 0
    every: int = 1
    """Every so manyth is kept."""
    robots: list[Any] = field(default_factory=list)
    caches: list[Any] = field(default_factory=list)
    draws: list[FloatArray] = field(default_factory=list)
    places: list[tuple[float, float]] = field(default_factory=list)

    def note(self, *inputs: Any) -> None:
        """Count a search and keep its inputs: record, remembered caches, draws and believed place of a robot."""
        self.n_done += 1
        if self.n_done % self.every:
            return
        lists = self.robots, self.caches, self.draws, self.places
        for kept, value in zip(lists, inputs, strict=True):
            kept.append(value)
        if len(self.robots) == MOST_KEPT:
            self.every *= 2
            for kept in lists:
                del kept[::2]


@kernel
def search_all(
    robots: np.ndarray,
    caches: np.ndarray,
    draws: FloatArray,
    places: FloatArray,
    constants: np.ndarray,
    memory: TaskMemory,
) -> int:
    """Do all searches anew; returns how many found a site. Only remembered caches are read of a memory."""
    others = task_memory_of(memory, 0)
    n_found = 0
    for k in range(robots.shape[0]):
        senses = Senses(False, 0.0, 0.0, True, 0, places[k, 0], places[k, 1])
        known = OneTaskMemory(others.objects, caches[k], others.shunned)
        n_found += select_site(robots[k], senses, constants[0], draws[k], known)
    return n_found


def noted_searches(spec: RunSpec) -> tuple[Searches, tuple[Any, ...]]:
    """Make a run tick by tick; returns its searches, and the state of the policy's kernel."""
    policy: Any = load_policy(spec.policy, spec.parameters)
    run = LiveRun(build_stack(spec.scenario, reads=policy.reads), policy, spec.seed)
    compiled, act = policy.compiled(), policy.act
    constants, robots, memory, *_ = compiled.state
    c, searches = constants[0], Searches()

    def act_and_note(obs: ObsArray, active: BoolArray) -> np.ndarray:
        # With a goal, or while it does something else, a robot does not search; one that begins to carry does.
        had_no_goal = (robots["vector_state"] == VECTOR_IDLE) | robots["is_searching"]
        was_about = robots["activity"].copy()
        draws = compiled.next_ticks()[1][0]
        actions = act(obs, active)
        about = robots["activity"]
        may_search = np.isin(about, (ACQUIRE, TRANSPORT)) & (robots["goal_kind"] == Goal.SITE)
        for row in np.flatnonzero(may_search & active & (had_no_goal | (about != was_about))):
            x = (float(obs[row, c.position]) + 1.0) * c.half_width_m
            y = (float(obs[row, c.position + 1]) + 1.0) * c.half_height_m
            searches.note(robots[row].copy(), memory.caches[row].copy(), draws[row].copy(), (x, y))
        return actions

    policy.act = act_and_note
    run.advance()
    return searches, compiled.state


def share_of_run(spec: RunSpec, repeats: int) -> tuple[float, str]:
    """Return the share of the run's processor time that its searches take, and what it is made of."""
    searches, (constants, robots, memory, *_) = noted_searches(spec)
    if not searches.robots:
        return 0.0, "no searches"
    inputs = (
        np.array(searches.robots, robots.dtype),
        np.stack(searches.caches),
        np.stack(searches.draws),
        np.array(searches.places),
    )
    arguments = (*inputs, constants, memory)
    again = direct(search_all, *arguments)
    n_found = again(*arguments)
    rounds = []
    for _ in range(max(3, repeats)):
        started = time.process_time()
        again(*arguments)
        rounds.append(time.process_time() - started)
    n_kept = len(searches.robots)
    seconds = statistics.median(rounds) / n_kept * searches.n_done
    warm_up(spec)
    started = time.process_time()
    run_one(spec)
    whole = time.process_time() - started
    known = inputs[0]["n_caches"]
    each_ns = seconds / searches.n_done * 1e9
    note = (
        f"{searches.n_done:,} searches of {each_ns:,.0f} ns, {n_found / n_kept:.0%} with a site, "
        f"{known.mean():.1f} caches known (at most {known.max()}); run {whole:.3g} s"
    )
    return seconds / whole, note
