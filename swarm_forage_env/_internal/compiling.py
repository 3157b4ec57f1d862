"""How functions on arrays are compiled, and when what was compiled before is out of date; for world and controllers."""

import functools
import gc
import hashlib
import logging
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from swarm_forage_env._internal import numba_settings  # noqa: F401  (before numba)

# isort: split
from numba import njit, typeof, types
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile

from swarm_forage_env._internal.compiled_parts import PartCacheImpl, PartCompiler

F = TypeVar("F", bound=Callable[..., Any])

# Without numba's memory runtime an allocation is a compile error, and arrays that are handed around, alone, in rows or
# as fields of a named tuple, are not reference-counted. That halves the time of functions that call others often.
# With numpy's error model no division is first asked whether it is one by zero: kernels raise nothing.
_OPTIONS: dict[str, Any] = {"_nrt": False, "error_model": "numpy"}
_NOT_FROM_PYTHON: dict[str, Any] = {"no_cpython_wrapper": True}
_NOT_FROM_C: dict[str, Any] = {"no_cfunc_wrapper": True}
"""What leaves out ways into a function."""

_PACKAGE = Path(__file__).parents[1]
_COMPILED_IN_EVERYWHERE = tuple(
    _PACKAGE / f"{name}.py"
    for name in (
        "_internal/compiled_parts",
        "_internal/compiling",
        "_internal/held",
        "_internal/prefetching",
        "contract/codes",
        "contract/detection",
        "contract/layout",
        "scenarios/floor",
    )
)
"""Modules whose functions and constants are compiled into those of other folders."""
_COMPILED_IN_BY_ROOM = {
    _PACKAGE / "world/kernels": (_PACKAGE / "world/state.py",),
}
"""Further modules that are compiled into the functions of one room; see `room_of`."""


@functools.cache
def _digest_of_sources(room: Path) -> str:
    """Digest of every source from which something may be compiled into a function of `room`."""
    return hashlib.sha256(b"".join(file.read_bytes() for file in sources_of(room))).hexdigest()


def room_of(file: Path) -> Path:
    """Return what may be compiled into each other together with a file: its folder, or itself if it is `kernels.py`."""
    return file if file.name == "kernels.py" else file.parent


def sources_of(room: Path) -> tuple[Path, ...]:
    """Return every source from which something may be compiled into a function of a room, sorted."""
    own = room.glob("*.py") if room.is_dir() else (room,)
    if room == _PACKAGE / "contract":  # that folder is listed file by file
        own = ()
    return tuple(sorted({*own, *_COMPILED_IN_EVERYWHERE, *_COMPILED_IN_BY_ROOM.get(room, ())}))


def kernel(function: F) -> F:
    """Compile a function that allocates nothing; the result is cached on disk until one of its sources changes.

    There are up to three versions, each made when it is needed: one for calls from Python, a part for calls from other
    kernels (see `compiled_parts`), and one for a `Callback`. What leads from Python to a function, a conversion of
    every array of a world, takes longer to compile than most functions themselves.
    """
    compiled = njit(**_NOT_FROM_C, **_OPTIONS)(function)
    if not is_compiled(compiled):
        return function
    _keep_on_disk(compiled, "")
    # Left to itself the compiler calls all but the smallest kernels: rows and tuples then travel over the stack.
    part = njit(forceinline=True, pipeline_class=PartCompiler, **_NOT_FROM_PYTHON, **_NOT_FROM_C, **_OPTIONS)(function)
    _keep_on_disk(part, "-called", PartCacheImpl)

    def get_call_template(args: Any, kws: Any) -> Any:
        return part.get_call_template(tuple(map(_widened, args)), {name: _widened(kind) for name, kind in kws.items()})

    compiled.get_call_template = get_call_template
    compiled.get_overload = part.get_overload
    return cast(F, compiled)


def kernel_of_process(function: F) -> F:
    """Compile a function that this process has made, a closure: as `kernel` does, but nothing is kept of it."""
    return cast(F, njit(**_NOT_FROM_C, **_OPTIONS)(function))


class HeldType(types.Type):
    """What numba knows of a tuple that is held, see `held`. As a value it is an address."""

    def __init__(self, of: Any) -> None:
        """Take the type of the tuple."""
        self.of = of
        super().__init__(f"Held({of})")


