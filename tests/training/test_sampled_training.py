"""Training in drawn worlds: rows to spare teach nobody, and policies are judged world by world."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")

from stable_baselines3 import DQN, PPO

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.network import Network
from swarm_forage_env.runs.plan import Table
from swarm_forage_env.scenarios.presets import warehouse_small
from swarm_forage_env.training import evaluations
from swarm_forage_env.training.evaluation_plan import EvaluationPlan, EvaluationWorld
from swarm_forage_env.training.evaluations import (
    baseline_runs,
    best_baselines,
    ratio_to,
    read_evaluations,
)
from swarm_forage_env.training.plan import Stage, TrainingPlan, named_plan, read_plan
from swarm_forage_env.training.recipe import recipe
from swarm_forage_env.training.sb3 import ActiveRolloutBuffer, PresentReplayBuffer, SwarmVecEnv
from swarm_forage_env.training.sb3.training import train
from swarm_forage_env.wrappers.world import World
from tests.support.sampled import TWO_WORLDS, sampler

WORLDS = sampler()
NUMBERED = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5)
QUICK = {"n_robots": 2, "n_objects": 20, "horizon_s": 200.0, "physics": "compiled"}
JUDGED = (
    EvaluationWorld(scenario=warehouse_small(**QUICK), baseline="random"),
    EvaluationWorld(scenario=warehouse_small(**QUICK), name="other", baseline="crw"),
)


def tiny_plan(**changes) -> TrainingPlan:
    """Two rollouts in drawn worlds."""
    plan = TrainingPlan(
        world=World(WORLDS.largest),
        sampler=WORLDS,
        interface=NUMBERED,
        n_arenas=2,
        hidden=(8,),
        options={"n_steps": 8, "batch_size": 48},
        stages=(Stage(steps=192),),
        evaluation=EvaluationPlan(every_steps=1000, worlds=JUDGED),
    )
    return dataclasses.replace(plan, **changes)


def test_rollouts_hold_nothing_of_rows_to_spare():
    """Runs of 40 decisions, so that the sizes of the swarms change within the rollout."""
    env = SwarmVecEnv(sampler=WORLDS, n_arenas=2, interface=NUMBERED, max_cycles=200)
    model = PPO(
        "MlpPolicy",
        env,
        n_steps=60,
        batch_size=360,
        n_epochs=1,
        policy_kwargs={"net_arch": [4]},
        rollout_buffer_class=ActiveRolloutBuffer,
        rollout_buffer_kwargs=env.rollout_buffer_kwargs,
        seed=0,
        device="cpu",
    )
    _, callback = model._setup_learn(720)
    model.collect_rollouts(env, callback, model.rollout_buffer, 60)
    buffer = model.rollout_buffer
    present = buffer.observations.any(axis=2)
    assert len({tuple(row) for row in present}) > 1
    assert 0 < present.sum() < present.size
    assert not buffer.rewards[~present].any()
    n_taught = sum(len(batch.observations) for batch in buffer.get(360))
    assert n_taught == present.sum()
    # One episode for each robot of the runs that ended; none for rows to spare.
    assert len(model.ep_info_buffer) == present[:40].any(axis=0).sum()


def test_a_replay_memory_never_samples_rows_to_spare():
    env = SwarmVecEnv(sampler=WORLDS, n_arenas=2, interface=NUMBERED)
    model = DQN(
        "MlpPolicy", env, replay_buffer_class=PresentReplayBuffer, buffer_size=480, learning_starts=10_000, seed=0
    )
    model.learn(120)
    buffer = model.replay_buffer
    stored = buffer.observations[: buffer.size()]
    assert not stored.any(axis=2).all()
    samples = buffer.sample(500)
    assert samples.observations.any(dim=1).all()


def test_a_plan_with_a_sampler_is_carried_out_and_tells_world_by_world(tmp_path):
    narrow = {"preset": "warehouse_small", "n_robots": 3, "n_objects": 10, "horizon_s": 200.0, "physics": "compiled"}
    first = type(WORLDS)({"worlds": [{"scenario": narrow}]})  # other rows than in the next stage
    plan = tiny_plan(stages=(Stage(steps=48, sampler=first), Stage(steps=192)))
    result = train(plan, tmp_path)
    assert result.model.num_timesteps == 240
    assert [evaluation.steps for evaluation in result.evaluations] == [48, 240]
    last = result.evaluations[-1]
    assert [world.world for world in last.worlds] == ["warehouse_small_2", "other"]
    assert [world.baseline_policy for world in last.worlds] == ["random", "crw"]
    assert last.performance == np.mean([world.ratio for world in last.worlds])
    assert read_evaluations(tmp_path / "evaluations.csv") == list(result.evaluations)
    assert read_plan(tmp_path / "plan.json") == plan
    card = Network.load(tmp_path / "policy.npz").about.card
    assert card["plan"]["sampler"] == json.loads(json.dumps(WORLDS.table))
    assert len(card["evaluation"]["worlds"]) == 2
    assert train(plan, tmp_path, resume=True).steps == 0


def test_the_same_plan_with_a_sampler_gives_the_same_weights(tmp_path):
    changes = {"stages": (Stage(steps=96),)}
    first, again, other = (
        [value.numpy() for value in train(plan, tmp_path / name).model.policy.state_dict().values()]
        for name, plan in (
            ("first", tiny_plan(**changes)),
            ("again", tiny_plan(**changes)),
            ("other", tiny_plan(**changes, seed=1)),
        )
    )
    assert all(map(np.array_equal, first, again))
    assert not all(map(np.array_equal, first, other))


def test_a_baseline_that_finds_nothing_counts_as_one_object():
    assert ratio_to(0.0, 5.0, 400.0) == pytest.approx(5.0 / (1000.0 / 400.0))
    assert ratio_to(10.0, 5.0, 400.0) == 0.5


def test_the_best_of_the_scripted_controllers_runs_with_its_own_caches(monkeypatch):
    reached = {"none": 3.0, "static": 9.0, "dynamic": 5.0}
    world = EvaluationWorld(scenario=warehouse_small(**QUICK))
    runs = baseline_runs(dataclasses.replace(FIXED, evaluation=EvaluationPlan(worlds=(world,))))
    caches = {condition: runs.specs_of(condition)[0].scenario.caches for condition in runs.conditions}
    monkeypatch.setattr(evaluations, "means", lambda _, condition: (reached[caches[condition]], 0.0))
    assert best_baselines(Table(plan=runs, records={})) == {"warehouse_small_2": ("stochm", 9.0)}


def test_the_recipe_judges_in_the_largest_world_of_each_name():
    plan = recipe(sampler=WORLDS)
    assert [world.name for world in plan.evaluation.worlds] == ["warehouse_small_6", "search_and_rescue_4"]
    assert [dict(stage.scenario) for stage in plan.stages] == [{}, {}]
    with pytest.raises(ConfigError, match="either a sampler or n_robots"):
        recipe(sampler=WORLDS, n_robots=3)


@pytest.mark.parametrize(
    ("mapping", "reason"),
    [
        ({"sampler": TWO_WORLDS}, r"evaluation\.worlds beside a sampler"),
        ({"sampler": TWO_WORLDS, "scenario": {"preset": "warehouse_small"}}, "either sampler or scenario"),
        (
            {"sampler": TWO_WORLDS, "evaluation": {"worlds": [{"scenario": {"preset": "warehouse_small"}}] * 2}},
            "different names",
        ),
        ({"sampler": TWO_WORLDS, "evaluation": {"worlds": {}}}, r"\[\[evaluation\.worlds\]\]"),
        (
            {
                "sampler": TWO_WORLDS,
                "evaluation": {"worlds": [{"scenario": {"preset": "warehouse_small"}, "name": "all"}]},
            },
            "means all of them",
        ),
        ({"scenario": {"preset": "warehouse_small"}, "evaluation": {"chosen_by": "best"}}, "mean, worst"),
    ],
)
def test_plans_that_are_refused(mapping, reason):
    with pytest.raises(ConfigError, match=reason):
        TrainingPlan.from_mapping(mapping)


FIXED = TrainingPlan(world=World(warehouse_small(**QUICK)), interface=NUMBERED)


@pytest.mark.parametrize("fields", [{"neighbours_seen": 2}, {"caches": "static"}])
def test_worlds_to_be_judged_in_fit_the_policy(fields):
    """The policy sees two neighbours within 4 m, which the worlds do not show so."""
    seen = {"neighbours_seen": 2, "neighbour_range_m": 4.0} if "neighbours_seen" in fields else {}
    odd = EvaluationWorld(scenario=warehouse_small(**QUICK, **fields), name="odd", baseline="crw")
    with pytest.raises(ConfigError, match=r"evaluation world odd(: .* neighbour_range_m=4| with the caches)"):
        dataclasses.replace(
            FIXED, world=World(warehouse_small(**QUICK, **seen)), evaluation=EvaluationPlan(worlds=(odd,))
        )


def test_runs_may_have_other_frames_than_a_training(tmp_path):
    plan = tmp_path / "plan.toml"
    text = (Path(__file__).parents[1] / "support/tiny_plan.toml").read_text()
    both = "in_runs = { decision_ticks = 2, frame_decisions = 500 }\n"
    plan.write_text(both + text.replace("[interface]", "[interface]\nframe_decisions = 200"))
    assert named_plan(str(plan)).interface.frame_decisions == 200
    assert named_plan(str(plan)).run_interface.frame_decisions == 500
