"""Choosing: verdicts by hand, the order of policies, the sentence that gives the reason, and the runs behind it."""

import json
import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from metrics import CurveError, choose_policy
from metrics.scoring import ask
from metrics.scoring.choosing import (
    MET,
    NOT_MET,
    UNDECIDED,
    ChoiceQuestion,
    Constraint,
    Evidence,
    choice_question,
)
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs import workers
from swarm_forage_env.runs.plan import Plan
from swarm_forage_env.runs.policy_spec import PolicySpec
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.store import load
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.noise import NOISE_GROUPS, ActuatorNoiseConfig, SensorNoiseConfig
from swarm_forage_env.wrappers.population import malfunction_levels
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import World
from tests.support.run_tables import table_of_totals

WORLD = scenario("warehouse_small", n_robots=4, n_objects=20, horizon_s=4.0, interval_s=2.0)
DEMANDS = (Constraint(condition="undisturbed", demand=10.0), Constraint(condition="noise 0.01", demand=5.0))
GOOD, BAD, UNSURE = [12.0, 13.0, 14.0], [1.0, 2.0, 3.0], [2.0, 10.0, 12.0]


def evidence(values, demand=10.0):
    return Evidence(
        constraint=Constraint(condition="undisturbed", demand=demand), per_seed=dict(enumerate(map(float, values)))
    )


def chosen(world=WORLD, **runs):
    """Rank policies by (undisturbed, noisy) runs."""
    worlds = [World(world), World(world, (ActuatorNoiseConfig(sigma=0.01),), criterion="noise", value=0.01)]
    seeds = range(max((len(values) for both in runs.values() for values in both), default=0) or 3)
    plan = Plan.product([PolicySpec(label=name, policy=name) for name in runs], worlds, tuple(seeds))
    return ChoiceQuestion(plan=plan, constraints=DEMANDS).answer(table_of_totals(plan, runs))


def test_a_verdict_by_hand():
    # Mean 13, standard deviation 1, three runs: 13 ± 4.303 / sqrt(3) = 10.52 to 15.48, all above 10.
    found = evidence([12, 13, 14])
    assert (found.summary.lower, found.summary.upper) == pytest.approx((10.5159, 15.4841), abs=1e-4)
    assert (found.margin, found.n_reaching, found.verdict) == (3.0, 3, MET)
    # t = 3 sqrt(3) = 5.196 with two degrees of freedom: 1/2 + t / (2 sqrt(2 + t^2)).
    assert found.confidence == pytest.approx(0.5 + 5.19615 / (2.0 * math.sqrt(29.0)), abs=1e-5)
    assert evidence([12, 13, 14], demand=10.6).verdict == UNDECIDED
    assert evidence([12, 13, 14], demand=13.0).confidence == pytest.approx(0.5)
    assert evidence([12, 13, 14], demand=15.4).verdict == UNDECIDED
    assert evidence([12, 13, 14], demand=15.5).verdict == NOT_MET


def test_runs_that_are_all_alike_leave_no_doubt():
    assert (evidence([10, 10]).verdict, evidence([10, 10]).confidence) == (MET, 1.0)
    assert (evidence([9, 9]).verdict, evidence([9, 9]).confidence) == (NOT_MET, 0.0)


@pytest.mark.parametrize("values", [[], [50]])
def test_too_few_runs_decide_nothing(values):
    assert evidence(values).verdict == UNDECIDED
    assert math.isnan(evidence(values).confidence)


def test_a_near_certainty_is_not_called_certain():
    assert "> 99.9 %" in evidence([50, 50.1, 50.2]).cells()
    assert "< 0.1 %" in evidence([1, 1.01, 1.02]).cells()
    assert "100 %" in evidence([10, 10]).cells()


def test_more_constraints_met_come_first_whatever_the_performance():
    choice = chosen(strong=([90.0, 91.0, 92.0], UNSURE), steady=(GOOD, GOOD))
    assert [candidate.policy for candidate in choice.candidates] == ["steady", "strong"]
    assert choice.reason == (
        "steady comes first: it meets 2 of 2 constraints with confidence, strong 1 (undecided: noise 0.01)."
    )


def test_undecided_comes_before_not_met():
    choice = chosen(fails=([90.0, 91.0, 92.0], BAD), unsure=(GOOD, UNSURE))
    assert [candidate.policy for candidate in choice.candidates] == ["unsure", "fails"]
    assert choice.reason == (
        "unsure comes first: it meets 1 of 2 constraints with confidence, as fails does, and fails 0 where fails "
        "fails 1."
    )


def test_performance_decides_between_equals_and_its_test_is_told():
    choice = chosen(less=(GOOD, GOOD), more=([22.0, 23.5, 24.0], GOOD))
    assert [candidate.policy for candidate in choice.candidates] == ["more", "less"]
    assert (
        "achieves 23.17 undisturbed against 13; the difference is significant (paired t test, p = 0.0" in choice.reason
    )


