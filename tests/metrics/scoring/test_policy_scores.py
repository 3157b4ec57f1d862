"""`score`: any policies give one answer, no run is made twice, failures are shown, and sentences say who is best."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import metrics
from metrics import MEASURES, CurveError, read_curves, score, summarize_runs
from metrics.scoring import Scores, score_question
from metrics.scoring.answer import spread
from metrics.scoring.frame import SCHEMA
from swarm_forage_env import Plan, run_plan
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs import runner
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import policy_specs
from swarm_forage_env.runs.store import load
from swarm_forage_env.scenarios.performance import DERIVED_PERFORMANCES, PERFORMANCE_COLUMNS
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.studies.ladders import Budget
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import World
from tests.support.pictures import keep_figures

WORLD = scenario("warehouse_small", n_robots=4, n_objects=20)
TINY = Budget(horizon_s=4.0, interval_s=2.0, n_seeds=2, n_sizes=2, n_levels=1)
SIZES = ["t_lost_fraction", "raw_performance"]


def scored(policies="random", world=WORLD, **options):
    """Score in this process, quietly, in the tiny budget."""
    return score(policies, world, **{"budget": TINY, "jobs": 1, "progress": False, **options})


def planned(policies, **options):
    """The runs that score policies in the tiny budget."""
    return score_question(policies, WORLD, **{"budget": TINY, **options}).plan


@pytest.fixture(scope="module")
def found():
    return scored()


def test_every_measure_has_rows_with_all_that_is_needed_to_read_them(found):
    assert set(found.frame["measure"]) == set(MEASURES)
    assert (found.policies, found.world) == (("random",), "warehouse_small with 20 objects")
    assert (found.missing, found.failures) == ({}, {})
    for row in found.summary.iter_rows(named=True):
        assert row["unit"]
        assert row["measure"] == "availability" or row["runs"] + row["undefined"] == 2
        assert (row["floor"] is not None) == MEASURES[row["measure"]].is_distance
    assert str(scored()) == str(found), "the same call gives the same answer"


def test_values_are_those_of_the_stored_runs(tmp_path):
    frame = scored(measures=["adaptability"], out=tmp_path).frame
    runs = {(record.spec.world.value, record.seed): record["performance"] for record in load(tmp_path)}
    assert runs.keys() == {(0.0, 0), (0.0, 1), (0.4, 0), (0.4, 1)}
    for seed, value in frame.select("seed", "value").iter_rows():
        assert value == metrics.adaptability(runs[0.0, seed], runs[0.4, seed])


def test_failed_runs_are_those_of_their_policy(tmp_path, monkeypatch):
    def failing(spec):
        if spec.policy == "crw" and spec.seed == 1:
            raise RuntimeError("out of luck")
        return run_one(spec)

    monkeypatch.setattr(runner, "run_one", failing)
    found = scored(["random", "crw"], measures=SIZES, out=tmp_path)
    lost = found.summary.group_by("policy", maintain_order=True).agg(pl.col("lost").unique())
    assert lost.rows() == [("random", [0]), ("crw", [1])]
    ((policy, (told,)),) = found.failures.items()
    assert policy == "crw"
    assert "seed 1, " in told
    assert told.endswith(", and 1 more of its runs: RuntimeError: out of luck")
    assert " !" in str(found)
    assert "! = runs are missing" in str(found)
    fresh = []
    monkeypatch.setattr(runner, "run_one", lambda spec: fresh.append(spec) or run_one(spec))
    assert scored(["random", "crw"], measures=SIZES, out=tmp_path).failures == {}
    assert {(spec.policy, spec.seed) for spec in fresh} == {("crw", 1)}


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"policies": "crww"}, ValueError, "Unknown policy 'crww'. Did you mean 'crw'"),
        ({"disturbance": "noise"}, CurveError, "Unknown disturbance 'noise'. Known: throttle, handling_cost"),
        ({"horizon_s": 3.0}, ConfigError, "whole number of intervals"),
        (
            {"policies": ["crw", "dpo"], "against": "cwr"},
            CurveError,
            "Unknown policy to compare against 'cwr'. Did you mean 'crw'",
        ),
    ],
)
def test_what_cannot_be_scored_is_refused_before_anything_runs(options, error, message, monkeypatch):
    monkeypatch.setattr(runner, "run_one", lambda spec: pytest.fail("something was run"))
    with pytest.raises(error, match=message):
        scored(**options)


def test_seeds_and_length_of_runs_can_be_chosen():
    plan = planned("random", seeds=[5, 9], horizon_s=8.0, measures=SIZES)
    assert {spec.seed for spec in plan.specs} == {5, 9}
    assert {spec.scenario.horizon_s for spec in plan.specs} == {8.0}
    criteria = {
        spec.world.criterion for spec in planned("random", measures=["reactivity"], disturbance="handling_cost").specs
    }
    assert criteria == {"handling_cost"}
    found = scored([Path("random")], seeds=1, measures=SIZES)
    assert (found.settings["budget"], found.settings["seeds"]) == ("custom", [0])


def test_wrappers_of_the_world_are_in_all_runs(tmp_path):
    slow = World(WORLD, (parse_wrapper("throttle:waveform=constant,amplitude=0.3"),))
    found = scored("random", slow, measures=[*SIZES, "population_robustness"], out=tmp_path)
    assert (found.world, found.failures, found.missing) == (slow.title(), {}, {})
    for run in load(tmp_path):
        wrappers = {config["wrapper"]: config for config in run.spec.to_mapping()["wrappers"]}
        assert wrappers["throttle"]["waveform"]["amplitude"] == 0.3
        assert ("population" in wrappers) == (run.spec.world.criterion == "population_dynamics")


def made(values, **told):
    """Scores by hand: (policy, measure) -> values by seed, at one level; a pair of lists has shares, too."""
    parts = []
    for (policy, measure), given in values.items():
        numbers, shares = given if isinstance(given, tuple) else (given, [None] * len(given))
        about = {"policy": policy, "measure": measure, "variant": "corrected", "form": "marginal", "at": "N = 4"}
        about |= {"criterion": "population_size", "x": 4.0, "n_robots": 4, "lost": 0, "misleads": False}
        about |= {"unit": "objects in 400 s", "remark": "", "floor": None, "distance": None, "total": 10.0}
        rows = zip(range(len(numbers)), numbers, shares, strict=True)
        parts += [{**about, "seed": seed, "value": value, "relative": share} for seed, value, share in rows]
    frame = pl.DataFrame(parts, schema={name: SCHEMA[name] for name in parts[0]})
    return Scores(frame=frame, policies=tuple(dict.fromkeys(policy for policy, _ in values)), **told)


HIGH, LOW = [10.0, 11.0, 10.5, 10.2], [1.0, 1.2, 0.9, 1.1]


def test_sentences_say_who_is_best_by_how_much_and_whether_that_is_certain():
    found = made(
        {
            ("a", "raw_performance"): HIGH,
            ("b", "raw_performance"): LOW,
            ("c", "raw_performance"): [2.0, 0.0, 1.0, 1.0],
            ("a", "adaptability"): ([4.0, 5.0, 4.5, 4.1], [0.5, 0.6, 0.4, 0.5]),
            ("b", "adaptability"): ([1.0, 2.2, 2.9, 1.5], [0.4, 0.6, 0.5, 0.4]),
        }
    )
    assert found.sentences() == [
        "raw performance at N = 4: a is best, 9.38 ± 0.61 objects in 400 s ahead of b (certain).",
        "No certain difference: adaptability.",
    ]
    against = made(
        {(name, "raw_performance"): values for name, values in (("a", HIGH), ("b", LOW), ("c", HIGH))}, against="b"
    )
    (sentence,) = against.sentences()
    assert "ahead of b (certain)." in sentence
    assert against.differences.select("first", "second").rows() == [("a", "b"), ("c", "b")]
    assert made({("a", "raw_performance"): HIGH}).sentences() == []


def test_json_has_every_number_and_csv_a_row_per_policy_and_level(found):
    told = json.loads(found.json())
    assert set(told) >= {"policies", "world", "settings", "scores", "differences", "missing", "failures"}
    first = next(row for row in told["scores"] if row["measure"] == "raw_performance")
    assert first["symbol"] == "P(N)"
    assert first["per_seed"].keys() == {"0", "1"}
    assert "NaN" not in found.json()
    header, *rows = found.csv().splitlines()
    assert header.startswith("policy,measure,variant,form,at,")
    assert len(rows) == len(told["scores"])


@pytest.mark.parametrize(
    ("mean", "half", "is_share", "text"),
    [
        (101.234, 3.214, False, "101.2 ± 3.2"),
        (6 / 50 - 5 / 50, 1e-17, False, "0.02 ± 0"),
        (-0.0001, 0.2, False, "0.00 ± 0.20"),
        (float("nan"), float("nan"), True, "-"),
    ],
)
def test_a_mean_has_as_many_digits_as_its_interval(mean, half, is_share, text):
    assert spread(mean, half, is_share=is_share) == text


SHORT = scenario("warehouse_small", n_robots=3, n_objects=20, horizon_s=20.0, interval_s=10.0)


def test_conditions_in_several_worlds_have_a_row_each(tmp_path, monkeypatch):
    noisy = World(SHORT, (parse_wrapper("sensor_noise:sigma=0.03"),))
    plan = Plan.product(policy_specs(["random", "crw"]), [World(SHORT), noisy], seeds=(0, 1))
    summary = summarize_runs(run_plan(plan, jobs=1))
    assert [(row["controller"], row["world"]) for row in summary.rows] == [
        (policy.label, world.name) for policy, world in plan.conditions
    ]
    lines = str(summary).splitlines()
    assert lines[0] == "warehouse_small and others: 2 worlds"
    assert "warehouse_small, 3 robots, 20 objects, sensor noise: sigma 0.03 (all sensors)" in lines[3]
    summary.write(tmp_path / "runs.csv")
    rows = pl.read_csv(tmp_path / "runs.csv")
    assert rows["controller", "world", "n_runs"].rows() == [(of.label, world.name, 2) for of, world in plan.conditions]
    assert (rows["performance_low"] <= rows["performance"]).all()
    answer = json.loads(summary.json())
    assert [len(answer[name]) for name in ("controllers", "runs", "failures")] == [4, 8, 0]
    assert (answer["out"], answer["runs"][0]["file"]) == (None, None)
    figures = keep_figures(monkeypatch)
    summary.draw(tmp_path / "runs.png")
    assert len(figures[0].axes[0].get_lines()) == 4


def test_failed_runs_are_in_the_answer_and_leave_nothing_to_draw(tmp_path):
    def refuse(obs):
        raise RuntimeError("I would rather not")

    plan = Plan.product(policy_specs({"no": refuse}), [World(SHORT)], seeds=[0])
    summary = summarize_runs(run_plan(plan))
    assert (summary.rows, summary.has_picture) == ((), False)
    assert str(summary).endswith("RuntimeError: I would rather not")
    with pytest.raises(ValueError, match="nothing to draw"):
        summary.draw(tmp_path / "runs.png")


# Any performance


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Stored runs of two sizes and two seeds of a policy with tasks, scored by deliveries."""
    place = tmp_path_factory.mktemp("runs")
    performed(out=place)
    return place


