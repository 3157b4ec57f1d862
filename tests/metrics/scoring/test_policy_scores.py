"""Public functions of scoring: any policy gives one table, no run is made twice, failures are shown."""

import json
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

import metrics
from metrics import CurveError, compare_policies, score_policy
from metrics.scoring import ask, score_question
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies import registry as policy_module
from swarm_forage_env.runs import workers
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.runner import RunsInterrupted
from swarm_forage_env.runs.store import RunStore, load
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.studies.ladders import Budget
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import World

WORLD = scenario("warehouse_small", n_robots=4, n_objects=20)
TINY = Budget(horizon_s=4.0, interval_s=2.0, n_seeds=2, n_sizes=2, n_levels=1)
SIZES = ["t_lost_fraction", "raw_performance"]


def scored(policy="random", **options):
    """Score in this process, quietly, in the tiny budget."""
    return score_policy(policy, WORLD, **{"budget": TINY, "jobs": 1, "progress": False, **options})


def planned(policies, **options):
    """The runs that score policies in the tiny budget."""
    return score_question(policies, WORLD, **{"budget": TINY, **options}).plan


def still(obs):
    return np.zeros((len(obs), 3), np.float32)


class Circling:
    """Drives in circles; remembers how many runs it has driven."""

    caches: ClassVar[str] = "static"

    def __init__(self, speed: float = 0.5) -> None:
        self.speed = speed
        self.n_runs = 0

    def reset(self, task, rng):
        self.n_runs += 1
        assert self.n_runs == 1, "a policy drives one run"

    def act(self, obs, active):
        return np.tile(np.float32([self.speed, 0.3, -1.0]), (len(obs), 1))


@pytest.fixture(scope="module")
def table():
    return scored()


def test_every_measure_has_rows_with_all_that_is_needed_to_read_them(table):
    assert {score.measure for score in table.scores} == set(metrics.METRICS)
    assert (table.policy, table.scenario, table.missing, table.failures) == (
        "random",
        "warehouse_small with 20 objects",
        {},
        (),
    )
    for score in table.scores:
        assert score.unit
        assert score.n_robots
        assert score.higher_is_better == metrics.METRICS[score.measure].higher_is_better
        if score.measure != "availability":
            assert score.summary.n_used + score.summary.n_nan == 2
        assert (score.noise_floor is not None) == metrics.METRICS[score.measure].is_distance
    assert {score.at for score in table["reactivity"]} == {"throttle 0.4"}
    assert table["spatial_emergence"][0].n_robots == (1, 4)


def test_values_are_those_of_the_stored_runs(tmp_path):
    found = scored(measures=["adaptability"], out=tmp_path)
    runs = {(record.criterion_value, record.seed): record.performance for record in load(tmp_path)}
    assert runs.keys() == {(0.0, 0), (0.0, 1), (0.4, 0), (0.4, 1)}
    for seed, value in found["adaptability"][0].per_seed.items():
        assert value == metrics.adaptability(runs[0.0, seed], runs[0.4, seed])


def test_the_same_call_gives_the_same_table(table):
    assert str(scored()) == str(table)


def test_stored_runs_are_not_repeated(tmp_path, monkeypatch):
    first = scored(out=tmp_path, measures=SIZES)
    monkeypatch.setattr(workers, "run_one", lambda spec: pytest.fail("a stored run was repeated"))
    assert str(scored(out=tmp_path, measures=SIZES)) == str(first)


def test_an_interrupted_call_goes_on_where_it_stopped(tmp_path, monkeypatch):
    n_runs = 0

    def interrupted(spec):
        nonlocal n_runs
        n_runs += 1
        if n_runs == 3:
            raise KeyboardInterrupt
        return run_one(spec)

    with monkeypatch.context() as patch:
        patch.setattr(workers, "run_one", interrupted)
        with pytest.raises(RunsInterrupted, match="2 of 4 runs are finished"):
            scored(out=tmp_path, measures=SIZES)
    before = set(RunStore(tmp_path).run_ids())
    assert len(before) == 2
    assert scored(out=tmp_path, measures=SIZES)["t_lost_fraction"][0].summary.n_used == 2
    assert before < set(RunStore(tmp_path).run_ids())


def test_failed_runs_are_told_in_every_row_they_touch(tmp_path, monkeypatch):
    def failing(spec):
        if spec.seed == 1 and spec.scenario.robots.n_robots == 4:
            raise RuntimeError("out of luck")
        return run_one(spec)

    monkeypatch.setattr(workers, "run_one", failing)
    found = scored(out=tmp_path, measures=["raw_performance", "task_emergence"])
    alone, together = found["raw_performance"]
    assert (alone.n_lost, together.n_lost, found["task_emergence"][0].n_lost) == (0, 1, 1)
    assert "1 of 2 runs failed" in together.note
    assert len(found.failures) == 1
    assert "out of luck" in found.failures[0]
    assert "seed 1" in found.failures[0]


