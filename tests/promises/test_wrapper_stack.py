"""What every wrapper promises, alone and in the full stack: PettingZoo's contract, determinism, conservation."""

import hashlib
from dataclasses import replace

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test
from pettingzoo.utils import BaseParallelWrapper
from pettingzoo.utils.conversions import parallel_to_aec

from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.runs.record import Record
from swarm_forage_env.runs.run import build_stack, run_one
from swarm_forage_env.runs.spec import RunSpec, plan_run
from swarm_forage_env.scenarios.columns import ALL_COLUMNS
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.views.gymnasium import JointForageEnv
from swarm_forage_env.wrappers.base import STACK_ORDER, WrapperConfig
from swarm_forage_env.wrappers.handling import HandlingCostConfig
from swarm_forage_env.wrappers.noise import (
    ActuatorNoise,
    ActuatorNoiseConfig,
    SensorNoise,
    SensorNoiseConfig,
)
from swarm_forage_env.wrappers.population import PopulationConfig
from swarm_forage_env.wrappers.registry import WRAPPERS, parse_wrapper, wrapper_config_class
from swarm_forage_env.wrappers.throttle import ThrottleConfig
from swarm_forage_env.wrappers.waveform import Waveform
from tests.support.crowded_runs import BusyPolicy
from tests.support.stage import assert_conserved

ROBOTS = 8

ACTIVE: dict[str, WrapperConfig] = {
    "sensor_noise": SensorNoiseConfig(
        sigma=0.1, sigmas={"position": 0.5, "light": Waveform(kind="constant", amplitude=0.2)}
    ),
    "population": PopulationConfig(
        death_per_tick=0.03, birth_per_tick=0.05, malfunction_per_tick=0.1, repair_per_tick=0.1, initial_robots=6
    ),
    "throttle": ThrottleConfig(
        waveform=Waveform(kind="square", amplitude=0.4, offset=0.4, period_s=3.0), carriers=True
    ),
    "actuator_noise": ActuatorNoiseConfig(sigma=0.3),
    "handling_cost": HandlingCostConfig(waveform=Waveform(kind="square", amplitude=2.0, offset=3.0, period_s=3.0)),
}
"""One strong example of each wrapper."""

QUIET: dict[str, WrapperConfig] = {
    "sensor_noise": SensorNoiseConfig(sigma=0.0, sigmas={"ground": Waveform(kind="sine", period_s=5.0)}),
    "population": PopulationConfig(),
    "throttle": ThrottleConfig(waveform=Waveform(kind="sine", amplitude=0.0, period_s=10.0)),
    "actuator_noise": ActuatorNoiseConfig(sigma=0.0),
    "handling_cost": HandlingCostConfig(waveform=Waveform(kind="sine", amplitude=0.0, period_s=10.0)),
}
"""Each wrapper with amplitudes, sigmas and rates of zero."""


def absorbing(config: WrapperConfig) -> WrapperConfig:
    return replace(config, deaths="absorbing") if isinstance(config, PopulationConfig) else config


STACKS = {name: (config,) for name, config in ACTIVE.items()}
STACKS |= {"population_absorbing": (absorbing(ACTIVE["population"]),)}
STACKS |= {"all": tuple(ACTIVE.values()), "all_absorbing": tuple(absorbing(config) for config in ACTIVE.values())}
each_stack = pytest.mark.parametrize("wrappers", STACKS.values(), ids=STACKS)


def world_config(**overrides):
    options = {"n_robots": ROBOTS, "n_objects": 400, "caches": "dynamic", "walk_probability": 0.01}
    options |= {"neighbours_seen": 2, "message_size": 2, "message_range_m": 5.0, **overrides}
    return scenario("warehouse_small", **options)


def stacked(wrappers, **overrides):
    return build_stack(world_config(interval_s=2.0, **overrides), wrappers)


class Foreign(BaseParallelWrapper):
    """Somebody else's wrapper."""


@pytest.mark.parametrize("name", WRAPPERS)
def test_names_places_and_examples_agree(name):
    config_class = wrapper_config_class(name)
    wrapper = ACTIVE[name].wrap(ForageEnv(world_config()))
    assert config_class is type(ACTIVE[name])
    assert config_class.name == name
    assert config_class.wrapper is type(wrapper)
    assert STACK_ORDER[wrapper.stack_position] == type(wrapper).__name__
    example = parse_wrapper(f"{name}:{config_class.example}")
    assert example.in_words(0.2) != QUIET[name].in_words(0.2), "it does something"
    with pytest.raises(TypeError, match="outside of the swarm wrappers"):
        ACTIVE[name].wrap(Foreign(ForageEnv(world_config())))  # type: ignore[arg-type] - that is the mistake
    parallel_api_test(Foreign(ACTIVE[name].wrap(ForageEnv(world_config()))), num_cycles=20)


# PettingZoo and Gymnasium


@pytest.mark.filterwarnings("ignore:Observation numpy array is all zeros")  # rows of the dead and the unborn
@each_stack
def test_tests_of_pettingzoo_and_gymnasium_pass(wrappers):
    parallel_api_test(stacked(wrappers), num_cycles=120)
    parallel_seed_test(lambda: stacked(wrappers), num_cycles=40)
    api_test(parallel_to_aec(stacked(wrappers, horizon_s=4.0)), num_cycles=200)
    check_env(JointForageEnv(world_config(), wrappers=wrappers), skip_render_check=True)


