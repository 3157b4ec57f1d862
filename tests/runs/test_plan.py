"""Plans: which runs there are, in which order, and what is refused."""

from dataclasses import dataclass, field

import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs.plan import Condition, Plan
from swarm_forage_env.runs.spec import plan_run, policy_spec
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.world import World
from tests.support.wrapper_configs import InnerConfig

WORLD = scenario("warehouse_small", n_robots=3, n_objects=20, horizon_s=4.0, interval_s=2.0)
CRW, STOCHM = policy_spec("crw", parameters={"wander_speed_mps": 0.05}), policy_spec("stochm", label="tasks")
QUIET, NOISY = World(WORLD), World(WORLD, (InnerConfig(),), criterion="noise", value=0.1)


def test_every_policy_runs_in_every_world_once_per_seed():
    plan = Plan.product([CRW, STOCHM], [QUIET, NOISY], seeds=[3, 5])
    assert plan.conditions == tuple(Condition(policy, world) for policy in (CRW, STOCHM) for world in (QUIET, NOISY))
    assert plan.policies == (CRW, STOCHM)
    assert plan.of_policy("tasks") == plan.conditions[2:]
    told = [(spec.policy, spec.world.value, spec.seed) for spec in plan.specs]
    assert told == [(policy, value, seed) for policy in ("crw", "stochm") for value in (0.0, 0.1) for seed in (3, 5)]
    assert len({spec.run_id for spec in plan.specs}) == 8
    assert plan.specs[2:4] == plan.specs_of(plan.conditions[1])
    assert plan.robot_ticks == sum(spec.robot_ticks for spec in plan.specs) == 8 * 3 * 20


@dataclass(frozen=True, kw_only=True, slots=True)
class ListedConfig(InnerConfig):
    """A configuration without a hash."""

    names: list[str] = field(default_factory=list)


def test_configurations_need_no_hash():
    world = World(WORLD, (ListedConfig(),))
    plan = Plan.product([CRW, STOCHM], [world], seeds=[3, 5])
    assert [spec.world.wrappers for spec in plan.specs] == [(ListedConfig(),)] * 4
    assert plan.specs_of(Condition(CRW, World(WORLD, (ListedConfig(),)))) == plan.specs[:2], "an equal condition"


@pytest.mark.parametrize("policy", [CRW, STOCHM])
@pytest.mark.parametrize("world", [QUIET, NOISY])
def test_its_runs_are_those_that_are_planned_one_by_one(policy, world):
    """Whoever made a run before finds it again."""
    plan = Plan.product([policy], [world], seeds=(0, 1))
    assert plan.specs == tuple(
        plan_run(world, policy.policy, parameters=policy.parameters, seed=seed) for seed in (0, 1)
    )


@pytest.mark.parametrize(
    ("conditions", "seeds", "message"),
    [
        ((), (), "one or more seeds"),
        ((Condition(CRW, QUIET),), (1, 1), "Expected different seeds, got 1, 1"),
        ((Condition(CRW, QUIET),), (-1,), "a seed to be a whole number >= 0, got -1"),
    ],
)
def test_impossible_plans_are_refused(conditions, seeds, message):
    with pytest.raises(ConfigError, match=message):
        Plan(conditions=conditions, seeds=seeds)


@pytest.mark.parametrize(("policies", "worlds"), [([], [QUIET]), ([CRW], [])])
def test_a_product_without_factors_is_refused(policies, worlds):
    with pytest.raises(ConfigError, match="one or more policies and worlds"):
        Plan.product(policies, worlds, seeds=(0,))


def test_a_condition_that_describes_no_run_is_refused_at_once():
    world = World(scenario("warehouse_small", horizon_s=300.0))
    with pytest.raises(ConfigError, match="whole number of intervals of 200 s, got 300 s"):
        Plan.product([CRW], [QUIET, world], seeds=(0,))