def _widened(kind: Any) -> Any:
    """Return the type as which a kernel takes an argument from another kernel.

    Signed whole numbers are all int64 and a tuple that is held is the tuple. So it is compiled once, and not for every
    width and every constant that it is called with.
    """
    plain = kind.of if isinstance(kind, HeldType) else types.unliteral(kind)
    return types.int64 if plain in types.signed_domain else plain


@functools.cache
def _for_callbacks(function: Callable[..., Any]) -> Any:
    """Return the version of a kernel that compiled code calls by its address."""
    compiled = njit(**_NOT_FROM_PYTHON, **_OPTIONS)(cast(Any, function).py_func)
    if isinstance(cast(Any, function)._cache, _Cache):
        _keep_on_disk(compiled, "-callback")
    return compiled


@contextmanager
def _collector_off() -> Iterator[None]:
    """Compile without Python's garbage collector: it takes a tenth of the time and frees next to nothing."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def _keep_on_disk(compiled: Any, mark: str, read_by: type[CompileResultCacheImpl] | None = None) -> None:
    """Do what `njit(cache=True)` does with a cache of numba's own.

    Args:
        compiled: A function that `njit` has returned.
        mark: Goes into the names of the files.
        read_by: How results are written and read, default as numba does.
    """
    function = compiled.py_func
    cache = _new_cache(function)
    if cache is None:
        return
    cache_file = IndexDataCacheFile(
        cache_path=cache.cache_path,
        filename_base=cache._impl.filename_base + mark,
        source_stamp=cache._impl.locator.get_source_stamp(),
    )
    # By itself numba watches only the file of the function, and would keep what it has compiled into it from others. It
    # offers no public way to watch more. The version is what it looks at first, before it opens an index that may name
    # types which the sources no longer have.
    cache_file._version += _digest_of_sources(room_of(Path(function.__code__.co_filename)))
    cache._cache_file = cache_file
    if read_by is not None:
        cache._impl = read_by(function)
    compiled._cache = cache


class _Cache(FunctionCache):
    """Compiled functions on disk. None of its faults ends a run: what cannot be read or kept is compiled anew."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return what was compiled before, or None."""
        try:
            found = super().load_overload(sig, target_context)
            # Two processes that keep different types at the same moment can choose the same name for a file.
            if found is not None and found.signature.args != tuple(sig):
                raise ValueError(f"types {found.signature.args} under those of {tuple(sig)}")
            if found is None:
                tell_of_first_run()
            return found
        except Exception as error:  # noqa: BLE001 - what a damaged file raises depends on where it is damaged
            _say(f"Compiled functions in {self.cache_path} cannot be read and are made anew ({error}).")
            with suppress(OSError):
                self.flush()
            return None

    def holds(self, sig: Any, target_context: Any) -> bool:
        """Return whether something is kept for a signature; it may yet turn out to be damaged."""
        try:
            return self._index_key(sig, target_context.codegen()) in self._cache_file._load_index()
        except Exception:  # noqa: BLE001 - as above; who loads it says so
            return True

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled."""
        try:
            super().save_overload(sig, data)
        except OSError as error:
            _say(f"{_NOT_KEPT} ({error.strerror}: {self.cache_path}). {_WAY_OUT}")


_FIRST_RUN = "Compiling what is used here for the first time: seconds, or half a minute after an installation."
_NOT_KEPT = "Compiled functions cannot be kept, so every process spends about half a minute or more on them"
_WAY_OUT = "Set NUMBA_CACHE_DIR to a folder that can be written to."


def _new_cache(function: Callable[..., Any]) -> _Cache | None:
    """Return the cache of a function, None where no folder can be written to."""
    try:
        return _Cache(function)
    except RuntimeError as error:
        if "no locator available" not in str(error):
            raise
        _say(f"{_NOT_KEPT} (neither the package nor the home folder can be written to). {_WAY_OUT}")
        return None


@functools.cache
def _say(text: str, level: int = logging.WARNING) -> None:
    """Say something once in a process; without settings of the user, loggers print one line on stderr."""
    logging.getLogger("swarm_forage_env").log(level, text)


def tell_of_first_run() -> None:
    """Tell, once in a process, that functions are being compiled, here or in a worker.

    It is no warning: the console command shows it, and scripts do if they set up `logging` for level INFO.
    """
    _say(_FIRST_RUN, logging.INFO)


def is_compiled(function: Callable[..., Any]) -> bool:
    """Whether calls of a kernel run compiled code; not so where the compiler is switched off."""
    return hasattr(function, "compile")


def direct(function: F, *example: Any) -> F:
    """Return a call of a kernel for arguments of the types of `example`, compiled here if it is not yet.

    It skips the search for the version that fits, which takes 0.2 microseconds per array, ten times what the call
    takes. So the caller must see to it that arguments keep their types: an array of another dtype raises a TypeError,
    but one of another number of dimensions, or not contiguous where the example is, would be misread.
    """
    compiled = getattr(function, "compile", None)
    if compiled is None:  # the compiler is switched off
        return function
    key = function, tuple(kind_of(argument) for argument in example)
    if key not in _entry_points:
        with _collector_off():
            _entry_points[key] = compiled(tuple(type_of(argument) for argument in example))
    return cast(F, _entry_points[key])


def is_new(function: Callable[..., Any], *example: Any) -> bool:
    """Whether `direct` would have to compile `function`, and other processes could use the result.

    That is not so where the compiler is switched off, or no folder can be written to.
    """
    compiled = cast(Any, function)
    if not is_compiled(function) or not isinstance(compiled._cache, _Cache):
        return False
    kinds = tuple(type_of(argument) for argument in example)
    if kinds in compiled.overloads or compiled._cache.holds(kinds, compiled.targetctx):
        return False
    try:
        with tempfile.TemporaryFile(dir=compiled._cache.cache_path):
            return True
    except OSError:
        return False


_entry_points: dict[Any, Callable[..., Any]] = {}
"""Kernel and kinds of its arguments -> what `direct` returns. To find the types of a whole world takes numba
milliseconds, and every run of a study asks."""


def kind_of(argument: Any) -> Any:
    """Return something that is equal for arguments of the same type."""
    if isinstance(argument, np.ndarray):
        flags = argument.flags
        return argument.dtype, argument.ndim, flags.c_contiguous, flags.f_contiguous, flags.aligned, flags.writeable
    if isinstance(argument, tuple):
        return type(argument), *map(kind_of, argument)
    if type(argument) in (bool, int, float):
        return type(argument)
    return type_of(argument)


def type_of(argument: Any) -> Any:
    """Return numba's type of an argument; a type stands for itself."""
    if isinstance(argument, types.Type):
        return argument
    return argument.type if isinstance(argument, Callback) else typeof(argument)