def performed(performance="collected", **options):
    """Score a policy with tasks in the tiny budget by a performance."""
    world = replace(WORLD, performance=performance)
    return scored("stochm", world, **{"measures": ["raw_performance"], **options})


def values(found) -> dict[tuple[int, int], float]:
    """(Robots, seed) -> raw performance."""
    return {(n, seed): value for n, seed, value in found.frame.select("n_robots", "seed", "value").iter_rows()}


@pytest.fixture
def no_runs(monkeypatch):
    monkeypatch.setattr(runner, "run_one", lambda spec: pytest.fail("a stored run was repeated"))


def test_every_column_of_stored_runs_can_be_scored(folder, no_runs):
    for name in (*PERFORMANCE_COLUMNS, *DERIVED_PERFORMANCES, "1/interference_fraction"):
        found = performed(out=folder, performance=name)
        assert len(values(found)) == 4
        assert all(np.isfinite(value) and value >= 0.0 for value in values(found).values()), name
        assert found.settings["performance"] == name
        for record in load(folder) if name in PERFORMANCE_COLUMNS else ():
            expected = record.columns.get(name, np.full(2, float(name == "task_share_none"))).sum()
            assert values(found)[record.spec.world.n_robots, record.seed] == pytest.approx(expected), name


def test_the_scenario_says_what_performance_is(folder, no_runs):
    by_scenario = performed(performance="n_active", out=folder)
    assert values(by_scenario) == {(1, 0): 2.0, (1, 1): 2.0, (4, 0): 8.0, (4, 1): 8.0}
    assert str(by_scenario).startswith("stochm in warehouse_small with 20 objects, performance n_active, budget custom")


