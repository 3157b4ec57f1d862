"""What determines a run: its identity and its JSON; plans of many runs, and what is refused in them."""

import json
from dataclasses import replace

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.model_files import file_digest
from swarm_forage_env.policies.registry import POLICIES, RandomPolicy, policy_class
from swarm_forage_env.runs.plan import Condition, Plan, Table, run_plan
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import PolicySpec, RunSpec, plan_run, policy_spec, policy_specs
from swarm_forage_env.scenarios.columns import INTERVAL_COLUMNS
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.quirks import AUTHORS_PROGRAM
from swarm_forage_env.wrappers.noise import ActuatorNoiseConfig, SensorNoiseConfig
from swarm_forage_env.wrappers.world import World
from tests.support.networks import network_of

BASE = RunSpec(world=World(scenario("warehouse_small")), policy="crw")


def base_in(**overrides):
    """The same run in another scenario."""
    return replace(BASE, world=World(scenario("warehouse_small", **overrides)))


def base_with(**fields):
    """The same run in a world of which other fields differ."""
    return replace(BASE, world=replace(BASE.world, **fields, name=""))


def test_quirks_parameters_and_wrappers_survive_json():
    spec = replace(
        BASE,
        world=World(
            scenario("search_and_rescue", quirks=AUTHORS_PROGRAM, nest_centre_m=(20.0, 24.0)),
            (ActuatorNoiseConfig(sigma=1 / 3), SensorNoiseConfig(sigma=0.1, groups=("light", "ground"))),
        ),
        parameters={"gain": 0.1, "levels": (1, 2), "nested": {"on": True, "none": None}},
    )
    again = RunSpec.from_mapping(json.loads(json.dumps(spec.to_mapping())))
    assert again == spec
    assert (again.run_id, hash(again)) == (spec.run_id, hash(spec))
    assert [wrapper.name for wrapper in again.wrappers] == ["sensor_noise", "actuator_noise"]


def test_the_id_is_short_and_tells_every_difference_apart():
    variants = [
        BASE,
        replace(BASE, seed=1),
        replace(BASE, policy="dpo"),
        base_with(criterion="noise"),
        base_with(value=0.1),
        replace(BASE, parameters={"a": 1}),
        replace(BASE, parameters={"a": True}),
        base_with(wrappers=(ActuatorNoiseConfig(sigma=0.1),)),
        base_with(wrappers=(ActuatorNoiseConfig(sigma=0.2),)),
        base_in(quirks=AUTHORS_PROGRAM),
        base_in(n_robots=49),
    ]
    ids = {spec.run_id for spec in variants}
    assert len(ids) == len(variants)
    assert {len(run_id) for run_id in ids} == {16}
    assert all(int(run_id, 16) >= 0 for run_id in ids)


def test_what_changes_no_run_changes_no_id():
    whole, real = (base_in(horizon_s=value) for value in (2000, 2000.0))
    assert (whole, whole.run_id) == (real, real.run_id)
    other = base_in(performance="n_carrying")
    assert other != BASE
    assert other.run_id == BASE.run_id
    named = replace(BASE, world=replace(BASE.world, name="at home"))
    assert (named, named.run_id) == (BASE, BASE.run_id)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        *(({"seed": seed}, "Expected seed to be a whole number") for seed in (-1, 2**63, 1.0, True)),
        ({"parameters": {"a": float("nan")}}, "plain JSON values"),
        ({"parameters": {"a": object()}}, "plain JSON values"),
        ({"world": "warehouse_small"}, "Expected world to be a World, got 'warehouse_small'"),
    ],
)
def test_what_describes_no_run_is_refused(fields, message):
    with pytest.raises(ConfigError, match=message):
        replace(BASE, **fields)


@pytest.mark.parametrize(
    ("part", "message"),
    [
        ({"polcy": "crw"}, "Unknown key of a run specification 'polcy'. Did you mean 'policy'"),
        ({"scenario": {"name": "mine", "are": {}}}, r"Unknown key 'scenario\.are'.* Did you mean 'scenario.arena'"),
        ({"scenario": "warehouse_small"}, "Expected scenario to be a table of values by name, got 'warehouse_small'"),
        ({"wrappers": [{"wrapper": "fog"}]}, "Unknown wrapper 'fog'"),
        ({"wrappers": [{"sigma": 1}]}, "Missing key 'wrapper'"),
        ({"wrappers": "fog"}, "Expected wrappers as a list of tables, got 'fog'"),
        ({"wrappers": ["fog"]}, "Expected a wrapper to be a table"),
    ],
)
def test_a_mapping_that_is_no_specification_is_refused(part, message):
    with pytest.raises(ConfigError, match=message):
        RunSpec.from_mapping({**BASE.to_mapping(), **part})


