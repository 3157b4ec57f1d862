"""STOCH-N1: each robot draws its next task from the neighbourhood of its last one in the task graph.

A robot has one active task allocation block (TAB): a root task that it can do as a whole, or partitioned into two
subtasks. When a task ends, the active block may move to its neighbour (`move_probability`). Then the robot does either
the block's root or, with `partition_probability`, one of its subtasks (`switch_probability`). While it works it may
give up (`abort_probability`). All four probabilities compare estimates of how long the tasks take. An estimate is a
moving average of the robot's own times (`new_estimate`).

Times are in control ticks. Source: STOCHM and STOCHX of the paper, section "Candidate Algorithms"; the numbers are in
`tasks`. Whole-number arithmetic of the authors' program is the quirk `integer_estimates`.

Conventions: `c` is the record of `parameters.kernel_constants`, `i` a robot, `u...` uniform draws in [0, 1).
"""

import math
from typing import NamedTuple

import numpy as np

from swarm_forage_env._internal.compiling import kernel, part
from swarm_forage_env.contract.codes import SOURCE, TAB_CHILDREN, TAB_ROOT, Goal, Tab, Task
from swarm_forage_env.contract.types import BoolArray, CodeArray, FloatArray, IntArray, Row
from swarm_forage_env.scenarios.quirks import Quirks

from .robots import ACQUIRE, TRANSPORT, WAIT_DROP, WAIT_PICKUP
from .tasks import N_TABS, N_TASKS, ROOTED_TAB, TaskParameters

NO_TASK = int(Task.NONE)
_GENERALIST = int(Task.GENERALIST)
_TRANSFERER = int(Task.TRANSFERER)
_TAB_G = int(Tab.GENERALIST)
_CACHE = int(Goal.CACHE)


class Allocation(NamedTuple):
    """Where every robot stands in the task graph and what it expects of the tasks."""

    task: CodeArray
    """(N,) current task, or the one that has just ended; `Task.NONE` before the first."""
    tab: CodeArray
    """(N,) active block, a `tasks.Tab` code."""
    last_child: CodeArray
    """(N, N_TABS) index (0, 1) of the subtask chosen last in each block."""
    partition: FloatArray
    """(N, N_TABS) probability of choosing a subtask, as of the last task that ended in that block."""
    estimate: FloatArray
    """(N, N_TASKS) expected execution time."""
    exec_start: IntArray
    """(N, N_TASKS) tick from which the execution time counts."""
    exec_time: IntArray
    """(N, N_TASKS) execution time at the end of the last executed tick of that task."""
    p_abort: FloatArray
    """(N, N_TASKS) probability of giving up in the next tick."""
    has_interface: BoolArray
    """(N, N_TASKS) whether the robot is where the task meets another one: at or on the way to a cache or its site."""


@part
def logistic(x: float) -> float:
    """1 / (1 + exp(-x)), without overflow."""
    small = math.exp(-abs(x))
    return (1.0 if x >= 0.0 else small) / (1.0 + small)


@kernel
def partition_probability(
    root: float, subtasks: float, reactivity: float, offset: float, gamma: float, is_integer: bool
) -> float:
    """Probability of doing a subtask instead of the root.

        theta = k (T / S - offset)  if T > S  else  k (offset - S / T);   P = min(1, gamma / (1 + exp(-theta)))

    A zero divisor gives theta = 0.

    Args:
        root: Estimate T of the root.
        subtasks: Sum S of the estimates of both subtasks.
        reactivity: k.
        offset: The quotient that gives P = gamma / 2.
        gamma: Scale.
        is_integer: Quotient and bracket are truncated to whole numbers.
    """
    bracket = 0.0
    if root > subtasks:
        if subtasks > 0.0:
            bracket = truncated(root / subtasks, is_integer) - offset
    elif root > 0.0:
        bracket = offset - truncated(subtasks / root, is_integer)
    return min(1.0, gamma * logistic(reactivity * truncated(bracket, is_integer)))


@part
def truncated(value: float, is_integer: bool) -> float:
    """Return `value`, or its whole part under the quirk `integer_estimates`."""
    return float(int(value)) if is_integer else value


@kernel
def switch_probability(last: float, other: float, reactivity: float, offset: float, gamma: float) -> float:
    """Probability of switching from the subtask done last to the other one.

        ratio = T_last / T_other  if T_other > T_last  else 1;   p = gamma / (1 + exp(-k (ratio - offset)))

    A zero estimate gives ratio = 1.

    Args:
        last: Estimate of the subtask done last.
        other: Estimate of the other one.
        reactivity: k.
        offset: The ratio that gives p = gamma / 2.
        gamma: Scale.
    """
    ratio = last / other if other > last > 0.0 else 1.0
    return gamma * logistic(reactivity * (ratio - offset))


@part
def imbalance(root: float, subtasks: float, is_integer: bool) -> float:
    """Imbalance of a block: rho = |(T - S) / T|, truncated under the quirk; `root` must not be 0."""
    return truncated(abs(root - subtasks) / root, is_integer)