def test_what_nobody_recorded_is_a_table_of_curves(folder):
    """The share of the robots that are at work: a column made of those of stored runs."""
    frame = pl.concat([record.frame for record in load(folder)])
    share = frame.with_columns(performance=pl.col("n_active") / pl.col("n_robots"))
    found = score(curves=read_curves(share), measures=["raw_performance"], progress=False)
    assert values(found) == {(1, 0): 2.0, (1, 1): 2.0, (4, 0): 2.0, (4, 1): 2.0}


def test_units_follow(folder, no_runs):
    def units(**options):
        measures = ["raw_performance", "efficiency"]
        return (
            performed(out=folder, measures=measures, **options)
            .summary.group_by("measure", maintain_order=True)
            .first()["unit"]
            .to_list()
        )

    assert units() == ["objects in 4 s", "objects per robot in 4 s"]
    assert units(performance="deaths") == ["robots in 4 s", "robots per robot in 4 s"]
    assert units(performance="n_active") == ["robots summed over intervals", "robots per robot summed over intervals"]
    assert units(performance="task_balance")[0] == "task_balance summed over intervals"


def test_shares_are_noted_where_growth_in_proportion_is_the_scale(folder, no_runs):
    """Two swarms in full balance are no worse than one; a swarm of four is not expected to have four times of it."""
    measures = ["raw_performance", "efficiency", "t_lost_fraction", "task_emergence", "scalability"]

    def noted(performance):
        found = performed(out=folder, measures=measures, performance=performance)
        return {row["measure"] for row in found.summary.iter_rows(named=True) if "no sum over robots" in row["remark"]}

    assert noted("task_balance") == noted("1/n_active") == {"efficiency", "task_emergence", "scalability"}
    assert noted("n_active") == noted("collected") == set()
