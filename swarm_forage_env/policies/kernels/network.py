"""A network that drives robots: its layers, its choice, and one tick of all robots.

Bits are the same on every machine, and a robot's do not depend on what other robots there are. The product of a library
of linear algebra adds up in the order that suits the processor and the shape, and the last bits of numpy's tanh and of
the C library's exponential depend on the processor. Here a sum goes from the bias through the columns from left to
right, and tanh and exponential are made of multiplications, additions and divisions, which round alike everywhere.
"""

from typing import NamedTuple

import numpy as np

from swarm_forage_env._internal.compiling import kernel, part
from swarm_forage_env.contract.types import ActionArray, BoolArray, FloatArray, IntArray, ObsArray, Row
from swarm_forage_env.policies.kernels.frames import leave_frames, take_frames
from swarm_forage_env.policies.kernels.learner import (
    N_SITES,
    SITE_COLUMNS,
    Translation,
    automatic_grip,
    compact_view,
    numbered_actions,
    remember_sites,
    show_sites,
    tell_sites,
)
from swarm_forage_env.policies.kernels.products import LANES, ROWS, add_products

_TANH_LIMIT = np.float32(9.0)
"""Where tanh rounds to 1 in float32."""
_LEAST_POWER = -64.0
"""Where an exponential is nothing beside 1, and the fraction of `power` is still above zero."""


class Layers(NamedTuple):
    """A perceptron, and room to work in."""

    sizes: IntArray
    """(layers + 1,) columns into the first layer, and outputs of each."""
    numbers: ObsArray
    """(rows, width) float32: of each layer, its biases and its weights (columns, outputs), padded with zeros."""
    is_tanh: bool
    """Activation after every layer but the last; else relu."""
    samples: bool
    """Whether discrete actions are drawn, see `pick`."""
    before: ObsArray
    """(ROWS, width) what goes into a layer."""
    after: ObsArray
    """(ROWS, width) what comes out of it."""
    places: IntArray
    """(ROWS,) which rows these are."""
    powers: FloatArray
    """(m,) see `pick`."""


class Choice(NamedTuple):
    """What robots saw and chose in the last decision."""

    seen: ObsArray
    """(N, d)."""
    outputs: ObsArray
    """(N, m) of the last layer; of continuous actions, cut to [-1, 1]."""
    number: IntArray
    """(N,) of discrete actions."""
    is_made: BoolArray
    """(N,) whether the robot was in the world; others stand until the next decision."""


@part
def _tanh(values: Row, n: int) -> None:
    """Tanh of the first `n` values, at most 4e-7 of its value from the true one.

    Lambert's fraction to the seventh power, at a quarter of the number, where it is good to the last bits; then twice
    tanh 2y = 2 t / (1 + t^2), with t = n / d as 2 n d / (d^2 + n^2). Our choice: it needs one division.
    """
    two = np.float32(2.0)
    for j in range(n):
        x = values[j]
        x = x if x < _TANH_LIMIT else _TANH_LIMIT
        x = np.float32(0.25) * (x if x > -_TANH_LIMIT else -_TANH_LIMIT)
        s = x * x
        above = x * (((s + np.float32(378.0)) * s + np.float32(17325.0)) * s + np.float32(135135.0))
        below = ((np.float32(28.0) * s + np.float32(3150.0)) * s + np.float32(62370.0)) * s + np.float32(135135.0)
        above, below = two * above * below, below * below + above * above
        above, below = two * above * below, below * below + above * above
        values[j] = np.divide(above, below)  # unlike /, it does not look for a zero, which is never there


@part
def _activate(values: ObsArray, n: int, is_tanh: bool) -> None:
    for r in range(values.shape[0]):
        if is_tanh:
            _tanh(values[r], n)
        else:
            for j in range(n):
                values[r, j] = values[r, j] if values[r, j] > 0.0 else np.float32(0.0)


@part
def _through(layers: Layers, n_taken: int, outputs: ObsArray) -> None:
    """Take the rows in `before` through the perceptron, and write what comes out to the first `n_taken` of `places`."""
    sizes, x, y = layers.sizes, layers.before, layers.after
    at, last = 0, sizes.shape[0] - 2
    for layer in range(last + 1):
        for first in range(0, sizes[layer + 1], LANES):
            add_products(x, layers.numbers, at, sizes[layer], first, y)
        if layer < last:
            _activate(y, sizes[layer + 1], layers.is_tanh)
        at += sizes[layer] + 1
        x, y = y, x
    for k in range(n_taken):
        for c in range(outputs.shape[1]):
            outputs[layers.places[k], c] = x[k, c]


@kernel
def forward(rows: ObsArray, layers: Layers, wanted: BoolArray, outputs: ObsArray) -> None:
    """Write the last layer's values (N, m) for those rows (N, d) that are wanted."""
    places, before = layers.places, layers.before
    n_rows, n_columns, n_taken = wanted.shape[0], rows.shape[1], 0
    for i in range(n_rows):
        if wanted[i]:
            for c in range(n_columns):
                before[n_taken, c] = rows[i, c]
            places[n_taken] = i
            n_taken += 1
        if n_taken == ROWS or (n_taken > 0 and i == n_rows - 1):
            _through(layers, n_taken, outputs)
            n_taken = 0