def test_a_policy_that_always_fails_gets_a_table_that_says_so():
    found = scored(lambda obs: still(obs)[:0], measures=["raw_performance", "adaptability", "population_robustness"])
    assert all(np.isnan(score.summary.mean) for score in found.scores)
    assert all("2 of 2 runs failed" in score.note for score in found.scores)
    assert "one row per robot" in found.failures[0]


@pytest.mark.parametrize(
    ("policy", "label"),
    [(still, "still"), (Circling(0.2), "Circling"), (Circling, "Circling"), (lambda: Circling(0.2), "<lambda>")],
    ids=["function", "object", "class", "factory"],
)
def test_policies_may_be_functions_objects_classes_and_factories(policy, label):
    found = scored(policy, measures=SIZES)
    assert (found.policy, found.failures) == (label, ())
    assert scored(policy, measures=SIZES, name="mine").policy == "mine"
    assert policy_module._LOCAL_POLICIES == {}


def test_the_world_of_a_policy_is_kept(tmp_path):
    scored(Circling, measures=SIZES, name="mine", out=tmp_path)
    assert {spec.scenario.caches for spec in planned([Circling]).specs} == {"static"}
    assert {spec.scenario.caches for spec in planned([still]).specs} == {"none"}
    assert {spec.scenario.caches for spec in planned([Circling], caches="dynamic").specs} == {"dynamic"}
    assert {record.controller for record in load(tmp_path)} == {"mine"}


def test_parameters_reach_names_and_classes():
    (spec, *_) = planned(["crw"], parameters={"wander_speed_mps": 0.05}).specs
    assert spec.parameters == {"wander_speed_mps": 0.05}
    assert scored(Circling, measures=SIZES, parameters={"speed": 0.1}).failures == ()
    with pytest.raises(ValueError, match="Expected parameters with a name, a file or a class only"):
        scored(still, parameters={"speed": 0.1})


def test_stored_runs_of_functions_need_a_name(tmp_path):
    with pytest.raises(ValueError, match="Expected name= for the policy still"):
        scored(still, out=tmp_path)
    scored(still, out=tmp_path, name="v1", measures=SIZES)
    assert len(RunStore(tmp_path).run_ids()) == 4


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"policy": "crww"}, ValueError, "Unknown policy 'crww'. Did you mean 'crw'"),
        ({"policy": 7}, TypeError, "Expected a policy as a registered name, .*, got 7"),
        ({"policy": "missing.zip"}, ValueError, "Cannot read the policy file .*missing.zip: No such file"),
        ({"policy": still, "name": "crw"}, ValueError, "Expected a name of its own for the policy, got 'crw'"),
        ({"measures": ["speed"]}, CurveError, "Unknown measure 'speed'"),
        ({"budget": "quik"}, ConfigError, "Unknown budget 'quik'. Did you mean 'quick'"),
        ({"seeds": 0}, ValueError, "Expected one or more seeds, got 0"),
        ({"seeds": [1, 1]}, ValueError, r"Expected different seeds, at least one, got \[1, 1\]"),
        ({"horizon_s": 3.0}, ConfigError, "whole number of intervals"),
    ],
)
def test_what_cannot_be_scored_is_refused_before_anything_runs(options, error, message, monkeypatch):
    monkeypatch.setattr(workers, "run_one", lambda spec: pytest.fail("something was run"))
    with pytest.raises(error, match=message):
        scored(**options)


def test_seeds_and_length_of_runs_can_be_chosen():
    plan = planned(["random"], seeds=[5, 9], horizon_s=8.0, measures=SIZES)
    assert {spec.seed for spec in plan.specs} == {5, 9}
    assert {spec.scenario.horizon_s for spec in plan.specs} == {8.0}
    assert planned(["random"], seeds=3).seeds == (0, 1, 2)


def test_policies_are_compared_in_the_same_worlds(tmp_path):
    comparison = compare_policies(
        {"circles": Circling, "noise": "random"},
        WORLD,
        budget=TINY,
        measures=SIZES,
        out=tmp_path,
        jobs=1,
        progress=False,
    )
    assert comparison.policies == ("circles", "noise")
    assert comparison.pairs == (("circles", "noise"),)
    for difference in comparison.differences:
        circles, noise = (
            next(score for score in table.scores if (score.measure, score.at) == (difference.measure, difference.at))
            for table in comparison.tables
        )
        expected = np.mean([circles.per_seed[seed] - noise.per_seed[seed] for seed in (0, 1)])
        assert difference.summary.mean == pytest.approx(expected)
    assert "circles - noise" in str(comparison)


def test_policies_of_equal_names_are_refused():
    with pytest.raises(ConfigError, match="Expected policies of different names, got random, random"):
        planned(["random", "random"])


