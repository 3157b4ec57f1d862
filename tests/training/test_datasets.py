"""Trajectories as files: they hold what the environment gave, and are there whole or not at all."""

import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from swarm_forage_env import ConfigError, load_policy, plan_run, run_one, scenario
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.policies.interface import LearnerInterface
from swarm_forage_env.policies.network import Network
from swarm_forage_env.policies.pretrained import network_file
from swarm_forage_env.runs.run import build_env
from swarm_forage_env.training.datasets import recording
from swarm_forage_env.training.datasets.layout import DatasetError, chunk_file, summary_file
from swarm_forage_env.training.datasets.reading import TrajectoryDataset
from swarm_forage_env.training.datasets.recording import plan_dataset, record_dataset
from swarm_forage_env.views.gymnasium import JointForageEnv
from swarm_forage_env.wrappers.population import PopulationConfig
from swarm_forage_env.wrappers.registry import parse_wrapper
from tests.reference import frames

WORLD = scenario("warehouse_small", n_robots=4, n_objects=400, horizon_s=20.0, interval_s=20.0, physics="compiled")
DEADLY = (PopulationConfig(death_per_tick=0.03),)


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch):
    """Chunks of some thirty decisions, so that a short run has several."""
    monkeypatch.setattr(recording, "CHUNK_BYTES", 60_000)


def plan(policy="crw", seeds=(3,), wrappers=(), **choices):
    return plan_dataset(plan_run(WORLD, policy, wrappers=wrappers), seeds, **choices)


def files(folder):
    return {file.name: file.read_bytes() for file in sorted(folder.iterdir())}


# What is in it


@pytest.mark.parametrize("policy", ["crw", "stochm", "mixed:ppo_warehouse_small=1,random=rest"])
def test_a_run_read_back_is_what_the_environment_gave(policy, tmp_path):
    planned = plan(policy, wrappers=DEADLY)
    record_dataset(planned, tmp_path)
    steps = TrajectoryDataset(tmp_path).steps(3)
    spec = planned.spec
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


def test_a_run_of_a_data_set_is_the_run_of_that_seed(tmp_path):
    (summary,) = record_dataset(plan("ppo_warehouse_small"), tmp_path)
    record = run_one(replace(plan("ppo_warehouse_small").spec, seed=3))
    assert (summary.collected, summary.first_picked) == (record.collected.sum(), record.first_picked.sum())
    assert summary.truncated


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
    planned = plan("ppo_warehouse_small" if frame_decisions is None else generalist(tmp_path, frame_decisions))
    config = planned.card.interface
    assert (config.observation, config.decision_ticks, config.frame_decisions) == ("compact", 5, frame_decisions or 0)
    record_dataset(planned, tmp_path / "data")
    steps = TrajectoryDataset(tmp_path / "data").steps(3)
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


def test_with_frames_rows_and_actions_are_those_that_robots_see_and_choose_in_them(tmp_path):
    planned = plan(generalist(tmp_path, 3))
    record_dataset(planned, tmp_path / "data")
    steps = TrajectoryDataset(tmp_path / "data").steps(3)
    env = build_env(WORLD)
    plain = LearnerInterface(replace(planned.card.interface, frame_decisions=0), env_spec())
    obs, as_it_is = env.reset_batch(3), []
    for decision, (actions, rewards) in enumerate(zip(steps.actions, steps.rewards, strict=True)):
        as_it_is.append(plain.observe(obs))
        np.testing.assert_array_equal(
            steps.observations[decision], frames.seen(as_it_is[-1], plain.layout, decision, 3)
        )
        earned = np.zeros(4)
        for _ in range(5):
            obs, reward, _, _ = env.step_batch(frames.commands(plain.command(actions, obs), decision, 3))
            earned += reward
        np.testing.assert_array_equal(earned, rewards)
    assert (np.array(as_it_is) != steps.observations[:-1]).any(axis=2).mean() > 0.5, "most robots see it as it is"


def test_observations_can_be_compact_for_any_policy(tmp_path):
    planned = plan("crw", observation="compact")
    record_dataset(planned, tmp_path)
    full = TrajectoryDataset(tmp_path).card
    assert len(full.columns) == LearnerInterface(planned.card.interface, env_spec()).layout.size == 23
    with pytest.raises(ConfigError, match="observation"):
        plan("crw", observation="compakt")


