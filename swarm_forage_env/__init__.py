"""Swarm foraging as a PettingZoo environment.

Public names load on first use (PEP 562): importing the package compiles nothing and loads neither the physics nor
numba. It registers every scenario with PettingZoo and Gymnasium under ids such as `swarm_forage/warehouse_small-v0`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import gymnasium
import pettingzoo

from swarm_forage_env.scenarios import SCENARIO_NAMES, scenario

if TYPE_CHECKING:
    from swarm_forage_env.config import ConfigError, ScenarioConfig, with_overrides
    from swarm_forage_env.env import ForageEnv, parallel_env
    from swarm_forage_env.layout import ObservationLayout
    from swarm_forage_env.policy import (
        Event,
        Grip,
        Policy,
        RandomPolicy,
        SwarmTask,
        Task,
        from_callable,
        load_policy,
        policy_names,
    )
    from swarm_forage_env.quirks import AUTHORS_PROGRAM, Quirks
    from swarm_forage_env.recording import RunRecord
    from swarm_forage_env.study.run import run_one
    from swarm_forage_env.study.spec import RunSpec

    __version__: str

__all__ = [
    "AUTHORS_PROGRAM",
    "SCENARIO_NAMES",
    "ConfigError",
    "Event",
    "ForageEnv",
    "Grip",
    "ObservationLayout",
    "Policy",
    "Quirks",
    "RandomPolicy",
    "RunRecord",
    "RunSpec",
    "ScenarioConfig",
    "SwarmTask",
    "Task",
    "from_callable",
    "load_policy",
    "parallel_env",
    "policy_names",
    "run_one",
    "scenario",
    "with_overrides",
]

_HOMES = {
    "AUTHORS_PROGRAM": "quirks",
    "ConfigError": "config",
    "Event": "policy",
    "ForageEnv": "env",
    "Grip": "policy",
    "ObservationLayout": "layout",
    "Policy": "policy",
    "Quirks": "quirks",
    "RandomPolicy": "policy",
    "RunRecord": "recording",
    "RunSpec": "study.spec",
    "ScenarioConfig": "config",
    "SwarmTask": "policy",
    "Task": "policy",
    "from_callable": "policy",
    "load_policy": "policy",
    "parallel_env": "env",
    "policy_names": "policy",
    "run_one": "study.run",
    "with_overrides": "config",
}
"""Public name -> submodule that defines it, loaded when the name is first used."""


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version  # slow to import and rarely asked for

        value = version("swarm-forage-env")
    elif name in _HOMES:
        value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})


def _register_environments() -> None:
    for name in SCENARIO_NAMES:
        env_id = f"swarm_forage/{name}-v0"
        kwargs = {"scenario": name}
        pettingzoo.register("parallel", env_id, "swarm_forage_env.env:parallel_env", kwargs=kwargs)
        pettingzoo.register("aec", env_id, "swarm_forage_env.env:env", kwargs=kwargs)
        gymnasium.register(
            env_id,
            "swarm_forage_env.adapters:JointForageEnv",
            kwargs=kwargs,
            vector_entry_point="swarm_forage_env.adapters:SwarmVectorEnv",
        )


_register_environments()
