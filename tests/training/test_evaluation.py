"""How policies are judged while they learn: runs beside baselines, what counts, and which network is kept."""

from dataclasses import replace

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.interface import InterfaceConfig, any_swarm
from swarm_forage_env.policies.network import Network, NetworkAbout
from swarm_forage_env.runs.plan import Table
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.presets import warehouse_small
from swarm_forage_env.training import evaluation as module
from swarm_forage_env.training.curves import read_training
from swarm_forage_env.training.evaluation import (
    EvaluationPlan,
    EvaluationWorld,
    Evaluator,
    baseline_runs,
    baselines_of,
    judged,
    reached_in,
)
from swarm_forage_env.training.plan import Stage, TrainingPlan
from swarm_forage_env.wrappers.world import World

QUICK = {"n_robots": 10, "n_objects": 120, "width_m": 12.0, "height_m": 8.0, "nest_centre_m": (3.0, 4.0),
         "nest_size_m": (4.0, 6.0), "horizon_s": 400.0}  # fmt: skip
NUMBERED = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5)
PLACE = EvaluationWorld(scenario=warehouse_small(**QUICK))
PLAN = TrainingPlan(
    world=World(warehouse_small(**QUICK)),
    interface=NUMBERED,
    stages=(Stage(steps=100), Stage(steps=150)),
    evaluation=EvaluationPlan(every_steps=60, worlds=(PLACE,)),
    samples=True,
)
SHAPE = any_swarm(NUMBERED).widths


def network(interface=NUMBERED, *, stands: float = 0.0) -> Network:
    """A network that takes all actions alike, or stands more often."""
    bias = np.zeros(SHAPE[1], np.float32)
    bias[0] = stands
    about = NetworkAbout(interface=interface, activation="tanh", samples=True)
    return Network((np.zeros(SHAPE, np.float32),), (bias,), about)


def test_a_network_is_run_and_kept_at_the_temperature_and_pace_of_the_plan(tmp_path):
    seen, framed = {"decision_ticks": 2, "frame_decisions": 7}, replace(NUMBERED, frame_decisions=3)
    learnt, often = network(framed, stands=1.0), replace(framed, **seen)
    plan = replace(PLAN, interface=framed)
    found = {
        name: Evaluator(one, tmp_path / name, {}).evaluate(tried, 60)
        for name, one, tried in (
            ("plan", replace(plan, temperature=0.25, in_runs=seen), learnt),
            ("network", replace(PLAN, interface=often), network(often, stands=4.0)),
            ("as_learnt", plan, learnt),
        )
    }
    told = {name: (one.reached, one.interference_fraction) for name, one in found.items()}
    assert told["plan"] == told["network"] != told["as_learnt"]
    kept = Network.load(tmp_path / "plan" / "policy.npz")
    assert (kept.about.interface, kept.biases[0][0]) == (often, 4.0)


def test_the_folder_becomes_that_of_a_training_and_holds_the_best_network(tmp_path):
    evaluator = Evaluator(PLAN, tmp_path / "mine", {"by": "a test", "versions": {"learner": "1.0"}})
    moves, stands = network(), network(stands=50.0)
    told = [evaluator.evaluate(one, 60 * (k + 1)) for k, one in enumerate((stands, moves, stands))]
    assert told[1].reached > told[0].reached == 0.0
    training = read_training(tmp_path / "mine")
    assert (training.plan, list(training.evaluations), training.kept) == (PLAN, told, told[1])
    kept = Network.load(training.policy)
    assert np.array_equal(kept.biases[0], moves.biases[0])
    card = kept.about.card
    assert (card["by"], card["evaluation"]["steps"], card["versions"]["learner"]) == ("a test", 120, "1.0")
    assert "numpy" in card["versions"]
    again = Evaluator(PLAN, tmp_path / "mine", {}, resume=True)
    assert (again.evaluations, again.baselines) == (told, evaluator.baselines)
    assert again.spent_s() > (told[-1].wall_time_s, told[-1].cpu_time_s)
    with pytest.raises(ConfigError, match=r"Expected more decisions than at the last evaluation, 180, got 180"):
        again.evaluate(moves, 180)
    with pytest.raises(ConfigError, match="an unused folder"):
        Evaluator(PLAN, tmp_path / "mine", {})
    drawn = replace(moves, about=replace(moves.about, samples=False))
    with pytest.raises(ConfigError, match="plan's interface and samples"):
        again.evaluate(drawn, 240)


def test_an_evaluation_is_the_runs_of_the_plan_beside_its_baseline(tmp_path):
    plan = replace(PLAN, evaluation=replace(PLAN.evaluation, n_runs=2))
    (found,) = Evaluator(plan, tmp_path, {}).evaluate(network(), 60).worlds
    runs = [run_one(plan_run(PLACE, str(tmp_path / "policy.npz"), seed=seed)) for seed in (1_000_000, 1_000_001)]
    assert found.performance == np.mean([record.per_1000_s("performance") for record in runs])
    assert found.baseline_policy in ("crw", "dpo", "stochm", "stochx")
    assert found.ratio == found.performance / found.baseline


def test_an_evaluation_is_due_when_its_decisions_are_full_and_at_the_end_of_each_stage(tmp_path):
    evaluator = Evaluator(PLAN, tmp_path, {})
    evaluator.baselines = {PLACE.name: ("crw", 1.0)}
    made = []
    for steps in range(0, 300, 25):
        if evaluator.is_due(steps):
            made.append(steps)
            evaluator.evaluate(network(stands=50.0), steps)
    assert made == [75, 100, 175, 250]


def test_the_best_of_the_paper_s_controllers_runs_with_its_own_caches(monkeypatch):
    reached = {"none": 3.0, "static": 9.0, "dynamic": 5.0}
    runs = baseline_runs(PLAN.evaluation, PLAN.world)
    caches = {condition: runs.specs_of(condition)[0].scenario.caches for condition in runs.conditions}
    monkeypatch.setattr(module, "finished_runs", lambda plan: Table(plan=plan, records={}))
    monkeypatch.setattr(module, "_means", lambda _, condition: (reached[caches[condition]], 0.0))
    assert baselines_of(PLAN.evaluation, PLAN.world) == {PLACE.name: ("stochm", 9.0)}
    with pytest.raises(ConfigError, match="Did you mean 'crw'"):
        baseline_runs(EvaluationPlan(baseline="crv"), PLAN.world)


def test_what_counts_is_performance_or_the_mean_or_worst_ratio(monkeypatch):
    places = (PLACE, replace(PLACE, name="other"))
    runs = baseline_runs(EvaluationPlan(worlds=places), PLAN.world)
    monkeypatch.setattr(module, "_means", lambda _, condition: ({"other": 12.0}.get(condition.world.name, 5.0), 0.1))
    baselines = {PLACE.name: ("crw", 0.0), "other": ("crw", 4.0)}
    plan = EvaluationPlan(worlds=places)
    worlds = judged(plan, Table(plan=runs, records={}), "dpo", baselines)
    assert [world.ratio for world in worlds] == [5.0 / (1000.0 / 400.0), 3.0], "one object where it finds nothing"
    assert reached_in(plan, worlds) == 2.5
    assert reached_in(replace(plan, chosen_by="worst"), worlds) == 2.0
    assert reached_in(EvaluationPlan(), worlds[:1]) == 5.0