# Determinism and conservation


def play(env, seed: int, ticks: int, *, check=None) -> str:
    """Fingerprint of what a busy run shows, tick by tick."""
    seen, policy, world = hashlib.sha256(), BusyPolicy(), env.unwrapped
    policy.reset(world.swarm_spec, stream_rng(seed, Stream.POLICY))
    obs = env.reset_batch(seed)
    for _ in range(ticks):
        seen.update(obs.tobytes())
        seen.update(env.state().tobytes())
        obs, reward, terminated, _ = env.step_batch(policy.act(obs, world.active))
        seen.update(reward.tobytes() + terminated.tobytes() + world.active.tobytes())
        if check:
            check(world)
    return seen.hexdigest()


@each_stack
def test_a_seed_is_a_run(wrappers):
    env = stacked(wrappers)
    first = play(env, 5, 60, check=assert_conserved)
    assert play(env, 6, 25) != first
    assert play(env, 5, 60) == first, "the same instance, after another run"
    assert play(stacked(tuple(reversed(wrappers))), 5, 60) == first, "another instance, wrappers named in another order"


# Nothing happens unless asked for


@pytest.mark.parametrize("names", [("handling_cost",), tuple(WRAPPERS)], ids="+".join)
def test_wrappers_without_effect_change_nothing(names):
    bare, wrapped = stacked((), horizon_s=20.0), stacked([QUIET[name] for name in names], horizon_s=20.0)
    assert play(bare, 3, 100) == play(wrapped, 3, 100)
    record, expected = wrapped.columns(), bare.columns()
    if names == ("handling_cost",):  # conditions are then the ticks that handling takes, one in any case
        expected["adversity"] = np.ones_like(expected["adversity"])
    assert record.keys() >= expected.keys()
    for name, values in record.items():
        assert (values == expected.get(name, name.startswith("handling_cost"))).all(), name


# As data


@each_stack
def test_runs_survive_json_and_parquet(wrappers, tmp_path):
    spec = plan_run(world_config(horizon_s=4.0, interval_s=2.0), "random", caches="dynamic", wrappers=wrappers, seed=7)
    assert RunSpec.from_mapping(spec.to_mapping()) == spec
    record = run_one(spec)
    record.write(tmp_path / "run.parquet")
    again = Record.read(tmp_path / "run.parquet")
    stored = again.spec
    assert stored.wrappers == spec.wrappers
    assert stored.run_id == spec.run_id
    assert run_one(stored).equals(record)
    assert set(record.columns) <= set(ALL_COLUMNS)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "throttle:waveform=square,amplitude=0.2,period_s=5000,carriers=true",
            ThrottleConfig(waveform=Waveform(kind="square", amplitude=0.2, period_s=5000), carriers=True),
        ),
        (
            "throttle:waveform=table,times_s=0+100+2e3,values=0+0.5+-1",
            ThrottleConfig(waveform=Waveform(kind="table", times_s=(0, 100, 2000.0), values=(0, 0.5, -1))),
        ),
        (
            " sensor_noise: sigma=0.03, groups=light+proximity, sigmas.position=0.1 ",
            SensorNoiseConfig(sigma=0.03, groups=("proximity", "light"), sigmas={"position": 0.1}),
        ),
        (
            "actuator_noise:sigma=sine,amplitude=0.1,offset=0.1,period_s=100",
            ActuatorNoiseConfig(sigma=Waveform(kind="sine", amplitude=0.1, offset=0.1, period_s=100)),
        ),
        (
            "population:death_per_tick=1e-4,initial_robots=20,deaths=absorbing",
            PopulationConfig(death_per_tick=1e-4, initial_robots=20, deaths="absorbing"),
        ),
    ],
)
def test_wrappers_are_named_on_a_command_line(text, expected):
    assert parse_wrapper(text) == expected


# Streams


def wheel_and_sensor_draws(*names: str) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """What actuator noise and sensor noise draw in a stack of these wrappers."""
    env, wheels, sensors = ForageEnv(world_config()), [], []
    actions = np.zeros((ROBOTS, 3), np.float32)
    for config in sorted((ACTIVE[name] for name in names), key=lambda config: -config.stack_position):
        env = config.wrap(env)
    env.reset_batch(4)
    for _ in range(20):
        env.step_batch(actions)
        wrapper = env
        while not isinstance(wrapper, ForageEnv):
            if isinstance(wrapper, ActuatorNoise):
                wheels.append(wrapper._draws.copy())
            elif isinstance(wrapper, SensorNoise):
                sensors.append(wrapper._draws.copy())
            wrapper = wrapper.env
    return wheels, sensors


def test_another_wrapper_or_a_lost_robot_shifts_nobodys_randomness():
    wheels, sensors = wheel_and_sensor_draws(*WRAPPERS)  # robots die and break in this one
    np.testing.assert_array_equal(wheels, wheel_and_sensor_draws("actuator_noise")[0])
    np.testing.assert_array_equal(sensors, wheel_and_sensor_draws("sensor_noise")[1])
    np.testing.assert_array_equal(wheels, wheel_and_sensor_draws("actuator_noise", "throttle")[0])
