"""Tuples of arrays that stay where they are: compiled code is told one address and finds all arrays there.

To hand over a tuple from Python, numba takes it apart, array by array; that of a world takes longer than a small swarm
takes for a tick, and its code longer to compile than most functions. So it is taken apart once, by `hold`. Compiled
functions need not know: a held tuple has the fields of the tuple, and kernels that take the tuple take it, too.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, TypeVar, cast

import numpy as np

from swarm_forage_env._internal import numba_settings  # noqa: F401  (before numba)

# isort: split
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel.models import OpaqueModel
from numba.core.registry import cpu_target
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    intrinsic,
    lower_cast,
    lower_getattr_generic,
    register_model,
    typeof_impl,
    unbox,
)

from swarm_forage_env._internal.compiling import HeldType, direct, is_compiled, kernel, kind_of, type_of

T = TypeVar("T")

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


@typeof_impl.register(Held)
def _typeof(held: Held, _: Any) -> HeldType:
    return held.type


@unbox(HeldType)
def _unbox(_: Any, held: Any, context: Any) -> NativeValue:
    address = context.pyapi.object_getattr_string(held, "address")
    pointer = context.pyapi.long_as_voidptr(address)
    context.pyapi.decref(address)
    return NativeValue(pointer, is_error=cgutils.is_not_null(context.builder, context.pyapi.err_occurred()))


@infer_getattr
class _Fields(AttributeTemplate):
    """A held tuple has the fields of the tuple."""

    key = HeldType

    def generic_resolve(self, held: HeldType, name: str) -> Any:
        """Return the type of a field, None for an unknown one."""
        return held.of[held.of.fields.index(name)] if name in getattr(held.of, "fields", ()) else None


def _place(context: Any, builder: Any, address: Any, held: HeldType) -> Any:
    return builder.bitcast(address, context.get_value_type(held.of).as_pointer())


def _read(builder: Any, place: Any) -> Any:
    """Read a value number by number: compilers leave out what is not used, but cannot read a part of a tuple."""
    kind = place.type.pointee
    if not isinstance(kind, ir.LiteralStructType | ir.ArrayType):
        return builder.load(place)
    value = ir.Constant(kind, ir.Undefined)
    for k in range(len(kind)):
        value = builder.insert_value(value, _read(builder, cgutils.gep_inbounds(builder, place, 0, k)), k)
    return value


@lower_getattr_generic(HeldType)
def _field(context: Any, builder: Any, held: HeldType, address: Any, name: str) -> Any:
    k = held.of.fields.index(name)  # type: ignore[attr-defined] - asked of named tuples only
    return _read(builder, cgutils.gep_inbounds(builder, _place(context, builder, address, held), 0, k))


@lower_cast(HeldType, types.BaseTuple)
def _tuple(context: Any, builder: Any, held: HeldType, _: Any, address: Any) -> Any:
    return _read(builder, _place(context, builder, address, held))


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


def _at(typingctx: Any, held: Any, address: Any) -> Any:  # noqa: ARG001 - as above
    """Say what compiled code has of a tuple at another address."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:  # noqa: ARG001 - as above
        return builder.inttoptr(args[1], args[0].type)

    return held(held, address), generate


write: Any = intrinsic(_write)
at: Any = intrinsic(_at)
"""(held, address) -> another held tuple of the same type. For compiled code only."""


@kernel
def keep(value: Any, room: np.ndarray) -> None:
    """Write a tuple into memory (bytes,)."""
    write(value, room)


_held_types: dict[Any, HeldType] = {}
"""Kinds of tuples -> what numba knows of them held; it takes milliseconds to find out."""


def held_type(value: Any) -> Any:
    """Return the type of a tuple that is held, for examples of arguments."""
    key = kind_of(value)
    if key not in _held_types:
        _held_types[key] = HeldType(type_of(value))
    return _held_types[key]


def hold(value: T) -> T:
    """Return a tuple as compiled functions take it from Python, fast; where the compiler is switched off, itself.

    To the eyes of Python it is a `Held`, which is of no use but to be handed over. Its arrays may change, but not be
    replaced.
    """
    if not is_compiled(keep):
        return value
    kind, target = held_type(value), cast(Any, cpu_target).target_context
    room = np.zeros(target.get_abi_sizeof(target.get_value_type(kind.of)), np.uint8)
    direct(keep, value, room)(value, room)
    return cast(T, Held(value, kind, room, room.ctypes.data))


def addresses(held: Iterable[Any]) -> np.ndarray:
    """Return where compiled code finds held tuples, for `at`."""
    return np.array([each.address for each in held], np.intp)