@pytest.mark.parametrize("policy", ["crw", "generalist"])
def test_what_robots_remember_is_recorded_where_it_is_asked_for_or_seen(policy, tmp_path):
    """It is what an interface of the same choices says of the recorded rows, from the first on."""
    is_seen = policy == "generalist"
    if is_seen:  # without frames of robots' own, so that the plain rows are those that the interface is given
        policy = generalist(tmp_path, 0)
    columns = len(plan(policy).card.columns)
    assert len(plan(policy, site_memory=not is_seen).card.columns) == columns + (-8 if is_seen else 8)
    remembering, plain = plan(policy, observation="full", site_memory=True), plan(policy, observation="full")
    if is_seen:
        plain = plan(policy, observation="full", site_memory=False)
    record_dataset(remembering, tmp_path / "remembering")
    record_dataset(plain, tmp_path / "plain")
    rows, seen = (TrajectoryDataset(tmp_path / name).steps(3).observations for name in ("remembering", "plain"))
    interface = LearnerInterface(remembering.card.interface, env_spec())
    for row, obs in zip(rows, seen, strict=True):
        np.testing.assert_array_equal(row, interface.observe(obs))
    assert rows[:, :, seen.shape[2] :].any(), "nobody remembers anything"


def env_spec():
    return build_env(WORLD).unwrapped.swarm_spec


def test_episodes_end_where_robots_do(tmp_path):
    record_dataset(plan("random", seeds=(3, 4), wrappers=DEADLY), tmp_path)
    dataset = TrajectoryDataset(tmp_path)
    episodes = list(dataset.episodes())
    assert [(one.seed, one.robot) for one in episodes] == [(seed, robot) for seed in (3, 4) for robot in range(4)]
    assert any(one.terminated[-1] for one in episodes)
    for one in episodes:
        steps = dataset.steps(one.seed)
        length = len(one.rewards)
        assert len(one.observations) == len(one.active) == length + 1
        assert one.terminated[-1] != one.truncated[-1] or len(steps) < 100
        assert steps.terminated[length - 1, one.robot] == one.terminated[-1]
        assert not one.terminated[:-1].any()
        if one.terminated[-1]:
            assert not one.observations[-1].any()
            assert not steps.active[length:, one.robot].any()


def test_transitions_are_the_decisions_of_robots_at_work(tmp_path):
    wrappers = (parse_wrapper("population:malfunction_per_tick=0.3,repair_per_tick=0.3"),)
    record_dataset(plan("random", wrappers=wrappers), tmp_path)
    dataset = TrajectoryDataset(tmp_path)
    rows, steps = dataset.transitions(), dataset.steps(3)
    working = steps.active[:-1]
    assert 0 < len(rows) == working.sum() < working.size
    np.testing.assert_array_equal(rows.observations, steps.observations[:-1][working])
    np.testing.assert_array_equal(rows.next_observations, steps.observations[1:][working])
    np.testing.assert_array_equal(rows.actions, steps.actions[working])


# Whole or not at all


def test_a_second_recording_into_one_folder_is_refused_while_the_first_is_under_way(tmp_path):
    pytest.importorskip("fcntl")
    told = []

    def second(*_):
        with pytest.raises(DatasetError, match="another command does; wait until it has ended"):
            record_dataset(plan(seeds=(4,)), tmp_path)
        told.append(True)

    record_dataset(plan(seeds=(3,)), tmp_path, progress=second)
    assert told
    assert [run.seed for run in TrajectoryDataset(tmp_path).runs] == [3]
    record_dataset(plan(seeds=(4,)), tmp_path)
    assert [run.seed for run in TrajectoryDataset(tmp_path).runs] == [3, 4]