def test_a_planned_run_has_the_world_its_policy_is_made_for():
    for policy in POLICIES:
        made_for = getattr(policy_class(policy), "caches", "none")
        assert plan_run(scenario("warehouse_small"), policy).scenario.caches == made_for
        assert plan_run(scenario("warehouse_small"), policy, caches="dynamic").scenario.caches == "dynamic"


def test_wrappers_are_added_to_those_of_the_world():
    inner, outer = ActuatorNoiseConfig(sigma=0.1), SensorNoiseConfig(sigma=0.1)
    world = World(scenario("warehouse_small"), (inner,), criterion="noise", value=0.1)
    spec = plan_run(world, "stochm", wrappers=[outer])
    assert spec.wrappers == (outer, inner)
    assert (spec.scenario.caches, spec.world.criterion, spec.world.value) == ("static", "noise", 0.1)


class ForStatic(RandomPolicy):
    caches = "static"


def forward(obs):
    return np.ones((len(obs), 3), np.float32)


@pytest.fixture
def network_in(tmp_path):
    """Writes a network with random weights into a folder of its own."""

    def write(folder, seed=0):
        path = tmp_path / folder / "net.npz"
        path.parent.mkdir(exist_ok=True)
        network_of(InterfaceConfig(observation="compact"), seed=seed, caches="static").save(path)
        return path

    return write


def test_a_name_is_looked_up_with_the_caches_that_it_states():
    assert policy_spec("random") == PolicySpec(label="random", policy="random")
    assert policy_spec("stochm").caches == "static"
    chosen = policy_spec("stochm", label="mine", parameters={"wander_speed_mps": 0.05}, caches="none")
    assert (chosen.label, chosen.policy, chosen.caches) == ("mine", "stochm", "none")
    assert chosen.parameters == {"wander_speed_mps": 0.05}
    assert chosen.is_named
    assert chosen.factory is None


def test_the_content_of_a_file_is_part_of_the_identity_of_its_runs(network_in, monkeypatch):
    path = network_in("a")
    monkeypatch.chdir(path.parent)
    assert policy_spec(str(path)) == PolicySpec(
        label="net", policy=str(path), caches="static", parameters={"digest": file_digest(path)}
    )
    first = plan_run("warehouse_small", "net.npz")
    assert first == plan_run("warehouse_small", str(path))
    assert first == plan_run("warehouse_small", path, parameters=first.parameters)
    assert first.scenario.caches == "static"
    network_in("a", seed=1)
    assert plan_run("warehouse_small", path).run_id != first.run_id
    with pytest.raises(ValueError, match="a file that has changed since"):
        plan_run("warehouse_small", path, parameters=first.parameters)


@pytest.mark.parametrize(
    ("given", "label", "caches"),
    [
        (ForStatic, "ForStatic", "static"),
        (ForStatic(), "ForStatic", "static"),
        (forward, "forward", None),
    ],
)
def test_what_only_this_process_can_build_has_a_factory(given, label, caches):
    found = policy_spec(given)
    assert (found.label, found.policy, found.caches) == (label, label, caches)
    assert not found.is_named, "nothing tells whose runs these are"
    policy = found.factory()
    assert policy is not given
    assert callable(policy.act)
    assert policy_spec(given, label="mine").is_named


def test_several_have_names_of_their_own():
    assert [spec.label for spec in policy_specs(["crw", "dpo"])] == ["crw", "dpo"]
    assert [spec.label for spec in policy_specs({"one": policy_spec("crw")})] == ["one"]
    named = policy_specs({"slow": "crw", "mine": forward}, caches="dynamic")
    assert [(spec.label, spec.policy) for spec in named] == [("slow", "crw"), ("mine", "mine")]
    assert {spec.caches for spec in named} == {"dynamic"}
    assert all(spec.is_named for spec in named)
    parameters = {"wander_speed_mps": 0.05}
    assert [dict(spec.parameters) for spec in policy_specs(["crw", "dpo"], parameters=parameters)] == [parameters] * 2


CRW, STOCHM = policy_spec("crw", parameters={"wander_speed_mps": 0.05}), policy_spec("stochm", label="tasks")
QUIET = World(scenario("warehouse_small", n_robots=3, n_objects=20, horizon_s=4.0, interval_s=2.0))
NOISY = replace(QUIET, wrappers=(SensorNoiseConfig(sigma=0.02),), criterion="noise", value=0.02, name="")