def test_runs_that_do_not_tell_policies_apart_say_so():
    choice = chosen(a=(GOOD, GOOD), b=([12.5, 13.0, 13.6], GOOD))
    assert choice.reason.endswith("so the runs do not tell them apart.")
    # Differences -0.5, 0, 0.4: their mean is -0.033, with a standard error of 0.26.
    assert "the difference is not significant (paired t test, p = 0.9" in choice.reason


def test_policies_without_runs_come_last_and_are_no_reason():
    choice = chosen(none=([], []), some=(BAD, BAD))
    assert [candidate.policy for candidate in choice.candidates] == ["some", "none"]
    assert choice.reason.endswith("(not met: undisturbed, noise 0.01); runs of none failed.")
    choice = chosen(none=([], []), other=([], []))
    assert "there are too few runs to test the difference" in choice.reason
    assert [told.partition(", and ")[2] for told in choice.candidates[0].failures] == ["5 more of its runs: it broke"]
    assert str(choice).count("it broke") == 2
    assert chosen(alone=(GOOD, UNSURE)).reason == (
        "alone meets 1 of 2 constraints with confidence (undecided: noise 0.01)."
    )
    assert json.loads(json.dumps(choice.to_mapping()))["ranking"][0]["performance"] is None


def test_the_table_has_a_row_for_each_policy_and_constraint():
    lines = str(chosen(a=(GOOD, BAD), b=(GOOD, GOOD))).splitlines()
    assert lines[0] == "warehouse_small with 20 objects, 4 robots, runs of 4 s: objects"
    assert " ".join(lines[2].split()) == "1 b undisturbed 10 13 10.52 to 15.48 +3 98.2 % 3 of 3 met"
    # 2 ± 4.303 / sqrt(3) stays below 5.
    assert " ".join(lines[5].split()) == "noise 0.01 5 2 -0.4841 to 4.484 -3 1.75 % 0 of 3 not met"


def test_the_unit_is_that_of_the_performance():
    for name, unit in {"first_picked": "objects", "n_carrying": "robots summed over intervals"}.items():
        choice = chosen(replace(WORLD, performance=name), a=([12.0, 13.0], [12.0, 13.0]))
        assert str(choice).splitlines()[0] == f"warehouse_small with 20 objects, 4 robots, runs of 4 s: {unit}"
        assert choice.to_mapping()["unit"] == unit


def test_disturbances_are_those_that_the_help_describes():
    world = scenario("warehouse_small")
    question = choice_question(["random"], world, deliver=10, keep=0.5, failures=0.001, deaths=5, noise=0.02)
    assert [(c.condition, c.demand) for c in question.constraints] == [
        ("undisturbed", 10), ("failures 0.001", 5.0), ("deaths 5", 5.0), ("noise 0.02", 5.0),
    ]  # fmt: skip
    undisturbed, failing, dying, noisy = (condition.world for condition in question.plan.conditions)
    assert undisturbed.wrappers == ()
    study = malfunction_levels(50)[0]  # the study's lowest level, 0.001 malfunctions per tick
    assert failing.population.malfunction_per_tick == study.malfunction_per_tick
    assert failing.population.repair_per_tick == pytest.approx(study.repair_per_tick, rel=1e-6)
    assert dying.population.death_per_tick == 5 / 50_000
    assert noisy.wrappers == (SensorNoiseConfig(sigma=0.02, groups=NOISE_GROUPS), ActuatorNoiseConfig(sigma=0.02))


def test_a_choice_runs_every_condition_once_and_stores_it(tmp_path):
    options = {"deliver": 1.0, "noise": 0.01, "deaths": 2.0, "seeds": 2, "out": tmp_path, "jobs": 1, "progress": False}
    choice = choose_policy(["random", "crw"], WORLD, **options)
    runs = load(tmp_path)
    assert len(runs) == 2 * 3 * 2
    for candidate in choice.candidates:
        for found, criterion in zip(candidate.evidence, ("none", "population_dynamics", "noise"), strict=True):
            mine = {r.seed: float(r.performance.sum()) for r in runs
                    if r.controller == candidate.policy and r.criterion == criterion}  # fmt: skip
            assert found.per_seed == mine
    orders = [candidate.order for candidate in choice.candidates]
    assert all(before <= after for before, after in pairwise(orders))
    assert str(choose_policy(["random", "crw"], WORLD, **options)) == str(choice)


@pytest.mark.parametrize(
    ("demand", "reason"),
    [
        ({"deliver": 0.0}, "deliver as a number above 0, got 0"),
        ({"deliver": 5.0, "keep": -1.0}, "keep as a number above 0"),
        ({"deliver": 5.0, "noise": math.inf}, "noise as a number above 0, got inf"),
        ({"deliver": 5.0, "deaths": 5.0}, "at most 4 deaths, one for each robot, got 5; ask for fewer deaths or more"),
        ({"deliver": 5.0, "seeds": 1}, "two or more seeds, got 1"),
    ],
)
def test_demands_that_make_no_sense_are_refused(demand, reason):
    with pytest.raises(CurveError, match=reason):
        choose_policy(["random"], WORLD, **demand)


