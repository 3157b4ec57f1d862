"""Swarm foraging as a PettingZoo environment.

Public names stand in `__init__.pyi`. They load on first use: importing the package loads next to nothing. Every
scenario is registered with PettingZoo and Gymnasium, as soon as they are imported, under ids such as
`swarm_forage/warehouse_small-v1`.
"""

from collections.abc import Iterator
from typing import Any

import lazy_loader

from swarm_forage_env._internal.importing import when_imported

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version  # slow to import and rarely asked for

        return version("swarm-forage-env")
    return _load(name)


def _ids() -> Iterator[tuple[str, dict[str, str]]]:
    from swarm_forage_env.scenarios.presets import SCENARIO_NAMES

    for name in (*SCENARIO_NAMES, "sampled"):
        yield f"swarm_forage/{name}-v1", {"scenario": name}


def _register_with_pettingzoo() -> None:
    import pettingzoo

    for env_id, kwargs in _ids():
        pettingzoo.register("parallel", env_id, "swarm_forage_env.views.pettingzoo:parallel_env", kwargs=kwargs)
        pettingzoo.register("aec", env_id, "swarm_forage_env.views.pettingzoo:env", kwargs=kwargs)


def _register_with_gymnasium() -> None:
    import gymnasium

    for env_id, kwargs in _ids():
        gymnasium.register(
            env_id,
            "swarm_forage_env.views.gymnasium:JointForageEnv",
            kwargs=kwargs,
            vector_entry_point="swarm_forage_env.views.gymnasium:vector_env",
        )


when_imported("pettingzoo", _register_with_pettingzoo)
when_imported("gymnasium", _register_with_gymnasium)