def test_every_policy_runs_in_every_world_once_per_seed():
    plan = Plan.product([CRW, STOCHM], [QUIET, NOISY], seeds=[3, 5])
    assert plan.conditions == tuple(Condition(policy, world) for policy in (CRW, STOCHM) for world in (QUIET, NOISY))
    assert plan.policies == (CRW, STOCHM)
    assert plan.of_policy("tasks") == plan.conditions[2:]
    told = [(spec.policy, spec.world.value, spec.seed) for spec in plan.specs]
    assert told == [(policy, value, seed) for policy in ("crw", "stochm") for value in (0.0, 0.02) for seed in (3, 5)]
    assert len({spec.run_id for spec in plan.specs}) == 8
    assert plan.specs[2:4] == plan.specs_of(plan.conditions[1])
    assert plan.specs[6:] == tuple(plan_run(NOISY, "stochm", seed=seed) for seed in (3, 5)), "whoever made one finds it"
    assert plan.robot_ticks == sum(spec.robot_ticks for spec in plan.specs) == 8 * 3 * 20


@pytest.mark.parametrize(
    ("policies", "worlds", "seeds", "message"),
    [
        ([CRW], [QUIET], (), "one or more seeds"),
        ([CRW], [QUIET], (1, 1), "Expected different seeds, got 1, 1"),
        ([CRW], [QUIET], (-1,), "a seed to be a whole number >= 0, got -1"),
        ([], [QUIET], (0,), "one or more policies and worlds"),
        ([CRW], [], (0,), "one or more policies and worlds"),
        ([CRW], ["odd"], (0,), "whole number of intervals of 200 s, got 300 s"),
    ],
)
def test_impossible_plans_are_refused(policies, worlds, seeds, message):
    worlds = [World(scenario("warehouse_small", horizon_s=300.0)) if one == "odd" else one for one in worlds]
    with pytest.raises(ConfigError, match=message):
        Plan.product(policies, worlds, seeds=seeds)


RANDOM = policy_spec("random")
NOBODY = PolicySpec(label="nobody", policy="nobody")
PLAN = Plan.product([RANDOM, NOBODY], [QUIET, NOISY], seeds=(1, 0))
FIRST, SECOND = PLAN.of_policy("random")


@pytest.fixture(scope="module")
def table():
    return run_plan(PLAN, jobs=1)


def test_each_condition_has_its_records_in_the_order_of_the_seeds(table):
    for condition in (FIRST, SECOND):
        for record, spec in zip(table.of(condition), PLAN.specs_of(condition), strict=True):
            assert record.equals(run_one(spec))
    assert table.folder is None


def test_runs_that_failed_are_told_by_condition(table):
    assert table.failure_lines("random") == ()
    assert len(table.failure_lines("nobody")) == 1
    lost = PLAN.of_policy("nobody")[1]
    assert len(table.failures) == 4
    assert table.of(lost) == ()
    assert table.curves(lost) == ((), {})


def test_curves_are_the_columns_of_its_runs(table):
    seeds, curves = table.curves(SECOND, "collected", "interference_fraction", "no_such_column")
    assert seeds == (1, 0)
    assert list(curves) == ["collected", "interference_fraction"]
    for name, values in curves.items():
        assert (values.shape, values.dtype) == ((2, 2), np.float64)
        np.testing.assert_array_equal(values, [record[name] for record in table.of(SECOND)])
    everything = table.curves(SECOND)[1]
    assert {"performance", "n_active", "believed_interference_fraction"} <= everything.keys()
    assert "believed_interference_fraction" not in table.curves(FIRST)[1], "only noisy runs have that column"


def test_a_column_that_only_some_runs_have_is_left_out(table):
    """Records of different versions may differ in what wrappers told them."""
    one, other = table.of(SECOND)
    bare = replace(other, columns={name: other[name] for name in INTERVAL_COLUMNS})
    mixed = Table(plan=PLAN, records={one.run_id: one, other.run_id: bare})
    seeds, curves = mixed.curves(SECOND, "believed_interference_fraction", "n_active")
    assert (seeds, list(curves)) == ((1, 0), ["n_active"])


def test_worlds_that_differ_in_performance_alone_share_runs_and_read_them_their_own_way(table):
    at_work = World(replace(QUIET.scenario, performance="n_active"))
    plan = Plan(conditions=(Condition(RANDOM, at_work), FIRST), seeds=PLAN.seeds)
    both = Table(plan=plan, records=table.records)
    assert both.curves(plan.conditions[0], "performance")[1]["performance"].tolist() == [[3.0, 3.0]] * 2
    collected = both.curves(FIRST, "performance", "collected")[1]
    np.testing.assert_array_equal(collected["performance"], collected["collected"])
    assert all(a is b for a, b in zip(both.of(FIRST), table.of(FIRST), strict=True))