@kernel
def move_probability(
    root: float,
    subtasks: float,
    next_root: float,
    next_subtasks: float,
    reactivity: float,
    offset: float,
    gamma: float,
    is_integer: bool,
) -> float:
    """Probability of moving the active block to a neighbouring one.

        p = gamma / (1 + exp(-k (rho / rho_next - offset)));   gamma if either block is balanced (rho = 0)

    Where both roots have no estimate, rho = S; where one has none, p = gamma.

    Args:
        root: Estimate T of the active block's root.
        subtasks: Sum S of the estimates of its subtasks.
        next_root: The same for the neighbour.
        next_subtasks: The same for the neighbour.
        reactivity: k.
        offset: The ratio that gives p = gamma / 2.
        gamma: Scale.
        is_integer: Imbalances are truncated to whole numbers.
    """
    if root == 0.0 and next_root == 0.0:
        rho = subtasks
        next_rho = next_subtasks
    elif root == 0.0 or next_root == 0.0:
        return gamma
    else:
        rho = imbalance(root, subtasks, is_integer)
        next_rho = imbalance(next_root, next_subtasks, is_integer)
    if rho <= 0.0 or next_rho <= 0.0:
        return gamma
    return gamma * logistic(reactivity * (rho / next_rho - offset))


@kernel
def abort_probability(
    exec_time: float, estimate: float, reactivity: float, offset: float, gamma: float, least: float
) -> float:
    """Probability per tick of giving up: p = gamma / (1 + exp(k |r - offset|)), r = execution time / estimate.

    The curve is a bump, not a step: beyond `offset` estimates the probability of giving up falls again.

    Args:
        exec_time: Execution time so far.
        estimate: Estimate of the task; 0 gives p = `least`.
        reactivity: k.
        offset: The r of the maximum, gamma / 2.
        gamma: Scale.
        least: Minimum probability.
    """
    if estimate <= 0.0:
        return least
    return gamma * logistic(-reactivity * abs(exec_time / estimate - offset))


@kernel
def new_estimate(estimate: float, exec_time: float, weight: float, is_integer: bool) -> float:
    """Exponential moving average (1 - a) T + a t; finished and aborted executions alike."""
    return truncated((1.0 - weight) * estimate + weight * exec_time, is_integer)


def new_allocation(
    n_robots: int, parameters: TaskParameters, quirks: Quirks, n_tabs: int, rng: np.random.Generator
) -> Allocation:
    """Return the state before the first task: estimates and first block drawn at random, for all robots.

    Args:
        n_robots: N.
        parameters: Numbers of the controller.
        quirks: `integer_estimates` matters here: the partition probabilities then come from estimates still at 0.
        n_tabs: 1: only the Generalist's block; 3: a robot starts in the Harvester's or in the Collector's.
        rng: Generator of the policy's stream.
    """
    draws = rng.random((n_robots, N_TASKS + 3))
    low = np.full(N_TASKS, math.ceil(parameters.subtask_estimate_low_ticks))
    high = np.full(N_TASKS, math.floor(parameters.subtask_estimate_high_ticks))
    low[_GENERALIST] = math.ceil(parameters.generalist_estimate_low_ticks)
    high[_GENERALIST] = math.floor(parameters.generalist_estimate_high_ticks)
    estimate = np.floor(low + draws[:, :N_TASKS] * (high - low + 1))
    heads = (draws[:, N_TASKS:] < 0.5).astype(np.int8)
    last_child = np.empty((n_robots, N_TABS), np.int8)
    last_child[:, _TAB_G] = heads[:, 0]
    last_child[:, _TAB_G + 1 :] = heads[:, 1:2]  # one coin for both lower blocks
    partition = np.empty((n_robots, N_TABS))
    for tab in range(N_TABS):
        # Quirk integer_estimates: probabilities are set before the estimates are seeded.
        seeds = np.zeros_like(estimate) if quirks.integer_estimates else estimate
        root, subtasks = seeds[:, TAB_ROOT[tab]], seeds[:, TAB_CHILDREN[tab]].sum(axis=1)
        partition[:, tab] = [
            partition_probability(
                whole,
                parts,
                parameters.partition_reactivity,
                parameters.partition_offset,
                parameters.partition_gamma,
                quirks.integer_estimates,
            )
            for whole, parts in zip(root.tolist(), subtasks.tolist(), strict=True)
        ]
    return Allocation(
        task=np.full(n_robots, NO_TASK, np.int8),
        tab=1 + heads[:, 2] if n_tabs > 1 else np.full(n_robots, _TAB_G, np.int8),
        last_child=last_child,
        partition=partition,
        estimate=estimate,
        exec_start=np.zeros((n_robots, N_TASKS), np.int32),
        exec_time=np.zeros((n_robots, N_TASKS), np.int32),
        p_abort=np.zeros((n_robots, N_TASKS)),
        has_interface=np.zeros((n_robots, N_TASKS), np.bool_),
    )


