"""Sums of products for several rows and outputs at once, as vectors of the processor.

The compiler by itself makes vectors half as wide as some processors have them, and brings every sum to memory and back
after a few products. Here a sum stays in a register until it is done. Each goes from left to right, and every product
is rounded before it is added: what comes out has the same bits on every machine, however wide its vectors are.
"""

from typing import Any

from swarm_forage_env._internal import numba_settings  # noqa: F401  (before numba)

# isort: split
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import lower_builtin, type_callable

from swarm_forage_env.contract.types import ObsArray

ROWS = 4
"""Rows that are summed together: a weight is read once for all of them."""
LANES = 16
"""Outputs that are summed together: as many numbers as the widest vectors have; of narrower ones it takes several."""


def add_products(rows: ObsArray, numbers: ObsArray, at: int, n_columns: int, first: int, out: ObsArray) -> None:
    """Write `LANES` sums from column `first` on in `ROWS` rows of `out`; all arrays (.., W) are contiguous.

    A sum is numbers[at] plus rows[:, k] numbers[at + 1 + k] for k = 0, ..., `n_columns` - 1.
    This is what it does where the compiler is switched off; compiled kernels do it as `_vectors` says.
    """
    lanes = slice(first, first + LANES)
    out[:, lanes] = numbers[at, lanes]
    for k in range(n_columns):
        out[:, lanes] += rows[:, k : k + 1] * numbers[at + 1 + k, lanes]


@type_callable(add_products)
def _typed(_: Any) -> Any:
    return lambda rows, numbers, at, n_columns, first, out: types.void  # noqa: ARG005 - of these names and no others


@lower_builtin(add_products, types.Array, types.Array, types.Integer, types.Integer, types.Integer, types.Array)
def _vectors(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    arrays = [context.make_array(signature.args[n])(context, builder, value=args[n]) for n in (0, 1, 5)]
    rows, numbers, out = (array.data for array in arrays)
    width = builder.extract_value(arrays[1].shape, 1)
    size, vector = width.type, ir.VectorType(ir.FloatType(), LANES)
    at, n_columns, first = (
        context.cast(builder, value, kind, types.intp)
        for value, kind in zip(args[2:5], signature.args[2:5], strict=True)
    )

    def place(data: Any, row: Any, column: Any) -> Any:
        return builder.gep(data, [builder.add(builder.mul(row, width), column)])

    def lanes(data: Any, row: Any) -> Any:
        return builder.bitcast(place(data, row, first), vector.as_pointer())

    def each(value: Any) -> Any:
        lone = builder.insert_element(ir.Constant(vector, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
        return builder.shuffle_vector(lone, lone, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES))

    sums = [cgutils.alloca_once_value(builder, builder.load(lanes(numbers, at), align=4)) for _ in range(ROWS)]
    with cgutils.for_range(builder, n_columns) as loop:
        weight_row = builder.add(builder.add(at, size(1)), loop.index)
        weights = builder.load(lanes(numbers, weight_row), align=4)
        for row, total in enumerate(sums):
            value = each(builder.load(place(rows, size(row), loop.index)))
            builder.store(builder.fadd(builder.load(total), builder.fmul(value, weights)), total)
    for row, total in enumerate(sums):
        builder.store(builder.load(total), lanes(out, size(row)), align=4)
    return context.get_dummy_value()
