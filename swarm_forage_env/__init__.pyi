# Public names, each written once, those first that are needed first; `__init__.py` loads them when they are first used.

# environments and scenarios
from .views.pettingzoo import parallel_env as parallel_env
from .views.pettingzoo import aec_env as aec_env
from .scenarios.presets import scenario as scenario
from .scenarios.presets import SCENARIO_NAMES as SCENARIO_NAMES
from .scenarios.config import ScenarioConfig as ScenarioConfig
from .scenarios.overrides import with_overrides as with_overrides
from .wrappers.world import World as World
from .wrappers.world import read_world as read_world
from .env import ForageEnv as ForageEnv
from .scenarios.quirks import Quirks as Quirks
from .scenarios.quirks import AUTHORS_PROGRAM as AUTHORS_PROGRAM

# policies
from .policies.registry import load_policy as load_policy
from .policies.registry import POLICIES as POLICIES
from .policies.registry import from_callable as from_callable
from .contract.policy import Policy as Policy
from .contract.robot_policy import RobotPolicy as RobotPolicy
from .contract.robot_policy import StepError as StepError
from .policies.registry import RandomPolicy as RandomPolicy
from .runs.spec import PolicySpec as PolicySpec
from .runs.spec import policy_spec as policy_spec
from .runs.spec import policy_specs as policy_specs

# runs
from .runs.plan import run_plan as run_plan
from .runs.runner import rerun as rerun
from .runs.plan import Plan as Plan
from .runs.plan import Condition as Condition
from .runs.plan import Table as Table
from .runs.runner import run_all as run_all
from .runs.run import run_one as run_one
from .runs.run import run_policy as run_policy
from .runs.spec import plan_run as plan_run
from .runs.spec import RunSpec as RunSpec
from .runs.record import Record as Record
from .runs.run import build_stack as build_stack
from .wrappers.recorder import RunRecorder as RunRecorder

# replays, films and figures
from .inspect.replay.capture import record_replay as record_replay
from .inspect.replay.files import write_replays as write_replays
from .inspect.film import record_run as record_run
from .rendering.figures import FigureStyle as FigureStyle

# training
from .views.sampler import ScenarioSampler as ScenarioSampler
from .training.export import export_policy as export_policy
from .policies.extras import ExtraFunctionError as ExtraFunctionError

# studies
from .studies.study import load_study as load_study
from .studies.results import run_study as run_study
from .studies.results import read_study as read_study
from .studies.study import StudySpec as StudySpec
from .studies.results import StudyTable as StudyTable

# checks
from .checks import check_env as check_env
from .checks import check_policy as check_policy
from .checks import check_determinism as check_determinism
from .checks import CheckError as CheckError
from ._internal.fields import ConfigError as ConfigError

# adversity
from .wrappers.registry import parse_wrapper as parse_wrapper
from .wrappers.throttle import Throttle as Throttle
from .wrappers.throttle import ThrottleConfig as ThrottleConfig
from .wrappers.noise import SensorNoise as SensorNoise
from .wrappers.noise import SensorNoiseConfig as SensorNoiseConfig
from .wrappers.noise import ActuatorNoise as ActuatorNoise
from .wrappers.noise import ActuatorNoiseConfig as ActuatorNoiseConfig
from .wrappers.population import PopulationDynamics as PopulationDynamics
from .wrappers.population import PopulationConfig as PopulationConfig
from .wrappers.handling import HandlingCost as HandlingCost
from .wrappers.handling import HandlingCostConfig as HandlingCostConfig
from .wrappers.waveform import Waveform as Waveform

# what observations, actions and events mean
from .contract.policy import SwarmSpec as SwarmSpec
from .contract.layout import ObservationLayout as ObservationLayout
from .contract.codes import Task as Task
from .contract.codes import Grip as Grip
from .contract.codes import Event as Event
from .world.snapshots import Snapshot as Snapshot
from .world.snapshots import SnapshotError as SnapshotError

__version__: str