class Callback:
    """A kernel that another one takes as an argument: which one it is may change without compiling anything anew."""

    def __init__(self, function: Callable[..., Any], *example: Any) -> None:
        """Take `function`, which returns nothing, for arguments of the types of `example`; it is compiled when used."""
        self.function = function
        self.type: Any = None
        if is_compiled(function):
            self._arguments = tuple(typeof(argument) for argument in example)
            self.type = types.FunctionType(types.none(*self._arguments))

    def __call__(self, *arguments: Any) -> None:
        """Call the function itself, for kernels that are not compiled."""
        self.function(*arguments)

    def __reduce__(self) -> Any:
        """Refuse copies for another process: the address is one of this process."""
        raise TypeError("A Callback cannot be pickled; make it anew from its function.")

    def __wrapper_address__(self) -> int:
        """Return the address that compiled code jumps to."""
        return self._address

    @cached_property
    def _address(self) -> int:
        version = _for_callbacks(self.function)
        with _collector_off():
            version.compile(self._arguments)
        compiled = version.overloads[self._arguments]
        return compiled.library.get_pointer_to_function(compiled.fndesc.llvm_cfunc_wrapper_name)

    def signature(self) -> Any:
        """Return numba's signature."""
        return self.type.signature


def inline_kernel(function: F) -> F:
    """Compile a function into each of its callers; it may take other compiled functions as arguments."""
    return cast(F, njit(inline="always", **_OPTIONS)(function))