def test_a_budget_of_ones_own_and_a_path_as_name(tmp_path):
    question = score_question([Path("random")], WORLD, budget=replace(TINY, n_seeds=1), measures=SIZES)
    (found,) = ask(question, out=str(tmp_path), jobs=1, progress=False).tables
    assert found.settings["budget"] == "custom"
    assert found.settings["seeds"] == [0]


def test_scoring_works_on_several_processes(tmp_path, table):
    assert str(scored(out=tmp_path, measures=SIZES, jobs=2)) == str(scored(measures=SIZES))


@pytest.fixture
def slow():
    """A world in which robots are always slowed down."""
    return World(WORLD, (parse_wrapper("throttle:waveform=constant,amplitude=0.3"),))


def test_wrappers_of_the_world_are_in_all_runs(slow, tmp_path):
    options = {"budget": TINY, "measures": [*SIZES, "population_robustness"], "jobs": 1, "progress": False}
    found = score_policy("random", slow, out=tmp_path, **options)
    assert (found.scenario, found.failures, found.missing) == (slow.title(), (), {})
    runs = load(tmp_path)
    assert {run.criterion for run in runs} == {"population_size", "none", "population_dynamics"}
    for run in runs:
        wrappers = {config["wrapper"]: config for config in json.loads(run.spec)["wrappers"]}
        assert wrappers["throttle"]["waveform"]["amplitude"] == 0.3
        assert ("population" in wrappers) == (run.criterion == "population_dynamics")
        assert run.contributed["throttle"].tolist() == [0.3, 0.3]


def test_a_world_with_wrappers_is_another_world(slow, tmp_path, monkeypatch):
    calm = {spec.run_id for spec in planned(["random"], measures=SIZES).specs}
    disturbed = score_question(["random"], slow, budget=TINY, measures=SIZES)
    assert calm.isdisjoint(spec.run_id for spec in disturbed.plan.specs)
    (first,) = ask(disturbed, out=tmp_path, jobs=1, progress=False).tables
    monkeypatch.setattr(workers, "run_one", lambda spec: pytest.fail("a stored run was repeated"))
    (again,) = ask(disturbed, out=tmp_path, jobs=1, progress=False).tables
    assert str(again) == str(first)


def test_policies_are_compared_in_a_world_with_wrappers(slow, tmp_path):
    options = {"budget": TINY, "measures": SIZES, "out": tmp_path, "jobs": 1, "progress": False}
    comparison = compare_policies(["random", "crw"], slow, **options)
    assert comparison.policies == ("random", "crw")
    assert all(table.failures == () for table in comparison.tables)
    runs = [json.loads(run.spec) for run in load(tmp_path)]
    assert len(runs) == 2 * 4
    assert [[config["wrapper"] for config in run["wrappers"]] for run in runs] == [["throttle"]] * 8


@pytest.mark.parametrize(
    ("words", "measure", "told"),
    [
        ("throttle:waveform=constant,amplitude=0.1", "adaptability", "no wrapper throttle in a world where throttle"),
        ("sensor_noise:sigma=0.1", "noise_robustness", "no wrapper sensor_noise in a world where noise is varied"),
        ("population:death_per_tick=0.1", "population_robustness", "no wrapper population in a world where population"),
    ],
)
def test_a_wrapper_of_the_world_that_a_criterion_varies_too_is_refused(words, measure, told, monkeypatch):
    monkeypatch.setattr(workers, "run_one", lambda spec: pytest.fail("something was run"))
    world = World(WORLD, (parse_wrapper(words),))
    with pytest.raises(ConfigError, match=told):
        score_policy("random", world, budget=TINY, measures=[measure], progress=False)
    with pytest.raises(ConfigError, match=told):
        compare_policies(["random", "crw"], world, budget=TINY, measures=[measure], progress=False)
    # Measures that do not vary it are scored.
    assert score_question(["random"], world, budget=TINY, measures=SIZES).plan.specs


def test_failed_runs_are_those_of_their_policy(tmp_path, monkeypatch):
    def failing(spec):
        if spec.policy == "crw" and spec.seed == 1:
            raise RuntimeError("out of luck")
        return run_one(spec)

    monkeypatch.setattr(workers, "run_one", failing)
    options = {"budget": TINY, "measures": SIZES, "out": tmp_path, "jobs": 1, "progress": False}
    random, crw = compare_policies(["random", "crw"], WORLD, **options).tables
    assert random.failures == ()
    (told,) = crw.failures
    assert "seed 1, " in told
    assert told.endswith(", and 1 more of its runs: RuntimeError: out of luck")
    # Asked again, only what failed is run.
    fresh = []
    monkeypatch.setattr(workers, "run_one", lambda spec: fresh.append(spec) or run_one(spec))
    assert compare_policies(["random", "crw"], WORLD, **options).tables[1].failures == ()
    assert {(spec.policy, spec.seed) for spec in fresh} == {("crw", 1)}
    assert len(fresh) == 2
