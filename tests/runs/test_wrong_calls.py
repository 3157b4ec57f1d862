"""Plausible wrong calls of functions of runs end in a line that says what to do; what siblings take, is taken."""

import pytest

from metrics import verdict
from swarm_forage_env import (
    ConfigError,
    Plan,
    World,
    build_stack,
    check_determinism,
    check_policy,
    from_callable,
    load_study,
    parse_wrapper,
    plan_run,
    policy_specs,
    run_all,
    run_one,
    run_plan,
    run_policy,
    run_study,
    scenario,
    with_overrides,
)

TINY = scenario("warehouse_small", n_robots=3, n_objects=20, horizon_s=4.0, interval_s=2.0)
SPEC = plan_run(TINY, "random")
PLAN = Plan.product("random", TINY, seeds=(0,))
NOISE = "sensor_noise:sigma=0.1"


def test_one_or_several_names_or_objects_are_taken_by_all_alike():
    world = World(TINY, (parse_wrapper(NOISE),))
    assert plan_run(TINY, "random", wrappers=[NOISE]).world == World(TINY, [NOISE]) == world
    assert [type(layer).__name__ for layer in build_stack(TINY, [NOISE]).stack] == ["RunRecorder", "SensorNoise"]
    assert PLAN.specs == Plan.product(policy_specs(["random"]), [World(TINY)], seeds=[0]).specs == (SPEC,)
    assert load_study("S1a", seeds=[0, 1], rules="program").run == load_study("S1a", seeds=2, rules=["program"]).run


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: plan_run(TINY, "crw", wrappers=NOISE), "wrappers as a list of configurations or words"),
        (lambda: plan_run(TINY, "crw", parameters=["x"]), "parameters to be a table of values by name"),
        (lambda: run_one("crw"), r"spec to be a RunSpec, got 'crw'; plan_run\(world, policy\) makes one"),
        (lambda: run_policy("crw", SPEC), "a policy object with reset and act, got 'crw'; load_policy makes one"),
        (lambda: run_all(SPEC), r"specs to be an Iterable, got RunSpec.* Plan.product\(...\).specs are many"),
        (lambda: run_all([SPEC], executor=4), "executor to be an Executor, got 4; jobs= sets the number"),
        (lambda: run_plan("crw"), r"plan to be a Plan, got 'crw'; Plan.product\(policies, worlds, seeds\)"),
        (lambda: Plan.product("crw", TINY, seeds=3), r"seeds to be an Iterable, got 3; range\(n\)"),
        (lambda: run_study("S1a", "out"), r"spec to be a StudySpec, got 'S1a'; load_study\(file\) reads one"),
        (lambda: check_policy("random", 7), "scenario to be a ScenarioConfig"),
        (lambda: check_determinism("random", TINY, seeds=2), "seeds to be a Sequence, got 2"),
        (lambda: with_overrides("classroom", n_robots=3), r"config to be a ScenarioConfig.* scenario\(name\)"),
        (lambda: scenario("hall.toml"), r"the name of a scenario, got the file hall.toml; read_world\('hall.toml'\)"),
        (lambda: parse_wrapper(parse_wrapper(NOISE)), "a wrapper to be a text"),
        (lambda: verdict("results"), r"a study to be a StudyTable, got 'results'; read_study\(path\) reads one"),
        (lambda: policy_specs(policy_specs("crw"), caches="static"), "a name, a file or an object for parameters"),
        (lambda: plan_run(TINY, "crw", parameters={"x": float("inf")}), "policy parameters to be plain JSON values"),
        (lambda: from_callable(3), "function to be callable, got 3"),
    ],
)
def test_a_wrong_call_is_told_in_a_line(call, told):
    with pytest.raises(ConfigError, match=f"Expected {told}") as error:
        call()
    assert "\n" not in str(error.value)
