"""Task allocation with frozen estimates as a Markov chain, solved exactly. Twin of `baselines.stoch_n1`.

A state is (active block, last task, last subtask of each block). Formulas are written out once more, on purpose.
"""

import itertools
import math
from collections.abc import Iterator, Mapping

import numpy as np

CHILDREN = {
    "generalist": ("harvester", "collector"),
    "harvester": ("starter", "finisher"),
    "collector": ("transferer", "cache_collector"),
}
"""Root of each block -> its subtasks. Blocks are called by their roots."""

State = tuple[str, str, tuple[tuple[str, str], ...]]


def whole(value: float, integer: bool) -> float:
    """Truncate towards zero if asked."""
    return math.trunc(value) if integer else value


def partition(estimates: Mapping[str, float], root: str, k: float, gamma: float, integer: bool) -> float:
    """Probability of a subtask instead of `root`."""
    t, s = estimates[root], sum(estimates[child] for child in CHILDREN[root])
    bracket = whole(t / s, integer) - 1.25 if t > s else 1.25 - whole(s / t, integer)
    return min(1.0, gamma / (1.0 + math.exp(-k * whole(bracket, integer))))


def switch(estimates: Mapping[str, float], last: str, other: str, k: float, gamma: float) -> float:
    """Probability of switching to the other subtask."""
    ratio = min(1.0, estimates[last] / estimates[other])
    return gamma / (1.0 + math.exp(-k * (ratio - 1.25)))


def move(estimates: Mapping[str, float], here: str, there: str, integer: bool) -> float:
    """Probability of moving to a neighbouring block."""
    rho = [
        whole(abs(estimates[root] - sum(estimates[child] for child in CHILDREN[root])) / estimates[root], integer)
        for root in (here, there)
    ]
    if 0 in rho:
        return 0.5
    return 0.5 / (1.0 + math.exp(-4.0 * (rho[0] / rho[1] - 3.0)))


def successors(
    state: State,
    estimates: Mapping[str, float],
    blocks: tuple[str, ...],
    p_partition: Mapping[str, float],
    subtask: tuple[float, float],
    integer: bool,
) -> Iterator[tuple[State, float]]:
    """All next states with their probabilities; `subtask` = k and gamma of the switch."""
    here, last_task, lasts = state
    there = here
    if here == last_task != "generalist":
        there = "generalist"
    elif here == "generalist" and last_task != "generalist" and last_task in blocks:
        there = last_task
    p_move = move(estimates, here, there, integer) if there != here else 0.0
    for block, p_block in ((here, 1.0 - p_move), (there, p_move)):
        p_child = p_partition[block]
        yield (block, block, lasts), p_block * (1.0 - p_child)
        last = dict(lasts)[block]
        other = next(child for child in CHILDREN[block] if child != last)
        p_switch = switch(estimates, last, other, *subtask)
        yield (block, last, lasts), p_block * p_child * (1.0 - p_switch)
        switched = tuple(sorted({**dict(lasts), block: other}.items()))
        yield (block, other, switched), p_block * p_child * p_switch


def stationary_shares(
    estimates: Mapping[str, float],
    blocks: tuple[str, ...],
    p_partition: Mapping[str, float],
    subtask: tuple[float, float],
    integer: bool,
) -> dict[str, float]:
    """Share of executions of each task in the long run."""
    tasks = sorted({*blocks, *(child for block in blocks for child in CHILDREN[block])})
    lasts = [
        tuple(zip(sorted(blocks), choice, strict=True))
        for choice in itertools.product(*(CHILDREN[block] for block in sorted(blocks)))
    ]
    states: list[State] = list(itertools.product(blocks, tasks, lasts))
    index = {state: k for k, state in enumerate(states)}
    chain = np.zeros((len(states), len(states)))
    for state in states:
        for successor, probability in successors(state, estimates, blocks, p_partition, subtask, integer):
            chain[index[state], index[successor]] += probability
    system = np.vstack([chain.T - np.eye(len(states)), np.ones(len(states))])
    flow = np.linalg.lstsq(system, np.append(np.zeros(len(states)), 1.0), rcond=None)[0]
    return {task: float(sum(flow[index[s]] for s in states if s[1] == task)) for task in tasks}
