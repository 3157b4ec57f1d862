"""Trajectories as files: they hold what the environment gave, and are there whole or not at all."""

from dataclasses import replace

import numpy as np
import pytest

from swarm_forage_env import load_policy, plan_run, scenario
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.policies.interface import LearnerInterface
from swarm_forage_env.policies.network import Network
from swarm_forage_env.policies.pretrained import network_file
from swarm_forage_env.runs.run import build_env
from swarm_forage_env.training import datasets
from swarm_forage_env.training.datasets import Dataset, DatasetError, record_dataset
from swarm_forage_env.views.gymnasium import JointForageEnv
from swarm_forage_env.wrappers.population import PopulationConfig
from swarm_forage_env.wrappers.registry import parse_wrapper

WORLD = scenario("warehouse_small", n_robots=4, n_objects=400, horizon_s=20.0, interval_s=20.0, physics="compiled")
DEADLY = (PopulationConfig(death_per_tick=0.03),)


def recorded(folder, policy="crw", seeds=(3,), wrappers=(), **choices):
    """The data set of a policy, recorded into a folder."""
    record_dataset(plan_run(WORLD, policy, wrappers=wrappers), seeds, folder, **choices)
    return Dataset(folder)


def first(dataset):
    return next(dataset.runs())


# What is in it


@pytest.mark.parametrize("policy", ["crw", "stochm"])
def test_a_run_read_back_is_what_the_environment_gave(policy, tmp_path):
    dataset = recorded(tmp_path, policy, wrappers=DEADLY)
    steps, spec = first(dataset), dataset.spec
    env, driver = build_env(spec.scenario, spec.wrappers), load_policy(spec.policy, spec.parameters)
    driver.reset(env.unwrapped.swarm_spec, stream_rng(3, Stream.POLICY))
    obs, dead = env.reset_batch(3), np.zeros(4, np.bool_)
    for tick in range(len(steps)):
        np.testing.assert_array_equal(steps.observations[tick], obs)
        np.testing.assert_array_equal(steps.active[tick], env.unwrapped.active)
        commands = driver.act(obs, env.unwrapped.active)
        np.testing.assert_array_equal(steps.actions[tick], commands)
        obs, rewards, terminated, truncated = env.step_batch(commands, tasks=getattr(driver, "task", None))
        np.testing.assert_array_equal(steps.rewards[tick], rewards)
        np.testing.assert_array_equal(steps.terminated[tick], terminated & ~dead)
        np.testing.assert_array_equal(steps.truncated[tick], ~terminated if truncated else np.zeros(4, np.bool_))
        dead = terminated.copy()
    np.testing.assert_array_equal(steps.observations[-1], obs)
    assert truncated or dead.all()
    assert dead.any(), "a run without deaths shows nothing of them"


def generalist(folder, frame_decisions):
    """The shipped policy, deciding once a second, with frames for so many decisions, as a file."""
    network = Network.load(network_file("generalist"))
    interface = replace(network.about.interface, decision_ticks=5, frame_decisions=frame_decisions)
    file = folder / f"frames_{frame_decisions}.npz"
    replace(network, about=replace(network.about, interface=interface)).save(file)
    return str(file)


@pytest.mark.parametrize("frame_decisions", [None, 3])
def test_a_learned_policy_is_recorded_as_it_decides(frame_decisions, tmp_path):
    """Its actions, taken again, make the same run, also where robots have frames of their own."""
    policy = "ppo_warehouse_small" if frame_decisions is None else generalist(tmp_path, frame_decisions)
    dataset = recorded(tmp_path / "data", policy)
    config, steps = dataset.interface, first(dataset)
    assert (config.observation, config.decision_ticks, config.frame_decisions) == ("compact", 5, frame_decisions or 0)
    assert (len(steps), steps.actions.shape, steps.actions.dtype) == (20, (20, 4), np.int64)
    env = JointForageEnv(WORLD, interface=config)
    obs, _ = env.reset(seed=3)
    for number, action in enumerate(steps.actions):
        np.testing.assert_array_equal(steps.observations[number], obs)
        obs, reward, _, truncated, info = env.step(action)
        assert reward == steps.rewards[number].sum()
        np.testing.assert_array_equal(info["active"], steps.active[number + 1])
    assert truncated
    np.testing.assert_array_equal(steps.observations[-1], obs)


