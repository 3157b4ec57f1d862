"""Compiled functions that only other compiled functions call: kept as something to build from, not as machine code.

Example: `look` calls `proximity`, and Python calls `look`. Then `proximity` is a part. Its code is copied into `look`,
where it is optimised and made machine code, once. By itself numba does that for `proximity` alone, too, and again for
each function on the way to Python: that took half of the time of a first run. All that is changed here are inner parts
of numba's compiler; it has no public way to leave these steps out.
"""

from typing import Any

from llvmlite import binding

from swarm_forage_env._internal import numba_settings  # noqa: F401  (before numba)

# isort: split
from numba.core.caching import CompileResultCacheImpl
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult


class _NoEnvironments:
    """What hands a part its Python objects: nothing does, as there is no machine code that could ask for them."""

    def set_env(self, env_name: str, env: Any) -> None:
        """Do nothing."""


class _PartLibrary(JITCodeLibrary):
    """The code of a part."""

    @property
    def codegen(self) -> Any:
        """What numba asks to hand the code its Python objects."""
        return _NoEnvironments()

    def _optimize_functions(self, ll_module: Any) -> None:
        # Simplified a little, because parts inside of parts are copied and stored many times. Full passes come later.
        ll_module.data_layout = self._codegen._data_layout
        for function in ll_module.functions:
            if not function.is_declaration:
                passes, builder = self._codegen._function_pass_manager(opt=1)
                passes.run(function, builder)

    def _optimize_final_module(self) -> None:
        """Leave it to the functions that are made of this part."""

    def _finalize_final_module(self) -> None:
        """Make no machine code."""
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0, numba's sign that there is no machine code of this name."""
        del name
        return 0

    def serialize_using_object_code(self) -> Any:
        """Return what the cache keeps; in spite of its name, LLVM's code and no machine code."""
        return self.serialize_using_bitcode()

    @classmethod
    def read(cls, codegen: Any, state: Any) -> "_PartLibrary":
        """Return a part as `serialize_using_object_code` has written it."""
        name, _, bitcode = state
        library = cls(codegen, name)
        library._final_module = binding.parse_bitcode(bitcode)
        library._finalize_final_module()
        return library


class PartCompiler(Compiler):
    """numba's compiler, for a part."""

    def __init__(self, typingctx: Any, targetctx: Any, library: Any, *others: Any) -> None:
        """Take what numba's compiler takes."""
        if library is None:
            library = _PartLibrary(targetctx.codegen(), "part")
            library.enable_object_caching()
        super().__init__(typingctx, targetctx, library, *others)


class PartCacheImpl(CompileResultCacheImpl):
    """How parts are read from the cache."""

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        """Return the part that numba's `CompileResult._reduce` has taken apart; see its `_rebuild`."""
        code, fndesc, environment, signature, objectmode, lifted, typeann, reload_init, environments = payload
        library = _PartLibrary.read(target_context.codegen(), code)
        return CompileResult(
            target_context=target_context,
            typing_context=target_context.typing_context,
            library=library,
            environment=environment,
            entry_point=target_context.get_executable(library, fndesc, environment),
            fndesc=fndesc,
            type_annotation=typeann,
            signature=signature,
            objectmode=objectmode,
            lifted=lifted,
            typing_error=None,
            call_helper=None,
            metadata=None,
            reload_init=reload_init,
            referenced_envs=environments,
        )
