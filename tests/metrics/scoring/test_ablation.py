"""Ablation of quirks: which runs are planned, which are left out, and what the differences are."""

from dataclasses import replace

import numpy as np
import pytest

from metrics.scoring.ablation import TASK_COLUMNS, Switch, ablate_quirks, ablation_question
from metrics.scoring.question import ask
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs.plan import Plan
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.quirks import AUTHORS_PROGRAM, QUIRK_NAMES, Quirks
from swarm_forage_env.wrappers.noise import SensorNoiseConfig
from swarm_forage_env.wrappers.world import World

WORLD = scenario("warehouse_small", n_robots=6, horizon_s=40.0, interval_s=20.0, start_margin_m=6.5)


def test_each_quirk_is_switched_alone_in_both_readings():
    question = ablation_question([WORLD], ["crw"], seeds=[3])
    rules = {switch: condition.world.scenario.quirks for switch, condition in question.conditions.items()}
    assert len(rules) == 2 * (1 + len(QUIRK_NAMES))
    assert rules[Switch("warehouse_small", 6, "crw", "DESCRIBED", "")] == Quirks()
    assert rules[Switch("warehouse_small", 6, "crw", "AUTHORS_PROGRAM", "")] == AUTHORS_PROGRAM
    for name in QUIRK_NAMES:
        assert rules[Switch("warehouse_small", 6, "crw", "DESCRIBED", name)] == Quirks(**{name: True})
        off = {other: other != name for other in QUIRK_NAMES}
        assert rules[Switch("warehouse_small", 6, "crw", "AUTHORS_PROGRAM", name)] == Quirks(**off)


def test_a_quirk_without_effect_is_run_once_and_one_with_effect_with_every_seed(tmp_path):
    quirks = ["nest_left_at_random", "explore_double_start"]
    question = ablation_question([WORLD], ["crw"], quirks=quirks, seeds=[0, 1])
    result = ask(question, out=tmp_path, jobs=1, progress=False)
    assert len(question.plan.specs) == 12
    # Nobody delivers in 40 s, so nobody leaves the nest after it; exploring starts in the first tick.
    assert len(list(tmp_path.rglob("*.parquet"))) == 4 + 2 * 1 + 2 * 2
    effects = {effect.switch[3:]: effect for effect in result.effects()}
    assert effects.keys() == {(rules, quirk) for rules in ("DESCRIBED", "AUTHORS_PROGRAM") for quirk in quirks}
    for rules in ("DESCRIBED", "AUTHORS_PROGRAM"):
        assert effects[rules, "nest_left_at_random"].is_same
        assert effects[rules, "nest_left_at_random"].interference.tolist() == [0.0]
        assert not effects[rules, "explore_double_start"].is_same
        assert len(effects[rules, "explore_double_start"].interference) == 2
    assert result.failures == ()


def test_differences_are_those_of_the_runs_with_the_same_seed():
    world = scenario("warehouse_small", n_robots=20, n_objects=300, horizon_s=400.0)
    question = ablation_question([world], ["stochm"], quirks=["integer_estimates"], seeds=[0, 1])
    effect = next(e for e in ask(question, jobs=1, progress=False).effects() if e.switch.rules == "DESCRIBED")
    conditions = [question.conditions[effect.switch._replace(quirk=quirk)] for quirk in ("", "integer_estimates")]
    runs = [Plan(conditions=(condition,), seeds=(0, 1)).specs for condition in conditions]
    pairs = [[run_one(spec) for spec in specs] for specs in zip(*runs, strict=True)]
    mean = np.mean([before.performance.sum() for before, _ in pairs])
    for seed, (before, after) in enumerate(pairs):
        gain = after.performance.sum() - before.performance.sum()
        assert effect.performance[seed] == pytest.approx(gain / mean, nan_ok=True)
        lost = after.interference_fraction.mean() - before.interference_fraction.mean()
        assert effect.interference[seed] == pytest.approx(lost)
        moved = [after.contributed[name].mean() - before.contributed[name].mean() for name in TASK_COLUMNS]
        assert effect.task_shares[seed] == pytest.approx(moved)


def test_policies_are_ordered_by_performance():
    world = scenario("warehouse_small", n_robots=20, horizon_s=1000.0)
    result = ablate_quirks([world], ["random", "dpo"], quirks=[], seeds=[0], jobs=1, progress=False)
    assert list(result.means(Switch("warehouse_small", 20, "", "DESCRIBED", ""))) == ["dpo", "random"]
    assert result.effects() == ()


def test_a_policy_that_fails_is_left_out_and_told():
    def refuse(obs):
        raise RuntimeError("I would rather not")

    question = ablation_question(
        [WORLD], {"random": "random", "mine": refuse}, quirks=["explore_double_start"], seeds=[0, 1]
    )
    result = ask(question, jobs=1, progress=False)
    assert {switch.policy for switch in result.records} == {"random"}
    assert {effect.switch.policy for effect in result.effects()} == {"random"}
    assert {failure.spec.policy for failure in result.failures} == {"mine"}
    assert len(result.failures) == len(question.plan.specs) / 2


def test_two_worlds_of_one_name_and_size_are_refused():
    with pytest.raises(
        ConfigError, match="differ in name or number of robots, got warehouse_small with 6 robots twice"
    ):
        ablation_question([WORLD, replace(WORLD, horizon_s=60.0)], ["crw"], quirks=[])


def test_disturbances_are_the_same_in_all_runs():
    noisy = World(WORLD, (SensorNoiseConfig(sigma=0.01),))
    question = ablation_question([noisy], ["crw"], quirks=["explore_double_start"])
    assert {spec.wrappers for spec in question.plan.specs} == {noisy.wrappers}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"quirks": ["integer_estimate"]}, "Did you mean 'integer_estimates'"),
        ({"seeds": []}, "one or more policies and seeds, got 1 and 0"),
    ],
)
def test_impossible_plans_are_refused(words, message):
    with pytest.raises(ConfigError, match=message):
        ablation_question([WORLD], ["crw"], **words)
