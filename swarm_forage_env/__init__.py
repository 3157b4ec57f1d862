"""Swarm foraging as a PettingZoo environment.

Public names stand in `__init__.pyi`. They load on first use: importing the package loads next to nothing. Every
scenario is registered with PettingZoo and Gymnasium, as soon as they are imported, under ids such as
`swarm_forage/warehouse_small-v2`.
"""

import sys
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NoReturn

import lazy_loader

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version  # slow to import and rarely asked for

        return version("swarm-forage-env")
    return _load(name)


def _ids() -> Iterator[tuple[str, dict[str, str]]]:
    from swarm_forage_env.scenarios.presets import SCENARIO_NAMES

    for name in (*SCENARIO_NAMES, "sampled"):
        yield f"swarm_forage/{name}", {"scenario": name}


def _former(error: type[Exception], name: str, **_: Any) -> NoReturn:
    """Stand in for an environment of version 1, whose runs cannot be told from those of version 2 by their id alone."""
    raise error(
        f"{name}-v1 moved robots with Chipmunk, {name}-v2 moves them in compiled code, several times as fast; other "
        f'rules have changed too, see the changelog. Make {name}-v2, with physics="chipmunk" for bodies as before.'
    )


def _register_with_pettingzoo() -> None:
    import pettingzoo

    if not hasattr(pettingzoo, "register"):  # before 1.27 there are no ids
        return
    from pettingzoo.env_registry.exceptions import VersionNotFound

    for name, kwargs in _ids():
        pettingzoo.register("parallel", f"{name}-v2", "swarm_forage_env.views.pettingzoo:parallel_env", kwargs=kwargs)
        pettingzoo.register("aec", f"{name}-v2", "swarm_forage_env.views.pettingzoo:env", kwargs=kwargs)
        former = partial(_former, VersionNotFound, name)
        pettingzoo.register("parallel", f"{name}-v1", former)
        pettingzoo.register("aec", f"{name}-v1", former)


def _register_with_gymnasium() -> None:
    import gymnasium

    for name, kwargs in _ids():
        gymnasium.register(
            f"{name}-v2",
            "swarm_forage_env.views.gymnasium:JointForageEnv",
            kwargs=kwargs,
            vector_entry_point="swarm_forage_env.views.gymnasium:vector_env",
        )
        former = partial(_former, gymnasium.error.DeprecatedEnv, name)
        gymnasium.register(f"{name}-v1", former, vector_entry_point=former)


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


def _when_imported(name: str, action: Callable[[], None]) -> None:
    """Have something done after the import of the top module `name`; now, where it is imported already."""
    if name in sys.modules:
        action()
        return
    if _finder not in sys.meta_path:
        sys.meta_path.insert(0, _finder)
    _finder.waiting[name] = action


_when_imported("pettingzoo", _register_with_pettingzoo)
_when_imported("gymnasium", _register_with_gymnasium)
