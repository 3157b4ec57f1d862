"""Training by stable-baselines3: reproducible, resumable, compared with a baseline."""

import contextlib
import csv
import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.policies.model_files import ModelError, ModelPolicy
from swarm_forage_env.policies.network import Network, NetworkPolicy
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.spec import policy_spec
from swarm_forage_env.scenarios.presets import search_and_rescue, warehouse_small
from swarm_forage_env.training.evaluation_plan import EvaluationPlan
from swarm_forage_env.training.evaluations import finished_runs, means, read_evaluations, write_evaluations
from swarm_forage_env.training.plan import Stage, TrainingPlan, read_plan
from swarm_forage_env.training.sb3 import ActiveRolloutBuffer, PresentReplayBuffer, SwarmVecEnv, training
from swarm_forage_env.training.sb3.export import export_network
from swarm_forage_env.training.sb3.training import train
from swarm_forage_env.views.pettingzoo import parallel_env
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import World

NUMBERED = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5)
DRIVEN = InterfaceConfig(observation="compact", automatic_gripper=True)


def tiny_plan(**changes) -> TrainingPlan:
    """Two stages of three rollouts, in seconds."""
    plan = TrainingPlan(
        world=World(warehouse_small(n_robots=4, n_objects=20, horizon_s=200.0)),
        interface=NUMBERED,
        n_arenas=2,
        hidden=(8,),
        options={"n_steps": 16, "batch_size": 64},
        stages=(
            Stage(steps=384, scenario={"n_objects": 40}),
            Stage(steps=384, options={"learning_rate": 1e-4, "gamma": 0.9}),
        ),
        evaluation=EvaluationPlan(every_steps=256, horizon_s=200.0, n_runs=1, baseline="random"),
    )
    return dataclasses.replace(plan, **changes)


ROOMLESS = {"width_m": 9.6, "height_m": 9.6, "nest_centre_m": (4.8, 4.8), "nest_size_m": (1.92, 1.92)}
"""An arena too small for the clusters of search and rescue."""
SHORT = tiny_plan(stages=(Stage(steps=128),))


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


def test_ppo_twice_from_one_seed_gives_the_same_weights_after_20000_steps():
    trained = []
    for seed in (0, 0, 1):
        env = SwarmVecEnv("warehouse_small", n_robots=20, n_arenas=2, interface=DRIVEN, n_objects=100)
        model = PPO(
            "MlpPolicy",
            env,
            n_steps=100,
            batch_size=2000,
            n_epochs=2,
            policy_kwargs={"net_arch": [32]},
            rollout_buffer_class=ActiveRolloutBuffer,
            rollout_buffer_kwargs=env.rollout_buffer_kwargs,
            seed=seed,
            device="cpu",
        ).learn(20_000)
        assert model.num_timesteps == 20_000
        trained.append(weights(model))
    assert same(trained[0], trained[1])
    assert not same(trained[0], trained[2])


def test_a_plan_is_carried_out_stage_by_stage(tmp_path):
    told = []
    result = train(tiny_plan(), tmp_path, report=told.append)
    assert result.model.num_timesteps == 768
    assert result.model.gamma == 0.9
    assert [evaluation.steps for evaluation in result.evaluations] == [256, 384, 640, 768]
    assert [news for news in told if news in result.evaluations] == list(result.evaluations)
    with (tmp_path / "evaluations.csv").open() as file:
        assert [int(row["steps"]) for row in csv.DictReader(file)] == [256, 384, 640, 768]
    about = Network.load(tmp_path / "policy.npz").about
    best = max(evaluation.performance for evaluation in result.evaluations)
    assert about.interface == NUMBERED
    assert about.card["evaluation"]["performance"] == best
    assert about.card["versions"]["torch"] == torch.__version__
    assert {path.name for path in tmp_path.iterdir()} >= {"plan.json", "model.zip", "policy.npz"}


def test_the_same_plan_gives_the_same_weights(tmp_path):
    first, again = train(tiny_plan(), tmp_path / "a"), train(tiny_plan(), tmp_path / "b")
    assert not same(weights(first.model), weights(train(tiny_plan(seed=1), tmp_path / "c").model))
    assert same(weights(first.model), weights(again.model))
    assert [each.performance for each in first.evaluations] == [each.performance for each in again.evaluations]


