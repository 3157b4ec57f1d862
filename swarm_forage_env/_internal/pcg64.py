"""The uniform numbers of numpy's PCG64 by compiled code: the same bits, in less time.

The generator has a state of 128 bits, which becomes state * factor + term with every number. A step has to wait for the
one before. Here `LANES` neighbouring states go on by as many numbers at once, side by side. That is a step of the same
kind, with another factor and term. Source: O'Neill (2014), PCG; factor and output function (XSL-RR) are numpy's.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env._internal.compiling import is_compiled, kernel

# isort: split
from llvmlite import ir
from numba import types
from numba.extending import lower_builtin, type_callable

LANES = 4
_FACTOR = 0x2360ED051FC65DA44385DF649FCCF645
_STATES, _WORD_BITS = 2**128, 64
_TURN, _ROUND, _MOST = np.uint64(58), np.uint64(64), np.uint64(63)
_DROPPED, _UNIT = np.uint64(11), 2.0**-53


def state_after(high: Any, low: Any, by_high: Any, by_low: Any, more_high: Any, more_low: Any) -> tuple[Any, Any]:
    """Return state * factor + term modulo 2^128; all of them are given as a high and a low word."""
    state, factor, term = _joined(high, low), _joined(by_high, by_low), _joined(more_high, more_low)
    after_high, after_low = _words((state * factor + term) % _STATES)
    return np.uint64(after_high), np.uint64(after_low)


@type_callable(state_after)
def _type_of_state_after(_context: Any) -> Any:
    def typed(high: Any, low: Any, by_high: Any, by_low: Any, more_high: Any, more_low: Any) -> Any:
        words = {high, low, by_high, by_low, more_high, more_low}
        return types.UniTuple(types.uint64, 2) if words == {types.uint64} else None

    return typed


@lower_builtin(state_after, *[types.uint64] * 6)
def _lower_state_after(context: Any, builder: Any, signature: Any, words: Any) -> Any:
    word, whole = ir.IntType(_WORD_BITS), ir.IntType(2 * _WORD_BITS)
    shift = whole(_WORD_BITS)
    state, factor, term = (
        builder.or_(builder.shl(builder.zext(high, whole), shift), builder.zext(low, whole))
        for high, low in zip(words[::2], words[1::2], strict=True)
    )
    after = builder.add(builder.mul(state, factor), term)
    halves = builder.trunc(builder.lshr(after, shift), word), builder.trunc(after, word)
    return context.make_tuple(builder, signature.return_type, halves)


@kernel
def _uniform(high: np.uint64, low: np.uint64) -> float:
    """Return the number of a state, in [0, 1)."""
    word = high ^ low
    turn = high >> _TURN
    bits = (word >> turn) | (word << ((_ROUND - turn) & _MOST))
    return np.int64(bits >> _DROPPED) * _UNIT


@kernel
def write_uniform(lanes: NDArray[np.uint64], stride: NDArray[np.uint64], out: NDArray[np.float64]) -> None:
    """Write the next numbers.

    Args:
        lanes: (LANES, 2) high and low words of the states of the next numbers, changed.
        stride: (4,) words of factor and term that take a state on by `LANES` numbers.
        out: (n,) is written.
    """
    by_high, by_low, more_high, more_low = stride[0], stride[1], stride[2], stride[3]
    high_0, low_0, high_1, low_1 = lanes[0, 0], lanes[0, 1], lanes[1, 0], lanes[1, 1]
    high_2, low_2, high_3, low_3 = lanes[2, 0], lanes[2, 1], lanes[3, 0], lanes[3, 1]
    n_left = out.shape[0] % LANES
    for k in range(0, out.shape[0] - n_left, LANES):
        out[k] = _uniform(high_0, low_0)
        out[k + 1] = _uniform(high_1, low_1)
        out[k + 2] = _uniform(high_2, low_2)
        out[k + 3] = _uniform(high_3, low_3)
        high_0, low_0 = state_after(high_0, low_0, by_high, by_low, more_high, more_low)
        high_1, low_1 = state_after(high_1, low_1, by_high, by_low, more_high, more_low)
        high_2, low_2 = state_after(high_2, low_2, by_high, by_low, more_high, more_low)
        high_3, low_3 = state_after(high_3, low_3, by_high, by_low, more_high, more_low)
    lanes[0, 0], lanes[0, 1], lanes[1, 0], lanes[1, 1] = high_0, low_0, high_1, low_1
    lanes[2, 0], lanes[2, 1], lanes[3, 0], lanes[3, 1] = high_2, low_2, high_3, low_3
    for k in range(out.shape[0] - n_left, out.shape[0]):
        first_high, first_low = lanes[0, 0], lanes[0, 1]
        out[k] = _uniform(first_high, first_low)
        for lane in range(LANES - 1):
            lanes[lane, 0], lanes[lane, 1] = lanes[lane + 1, 0], lanes[lane + 1, 1]
        lanes[LANES - 1, 0], lanes[LANES - 1, 1] = state_after(
            first_high, first_low, by_high, by_low, more_high, more_low
        )


class Uniform:
    """Numbers of a generator's `random`, from where it stands when the first are drawn; it stays behind there."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Take the generator; those of another kind, or where the compiler is switched off, draw themselves."""
        self._rng = rng
        self._lanes = np.zeros((0, 2), np.uint64)
        self._stride = np.zeros(4, np.uint64)

    def fill(self, out: NDArray[np.float64]) -> None:
        """Write the next numbers into a contiguous array."""
        if type(self._rng.bit_generator) is not np.random.PCG64 or not is_compiled(write_uniform):
            self._rng.random(out=out)
            return
        if not len(self._lanes):
            self._read_generator()
        write_uniform(self._lanes, self._stride, out.reshape(out.size))

    def _read_generator(self) -> None:
        told: Any = self._rng.bit_generator.state
        state, term = told["state"]["state"], told["state"]["inc"]
        states = [state := (state * _FACTOR + term) % _STATES for _ in range(LANES)]
        self._lanes = np.array([_words(each) for each in states], np.uint64)
        factor, more = 1, 0
        for _ in range(LANES):
            factor, more = factor * _FACTOR % _STATES, (more * _FACTOR + term) % _STATES
        self._stride[:] = *_words(factor), *_words(more)


def _joined(high: Any, low: Any) -> int:
    """Return the number of 128 bits with these words."""
    return int(high) << _WORD_BITS | int(low)


def _words(number: int) -> tuple[int, int]:
    """Return the high and the low word of a number of 128 bits."""
    return number >> _WORD_BITS, number % 2**_WORD_BITS