def test_all_robots_may_be_expected_to_die():
    dying = choice_question(["random"], WORLD, deliver=5.0, deaths=4.0).plan.conditions[1]
    assert dying.world.population.death_per_tick == 4.0 / 20.0  # 4 s have 20 ticks


def test_a_failed_policy_is_shown_and_the_others_are_ranked():
    class Broken:
        def reset(self, task, rng):
            raise RuntimeError("no")

        def act(self, obs, active):
            return np.zeros((len(obs), 3), np.float32)

    choice = choose_policy({"broken": Broken, "crw": "crw"}, WORLD, deliver=1000.0, seeds=2, jobs=1, progress=False)
    broken = next(candidate for candidate in choice.candidates if candidate.policy == "broken")
    (told,) = broken.failures
    assert told.endswith("broken in warehouse_small, 4 robots, seed 0, and 1 more of its runs: RuntimeError: no")
    assert "failed: " in str(choice)
    assert broken.evidence[0].verdict == UNDECIDED


def test_wrappers_of_the_world_are_in_all_runs(tmp_path):
    slow, deaf = (
        parse_wrapper(words) for words in ("throttle:waveform=constant,amplitude=0.3", "sensor_noise:sigma=0.2")
    )
    options = {"deliver": 1.0, "deaths": 2.0, "seeds": 2, "out": tmp_path, "jobs": 1, "progress": False}
    choice = choose_policy(["random"], World(WORLD, (slow, deaf)), **options)
    disturbed = "sensor noise: sigma 0.2 (all sensors), throttle: robots lose 30 % of their speed"
    assert choice.scenario == f"warehouse_small with 20 objects, {disturbed}"
    runs = [json.loads(record.spec) for record in load(tmp_path)]
    assert len(runs) == 4
    always = {"throttle", "sensor_noise"}
    kinds = {run["criterion"]: {config["wrapper"] for config in run["wrappers"]} for run in runs}
    assert kinds == {"none": always, "population_dynamics": always | {"population"}}
    assert all(
        config["waveform"]["amplitude"] == 0.3
        for run in runs
        for config in run["wrappers"]
        if config["wrapper"] == "throttle"
    )


def test_a_wrapper_of_the_world_that_a_demand_sets_too_is_refused():
    noisy = World(WORLD, (parse_wrapper("actuator_noise:sigma=0.2"),))
    with pytest.raises(ConfigError, match="no wrapper actuator_noise in a world where noise is varied"):
        choose_policy(["random"], noisy, deliver=1.0, noise=0.01)
    with pytest.raises(ConfigError, match="no wrapper population in a world where population_dynamics is varied"):
        choose_policy(
            ["random"], World(WORLD, (parse_wrapper("population:death_per_tick=0.1"),)), deliver=1.0, deaths=1
        )


def test_failed_runs_are_those_of_their_condition(monkeypatch, tmp_path):
    def failing(spec):
        if spec.world.criterion == "noise" and spec.seed == 1:
            raise RuntimeError("out of luck")
        return run_one(spec)

    monkeypatch.setattr(workers, "run_one", failing)
    question = choice_question(["random", "crw"], WORLD, deliver=1.0, noise=0.01, seeds=2)
    choice = ask(question, out=tmp_path, jobs=1, progress=False)
    for candidate in choice.candidates:
        calm, noisy = candidate.evidence
        assert (calm.per_seed.keys(), noisy.per_seed.keys()) == ({0, 1}, {0})
        (told,) = candidate.failures
        assert (
            f"{candidate.policy} in warehouse_small, 4 robots, seed 1, noise = 0.01: RuntimeError: out of luck" in told
        )
    # Asked again, only what failed is run.
    fresh = []
    monkeypatch.setattr(workers, "run_one", lambda spec: fresh.append(spec) or run_one(spec))
    again = ask(question, out=tmp_path, jobs=1, progress=False)
    assert [(spec.policy, spec.seed, spec.world.criterion) for spec in fresh] == [
        ("random", 1, "noise"),
        ("crw", 1, "noise"),
    ]
    assert not any(candidate.failures for candidate in again.candidates)


def test_stored_runs_of_functions_need_a_name(tmp_path):
    def still(obs):
        return np.zeros((len(obs), 3), np.float32)

    with pytest.raises(ValueError, match="Expected name= for the policy still"):
        choose_policy([still], WORLD, deliver=1.0, seeds=2, out=tmp_path, progress=False)
    choice = choose_policy({"v1": still}, WORLD, deliver=1.0, seeds=2, out=tmp_path, progress=False)
    assert choice.candidates[0].policy == "v1"
    assert {record.controller for record in load(tmp_path)} == {"v1"}