@pytest.mark.parametrize(("plan", "evaluated"), [(tiny_plan(), [256, 384, 640, 768]), (SHORT, [128])])
def test_a_training_that_was_killed_in_an_evaluation_goes_on_with_it(tmp_path, monkeypatch, plan, evaluated):
    """Without the help of Ctrl-C, which keeps a checkpoint itself; after the last decision, too."""

    def kill(*_, **__):
        raise SystemExit("killed")

    with monkeypatch.context() as patched:
        patched.setattr(training, "evaluated", kill)
        with pytest.raises(SystemExit):
            train(plan, tmp_path)
    assert not (tmp_path / "policy.npz").exists()
    result = train(plan, tmp_path, resume=True)
    assert [each.steps for each in result.evaluations] == evaluated
    assert result.steps == evaluated[-1] - evaluated[0]
    assert (tmp_path / "policy.npz").exists()


def test_tensorboard_shows_the_settings(trained):
    name = "tensorboard.backend.event_processing.event_accumulator"
    event_accumulator = pytest.importorskip(name, reason="needs the train extra: tensorboard")
    (folder,) = (trained / "tensorboard").iterdir()
    events = event_accumulator.EventAccumulator(str(folder)).Reload()
    content = events.summary_metadata["_hparams_/session_start_info"].plugin_data.content
    for name in (
        b"options.batch_size",
        b"interface.decision_ticks",
        b"temperature",
        b"stages[0].steps",
        b"scenario.robots.n_robots",
    ):
        assert name in content
    assert "evaluation/performance" in events.Tags()["scalars"]


def test_training_goes_on_where_it_stopped(tmp_path):
    plan = tiny_plan()
    done = train(plan, tmp_path).model
    again = train(plan, tmp_path, resume=True)
    assert same(weights(done), weights(again.model))
    assert len(again.evaluations) == 4

    # As if it had been stopped after the first evaluation of the second stage.
    other = tmp_path / "stopped"
    stopped = train(dataclasses.replace(plan, stages=(plan.stages[0], Stage(steps=256))), other)
    assert stopped.model.num_timesteps == 640
    plan.write(other / "plan.json")
    finished = train(plan, other, resume=True)
    assert finished.model.num_timesteps == 768
    assert finished.model.learning_rate == 1e-4
    assert not same(weights(stopped.model), weights(finished.model))


def test_folders_of_other_trainings_are_left_alone(tmp_path):
    train(tiny_plan(stages=(Stage(steps=128),)), tmp_path)
    with pytest.raises(ConfigError, match="or choose another folder"):
        train(tiny_plan(), tmp_path)
    other = dataclasses.replace(tiny_plan().evaluation, n_runs=2)
    with pytest.raises(ConfigError, match=r"another plan: evaluation\.n_runs: 1 before, 2 now; seed: 0 before, 5 now"):
        train(tiny_plan(stages=(Stage(steps=128),), evaluation=other, seed=5), tmp_path, resume=True)


def test_a_second_training_in_one_folder_is_refused_while_the_first_is_under_way(tmp_path):
    pytest.importorskip("fcntl")
    told = []

    class Second(BaseCallback):
        """Before the first one has written anything that tells of it."""

        def _on_training_start(self):
            with pytest.raises(ConfigError, match="another command does; wait until it has ended"):
                train(tiny_plan(seed=5), tmp_path)
            told.append(read_plan(tmp_path / "plan.json").seed)

        def _on_step(self):
            return True

    train(tiny_plan(stages=(Stage(steps=128),)), tmp_path, callbacks=[Second()])
    assert told == [0]