@pytest.mark.parametrize("is_killed", [False, True])
def test_an_interrupted_recording_goes_on(is_killed, tmp_path, monkeypatch):
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    record_dataset(plan(seeds=(1, 2)), whole)
    save, calls = np.savez, []

    def interrupted(file, **arrays):
        calls.append(file)
        if len(calls) == 6:
            file.write(b"half of a chunk")
            raise KeyboardInterrupt
        save(file, **arrays)

    with monkeypatch.context() as patch:
        patch.setattr(np, "savez", interrupted)
        with pytest.raises(KeyboardInterrupt):
            record_dataset(plan(seeds=(1, 2)), cut)
    if is_killed:  # then the draft stays
        (cut / ".seed_000002_0001.npz.0123.tmp").write_bytes(b"half of a chunk")
    there = TrajectoryDataset(cut)
    assert [run.seed for run in there.runs] == [1]
    assert not there.is_complete
    first = summary_file(cut, 1).stat().st_mtime_ns, chunk_file(cut, 1, 0).stat().st_mtime_ns
    record_dataset(plan(seeds=(1, 2)), cut)
    assert first == (summary_file(cut, 1).stat().st_mtime_ns, chunk_file(cut, 1, 0).stat().st_mtime_ns)
    assert files(cut) == files(whole)
    assert TrajectoryDataset(cut).is_complete


def test_seeds_can_be_added_but_nothing_else_changed(tmp_path):
    record_dataset(plan(seeds=(1,)), tmp_path)
    record_dataset(plan(seeds=(2, 1)), tmp_path)
    assert TrajectoryDataset(tmp_path).card.seeds == (1, 2)
    with pytest.raises(DatasetError, match="another run"):
        record_dataset(plan("random"), tmp_path)
    with pytest.raises(DatasetError, match="other interface"):
        record_dataset(plan(observation="compact"), tmp_path)


def test_the_estimate_is_what_is_written(tmp_path):
    planned = plan()
    record_dataset(planned, tmp_path)
    written = sum(file.stat().st_size for file in tmp_path.glob("*.npz"))
    assert len(list(tmp_path.glob("*.npz"))) > 1
    assert 0.9 * planned.run_bytes < written <= planned.run_bytes
    packed = plan(compress=True)
    record_dataset(packed, tmp_path / "packed")
    assert sum(file.stat().st_size for file in (tmp_path / "packed").glob("*.npz")) < written / 2
    same = (TrajectoryDataset(folder).steps(3).observations for folder in (tmp_path, tmp_path / "packed"))
    np.testing.assert_array_equal(*same)


