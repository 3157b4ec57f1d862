"""Asking for memory before it is needed, for swarms that no cache of a processor holds.

Kernels go through robots row by row. What belongs to a row, or to the place on the floor where its robot stands, then
comes from main memory, a tenth of a microsecond away. Asked for some rows ahead, it is there in time. It changes no
result: a processor may even ignore it.
"""

from typing import Any

import numpy as np

from swarm_forage_env._internal import numba_settings  # noqa: F401  (before numba)

# isort: split
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import lower_builtin, type_callable

AHEAD = 16
"""Rows that are asked for ahead."""
LINE = 64
"""Bytes that a processor fetches at once."""
LARGE = 4096
"""Robots from which on it pays: smaller swarms stay in the cache, where asking only takes time."""


def prefetch(array: np.ndarray, row: int, byte: int) -> None:
    """Ask for the cache line `byte` bytes behind the start of a row; a row that is not there does no harm.

    Called from Python, or where the compiler is switched off, it does nothing.
    """


@type_callable(prefetch)
def _type_of_prefetch(_context: Any) -> Any:
    def typed(array: Any, row: Any, byte: Any) -> Any:
        is_place = isinstance(row, types.Integer) and isinstance(byte, types.Integer)
        return types.none if isinstance(array, types.Array) and is_place else None

    return typed


@lower_builtin(prefetch, types.Array, types.Integer, types.Integer)
def _lower_prefetch(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    array = context.make_array(signature.args[0])(context, builder, value=arguments[0])
    row, byte = (
        context.cast(builder, value, kind, types.intp)
        for value, kind in zip(arguments[1:], signature.args[1:], strict=True)
    )
    stride = cgutils.unpack_tuple(builder, array.strides)[0]
    offset = builder.add(builder.mul(row, stride), byte)
    word, pointer = ir.IntType(32), ir.IntType(8).as_pointer()
    address = builder.gep(builder.bitcast(array.data, pointer), [offset])
    kind = ir.FunctionType(ir.VoidType(), [pointer, word, word, word])
    ask = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0i8")
    builder.call(ask, [address, word(0), word(3), word(1)])  # to read, into every cache, data
    return context.get_dummy_value()