def test_a_finished_training_goes_on_by_a_longer_plan(trained, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(trained, folder)
    assert train(SHORT, folder, resume=True).steps == 0
    longer = dataclasses.replace(SHORT, stages=(Stage(steps=256), Stage(steps=128, options={"gamma": 0.8})))
    result = train(longer, folder, resume=True)
    assert result.steps == 256
    assert result.model.num_timesteps == 384
    assert result.model.gamma == 0.8
    assert read_plan(folder / "plan.json") == longer
    with pytest.raises(ConfigError, match=r"stages\[0\].steps: 256 before, 128 now"):
        train(SHORT, folder, resume=True)


def test_time_spent_counts_on(trained, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(trained, folder)
    path = folder / "evaluations.csv"
    before = read_evaluations(path)
    write_evaluations(path, [dataclasses.replace(each, wall_time_s=1000.0, cpu_time_s=500.0) for each in before])
    told = []
    result = train(dataclasses.replace(SHORT, stages=(Stage(steps=256),)), folder, resume=True, report=told.append)
    assert 1000.0 < result.evaluations[-1].wall_time_s < 2000.0
    assert 500.0 < result.evaluations[-1].cpu_time_s < 1000.0
    assert all(1000.0 < news.wall_time_s < 2000.0 for news in told)


@pytest.mark.parametrize("missing", ["plan.json", "model.zip"])
def test_only_a_training_is_resumed(trained, tmp_path, missing):
    folder = tmp_path / "copy"
    with pytest.raises(ConfigError, match=r"to hold a training to resume, .* found no plan\.json"):
        train(SHORT, folder, resume=True)
    assert not folder.exists()
    shutil.copytree(trained, folder)
    (folder / missing).unlink()
    with pytest.raises(ConfigError, match=f"found no {missing}"):
        train(SHORT, folder, resume=True)
    with pytest.raises(ConfigError, match="unused folder"):
        train(SHORT, folder)


def test_a_training_that_kept_nothing_is_started_again(tmp_path):
    SHORT.write(tmp_path / "plan.json")
    assert train(SHORT, tmp_path).steps == 128


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"evaluation": EvaluationPlan(baseline="gone.npz")}, r"baseline to be a controller: .*gone\.npz"),
        # Clusters are drawn by the first reset.
        (
            {"world": World(search_and_rescue(side_m=48.0, n_robots=4, horizon_s=200.0)),
             "stages": (Stage(steps=64, scenario=ROOMLESS),)},
            r"Cannot train in stage 1, with width_m = 9.6, .*: Expected room for \d+ clusters",
        ),
    ],
)  # fmt: skip
def test_what_cannot_begin_leaves_nothing_behind(tmp_path, changes, reason):
    with pytest.raises(ConfigError, match=reason):
        train(tiny_plan(**changes), tmp_path / "new" / "folder")
    assert list(tmp_path.iterdir()) == []


def test_a_training_that_diverges_says_so(tmp_path):
    plan = tiny_plan(options={"n_steps": 16, "batch_size": 64, "learning_rate": 1e15})
    with pytest.raises(ConfigError, match=r"diverged in stage 1, .*lower the learning_rate") as refusal:
        train(plan, tmp_path)
    assert "\n" not in str(refusal.value)


def test_a_training_that_diverges_leaves_the_checkpoint_before(tmp_path):
    plan = tiny_plan(stages=(Stage(steps=128),))
    train(plan, tmp_path)
    sound = (tmp_path / "model.zip").read_bytes()
    wild = {"learning_rate": 1e15, "batch_size": 128, "n_epochs": 1}  # one update, which only the end looks at
    longer = dataclasses.replace(plan, stages=(*plan.stages, Stage(steps=128, options=wild)))
    with pytest.raises(ConfigError, match="diverged"):
        train(longer, tmp_path, resume=True)
    assert (tmp_path / "model.zip").read_bytes() == sound


def test_a_rollout_with_nobody_at_work_says_so(tmp_path):
    plan = tiny_plan(
        world=World(
            warehouse_small(n_robots=1, n_objects=20, horizon_s=200.0),
            (parse_wrapper("population:malfunction_per_tick=0.2,repair_per_tick=0.201"),),
        ),
        n_arenas=1,
        options={"n_steps": 2, "batch_size": 2},
    )
    with pytest.raises(ConfigError, match=r"Cannot train in stage 1.*: Expected a robot at work"):
        train(plan, tmp_path)


@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
def test_checkpoints_run_as_they_were_trained(tmp_path, algorithm):
    driven = dataclasses.replace(DRIVEN, decision_ticks=3)
    replay = {"buffer_size": 400, "learning_starts": 64, "batch_size": 16}
    scenario = warehouse_small(n_robots=4, n_objects=60, horizon_s=200.0, caches="static")
    changes = {"algorithm": "sac", "interface": driven, "options": replay} if algorithm == "sac" else {}
    result = train(tiny_plan(stages=(Stage(steps=128),), world=World(scenario), **changes), tmp_path)
    policy = load_policy(tmp_path / "model.zip")
    assert policy.caches == "static"
    env = parallel_env("warehouse_small", n_robots=4, n_objects=20)
    interface = LearnerInterface(driven if algorithm == "sac" else NUMBERED, env.swarm_spec)
    policy.reset(env.swarm_spec, np.random.default_rng(0))
    obs = env.reset_batch(0)
    for tick in range(12):
        if tick % interface.config.decision_ticks == 0:
            choice, _ = result.model.predict(interface.observe(obs), deterministic=True)
        actions = policy.act(obs, env.active)
        np.testing.assert_array_equal(actions, interface.command(choice, obs))
        obs, *_ = env.step_batch(actions)


