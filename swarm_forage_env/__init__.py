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
    from swarm_forage_env.rendering_run import record_run
    from swarm_forage_env.signals import Waveform
    from swarm_forage_env.study.run import build_stack, run_one, run_policy
    from swarm_forage_env.study.runner import run_all
    from swarm_forage_env.study.spec import RunSpec, plan_run
    from swarm_forage_env.wrappers.noise import ActuatorNoise, ActuatorNoiseConfig, SensorNoise, SensorNoiseConfig
    from swarm_forage_env.wrappers.population import PopulationConfig, PopulationDynamics
    from swarm_forage_env.wrappers.recorder import RunRecorder
    from swarm_forage_env.wrappers.registry import parse_wrapper
    from swarm_forage_env.wrappers.throttle import Throttle, ThrottleConfig

    __version__: str

__all__ = [
    "AUTHORS_PROGRAM",
    "SCENARIO_NAMES",
    "ActuatorNoise",
    "ActuatorNoiseConfig",
    "ConfigError",
    "Event",
    "ForageEnv",
    "Grip",
    "ObservationLayout",
    "Policy",
    "PopulationConfig",
    "PopulationDynamics",
    "Quirks",
    "RandomPolicy",
    "RunRecord",
    "RunRecorder",
    "RunSpec",
    "ScenarioConfig",
    "SensorNoise",
    "SensorNoiseConfig",
    "SwarmTask",
    "Task",
    "Throttle",
    "ThrottleConfig",
    "Waveform",
    "build_stack",
    "from_callable",
    "load_policy",
    "parallel_env",
    "parse_wrapper",
    "plan_run",
    "policy_names",
    "record_run",
    "run_all",
    "run_one",
    "run_policy",
    "scenario",
    "with_overrides",
]

_HOMES = {
    "AUTHORS_PROGRAM": "quirks",
    "ActuatorNoise": "wrappers.noise",
    "ActuatorNoiseConfig": "wrappers.noise",
    "ConfigError": "config",
    "Event": "policy",
    "ForageEnv": "env",
    "Grip": "policy",
    "ObservationLayout": "layout",
    "Policy": "policy",
    "PopulationConfig": "wrappers.population",
    "PopulationDynamics": "wrappers.population",
    "Quirks": "quirks",
    "RandomPolicy": "policy",
    "RunRecord": "recording",
    "RunRecorder": "wrappers.recorder",
    "RunSpec": "study.spec",
    "ScenarioConfig": "config",
    "SensorNoise": "wrappers.noise",
    "SensorNoiseConfig": "wrappers.noise",
    "SwarmTask": "policy",
    "Task": "policy",
    "Throttle": "wrappers.throttle",
    "ThrottleConfig": "wrappers.throttle",
    "Waveform": "signals",
    "build_stack": "study.run",
    "from_callable": "policy",
    "load_policy": "policy",
    "parallel_env": "env",
    "parse_wrapper": "wrappers.registry",
    "plan_run": "study.spec",
    "policy_names": "policy",
    "record_run": "rendering_run",
    "run_all": "study.runner",
    "run_one": "study.run",
    "run_policy": "study.run",
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
        pettingzoo.register("parallel", env_id, "swarm_forage_env.learning.parallel:parallel_env", kwargs=kwargs)
        pettingzoo.register("aec", env_id, "swarm_forage_env.learning.parallel:env", kwargs=kwargs)
        gymnasium.register(
            env_id,
            "swarm_forage_env.adapters:JointForageEnv",
            kwargs=kwargs,
            vector_entry_point="swarm_forage_env.adapters:SwarmVectorEnv",
        )


_register_environments()