@kernel
def power(x: float) -> float:
    """E to the power of x <= 0: Pade's fraction of degree 3 at a sixteenth of it, where it is good; squared four times.

    At most 1e-5 of its value from the true one down to x = -10.
    """
    x = max(x, _LEAST_POWER) / 16.0
    s = x * x
    even, odd = 120.0 + 12.0 * s, x * (60.0 + s)
    share = np.divide(even + odd, even - odd)  # see _tanh
    share *= share
    share *= share
    share *= share
    return share * share


@kernel
def pick(logits: Row, samples: bool, chance: float, powers: FloatArray) -> int:
    """The number of the largest logit, the first of several; if it samples, one by their probabilities.

    `chance` is uniform in [0, 1); `powers` is room for as many numbers as there are logits.
    """
    n = logits.shape[0]
    best = 0
    for k in range(n):
        if logits[k] > logits[best]:
            best = k
    if not samples:
        return best
    most, total = float(logits[best]), 0.0
    for k in range(n):
        powers[k] = power(logits[k] - most)
    for k in range(n):
        total += powers[k]
    left = chance * total
    for k in range(n - 1):
        left -= powers[k]
        if left < 0.0:
            return k
    return n - 1


@kernel
def see(obs: ObsArray, decision: int, t: Translation, view: ObsArray) -> None:
    """Write what robots see (N, d), as `LearnerInterface.observe` does, and let them remember it."""
    if t.is_compact:
        compact_view(obs, t.view_starts, t.half[0], t.half[1], t.behind_counts, view)
    else:
        for i in range(obs.shape[0]):
            for c in range(t.n_shown):
                view[i, c] = obs[i, c]
    at = t.n_shown
    if t.has_memory:
        remember_sites(obs, t.pose_starts, t.cargo_starts, t.half, decision, t.sites)
        if t.hearing_m > 0.0:
            tell_sites(obs, t.pose_starts, t.half, t.hearing_m, t.sites)
        show_sites(obs, t.pose_starts, t.half, t.sites, view[:, at:])
        at += N_SITES * SITE_COLUMNS
    for i in range(obs.shape[0]):
        for c in range(t.own_columns.shape[0]):
            view[i, at + c] = obs[i, t.own_columns[c]]
    take_frames(view, decision, t.frames)


@part
def decide(obs: ObsArray, draws: FloatArray, decision: int, t: Translation, layers: Layers, choice: Choice) -> None:
    """Make the decision of every robot that is in the world; `decision` = how many were made before."""
    see(obs, decision, t, choice.seen)
    heading = t.pose_starts[1]
    for i in range(obs.shape[0]):
        choice.is_made[i] = obs[i, heading] != 0.0 or obs[i, heading + 1] != 0.0
        choice.outputs[i, :] = 0.0
        choice.number[i] = 0
    forward(choice.seen, layers, choice.is_made, choice.outputs)
    for i in range(obs.shape[0]):
        outputs = choice.outputs[i]
        if not t.is_discrete:
            for c in range(outputs.shape[0]):
                outputs[c] = min(max(outputs[c], np.float32(-1.0)), np.float32(1.0))
        elif choice.is_made[i]:
            chance = draws[i, 0] if layers.samples else 0.0
            choice.number[i] = pick(outputs, layers.samples, chance, layers.powers)


@kernel
def carry_out(obs: ObsArray, t: Translation, number: IntArray, values: ObsArray, actions: ActionArray) -> None:
    """Write the commands (N, A) of actions by number (N,), or by value (N, m) where they are continuous."""
    if t.is_discrete:
        numbered_actions(number, t.wheels, t.grips, obs, t.cargo_starts[0], actions)
    else:
        n_driven, n_said = t.n_driven, values.shape[1] - t.n_driven
        for i in range(actions.shape[0]):
            for c in range(n_driven):
                actions[i, c] = values[i, c]
            for c in range(n_said):  # the message, if there is one, comes last in both
                actions[i, actions.shape[1] - n_said + c] = values[i, n_driven + c]
    if t.grips_itself:
        automatic_grip(obs, t.grip_starts, actions)
    leave_frames(actions, t.frames)


@kernel
def keep_on(
    obs: ObsArray,
    _active: BoolArray,
    _draws: FloatArray,
    state: tuple[Translation, IntArray, ObsArray, ActionArray],
    _now: int,
) -> None:
    """One tick of a decision that a learner has made: `carry_out` of what is in `state`."""
    t, number, values, actions = state
    carry_out(obs, t, number, values, actions)


@kernel
def step_network(
    obs: ObsArray,
    _active: BoolArray,
    draws: FloatArray,
    state: tuple[Translation, Layers, Choice, ActionArray],
    now: int,
) -> None:
    """One tick of all robots, those in repair too: a decision if it is time for one, then its commands.

    `draws` is (N, 1) uniform in [0, 1), (N, 0) for a network that draws nothing.
    """
    t, layers, choice, actions = state
    if (now - 1) % t.decision_ticks == 0:
        decide(obs, draws, (now - 1) // t.decision_ticks, t, layers, choice)
    carry_out(obs, t, choice.number, choice.outputs, actions)
