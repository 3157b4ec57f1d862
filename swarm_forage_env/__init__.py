"""Swarm foraging as a PettingZoo environment.

Public names stand in `__init__.pyi`. They load on first use: importing the package compiles nothing and loads neither
the physics nor numba. It registers every scenario with PettingZoo and Gymnasium under ids such as
`swarm_forage/warehouse_small-v1`.
"""

from typing import Any

import gymnasium
import lazy_loader
import pettingzoo

from swarm_forage_env.scenarios.presets import SCENARIO_NAMES

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version  # slow to import and rarely asked for

        return version("swarm-forage-env")
    return _load(name)


def _register_environments() -> None:
    for name in (*SCENARIO_NAMES, "sampled"):
        env_id = f"swarm_forage/{name}-v1"
        kwargs = {"scenario": name}
        pettingzoo.register("parallel", env_id, "swarm_forage_env.views.pettingzoo:parallel_env", kwargs=kwargs)
        pettingzoo.register("aec", env_id, "swarm_forage_env.views.pettingzoo:env", kwargs=kwargs)
        gymnasium.register(
            env_id,
            "swarm_forage_env.views.gymnasium:JointForageEnv",
            kwargs=kwargs,
            vector_entry_point="swarm_forage_env.views.gymnasium:vector_env",
        )


_register_environments()