@pytest.mark.parametrize("policy", ["crw", "generalist"])
def test_what_robots_remember_is_recorded_where_it_is_asked_for_or_seen(policy, tmp_path):
    """It is what an interface of the same choices says of the recorded rows, from the first on."""
    is_seen = policy == "generalist"
    if is_seen:  # without frames of robots' own, so that the plain rows are those that the interface is given
        policy = generalist(tmp_path, 0)
    remembering = recorded(tmp_path / "remembering", policy, observation="full", site_memory=True)
    plain = recorded(tmp_path / "plain", policy, observation="full", site_memory=False)
    assert len(remembering.columns) == len(plain.columns) + 8
    assert (
        recorded(tmp_path / "usual", policy, observation="full").columns == (remembering if is_seen else plain).columns
    )
    rows, seen = first(remembering).observations, first(plain).observations
    interface = LearnerInterface(remembering.interface, SwarmSpec.of(WORLD))
    for row, obs in zip(rows, seen, strict=True):
        np.testing.assert_array_equal(row, interface.observe(obs))
    assert rows[:, :, seen.shape[2] :].any(), "nobody remembers anything"


def test_transitions_are_the_decisions_of_robots_at_work(tmp_path):
    wrappers = (parse_wrapper("population:malfunction_per_tick=0.3,repair_per_tick=0.3"),)
    dataset = recorded(tmp_path, "random", wrappers=wrappers)
    rows, steps = dataset.transitions(), first(dataset)
    working = steps.active[:-1]
    assert 0 < len(rows["rewards"]) == working.sum() < working.size
    np.testing.assert_array_equal(rows["observations"], steps.observations[:-1][working])
    np.testing.assert_array_equal(rows["next_observations"], steps.observations[1:][working])
    np.testing.assert_array_equal(rows["actions"], steps.actions[working])


# Whole or not at all


def test_an_interrupted_recording_goes_on(tmp_path, monkeypatch):
    save, calls = np.savez_compressed, []

    def interrupted(file, **arrays):
        calls.append(file)
        if len(calls) == 2:
            file.write(b"half of a run")
            raise KeyboardInterrupt
        save(file, **arrays)

    with monkeypatch.context() as patch:
        patch.setattr(datasets.np, "savez_compressed", interrupted)
        with pytest.raises(KeyboardInterrupt):
            recorded(tmp_path, seeds=(1, 2))
    assert [run.seed for run in Dataset(tmp_path).runs()] == [1]
    assert record_dataset(plan_run(WORLD, "crw"), (1, 2), tmp_path) == 1
    assert [run.seed for run in Dataset(tmp_path).runs()] == [1, 2]


def test_seeds_can_be_added_but_nothing_else_changed(tmp_path):
    recorded(tmp_path, seeds=(1,))
    assert [run.seed for run in recorded(tmp_path, seeds=(2, 1)).runs()] == [1, 2]
    with pytest.raises(DatasetError, match="another run"):
        recorded(tmp_path, "random")
    with pytest.raises(DatasetError, match="another interface"):
        recorded(tmp_path, observation="compact")


def test_damaged_files_are_named(tmp_path):
    dataset = recorded(tmp_path)
    run = tmp_path / "seed_000003.npz"
    with np.load(run) as stored:
        np.savez(run, **{name: array for name, array in stored.items() if name != "active"})
    with pytest.raises(DatasetError, match=r"seed_000003\.npz.*active"):
        first(dataset)
    for content in (b"", b"no archive", run.read_bytes()[:500]):
        run.write_bytes(content)
        with pytest.raises(DatasetError, match=r"seed_000003\.npz"):
            first(dataset)
    for text in ("", "[]", "{}", '{"run": {}, "interface": {}, "columns": []}'):
        (tmp_path / "dataset.json").write_text(text)
        with pytest.raises(DatasetError, match=r"dataset\.json"):
            Dataset(tmp_path)


# For other libraries


@pytest.mark.slow
@pytest.mark.parametrize("policy", ["crw", "ppo_warehouse_small"])
def test_minari_gets_the_same_numbers(policy, tmp_path, monkeypatch):
    minari = pytest.importorskip("minari")
    from swarm_forage_env.training.datasets import check_minari, export_minari

    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))
    folder = tmp_path / "ours"
    ours = recorded(folder, policy, seeds=(3, 5))
    check_minari("swarm_forage/test-v0")
    export_minari(folder, "swarm_forage/test-v0", author="somebody")
    with pytest.raises(DatasetError, match="There is a Minari data set"):
        check_minari("swarm_forage/test-v0")
    for name in ("test", "my world-v0", "a/test-v0"):  # of a namespace it asks for two characters
        with pytest.raises(DatasetError, match=f"such as swarm_forage/dpo-v0, got '{name}'"):
            check_minari(name)
    theirs = minari.load_dataset("swarm_forage/test-v0")
    assert theirs.total_episodes == 2
    for episode, steps in zip(theirs.iterate_episodes(), ours.runs(), strict=True):
        np.testing.assert_array_equal(episode.observations, steps.observations)
        np.testing.assert_array_equal(episode.actions, steps.actions)
        np.testing.assert_array_equal(episode.rewards, steps.rewards.sum(axis=1))
        assert episode.observations[0] in theirs.observation_space
        assert episode.actions[0] in theirs.action_space
        assert not episode.terminations.any()
        assert np.flatnonzero(episode.truncations).tolist() == [len(steps) - 1]
