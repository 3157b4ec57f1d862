"""How functions on arrays are compiled, for world and controllers, and where the machine code is kept."""

import functools
import gc
import hashlib
import logging
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from swarm_forage_env._internal import numba_settings  # noqa: F401  (before numba)

# isort: split
from numba import cfunc, njit, typeof, types
from numba import config as numba_config
from numba.core import event

F = TypeVar("F", bound=Callable[..., Any])
T = TypeVar("T")

# Without numba's memory runtime an allocation is a compile error, and arrays that are handed around, alone, in rows or
# as fields of a named tuple, are not reference-counted. That halves the time of functions that call others often.
# With numpy's error model no division is first asked whether it is one by zero: kernels raise nothing.
_OPTIONS: dict[str, Any] = {"_nrt": False, "error_model": "numpy"}
_COPIED = _OPTIONS | {"forceinline": True, "no_cfunc_wrapper": True}

_CONFIG: Any = numba_config  # its settings are made at run time

_PACKAGE = Path(__file__).parents[1]
_COMPILED_IN_EVERYWHERE = (
    "_internal/compiling.py",
    "_internal/held.py",
    "_internal/prefetching.py",
    "contract/*.py",
    "scenarios/floor.py",
    "world/state.py",
)
"""Modules whose functions and constants are compiled into those of other folders."""


def sources_of(folder: Path) -> list[Path]:
    """Return every source from which something may be compiled into a function of a folder, sorted."""
    shared = {file for pattern in _COMPILED_IN_EVERYWHERE for file in _PACKAGE.glob(pattern)}
    return sorted(shared.union(folder.glob("*.py")))


@functools.cache
def _place_for(folder: Path) -> str | None:
    """Return where machine code of the functions of a folder is kept, None where nothing can be written.

    By itself numba watches the file of a function only, and would keep what it has compiled into it from others. So
    there is a place for each state of the sources, and those of former states go.
    """
    sources = hashlib.sha256(b"".join(file.read_bytes() for file in sources_of(folder))).hexdigest()[:16]
    name = f"{folder.name}-{hashlib.sha256(str(folder).encode()).hexdigest()[:8]}"
    for root in (_CONFIG.CACHE_DIR or _PACKAGE / "__pycache__", "~/.cache/swarm_forage_env"):
        states = Path(root).expanduser() / name
        try:
            (states / sources).mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(states / sources, os.W_OK):
            for former in set(states.iterdir()) - {states / sources}:
                shutil.rmtree(former, ignore_errors=True)
            return str(states / sources)
    return None


def _kept(function: F, compiled: Callable[..., Any]) -> F:
    """Return what a decorator of numba makes of a function, with a cache on disk if that is possible."""
    place, before = _place_for(Path(function.__code__.co_filename).parent), _CONFIG.CACHE_DIR
    try:
        _CONFIG.CACHE_DIR = place
        return compiled(cache=place is not None)(function)
    except RuntimeError as error:
        if "no locator available" not in str(error):
            raise
        place = None  # a function without a file
        return compiled(cache=False)(function)
    finally:
        _CONFIG.CACHE_DIR = before
        if place is None:
            _say(
                "Compiled functions cannot be kept, so every process spends a minute on them. Set NUMBA_CACHE_DIR to a "
                "folder that can be written to."
            )


def kernel(function: F) -> F:
    """Compile a function that allocates nothing; the result is kept on disk until one of its sources changes.

    It is copied into the kernels that call it. Left to itself the compiler calls all but the smallest, and rows and
    tuples then travel over the stack.
    """
    return _kept(function, functools.partial(njit, **_COPIED))


def part(function: F) -> F:
    """Compile a function that kernels call, and nobody else.

    What leads from Python into a function takes longer to compile than most functions themselves.
    """
    return _kept(function, functools.partial(njit, no_cpython_wrapper=True, **_COPIED))


def inline_kernel(function: F) -> F:
    """Compile a function into each of its callers, and on its own for calls from Python only.

    It may take other compiled functions as arguments. For the phases of a tick: each level of functions that call each
    other is optimized anew with all that is in it, and one level less is seconds less.
    """
    return _kept(function, functools.partial(njit, inline="always", no_cfunc_wrapper=True, **_OPTIONS))


def is_compiled(function: Callable[..., Any]) -> bool:
    """Whether calls of a kernel run compiled code; not so where the compiler is switched off."""
    return hasattr(function, "compile")


def is_kept(function: Callable[..., Any]) -> bool:
    """Whether there is anything on disk for a kernel, or nothing can be; what there is may be for other types."""
    if not is_compiled(function):
        return True
    place, kernel_function = cast(Any, function).stats.cache_path, cast(Any, function).py_func
    name = f"{Path(kernel_function.__code__.co_filename).stem}.{kernel_function.__qualname__}"
    return place is None or any(Path(place).glob(f"{name}-*.nbi"))


