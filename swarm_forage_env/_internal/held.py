"""Named tuples of arrays that stay where they are: compiled code is told one address and finds all arrays there.

To hand over a tuple, from Python or from one kernel to another, numba takes it apart, array by array; that of a world
takes longer than a small swarm takes for a tick, and every function that is given one takes longer to compile. So it is
taken apart once, by `hold`. Kernels read its fields by their names, held or not.
"""

import hashlib
import warnings
from dataclasses import dataclass
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np

from swarm_forage_env._internal.compiling import direct, is_compiled, kernel, kind_of

# isort: split
from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.core.datamodel.models import OpaqueModel
from numba.core.errors import NumbaExperimentalFeatureWarning
from numba.core.imputils import lower_getattr_generic
from numba.core.registry import cpu_target
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import NativeValue, intrinsic, register_model, typeof_impl, unbox

T = TypeVar("T")
Fields: TypeAlias = dict[str, Any]
"""Names of the fields of a named tuple -> those of a field that is one, None of others."""


class HeldType(types.Type):
    """What numba knows of a tuple that is held. As a value it is an address.

    It knows no class: what is compiled for somebody's tuple is kept on disk beside the rest, and is read where there is
    no such class.
    """

    def __init__(self, fields: Fields, of: Any) -> None:
        """Take the names of the fields, and the type of a plain tuple of their values.

        The whole name of that is pages long, and would be in the names of functions.
        """
        self.fields, self.of = fields, of
        super().__init__(f"Held({hashlib.sha256(f'{fields}{of}'.encode()).hexdigest()[:16]})")


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


@infer_getattr
class _Attributes(AttributeTemplate):
    """What kernels see of a held tuple: its fields. A field that has fields itself is held, too."""

    key = HeldType

    def generic_resolve(self, held: Any, name: str) -> Any:
        if name not in held.fields:
            return None
        fields, kind = held.fields[name], held.of.types[list(held.fields).index(name)]
        return kind if fields is None else HeldType(fields, kind)


@lower_getattr_generic(HeldType)
def _field(context: Any, builder: Any, held: Any, address: Any, name: str) -> Any:
    """Read one field, or say where it is."""
    number = list(held.fields).index(name)
    tuple_at = builder.bitcast(address, context.get_value_type(held.of).as_pointer())
    place = cgutils.gep_inbounds(builder, tuple_at, 0, number)
    if held.fields[name] is not None:
        return builder.bitcast(place, cgutils.voidptr_t)
    return _read(builder, place)


_types: dict[Any, HeldType] = {}
"""Kinds of tuples -> what numba knows of them held; it takes milliseconds to find out, and every run asks."""


def _fields(value: Any) -> Fields | None:
    return {name: _fields(getattr(value, name)) for name in value._fields} if hasattr(value, "_fields") else None


def _plain(value: Any) -> Any:
    """Return a tuple without names in it."""
    return tuple(map(_plain, value)) if isinstance(value, tuple) else value


def hold(value: T) -> T:
    """Return a named tuple as compiled functions take it fast; where the compiler is switched off, itself.

    To the eyes of Python it is a `Held`, which is of no use but to be handed to kernels. Its arrays may change, but not
    be replaced.
    """
    if not is_compiled(_keep):
        return value
    kind, target, plain = kind_of(value), cast(Any, cpu_target).target_context, _plain(value)
    if kind not in _types:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NumbaExperimentalFeatureWarning)  # tuples of functions
            _types[kind] = HeldType(cast(Fields, _fields(value)), typeof(plain))
            direct(_keep, plain, np.zeros(1, np.uint8))
    held = _types[kind]
    room = np.zeros(target.get_abi_sizeof(target.get_value_type(held.of)), np.uint8)
    direct(_keep, plain, room)(plain, room)
    return cast(T, Held(value, held, room, room.ctypes.data))