def test_a_disk_without_room_is_told_before_anything_is_run(tmp_path, monkeypatch):
    monkeypatch.setattr(recording.shutil, "disk_usage", lambda _: type("Usage", (), {"free": 1000})())
    with pytest.raises(OSError, match="free disk for the data set"):
        record_dataset(plan(), tmp_path / "new")
    assert not (tmp_path / "new").exists()


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Two runs of a scripted policy, of several chunks each."""
    folder = tmp_path_factory.mktemp("recorded")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recording, "CHUNK_BYTES", 60_000)
        record_dataset(plan(seeds=(3, 4)), folder)
    return folder


@pytest.fixture
def copied(recorded, tmp_path):
    return Path(shutil.copytree(recorded, tmp_path / "copied"))


def changed_chunk(folder, change):
    chunk = chunk_file(folder, 3, 0)
    with np.load(chunk) as arrays:
        values = dict(arrays)
    change(values)
    np.savez(chunk, **values)


def set_array(name, change):
    return lambda arrays: arrays.update({name: change(arrays[name])})


def with_nan(array):
    array[2, 1] = np.nan
    return array


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (set_array("active", lambda a: a[:-1]), r"Expected active to be an array \(\d+, 4\) of bool"),
        (set_array("observations", lambda a: a[:, :3]), "Expected observations to be an array"),
        (set_array("observations", lambda a: a[..., 1:]), "Expected observations to be an array"),
        (set_array("observations", with_nan), "Expected observations to hold finite numbers"),
        (set_array("observations", lambda a: a.astype(np.float64)), "of float32, got .* of float64"),
        (set_array("observations", lambda a: a.astype(">f4")), "Expected observations to be an array"),
        (set_array("rewards", lambda a: a.astype(str)), "Expected rewards to be an array"),
        (set_array("rewards", lambda a: a.astype(complex)), "Expected rewards to be an array"),
        (set_array("actions", with_nan), "Expected actions to hold finite numbers"),
        (set_array("actions", lambda a: a[..., :2]), "Expected actions to be an array"),
        (set_array("terminated", lambda a: a.astype(np.int8)), "Expected terminated to be an array"),
        (lambda arrays: arrays.pop("active"), "has no part 'active'"),
        (lambda arrays: arrays.update(more=np.zeros(10**7)), "bytes, but at most"),
    ],
)
def test_a_chunk_of_other_arrays_is_refused(copied, change, message):
    changed_chunk(copied, change)
    with pytest.raises(DatasetError, match=message) as refused:
        TrajectoryDataset(copied).steps(3)
    assert chunk_file(copied, 3, 0).name in str(refused.value)


def test_actions_that_nobody_could_choose_are_refused(tmp_path):
    record_dataset(plan("ppo_warehouse_small"), tmp_path)
    changed_chunk(tmp_path, set_array("actions", lambda a: a + 4))
    with pytest.raises(DatasetError, match="Expected actions from 0 to 5 in"):
        TrajectoryDataset(tmp_path).steps(3)


@pytest.mark.parametrize(
    ("file", "change", "message"),
    [
        ("dataset.json", {"seeds": 3}, "Expected seeds to be a list"),
        ("dataset.json", {"seeds": [3, 3]}, "Expected different seeds"),
        ("dataset.json", {"seeds": ["x"]}, r"Expected seeds\[0\] to be a whole number"),
        ("dataset.json", {"columns": None}, "Expected columns to be a list"),
        ("dataset.json", {"n_actions": "x"}, "Expected n_actions to be a whole number >= 1"),
        ("dataset.json", {"parts": [1]}, "Expected parts to be a table"),
        ("dataset.json", {"versions": {"a": 1}}, "Expected versions.a to be a text"),
        ("dataset.json", {"interface": 5}, "Expected interface to be a table"),
        ("dataset.json", {"interface": {"decision_ticks": 0}}, "decision_ticks"),
        ("dataset.json", {"run": {}}, "Missing key 'scenario'"),
        ("dataset.json", {"run": 5}, "Expected run to be a table"),
        ("dataset.json", {"schema_version": None}, "Expected schema_version to be a whole number"),
        ("seed_000003.json", {"seed": 4}, "to be of seed 3, got seed 4"),
        ("seed_000003.json", {"chunks": []}, "Expected chunks to have at least 1"),
        ("seed_000003.json", {"chunks": [0]}, r"Expected chunks\[0\] to be a whole number >= 1"),
        ("seed_000003.json", {"chunks": [10**9]}, "Expected at most 100 decisions in the chunks"),
        ("seed_000003.json", {"chunks": "x"}, "Expected chunks to be a list"),
        ("seed_000003.json", {"truncated": 1}, "Expected truncated to be True or False"),
        ("seed_000003.json", {"collected": -1}, "Expected collected to be a whole number >= 0"),
        ("seed_000003.json", {"colour": 1}, "Unknown key 'colour'"),
    ],
)
def test_cards_and_summaries_from_strangers_are_refused_by_the_name_of_the_field(copied, file, change, message):
    content = json.loads((copied / file).read_text())
    (copied / file).write_text(json.dumps(content | change))
    with pytest.raises(DatasetError, match=message) as refused:
        TrajectoryDataset(copied)
    assert file in str(refused.value)


def test_damaged_files_are_named(tmp_path):
    record_dataset(plan(), tmp_path)
    dataset = TrajectoryDataset(tmp_path)
    with pytest.raises(DatasetError, match="seeds 3, got seed 9"):
        dataset.steps(9)
    chunk = chunk_file(tmp_path, 3, 1)
    content = bytearray(chunk.read_bytes())
    content[len(content) // 2] ^= 1
    chunk.write_bytes(content)
    with pytest.raises(DatasetError, match=chunk.name):
        dataset.steps(3)
    card = json.loads((tmp_path / "dataset.json").read_text())
    (tmp_path / "dataset.json").write_text(json.dumps(card | {"schema_version": 9}))
    with pytest.raises(DatasetError, match="schema version 1"):
        TrajectoryDataset(tmp_path)
    (tmp_path / "dataset.json").unlink()
    with pytest.raises(DatasetError, match=r"dataset\.json"):
        TrajectoryDataset(tmp_path)


@pytest.mark.parametrize("seeds", [(), (1, 1), (-1,), (0.5,)])
def test_bad_seeds_are_refused(seeds):
    with pytest.raises(ConfigError, match="seed"):
        plan(seeds=seeds)


# For other libraries


def test_torch_reads_batches(tmp_path):
    torch = pytest.importorskip("torch")
    from swarm_forage_env.training.datasets.torch_data import TransitionData

    record_dataset(plan("ppo_warehouse_small"), tmp_path)
    data, rows = TransitionData(tmp_path), TrajectoryDataset(tmp_path).transitions()
    assert len(data) == len(rows) == 80
    (batch,) = torch.utils.data.DataLoader(data, batch_size=80)
    for name, values in batch.items():
        np.testing.assert_array_equal(values.numpy(), getattr(rows, name).astype(values.numpy().dtype))
    assert batch["rewards"].dtype == torch.float32


@pytest.mark.parametrize("policy", ["crw", "ppo_warehouse_small"])
def test_minari_gets_the_same_numbers(policy, tmp_path, monkeypatch):
    minari = pytest.importorskip("minari")
    from swarm_forage_env.training.datasets.minari_export import check_minari, export_minari

    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))
    folder = tmp_path / "ours"
    record_dataset(plan(policy, seeds=(3, 5)), folder)
    check_minari("swarm_forage/test-v0")
    export_minari(folder, "swarm_forage/test-v0", author="somebody")
    with pytest.raises(DatasetError, match="a new Minari data set"):
        check_minari("swarm_forage/test-v0")
    with pytest.raises(DatasetError, match=r"such as swarm_forage/dpo-v0, got 'test'"):
        check_minari("test")
    theirs, ours = minari.load_dataset("swarm_forage/test-v0"), TrajectoryDataset(folder)
    assert theirs.total_episodes == 2
    for episode, run in zip(theirs.iterate_episodes(), ours.runs, strict=True):
        steps = ours.steps(run.seed)
        np.testing.assert_array_equal(episode.observations, steps.observations)
        np.testing.assert_array_equal(episode.actions, steps.actions)
        np.testing.assert_array_equal(episode.rewards, steps.rewards.sum(axis=1))
        assert episode.observations[0] in theirs.observation_space
        assert episode.actions[0] in theirs.action_space
        assert not episode.terminations.any()
        assert np.flatnonzero(episode.truncations).tolist() == [len(steps) - 1]


def test_minari_recovers_the_environment_and_knows_reference_scores(tmp_path, monkeypatch):
    minari = pytest.importorskip("minari")
    from swarm_forage_env.training.datasets.minari_export import export_minari

    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))
    noisy = (parse_wrapper("sensor_noise:sigma=0.02"),)
    record_dataset(plan("dpo", seeds=(3, 5), wrappers=noisy, observation="compact"), tmp_path / "ours")
    export_minari(tmp_path / "ours", "swarm_forage/test-v0", author="somebody", ref_max_score=8.0)
    found = minari.load_dataset("swarm_forage/test-v0")
    env = found.recover_environment()
    first = next(found.iterate_episodes())
    obs, _ = env.reset(seed=3)
    for action, seen, reward in zip(first.actions, first.observations[1:], first.rewards, strict=True):
        obs, gained, *_ = env.step(action)
        np.testing.assert_array_equal(obs, seen)
        assert gained == reward
    assert found.storage.metadata["ref_max_score"] == 8.0
    low = found.storage.metadata["ref_min_score"]
    assert minari.get_normalized_score(found, np.array([low, 8.0])).tolist() == [0.0, 1.0]


def test_without_minari_the_error_says_what_to_install(tmp_path, monkeypatch):
    from swarm_forage_env.training.datasets.minari_export import export_minari

    monkeypatch.setitem(sys.modules, "minari", None)
    with pytest.raises(ImportError, match=r'pip install "\.\[minari\]"'):
        export_minari(tmp_path, "x-v0")
