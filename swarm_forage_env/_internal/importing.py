"""What is done when somebody else's package is imported, whenever that is."""

import sys
from collections.abc import Callable
from typing import Any


class _Finder:
    """Asks the other finders where a module is, and has something done after it was run."""

    def __init__(self) -> None:
        self.waiting: dict[str, Callable[[], None]] = {}

    def find_spec(self, name: str, path: Any, target: Any = None) -> Any:
        """Return what Python is to import, None for modules that nobody waits for."""
        if name not in self.waiting:
            return None
        others = (finder.find_spec(name, path, target) for finder in sys.meta_path if finder is not self)
        spec: Any = next(filter(None, others), None)
        if spec is not None:
            run = spec.loader.exec_module

            def run_and_tell(module: Any) -> None:
                run(module)
                self.waiting.pop(name, _nothing)()

            spec.loader.exec_module = run_and_tell
        return spec


def _nothing() -> None: ...


_finder = _Finder()


def when_imported(name: str, action: Callable[[], None]) -> None:
    """Have something done after the import of the top module `name`; now, where it is imported already."""
    if name in sys.modules:
        action()
        return
    if _finder not in sys.meta_path:
        sys.meta_path.insert(0, _finder)
    _finder.waiting[name] = action
