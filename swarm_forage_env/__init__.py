"""Swarm foraging as a PettingZoo environment.

Public names load on first use (PEP 562): importing the package compiles nothing and loads neither the physics nor
numba. It registers every scenario with PettingZoo and Gymnasium under ids such as `swarm_forage/warehouse_small-v1`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import gymnasium
import pettingzoo

from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario

if TYPE_CHECKING:
    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env.checks import CheckError, check_determinism, check_env, check_policy
    from swarm_forage_env.contract.codes import Event, Grip, Task
    from swarm_forage_env.contract.layout import ObservationLayout
    from swarm_forage_env.contract.own import OwnSensor, register_reward, register_sensor
    from swarm_forage_env.contract.policy import Policy, SwarmSpec
    from swarm_forage_env.env import ForageEnv
    from swarm_forage_env.inspect.film import record_run
    from swarm_forage_env.inspect.replay.capture import record_replay
    from swarm_forage_env.inspect.replay.files import read_replays, write_replays
    from swarm_forage_env.policies.registry import RandomPolicy, from_callable, load_policy, policy_names
    from swarm_forage_env.rendering.figures import FigureStyle
    from swarm_forage_env.runs.plan import Condition, Plan
    from swarm_forage_env.runs.policy_spec import PolicySpec, policy_spec, policy_specs
    from swarm_forage_env.runs.record import RunRecord
    from swarm_forage_env.runs.run import build_stack, run_one, run_policy
    from swarm_forage_env.runs.runner import run_plan, run_specs
    from swarm_forage_env.runs.spec import RunSpec, plan_run
    from swarm_forage_env.runs.table import Table
    from swarm_forage_env.scenarios.config import ScenarioConfig
    from swarm_forage_env.scenarios.kinds import RobotKind
    from swarm_forage_env.scenarios.overrides import with_overrides
    from swarm_forage_env.scenarios.quirks import AUTHORS_PROGRAM, Quirks
    from swarm_forage_env.studies.study import StudySpec
    from swarm_forage_env.studies.study_file import load_study
    from swarm_forage_env.studies.study_folder import StudyFolder, run_study
    from swarm_forage_env.studies.study_table import StudyTable, read_study
    from swarm_forage_env.views.pettingzoo import parallel_env
    from swarm_forage_env.views.sampler import SampledWorld, ScenarioSampler
    from swarm_forage_env.world.snapshots import Snapshot, SnapshotError
    from swarm_forage_env.wrappers.handling import HandlingCost, HandlingCostConfig
    from swarm_forage_env.wrappers.messages import MessageNoise, MessageNoiseConfig
    from swarm_forage_env.wrappers.noise import ActuatorNoise, ActuatorNoiseConfig, SensorNoise, SensorNoiseConfig
    from swarm_forage_env.wrappers.population import PopulationConfig, PopulationDynamics
    from swarm_forage_env.wrappers.recorder import RunRecorder
    from swarm_forage_env.wrappers.registry import parse_wrapper
    from swarm_forage_env.wrappers.throttle import Throttle, ThrottleConfig
    from swarm_forage_env.wrappers.waveform import Waveform
    from swarm_forage_env.wrappers.world import World

    __version__: str

__all__ = [
    "AUTHORS_PROGRAM",
    "SCENARIO_NAMES",
    "ActuatorNoise",
    "Condition",
    "Plan",
    "PolicySpec",
    "Table",
    "World",
    "policy_spec",
    "policy_specs",
    "ActuatorNoiseConfig",
    "CheckError",
    "ConfigError",
    "Event",
    "FigureStyle",
    "ForageEnv",
    "Grip",
    "HandlingCost",
    "HandlingCostConfig",
    "MessageNoise",
    "MessageNoiseConfig",
    "ObservationLayout",
    "OwnSensor",
    "Policy",
    "PopulationConfig",
    "PopulationDynamics",
    "Quirks",
    "RandomPolicy",
    "RobotKind",
    "RunRecord",
    "RunRecorder",
    "RunSpec",
    "SampledWorld",
    "ScenarioConfig",
    "ScenarioSampler",
    "SensorNoise",
    "SensorNoiseConfig",
    "Snapshot",
    "SnapshotError",
    "StudyFolder",
    "StudySpec",
    "StudyTable",
    "SwarmSpec",
    "Task",
    "Throttle",
    "ThrottleConfig",
    "Waveform",
    "build_stack",
    "check_determinism",
    "check_env",
    "check_policy",
    "from_callable",
    "load_policy",
    "load_study",
    "parallel_env",
    "parse_wrapper",
    "plan_run",
    "policy_names",
    "read_replays",
    "record_replay",
    "read_study",
    "record_run",
    "register_reward",
    "register_sensor",
    "run_plan",
    "run_specs",
    "run_one",
    "run_policy",
    "run_study",
    "scenario",
    "with_overrides",
    "write_replays",
]

_HOMES = {
    "AUTHORS_PROGRAM": "scenarios.quirks",
    "ActuatorNoise": "wrappers.noise",
    "ActuatorNoiseConfig": "wrappers.noise",
    "CheckError": "checks",
    "ConfigError": "_internal.fields",
    "Event": "contract.codes",
    "FigureStyle": "rendering.figures",
    "ForageEnv": "env",
    "Grip": "contract.codes",
    "HandlingCost": "wrappers.handling",
    "HandlingCostConfig": "wrappers.handling",
    "MessageNoise": "wrappers.messages",
    "MessageNoiseConfig": "wrappers.messages",
    "ObservationLayout": "contract.layout",
    "OwnSensor": "contract.own",
    "Policy": "contract.policy",
    "PopulationConfig": "wrappers.population",
    "PopulationDynamics": "wrappers.population",
    "Quirks": "scenarios.quirks",
    "RandomPolicy": "policies.registry",
    "RobotKind": "scenarios.kinds",
    "RunRecord": "runs.record",
    "RunRecorder": "wrappers.recorder",
    "RunSpec": "runs.spec",
    "SampledWorld": "views.sampler",
    "ScenarioConfig": "scenarios.config",
    "ScenarioSampler": "views.sampler",
    "SensorNoise": "wrappers.noise",
    "SensorNoiseConfig": "wrappers.noise",
    "Snapshot": "world.snapshots",
    "SnapshotError": "world.snapshots",
    "StudyFolder": "studies.study_folder",
    "StudySpec": "studies.study",
    "StudyTable": "studies.study_table",
    "SwarmSpec": "contract.policy",
    "Task": "contract.codes",
    "Throttle": "wrappers.throttle",
    "ThrottleConfig": "wrappers.throttle",
    "Waveform": "wrappers.waveform",
    "build_stack": "runs.run",
    "check_determinism": "checks",
    "check_env": "checks",
    "check_policy": "checks",
    "from_callable": "policies.registry",
    "load_policy": "policies.registry",
    "load_study": "studies.study_file",
    "parallel_env": "views.pettingzoo",
    "parse_wrapper": "wrappers.registry",
    "plan_run": "runs.spec",
    "policy_names": "policies.registry",
    "read_replays": "inspect.replay.files",
    "record_replay": "inspect.replay.capture",
    "read_study": "studies.study_table",
    "record_run": "inspect.film",
    "register_reward": "contract.own",
    "register_sensor": "contract.own",
    "run_plan": "runs.runner",
    "run_specs": "runs.runner",
    "World": "wrappers.world",
    "Plan": "runs.plan",
    "Condition": "runs.plan",
    "Table": "runs.table",
    "PolicySpec": "runs.policy_spec",
    "policy_spec": "runs.policy_spec",
    "policy_specs": "runs.policy_spec",
    "run_one": "runs.run",
    "run_policy": "runs.run",
    "run_study": "studies.study_folder",
    "with_overrides": "scenarios.overrides",
    "write_replays": "inspect.replay.files",
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
