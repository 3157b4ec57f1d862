"""Levels that are changed by hand: until then a run is what it would be, and from then on they are told."""

import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.inspect.play.levels import LEVELS, Levels, with_idle
from swarm_forage_env.inspect.play.run import RunByHand
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import LiveRun, build_env
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.noise import SensorNoiseConfig
from swarm_forage_env.wrappers.throttle import ThrottleConfig
from swarm_forage_env.wrappers.waveform import Waveform

SMALL = scenario("warehouse_small", n_robots=8, n_objects=40)
NOISY = (SensorNoiseConfig(sigma=0.02), ThrottleConfig(waveform=Waveform(kind="constant", amplitude=0.1)))


def state_of(world):
    swarm = world.swarm
    arrays = (swarm.position, swarm.heading, swarm.wheel_speed, swarm.carried_object, world.objects.cell)
    return [array.tobytes() for array in (*arrays, world.events.counters)]


@pytest.mark.parametrize(("policy", "wrappers"), [("dpo", ()), ("stochm", NOISY)])
def test_looking_changes_nothing(policy, wrappers):
    looked = RunByHand(plan_run(SMALL, policy, seed=3, wrappers=wrappers))
    for _ in range(150):
        looked.step()
    plain = load_policy(policy)
    run = LiveRun(build_env(looked.scenario, wrappers, reads=getattr(plain, "reads", None)), plain, 3)
    run.advance(to_tick=150)
    assert state_of(looked.world) == state_of(run.forage_env)
    assert looked.levels.changes == []


@pytest.mark.parametrize("name", ["sensor_noise", "wheel_noise", "throttle", "deaths"])
def test_a_level_that_was_set_changes_the_run_and_is_told(name):
    runs = [RunByHand(plan_run(SMALL, "crw", seed=3)) for _ in range(2)]
    title, wanted = LEVELS[name].title, LEVELS[name].most
    assert runs[0].levels.set(name, wanted) == f"{title} is {wanted:g}"
    for each in runs:
        for _ in range(400):
            each.step()
    assert state_of(runs[0].world) != state_of(runs[1].world)
    assert runs[0].summary().endswith(f"changed by hand: {title} {wanted:g}")


def test_a_level_by_a_table_stays_as_it_is():
    table = ThrottleConfig(waveform=Waveform(kind="table", times_s=(0.0, 9.0), values=(0.1, 0.2)))
    levels = Levels(build_env(SMALL, with_idle((table,))))
    with pytest.raises(ConfigError, match="got a table of values"):
        levels.set("throttle", 0.3)
    assert levels.changes == []


def test_a_swarm_that_is_dead_ends_the_run():
    run = RunByHand(plan_run(SMALL, "crw", seed=3))
    for robot in range(8):
        assert run.levels.kill(robot) == f"robot {robot} was killed"
    assert run.levels.kill(6) == "robot 6 is not alive"
    run.step()
    assert run.run.over
