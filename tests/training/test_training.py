"""Training by stable-baselines3: reproducible, resumable, compared with a baseline."""

import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")

import torch
from stable_baselines3 import PPO

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies import trust
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.network import Network, NetworkPolicy
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.scenarios.presets import warehouse_small
from swarm_forage_env.training import evaluation
from swarm_forage_env.training.evaluation import EvaluationPlan, EvaluationWorld, Evaluator, read_evaluations
from swarm_forage_env.training.plan import Stage, TrainingPlan, read_plan
from swarm_forage_env.training.sb3 import PresentReplayBuffer, training
from swarm_forage_env.training.sb3.export import export_network
from swarm_forage_env.training.sb3.training import train
from swarm_forage_env.views.sampler import ScenarioSampler
from swarm_forage_env.wrappers.world import World
from tests.support.fake_trainings import NUMBERED, SHORT, tiny_plan
from tests.support.sampled import sampler

DRIVEN = InterfaceConfig(observation="compact", automatic_gripper=True)


@pytest.fixture(scope="module")
def trained(tmp_path_factory) -> Path:
    """Folder of a finished training by SHORT."""
    folder = tmp_path_factory.mktemp("trained")
    train(SHORT, folder)
    return folder


def weights(model) -> list[np.ndarray]:
    return [value.detach().numpy() for value in model.policy.state_dict().values()]


def same(one: list[np.ndarray], other: list[np.ndarray]) -> bool:
    return all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A finished training of two stages, its folder, and what it told on the way."""
    folder, told = tmp_path_factory.mktemp("whole"), []
    with trust.only_typed(()):  # its own checkpoints need no leave
        return train(tiny_plan(), folder, report=told.append), folder, told


def test_a_plan_is_carried_out_stage_by_stage(whole):
    result, folder, told = whole
    assert result.model.num_timesteps == 768
    assert result.model.gamma == 0.9
    assert [evaluation.steps for evaluation in result.evaluations] == [256, 384, 640, 768]
    assert [news for news in told if news in result.evaluations] == list(result.evaluations)
    assert read_evaluations(folder / "evaluations.csv") == list(result.evaluations)
    about = Network.load(folder / "policy.npz").about
    best = max(evaluation.reached for evaluation in result.evaluations)
    assert about.interface == NUMBERED
    assert about.card["evaluation"]["reached"] == best
    assert about.card["versions"]["torch"] == torch.__version__
    assert {path.name for path in folder.iterdir()} >= {"plan.json", "model.zip", "policy.npz"}


def test_the_same_plan_gives_the_same_weights(whole, tmp_path):
    """Two seconds: a whole training."""
    again = train(tiny_plan(), tmp_path)
    assert same(weights(whole[0].model), weights(again.model))
    assert [each.reached for each in whole[0].evaluations] == [each.reached for each in again.evaluations]
    assert not same(weights(whole[0].model), weights(train(tiny_plan(seed=1), tmp_path / "other").model))


def test_a_training_that_was_killed_in_an_evaluation_goes_on_with_it(tmp_path, monkeypatch):
    """Without the help of Ctrl-C, which keeps a checkpoint itself; after the last decision, too."""

    def kill(*_, **__):
        raise SystemExit("killed")

    with monkeypatch.context() as patched:
        patched.setattr(Evaluator, "evaluate", kill)
        with pytest.raises(SystemExit):
            train(SHORT, tmp_path)
    assert not (tmp_path / "policy.npz").exists()
    result = train(SHORT, tmp_path, resume=True)
    assert [each.steps for each in result.evaluations] == [128]
    assert result.steps == 0
    assert (tmp_path / "policy.npz").exists()


def test_training_goes_on_where_it_stopped(whole, tmp_path):
    """As if it had been stopped after the first evaluation of the second stage."""
    plan = tiny_plan()
    stopped = train(dataclasses.replace(plan, stages=(plan.stages[0], Stage(steps=256))), tmp_path)
    assert stopped.model.num_timesteps == 640
    plan.write(tmp_path / "plan.json")
    finished = train(plan, tmp_path, resume=True)
    assert finished.model.num_timesteps == 768
    assert finished.model.learning_rate == 1e-4
    assert not same(weights(stopped.model), weights(finished.model))
    again = train(plan, tmp_path, resume=True)
    assert same(weights(finished.model), weights(again.model))
    assert len(again.evaluations) == 4


def test_a_training_that_diverges_leaves_the_checkpoint_before(trained, tmp_path):
    plan = tiny_plan(stages=(Stage(steps=128),))
    shutil.copytree(trained, tmp_path, dirs_exist_ok=True)
    sound = (tmp_path / "model.zip").read_bytes()
    wild = {"learning_rate": 1e15, "batch_size": 128, "n_epochs": 1}  # one update, which only the end looks at
    longer = dataclasses.replace(plan, stages=(*plan.stages, Stage(steps=128, options=wild)))
    with pytest.raises(ConfigError, match="diverged"):
        train(longer, tmp_path, resume=True)
    assert (tmp_path / "model.zip").read_bytes() == sound


def test_ctrl_c_before_the_first_evaluation_loses_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(training, "_REPORT_EVERY_S", 0.0)
    plan = tiny_plan(evaluation=EvaluationPlan(every_steps=10_000, horizon_s=200.0, n_runs=1, baseline="random"))

    def stop(news):
        if news.steps == 256:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(plan, tmp_path, report=stop)
    assert PPO.load(tmp_path / "model.zip").num_timesteps == 256
    result = train(plan, tmp_path, resume=True)
    assert [each.steps for each in result.evaluations] == [384, 768]


@pytest.mark.parametrize("better", [0, 1])
def test_the_better_of_two_starts_goes_on(tmp_path, monkeypatch, better):
    """Killed in the second start's evaluation and stopped after its first rollout; all decisions count."""
    plan = tiny_plan(starts=2, enough=2.0, stages=(Stage(steps=128), Stage(steps=128, options={"learning_rate": 0.0})))
    plan = dataclasses.replace(plan, evaluation=dataclasses.replace(plan.evaluation, every_steps=10_000))
    monkeypatch.setattr(training, "_REPORT_EVERY_S", 0.0)
    judge, ways, found = Evaluator.evaluate, ["stop", "kill"], {}

    def stop(news):
        if news.steps == 256 and ways[:1] == ["stop"]:
            raise KeyboardInterrupt(ways.pop(0))

    def judged(self, network, steps, **kwargs):
        if steps == 256 and ways:
            raise SystemExit(ways.pop(0))
        found[steps] = network.weights[0]
        return judge(self, network, steps, **kwargs)

    monkeypatch.setattr(Evaluator, "evaluate", judged)
    monkeypatch.setattr(evaluation, "reached_in", lambda *_: float([*found][-1] == 128 + 128 * better))
    for error in (KeyboardInterrupt, SystemExit):
        with pytest.raises(error):
            train(plan, tmp_path, report=stop, resume=error is SystemExit)
    result = train(plan, tmp_path, report=stop, resume=True)
    assert (plan.total_steps, result.model.num_timesteps, [*found]) == (384, 384, [128, 256, 384])
    assert not same(found[128], found[256])
    assert same(found[384], found[128 + 128 * better])