def test_a_policy_that_draws_its_actions_is_judged_and_kept_as_such(tmp_path):
    plan = tiny_plan(samples=True, stages=(Stage(steps=128),))
    result = train(plan, tmp_path / "drawn")
    network = Network.load(tmp_path / "drawn" / "policy.npz")
    assert network.about.samples
    assert not Network.load(train(SHORT, tmp_path / "likeliest").policy_file).about.samples
    policy, env = NetworkPolicy(network), ForageEnv(warehouse_small(n_robots=400))
    policy.reset(env.swarm_spec, np.random.default_rng(0))
    policy.act(env.reset_batch(0)[:1].repeat(400, axis=0), env.active)
    assert len(set(policy.chosen.tolist())) > 1
    assert same(weights(result.model), weights(train(SHORT, tmp_path / "same").model)), (
        "drawing takes no chance from learning"
    )


def test_a_policy_is_judged_and_kept_at_the_temperature_of_its_plan(tmp_path):
    plan = tiny_plan(samples=True, temperature=0.5, stages=(Stage(steps=128),))
    result = train(plan, tmp_path)
    learnt = export_network(result.model, plan.interface, samples=True)
    kept = Network.load(tmp_path / "policy.npz")
    np.testing.assert_allclose(kept.weights[-1], 2.0 * learnt.weights[-1], rtol=1e-6)
    np.testing.assert_array_equal(kept.weights[0], learnt.weights[0])


def test_a_policy_learns_at_one_pace_and_is_judged_and_kept_at_another(tmp_path):
    plan = tiny_plan(samples=True, in_runs={"decision_ticks": 1}, stages=(Stage(steps=128),))
    result = train(plan, tmp_path / "often")
    kept = Network.load(tmp_path / "often" / "policy.npz")
    assert (kept.about.interface.decision_ticks, plan.interface.decision_ticks) == (1, 5)
    slow = train(dataclasses.replace(plan, in_runs={}), tmp_path / "as_learnt")
    assert same(weights(result.model), weights(slow.model))
    assert result.evaluations[-1].interference_fraction != slow.evaluations[-1].interference_fraction


def test_a_policy_that_does_not_draw_is_judged_as_its_file_runs(tmp_path):
    plan = tiny_plan(in_runs={"decision_ticks": 1}, stages=(Stage(steps=64),))
    result = train(plan, tmp_path)
    runs = plan.judging(policy_spec(str(result.policy_file)))
    (condition,) = runs.conditions
    evaluation = result.evaluations[-1]
    assert (evaluation.performance, evaluation.interference_fraction) == means(finished_runs(runs), condition)


def test_a_dqn_that_draws_does_so_by_its_values_over_the_temperature(tmp_path):
    plan = tiny_plan(algorithm="dqn", samples=True, temperature=0.005, stages=(Stage(steps=128),), interface=NUMBERED,
                     options={"buffer_size": 400, "learning_starts": 64, "batch_size": 16})  # fmt: skip
    result = train(plan, tmp_path)
    learnt, kept = export_network(result.model, plan.interface), Network.load(tmp_path / "policy.npz")
    assert kept.about.samples
    np.testing.assert_allclose(kept.weights[-1], 200.0 * learnt.weights[-1], rtol=1e-6)


def test_the_last_checkpoint_holds_all_that_was_learnt(tmp_path):
    """Also where an evaluation is due with the last step of a stage."""
    evaluation = dataclasses.replace(tiny_plan().evaluation, every_steps=128)
    result = train(tiny_plan(stages=(Stage(steps=256),), evaluation=evaluation), tmp_path)
    assert [each.steps for each in result.evaluations] == [128, 256]
    assert same(weights(result.model), weights(PPO.load(tmp_path / "model.zip")))


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


