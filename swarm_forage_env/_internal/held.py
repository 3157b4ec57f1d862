"""Tuples of arrays that stay where they are: compiled code is told one address and finds all arrays there.

To hand over a tuple from Python, numba takes it apart, array by array; that of a world takes longer than a small swarm
takes for a tick. So it is taken apart once, by `hold`, and kernels begin with `opened`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar, cast

import numpy as np

from swarm_forage_env._internal.compiling import direct, is_compiled, kernel, kind_of

# isort: split
from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.core.datamodel.models import OpaqueModel
from numba.core.registry import cpu_target
from numba.extending import NativeValue, intrinsic, register_model, typeof_impl, unbox

T = TypeVar("T")


class HeldType(types.Type):
    """What numba knows of a tuple that is held. As a value it is an address."""

    def __init__(self, of: Any) -> None:
        """Take the type of the tuple."""
        self.of = of
        super().__init__(f"Held({of})")


register_model(HeldType)(OpaqueModel)


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """A tuple and where compiled code finds it."""

    value: Any
    """The tuple; its arrays live as long as this."""
    type: HeldType
    room: np.ndarray
    """(bytes,) uint8 memory."""
    address: int
    """Of the memory."""

    def __reduce__(self) -> Any:
        return hold, (self.value,)


@typeof_impl.register(Held)
def _typeof(held: Held, _: Any) -> HeldType:
    return held.type


@unbox(HeldType)
def _unbox(_: Any, held: Any, context: Any) -> NativeValue:
    address = context.pyapi.object_getattr_string(held, "address")
    pointer = context.pyapi.long_as_voidptr(address)
    context.pyapi.decref(address)
    return NativeValue(pointer, is_error=cgutils.is_not_null(context.builder, context.pyapi.err_occurred()))


def _read(builder: Any, place: Any) -> Any:
    """Read a value number by number: compilers leave out what is not used, but cannot read a part of a tuple."""
    kind = place.type.pointee
    if not isinstance(kind, ir.LiteralStructType | ir.ArrayType):
        return builder.load(place)
    value = ir.Constant(kind, ir.Undefined)
    for k in range(len(kind)):
        value = builder.insert_value(value, _read(builder, cgutils.gep_inbounds(builder, place, 0, k)), k)
    return value


def _written(builder: Any, value: Any, place: Any) -> None:
    """Write a value as `_read` reads it."""
    if isinstance(value.type, ir.LiteralStructType | ir.ArrayType):
        for k in range(len(value.type)):
            _written(builder, builder.extract_value(value, k), cgutils.gep_inbounds(builder, place, 0, k))
    else:
        builder.store(value, place)


def _write(typingctx: Any, value: Any, room: Any) -> Any:  # noqa: ARG001 - numba hands over the types
    """Say how compiled code writes a tuple into memory."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        memory = context.make_array(signature.args[1])(context, builder, value=args[1])
        _written(builder, args[0], builder.bitcast(memory.data, args[0].type.as_pointer()))
        return context.get_dummy_value()

    return types.void(value, room), generate


_written_to: Any = intrinsic(_write)


@kernel
def _keep(value: Any, room: np.ndarray) -> None:
    _written_to(value, room)


def _opened(typingctx: Any, given: Any) -> Any:  # noqa: ARG001 - as above
    """Say how compiled code has the tuple that it is given, held or not."""
    if not isinstance(given, HeldType):
        return given(given), lambda context, builder, signature, args: args[0]  # noqa: ARG005

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return _read(builder, builder.bitcast(args[0], context.get_value_type(signature.return_type).as_pointer()))

    return given.of(given), generate


def _as_given(given: T) -> T:
    return given


opened: Callable[[Any], Any] = cast(Any, intrinsic(_opened)) if is_compiled(_keep) else _as_given
"""For compiled code: returns the tuple that it is given, held or not."""


_types: dict[Any, HeldType] = {}
"""Kinds of tuples -> what numba knows of them held; it takes milliseconds to find out, and every run asks."""


def hold(value: T) -> T:
    """Return a tuple as compiled functions take it from Python, fast; where the compiler is switched off, itself.

    To the eyes of Python it is a `Held`, which is of no use but to be handed to kernels that begin with `opened`. Its
    arrays may change, but not be replaced.
    """
    if not is_compiled(_keep):
        return value
    kind, target = kind_of(value), cast(Any, cpu_target).target_context
    if kind not in _types:
        _types[kind] = HeldType(typeof(value))
    held = _types[kind]
    room = np.zeros(target.get_abi_sizeof(target.get_value_type(held.of)), np.uint8)
    direct(_keep, value, room)(value, room)
    return cast(T, Held(value, held, room, room.ctypes.data))
