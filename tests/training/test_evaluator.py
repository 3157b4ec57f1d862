"""Networks of other learners are judged as those of `swarm-forage train` are, and the best one is kept."""

from dataclasses import replace

import numpy as np
import pytest
from gymnasium.spaces import flatdim

from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.policies.network import Network, NetworkAbout
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import policy_spec
from swarm_forage_env.scenarios.presets import warehouse_small
from swarm_forage_env.training.evaluation_plan import EvaluationPlan, EvaluationWorld
from swarm_forage_env.training.evaluations import read_training
from swarm_forage_env.training.evaluator import Evaluator
from swarm_forage_env.training.plan import LEARNING, Stage, TrainingPlan
from swarm_forage_env.wrappers.world import World

QUICK = {"n_robots": 10, "n_objects": 120, "width_m": 12.0, "height_m": 8.0, "nest_centre_m": (3.0, 4.0),
         "nest_size_m": (4.0, 6.0), "horizon_s": 400.0}  # fmt: skip
NUMBERED = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5)
PLAN = TrainingPlan(
    world=World(warehouse_small(**QUICK)),
    interface=NUMBERED,
    hidden=(),
    stages=(Stage(steps=100), Stage(steps=150)),
    evaluation=EvaluationPlan(every_steps=60, worlds=(EvaluationWorld(scenario=warehouse_small(**QUICK)),)),
    samples=True,
)
ROBOT = LearnerInterface(NUMBERED, SwarmSpec.of(PLAN.scenario))
N_INPUTS, N_ACTIONS = flatdim(ROBOT.observation_space), flatdim(ROBOT.action_space)


def network(*, stands: bool) -> Network:
    """A network that takes all actions alike, or always stands."""
    bias = np.zeros(N_ACTIONS, np.float32)
    bias[0] = 50.0 if stands else 0.0
    about = NetworkAbout(interface=NUMBERED, activation="tanh", samples=True)
    return Network((np.zeros((N_INPUTS, N_ACTIONS), np.float32),), (bias,), about)


def test_a_network_is_run_and_kept_at_the_temperature_of_the_plan(tmp_path):
    learnt = network(stands=False)
    learnt.biases[0][0] = 1.0  # stands more often than not
    sharp = learnt.at_temperature(0.25)
    found = [
        Evaluator(replace(PLAN, temperature=temperature), tmp_path / name, {}).evaluate(one, 60)
        for name, one, temperature in (("plan", learnt, 0.25), ("network", sharp, 1.0), ("as_learnt", learnt, 1.0))
    ]
    told = [(one.performance, one.interference_fraction) for one in found]
    assert told[0] == told[1] != told[2]
    assert Network.load(tmp_path / "plan" / "policy.npz").biases[0][0] == 4.0


def test_a_network_is_run_and_kept_with_the_interface_that_it_has_in_runs(tmp_path):
    seen, framed = {"decision_ticks": 2, "frame_decisions": 7}, replace(NUMBERED, frame_decisions=3)
    plan, unframed = replace(PLAN, interface=framed), network(stands=False)
    learnt, often = (
        replace(unframed, about=replace(unframed.about, interface=one)) for one in (framed, replace(framed, **seen))
    )
    evaluation = Evaluator(replace(plan, in_runs=seen), tmp_path / "plan", {}).evaluate(learnt, 60)
    kept = Network.load(tmp_path / "plan" / "policy.npz")
    assert kept.about.interface == replace(NUMBERED, **seen)
    as_asked = replace(plan, interface=often.about.interface)
    same = Evaluator(as_asked, tmp_path / "asked", {}).evaluate(often, 60)
    as_learnt = Evaluator(plan, tmp_path / "as_learnt", {}).evaluate(learnt, 60)
    assert evaluation.performance == same.performance
    assert evaluation.interference_fraction == same.interference_fraction != as_learnt.interference_fraction


def test_the_folder_becomes_that_of_a_training_and_holds_the_best_network(tmp_path):
    evaluator = Evaluator(PLAN, tmp_path / "mine", {"by": "a test", "versions": {"learner": "1.0"}})
    moves, stands = network(stands=False), network(stands=True)
    told = [evaluator.evaluate(one, 60 * (k + 1)) for k, one in enumerate((stands, moves, stands))]
    assert told[1].performance > told[0].performance == 0.0
    training = read_training(tmp_path / "mine")
    assert training.plan == PLAN
    assert list(training.evaluations) == told
    kept = Network.load(tmp_path / "mine" / "policy.npz")
    assert np.array_equal(kept.biases[0], moves.biases[0])
    assert kept.about.card["by"] == "a test"
    assert kept.about.card["evaluation"]["steps"] == 120
    assert kept.about.card["versions"]["learner"] == "1.0"
    assert "numpy" in kept.about.card["versions"]


def test_an_evaluation_is_the_runs_of_the_plan_beside_its_baseline(tmp_path):
    evaluator = Evaluator(PLAN, tmp_path, {})
    found = evaluator.evaluate(network(stands=False), 60)
    file = str(tmp_path / "policy.npz")
    runs = [run_one(spec) for spec in PLAN.judging(policy_spec(file, label=LEARNING.label)).specs]
    assert found.worlds[0].performance == np.mean([record.per_1000_s("performance") for record in runs])
    assert found.worlds[0].baseline_policy in ("crw", "dpo", "stochm", "stochx")
    assert found.performance == pytest.approx(found.worlds[0].ratio)


def test_an_evaluation_is_due_when_its_decisions_are_full_and_at_the_end_of_each_stage(tmp_path):
    evaluator = Evaluator(PLAN, tmp_path, {})
    made = []
    for steps in range(0, 300, 25):
        if evaluator.is_due(steps):
            made.append(steps)
            evaluator.evaluate(network(stands=True), steps)
    assert made == [75, 100, 175, 250]


def test_baselines_of_another_training_save_their_runs(tmp_path, monkeypatch):
    first = Evaluator(PLAN, tmp_path / "first", {})
    monkeypatch.setattr("swarm_forage_env.training.evaluator.baselines_of", None)
    assert Evaluator(PLAN, tmp_path / "second", {}, baselines=first.baselines).baselines == first.baselines