def direct(function: F, *example: Any) -> F:
    """Return a call of a kernel for arguments of the types of `example`, compiled here if it is not yet.

    It skips the search for the version that fits, which takes 0.2 microseconds per array, ten times what the call
    takes. So the caller must see to it that arguments keep their types: an array of another dtype raises a TypeError,
    but one of another number of dimensions, or not contiguous where the example is, would be misread.
    """
    if not is_compiled(function):
        return function
    key = function, tuple(map(kind_of, example))
    if key not in _entry_points:
        with _collector_off():
            _entry_points[key] = cast(Any, function).compile(tuple(map(_type_of, example)))
    return cast(F, _entry_points[key])


_entry_points: dict[Any, Callable[..., Any]] = {}
"""Kernel and kinds of its arguments -> what `direct` returns. To find the types of a whole world takes numba
milliseconds, and every run of a study asks."""


class Calls:
    """Direct calls of kernels whose arguments keep their types, compiled at the first; copies compile theirs anew."""

    def __init__(self) -> None:
        """Begin without any."""
        self._found: dict[Callable[..., Any], Any] = {}

    def __call__(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Call a kernel."""
        found = self._found.get(function)
        if found is None:
            found = self._found[function] = direct(function, *arguments)
        return found(*arguments)

    def once(self, make: Callable[..., T], *arguments: Any) -> T:
        """Return what a function makes for these calls; it is asked once, and anew for copies."""
        if make not in self._found:
            self._found[make] = make(*arguments)
        return cast(T, self._found[make])

    def __reduce__(self) -> Any:
        return Calls, ()


def _type_of(argument: Any) -> Any:
    """Return numba's type of an argument; one version takes arrays that may be written to, and those that may not."""
    kind = typeof(argument)
    return kind.copy(readonly=False) if isinstance(kind, types.Array) else kind


def kind_of(argument: Any) -> Any:
    """Return something that is equal for arguments of the same type."""
    if isinstance(argument, np.ndarray):
        flags = argument.flags
        return argument.dtype, argument.ndim, flags.c_contiguous, flags.f_contiguous, flags.aligned
    if isinstance(argument, tuple):
        return type(argument), *map(kind_of, argument)
    return type(argument) if type(argument) in (bool, int, float) else typeof(argument)


@functools.cache
def _callable_by_address(function: Any, signature: Any) -> Any:
    """Return the version of a kernel that compiled code calls by its address; every run asks."""
    with _collector_off():
        return _kept(function.py_func, functools.partial(cfunc, signature, **_OPTIONS))


class Callback:
    """A kernel that another one takes as an argument: which one it is may change without compiling anything anew."""

    def __init__(self, function: Callable[..., Any], *example: Any, gives: Any = None) -> None:
        """Take `function`, for arguments of the types of `example`, and what it returns; it is compiled when used."""
        self.function = function
        if is_compiled(function):
            self._numba_type_ = types.FunctionType(typeof(gives)(*map(typeof, example)))  # where numba looks

    def __call__(self, *arguments: Any) -> Any:
        """Call the function itself, for kernels that are not compiled."""
        return self.function(*arguments)

    def __reduce__(self) -> Any:
        """Refuse copies for another process: the address is one of this process."""
        raise TypeError("A Callback cannot be pickled; make it anew from its function.")

    def __wrapper_address__(self) -> int:
        """Return the address that compiled code jumps to; numba asks for it."""
        return self._address

    @functools.cached_property
    def _address(self) -> int:
        return _callable_by_address(self.function, self.signature()).address

    def signature(self) -> Any:
        """Return numba's signature."""
        return self._numba_type_.signature


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


@functools.cache
def _say(text: str) -> None:
    """Say something once in a process; without settings of the user, loggers print warnings on stderr."""
    logging.getLogger("swarm_forage_env").warning(text)


def tell_of_first_run() -> None:
    """Tell, once in a process, that functions are being compiled, here or in a worker.

    Loggers without settings print it on stderr, so scripts show it, too.
    """
    _say("Compiling what is used here for the first time: seconds, or a minute after an installation.")


class _FirstRun(event.Listener):
    """Tells of a first run when numba begins to compile a function of ours."""

    def on_start(self, event: Any) -> None:
        if event.data["dispatcher"].targetoptions.items() >= _OPTIONS.items():
            tell_of_first_run()

    def on_end(self, event: Any) -> None:
        pass


event.register("numba:compile", _FirstRun())