@part
def _subtask_sum(a: Allocation, i: int, tab: int) -> float:
    return a.estimate[i, TAB_CHILDREN[tab, 0]] + a.estimate[i, TAB_CHILDREN[tab, 1]]


@kernel
def end_task(a: Allocation, i: int, now: int, c: Row) -> None:
    """Account for the current task, finished or aborted: its estimate, and the active block's partition."""
    task = a.task[i]
    tab = a.tab[i]
    is_integer = c.integer_estimates != 0
    a.estimate[i, task] = new_estimate(a.estimate[i, task], a.exec_time[i, task], c.estimate_weight, is_integer)
    a.exec_start[i, task] = now
    a.partition[i, tab] = partition_probability(
        a.estimate[i, int(TAB_ROOT[tab])],
        _subtask_sum(a, i, tab),
        c.partition_reactivity,
        c.partition_offset,
        c.partition_gamma,
        is_integer,
    )


@part
def move_tab(a: Allocation, i: int, c: Row, u: float) -> None:
    """Decide whether the active block moves by one level, after the task that has just ended.

    After its root, a lower block moves up; after the root of a lower block, the Generalist's block moves down to it.
    """
    tab = a.tab[i]
    candidate = int(ROOTED_TAB[a.task[i]])
    if tab == _TAB_G:
        if candidate <= _TAB_G or candidate >= c.n_tabs:
            return
    elif candidate == tab:
        candidate = _TAB_G
    else:
        return
    p = move_probability(
        a.estimate[i, int(TAB_ROOT[tab])],
        _subtask_sum(a, i, tab),
        a.estimate[i, int(TAB_ROOT[candidate])],
        _subtask_sum(a, i, candidate),
        c.tab_reactivity,
        c.tab_offset,
        c.tab_gamma,
        c.integer_estimates != 0,
    )
    if u < p:
        a.tab[i] = candidate


@part
def choose_task(a: Allocation, i: int, c: Row, u_partition: float, u_switch: float) -> None:
    """Choose the next task inside the active block: its root or one of its subtasks."""
    tab = a.tab[i]
    if u_partition >= a.partition[i, tab]:
        a.task[i] = TAB_ROOT[tab]
        return
    last = a.last_child[i, tab]
    p = switch_probability(
        a.estimate[i, int(TAB_CHILDREN[tab, last])],
        a.estimate[i, int(TAB_CHILDREN[tab, 1 - last])],
        c.subtask_reactivity,
        c.subtask_offset,
        c.subtask_gamma,
    )
    if u_switch < p:
        last = 1 - last
    a.last_child[i, tab] = last
    a.task[i] = TAB_CHILDREN[tab, last]


@part
def start_task(a: Allocation, i: int, now: int, c: Row) -> None:
    """Start the execution of the task that was chosen."""
    task = a.task[i]
    if not c.exec_time_since_last_completion:  # quirk: time spent in other tasks since the last end counts too
        a.exec_start[i, task] = now
        a.exec_time[i, task] = 0
        a.p_abort[i, task] = 0.0
    if not c.interface_flag_survives_abort:  # quirk: an aborted execution leaves its interface marked active
        a.has_interface[i, task] = False


@kernel
def next_task(a: Allocation, i: int, now: int, c: Row, u_move: float, u_partition: float, u_switch: float) -> None:
    """Allocate and start the first task, or the one after the task that has just ended."""
    if a.task[i] != NO_TASK:
        move_tab(a, i, c, u_move)
    choose_task(a, i, c, u_partition, u_switch)
    start_task(a, i, now, c)


@kernel
def interface_after(had_interface: bool, task: int, activity: int, c: Row) -> bool:
    """Whether a task's interface is active after a tick spent in `activity`.

    It is active while a cache is being acquired, until the robot waits to pick up there, and from the start of the
    transport to anything but the nest until the robot waits to drop.
    """
    takes_from_cache = SOURCE[task] == _CACHE
    # Quirk transferer_interface_never_leaves: only its transport activates the interface, and nothing ends it.
    is_stuck = task == _TRANSFERER and c.transferer_interface_never_leaves != 0
    if activity == TRANSPORT or (activity == ACQUIRE and takes_from_cache and not is_stuck):
        return True
    if activity == WAIT_PICKUP and takes_from_cache and not is_stuck:
        return False
    if activity == WAIT_DROP and not is_stuck:
        return False
    return had_interface


@kernel
def after_tick(a: Allocation, i: int, now: int, activity: int, c: Row) -> None:
    """Account for a tick in which the current task was executed: its time, abort probability and interface."""
    task = a.task[i]
    exec_time = now - a.exec_start[i, task]
    a.exec_time[i, task] = exec_time
    if task == _GENERALIST or a.has_interface[i, task]:
        a.p_abort[i, task] = abort_probability(
            exec_time,
            a.estimate[i, task],
            c.abort_reactivity,
            c.abort_offset,
            c.abort_gamma,
            c.least_abort_probability,
        )
    else:
        a.p_abort[i, task] = c.least_abort_probability
    a.has_interface[i, task] = interface_after(a.has_interface[i, task], task, activity, c)