def test_the_network_is_there_before_the_table_speaks_of_it(tmp_path, monkeypatch):
    def full_disk(path, evaluations):
        raise OSError("no space left")

    monkeypatch.setattr(training, "write_evaluations", full_disk)
    with pytest.raises(OSError, match="no space"):
        train(tiny_plan(stages=(Stage(steps=128),)), tmp_path)
    assert Network.load(tmp_path / "policy.npz").about.card["evaluation"]["steps"] == 128
    assert not (tmp_path / "evaluations.csv").exists()


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("model.zip", b"", "Cannot open the checkpoint .*model.zip"),
        ("model.zip", None, "Cannot open the checkpoint .*model.zip"),
        ("evaluations.csv", b"steps,wall_time_s\n12", "Cannot read the evaluations in .*evaluations.csv"),
        ("evaluations.csv", b"steps\nmany\n", "Cannot read the evaluations in .*evaluations.csv"),
        ("plan.json", b"{", "Cannot use the plan .*plan.json"),
    ],
)
def test_broken_files_are_named(trained, tmp_path, name, content, reason):
    folder = tmp_path / "copy"
    shutil.copytree(trained, folder)
    path = folder / name
    path.write_bytes(path.read_bytes()[:3000] if content is None else content)
    with pytest.raises(ConfigError, match=reason):
        train(SHORT, folder, resume=True)


def test_damaged_models_are_refused_as_policies(trained, tmp_path):
    whole, rng = (trained / "model.zip").read_bytes(), np.random.default_rng(0)
    path, refused = tmp_path / "model.zip", 0
    for _ in range(60):
        damaged = bytearray(whole)
        for at in (rng.integers(len(whole)), len(whole) - 1 - rng.integers(300)):  # the second in the table of contents
            damaged[at] = rng.integers(256)
        path.write_bytes(damaged)
        with contextlib.suppress(ModelError):  # and nothing else
            ModelPolicy(path)
            refused -= 1
        refused += 1
    assert refused > 30


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"learning_rat": 1.0}, "Did you mean 'learning_rate'"),
        ({"seed": 3}, "the plan says it in 'seed'"),
        ({"hidden": 128}, "the plan says it in 'hidden'"),
        ({"net_arch": 128}, "the plan says it in 'hidden'"),
        ({"policy_kwargs": {}}, "the plan says it in 'hidden'"),
        ({"activation_fn": "relu"}, "the plan says it in 'activation'"),
        ({"device": "cpu"}, "without 'device', which training sets itself"),
        ({"n_steps": 1, "batch_size": 1}, "Cannot prepare ppo with its options: `batch_size`"),
    ],
)
def test_options_that_the_algorithm_refuses_leave_the_folder_unused(tmp_path, options, reason):
    with pytest.raises(ConfigError, match=reason):
        train(tiny_plan(options=options), tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_options_of_later_stages_are_checked_before_the_first(tmp_path):
    stages = (Stage(steps=128), Stage(steps=128, options={"learning_rat": 1.0}))
    with pytest.raises(ConfigError, match="Did you mean 'learning_rate'"):
        train(tiny_plan(stages=stages), tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_seeds_of_stages_and_of_resumed_trainings_are_new_and_none_of_the_evaluations():
    seeds = {training.training_seed(seed, done) for seed in (0, 1) for done in (0, 1_000_000, 1_000_001)}
    assert len(seeds) == 6
    evaluated = range(EvaluationPlan().first_seed, EvaluationPlan().first_seed + EvaluationPlan().n_runs)
    assert not any(seed + arena in evaluated for seed in seeds for arena in range(64))


@pytest.mark.parametrize("algorithm", ["a2c", "dqn", "sac"])
def test_other_algorithms_train(tmp_path, algorithm):
    options = {"a2c": {"n_steps": 8}}.get(algorithm, {"buffer_size": 400, "learning_starts": 64, "batch_size": 16})
    plan = tiny_plan(
        algorithm=algorithm,
        interface=DRIVEN if algorithm == "sac" else NUMBERED,
        options=options,
        stages=(Stage(steps=128),),
    )
    result = train(plan, tmp_path)
    assert result.model.num_timesteps == 128
    assert (result.policy_file is None) == (algorithm == "sac")
    if algorithm in ("dqn", "sac"):
        assert isinstance(result.model.replay_buffer, PresentReplayBuffer)


@pytest.mark.parametrize(("activation", "layer"), [("tanh", torch.nn.Tanh), ("relu", torch.nn.ReLU)])
def test_a_plan_chooses_what_hidden_layers_do(tmp_path, activation, layer):
    result = train(dataclasses.replace(SHORT, activation=activation), tmp_path)
    policy = result.model.policy
    for part in (policy.mlp_extractor.policy_net, policy.mlp_extractor.value_net):
        assert [type(each) for each in part] == [torch.nn.Linear, layer]
    assert result.policy_file is not None
    assert Network.load(result.policy_file).about.activation == activation


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