def test_extra_columns_and_rewards_reach_training_and_evaluations(tmp_path):
    seen = set()

    def nest_side(arena):
        seen.add(arena.tick)
        return np.sign(arena.swarm.position[:, :1] - 16.0)

    plan = tiny_plan(samples=True, stages=(Stage(steps=128, scenario={}),))
    result = train(plan, tmp_path, extra_observation=nest_side, extra_reward=lambda arena: 0.5 * arena.swarm.active)
    kept = Network.load(tmp_path / "policy.npz")
    assert kept.about.interface.extra_columns == 1
    assert kept.n_columns == result.model.observation_space.shape[0]
    assert max(seen) >= 900, "evaluations of whole runs call it, too"


def test_a_folder_goes_on_with_its_own_training_only(trained, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(trained, folder)
    with pytest.raises(ConfigError, match=r"resume it .* or choose another folder"):
        train(tiny_plan(), folder)
    with pytest.raises(ConfigError, match="another plan: seed: 0 before, 5 now"):
        train(dataclasses.replace(SHORT, seed=5), folder, resume=True)
    assert train(SHORT, folder, resume=True).steps == 0
    longer = dataclasses.replace(SHORT, stages=(Stage(steps=256), Stage(steps=128, options={"gamma": 0.8})))
    result = train(longer, folder, resume=True)
    assert (result.steps, result.model.num_timesteps, result.model.gamma) == (256, 384, 0.8)
    assert read_plan(folder / "plan.json") == longer
    with pytest.raises(ConfigError, match=r"stages\[0\].steps: 256 before, 128 now"):
        train(SHORT, folder, resume=True)
    for name, content, reason in (
        ("evaluations.csv", b"steps,wall_time_s\n12", "Cannot read the evaluations in .*evaluations.csv"),
        ("model.zip", (folder / "model.zip").read_bytes()[:3000], "Cannot open the checkpoint .*model.zip"),
        ("plan.json", b"{", "Cannot use the plan .*plan.json"),
    ):
        whole = (folder / name).read_bytes()
        (folder / name).write_bytes(content)
        with pytest.raises(ConfigError, match=reason):
            train(longer, folder, resume=True)
        (folder / name).write_bytes(whole)
    (folder / "model.zip").unlink()
    with pytest.raises(ConfigError, match=r"found no model\.zip"):
        train(longer, folder, resume=True)


REPLAY = {"buffer_size": 400, "learning_starts": 64, "batch_size": 16}


@pytest.mark.parametrize(
    ("algorithm", "changes"),
    [
        ("a2c", {"options": {"n_steps": 8}, "activation": "relu"}),
        ("dqn", {"options": REPLAY, "samples": True, "temperature": 50.0}),
        ("sac", {"options": REPLAY, "interface": dataclasses.replace(DRIVEN, decision_ticks=3)}),
        ("ppo", {"samples": True, "world": World(warehouse_small(n_robots=4, horizon_s=200.0, caches="static"))}),
    ],
)
def test_what_is_left_runs_as_it_was_trained(tmp_path, algorithm, changes):
    plan = tiny_plan(algorithm=algorithm, stages=(Stage(steps=128),), **changes)
    result = train(plan, tmp_path)
    assert result.model.num_timesteps == 128
    if algorithm in ("dqn", "sac"):
        assert isinstance(result.model.replay_buffer, PresentReplayBuffer)
    for name in ("model.zip",) if algorithm == "sac" else ("model.zip", "policy.npz"):
        policy = load_policy(tmp_path / name)
        assert (policy.caches, policy._config) == (plan.scenario.caches, plan.interface)
    if algorithm == "sac":
        assert result.policy_file is None
        return
    learnt = export_network(result.model, plan.interface, samples=plan.samples)
    kept = Network.load(result.policy_file)
    assert (kept.about.samples, kept.about.activation) == (plan.samples, plan.activation)
    np.testing.assert_allclose(kept.weights[-1], learnt.weights[-1] / np.float32(plan.temperature), rtol=1e-6)
    policy, env = NetworkPolicy(kept), ForageEnv(warehouse_small(n_robots=400))
    policy.reset(env.swarm_spec, np.random.default_rng(0))
    policy.act(env.reset_batch(0)[:1].repeat(400, axis=0), env.active)
    assert (len(set(policy.chosen.tolist())) > 1) == plan.samples


def test_worlds_are_drawn_and_told_one_by_one(tmp_path):
    quick = {"n_robots": 2, "n_objects": 20, "horizon_s": 200.0, "physics": "compiled"}
    narrow = {"preset": "warehouse_small", **quick, "n_robots": 3}
    first = ScenarioSampler({"worlds": [{"scenario": narrow}]})  # other rows than in the next stage
    judged = tuple(
        EvaluationWorld(scenario=warehouse_small(**quick), name=name, baseline=name) for name in ("random", "crw")
    )
    plan = TrainingPlan(
        world=World(sampler().largest),
        sampler=sampler(),
        interface=NUMBERED,
        n_arenas=2,
        hidden=(8,),
        options={"n_steps": 8, "batch_size": 48},
        stages=(Stage(steps=48, sampler=first), Stage(steps=192)),
        evaluation=EvaluationPlan(every_steps=1000, worlds=judged),
    )
    result = train(plan, tmp_path / "one")
    assert [evaluation.steps for evaluation in result.evaluations] == [48, 240]
    last = result.evaluations[-1]
    assert [(world.world, world.baseline_policy) for world in last.worlds] == [("random", "random"), ("crw", "crw")]
    assert last.reached == np.mean([world.ratio for world in last.worlds])
    assert read_plan(tmp_path / "one" / "plan.json") == plan
    assert Network.load(tmp_path / "one" / "policy.npz").about.card["plan"]["sampler"] == plan.sampler.table
    assert same(weights(result.model), weights(train(plan, tmp_path / "two").model))
