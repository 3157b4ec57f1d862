"""Networks with a memory: minibatches against slow twins, and trainings that go on, repeat and run from their files."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")
pytest.importorskip("sb3_contrib", reason="needs the train extra: sb3-contrib")

import torch
from gymnasium import spaces
from sb3_contrib.common.recurrent.type_aliases import RNNStates

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.wording import install_command
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.policies.network import Network
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.scenarios.presets import warehouse_small
from swarm_forage_env.training.evaluation_plan import EvaluationPlan
from swarm_forage_env.training.plan import Stage, TrainingPlan, read_plan
from swarm_forage_env.training.sb3 import SwarmVecEnv
from swarm_forage_env.training.sb3.recurrent import ActiveRecurrentBuffer, SwarmRecurrentPPO, batch_ends
from swarm_forage_env.training.sb3.training import train
from swarm_forage_env.views.pettingzoo import parallel_env
from swarm_forage_env.wrappers.world import World

N_CELLS = 6
NUMBERED = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5)
DRIVEN = InterfaceConfig(observation="compact", automatic_gripper=True, decision_ticks=5)
_RATES = {"birth": 0.03, "death": 0.004, "malfunction": 0.03, "repair": 0.05}
LIVES = "population:initial_robots=5," + ",".join(f"{event}_per_tick={rate}" for event, rate in _RATES.items())
"""Within a few decisions robots die, are born, break down and are repaired."""


def tiny_plan(**changes) -> TrainingPlan:
    """Two stages of two rollouts, in seconds."""
    plan = TrainingPlan(
        world=World(warehouse_small(n_robots=4, n_objects=20, horizon_s=200.0)),
        interface=DRIVEN,
        n_arenas=2,
        hidden=(8,),
        lstm=N_CELLS,
        options={"n_steps": 16, "batch_size": 64},
        stages=(Stage(steps=256), Stage(steps=256, options={"learning_rate": 1e-4})),
        evaluation=EvaluationPlan(every_steps=10_000, horizon_s=200.0, n_runs=1, baseline="random"),
    )
    return dataclasses.replace(plan, **changes)


def made(interface: InterfaceConfig = NUMBERED, **options) -> SwarmRecurrentPPO:
    """A model of eight robots in two arenas, whose runs of 30 decisions are shorter than two rollouts."""
    env = SwarmVecEnv("warehouse_small", n_robots=8, n_arenas=2, interface=interface, horizon_s=30.0, wrappers=[LIVES])
    network = {"net_arch": [8], "lstm_hidden_size": N_CELLS, "shared_lstm": True, "enable_critic_lstm": False}
    return SwarmRecurrentPPO(
        "MlpLstmPolicy",
        env,
        n_steps=24,
        batch_size=64,
        n_epochs=2,
        rollout_buffer_kwargs=env.rollout_buffer_kwargs,
        device="cpu",
        **{"policy_kwargs": network, "seed": 0, **options},
    )


def weights(model) -> np.ndarray:
    return torch.cat([value.flatten() for value in model.policy.state_dict().values()]).numpy()


def random_buffer(seed: int, n_steps: int = 9, n_rows: int = 7) -> ActiveRecurrentBuffer:
    """A rollout of rows that come, go, are repaired and begin episodes at random; the last row is to spare.

    Advantages are numbers of the steps, row by row, from 1.
    """
    rng = np.random.default_rng(seed)
    buffer = ActiveRecurrentBuffer(
        n_steps, spaces.Box(-1, 1, (3,)), spaces.Discrete(3), n_envs=n_rows, gamma=0.9, gae_lambda=0.8, active_column=1
    )
    is_here = np.arange(n_rows) < n_rows - 1
    for _ in range(n_steps):
        is_here = np.where(rng.random(n_rows) < 0.2, ~is_here, is_here) & (np.arange(n_rows) < n_rows - 1)
        obs = rng.uniform(0.1, 1.0, (n_rows, 3))
        obs[:, 1] = rng.random(n_rows) < 0.7
        numbers = torch.from_numpy(rng.normal(size=(2, n_rows)))
        starts = (rng.random(n_rows) < 0.1).astype(np.float32)
        buffer.add(obs * is_here[:, None], rng.integers(3, size=(n_rows, 1)), rng.normal(size=n_rows), starts, *numbers)
    buffer.compute_returns_and_advantage(torch.zeros(n_rows), np.zeros(n_rows))
    buffer.advantages = 1.0 + np.arange(n_steps * n_rows, dtype=np.float32).reshape(n_rows, n_steps).T
    buffer.memories = RNNStates(*(tuple(torch.rand(1, n_rows, 2) + 1.0 for _ in range(2)) for _ in range(2)))
    return buffer


def sequences_by_hand(buffer: ActiveRecurrentBuffer) -> dict[int, tuple[list[int], list[bool], np.ndarray]]:
    """First number of each sequence -> its numbers, which of them teach, and the hidden state it begins with."""
    found = {}
    for row in range(buffer.n_envs):
        sequence: list[int] = []
        for step in range(buffer.buffer_size):
            number = int(buffer.advantages[step, row])
            is_here = bool(buffer.observations[step, row].any())
            if not is_here or buffer.episode_starts[step, row]:
                sequence = []
            if not is_here:
                continue
            if not sequence:
                remembers = step == 0 and not buffer.episode_starts[step, row]
                hidden = buffer.memories.pi[0][0, row].numpy()
                found[number] = sequence, [], hidden if remembers else 0.0 * hidden
            sequence.append(number)
            found[sequence[0]][1].append(buffer.observations[step, row, 1] == 1.0)
    return {number: told for number, told in found.items() if any(told[1])}


@pytest.mark.parametrize("batch_size", [None, 8, 1])
@pytest.mark.parametrize("seed", range(4))
def test_minibatches_are_the_sequences_of_a_slow_twin(seed, batch_size):
    buffer = random_buffer(seed)
    expected = sequences_by_hand(buffer)
    assert any(not all(taught) for _, taught, _ in expected.values())
    assert any(hidden.any() for *_, hidden in expected.values())
    assert len(expected) >= buffer.n_envs
    by_number = {name: getattr(buffer, name).swapaxes(0, 1).reshape(63, -1).copy() for name in ("actions", "returns")}
    seen = buffer.observations.swapaxes(0, 1).reshape(63, 3).copy()
    orders = []
    for _ in range(2):  # each epoch has all of them
        found = {}
        for batch in buffer.get(batch_size):
            assert not batch.episode_starts.any()
            hidden = batch.lstm_states.pi[0][0].numpy()
            numbers = batch.advantages.numpy().astype(int)
            is_step = numbers > 0
            np.testing.assert_array_equal(batch.observations.numpy()[is_step], seen[numbers[is_step] - 1])
            np.testing.assert_array_equal(batch.actions.numpy()[is_step], by_number["actions"][numbers[is_step] - 1])
            np.testing.assert_array_equal(batch.returns.numpy()[is_step], by_number["returns"][numbers[is_step] - 1, 0])
            assert not batch.observations.numpy()[~is_step].any()
            for k, (line, mask) in enumerate(
                zip(numbers.reshape(len(hidden), -1), batch.mask.numpy().reshape(len(hidden), -1), strict=True)
            ):
                told = [int(number) for number in line if number]
                assert not line[len(told) :].any()
                assert not mask[len(told) :].any()
                found[told[0]] = told, list(mask[: len(told)] == 1.0), hidden[k]
        orders.append(list(found))
        assert found.keys() == expected.keys()
        for number, (told, taught, begun) in expected.items():
            assert found[number][:2] == (told, taught)
            np.testing.assert_array_equal(found[number][2], begun)
    assert orders[0] != orders[1]
    assert len(buffer.returns) == sum(sum(taught) for _, taught, _ in expected.values())


@pytest.mark.parametrize(
    ("sizes", "least", "ends"),
    [
        ([3, 1, 4, 2, 2], 4, [2, 3, 5]),
        ([4, 4, 2], 4, [1, 3]),  # a rest of half the size is added to the minibatch before
        ([4, 4, 3], 4, [1, 2, 3]),
        ([1, 1], 4, [2]),
        ([9], 4, [1]),
    ],
)
def test_minibatches_have_at_least_their_size(sizes, least, ends):
    assert batch_ends(np.array(sizes), least) == ends


@pytest.mark.parametrize("n_at_work", [0, 1])
def test_a_rollout_without_two_steps_at_work_says_so(n_at_work):
    buffer = ActiveRecurrentBuffer(2, spaces.Box(0, 1, (1,)), spaces.Discrete(2), active_column=0)
    one = torch.ones(1)
    for k in range(2):
        buffer.add(np.full((1, 1), float(k < n_at_work)), np.zeros((1, 1)), np.zeros(1), np.zeros(1), one, one)
    buffer.compute_returns_and_advantage(one, np.zeros(1))
    with pytest.raises(ValueError, match=f"two steps of robots at work in the rollout, got {n_at_work}"):
        next(buffer.get())


@pytest.mark.parametrize("interface", [NUMBERED, DRIVEN], ids=["numbers", "values"])
def test_robots_remember_through_repairs_and_not_through_deaths_births_and_ends(interface):
    """Step by step and row by row, and then by the minibatches: the same log probabilities as in the rollout."""
    model = made(interface)
    env, buffer = model.get_env(), model.rollout_buffer
    assert env is not None
    assert isinstance(buffer, ActiveRecurrentBuffer)
    _, callback = model._setup_learn(1000)
    state = np.zeros((env.num_envs, 2, N_CELLS), np.float32)
    happened = np.zeros(5, int)
    for _ in range(3):
        model.collect_rollouts(env, callback, buffer, 24)
        present, at_work = buffer.present(buffer.observations), buffer.at_work(buffer.observations)
        starts = buffer.episode_starts == 1.0
        come, gone = present[1:] & ~present[:-1], ~present[1:] & present[:-1]
        repaired = at_work[1:] & ~at_work[:-1] & present[:-1]
        happened += [(come & ~starts[1:]).sum(), (gone & starts[1:]).sum(), repaired.sum(),
                     (present & ~at_work).sum(), (starts[1:] & present[1:] & present[:-1]).sum()]  # fmt: skip
        for step in range(24):
            for row in range(env.num_envs):
                if starts[step, row] or not present[step, row]:
                    state[row] = 0.0
                if step == 0 and present[step, row] and not starts[step, row]:
                    kept = [part[0, row].numpy() for part in buffer.memories.pi]
                    np.testing.assert_allclose(kept, state[row], rtol=1e-4, atol=1e-6)
                if present[step, row]:
                    log_prob, state[row] = answered(model, buffer, step, row, state[row])
                    np.testing.assert_allclose(buffer.log_probs[step, row], log_prob, rtol=1e-4, atol=1e-5)
                else:
                    assert not buffer.actions[step, row].any()
                    assert buffer.log_probs[step, row] == 0.0
        for batch in buffer.get(64):
            actions = batch.actions.long().flatten() if interface is NUMBERED else batch.actions
            with torch.no_grad():
                values, log_probs, _ = model.policy.evaluate_actions(
                    batch.observations, actions, batch.lstm_states, batch.episode_starts
                )
            taught = batch.mask == 1.0
            np.testing.assert_allclose(log_probs[taught], batch.old_log_prob[taught], rtol=1e-4, atol=1e-5)
            np.testing.assert_allclose(values.flatten()[taught], batch.old_values[taught], rtol=1e-4, atol=1e-5)
    assert happened.all(), happened


def answered(model, buffer, step: int, row: int, state: np.ndarray) -> tuple[float, np.ndarray]:
    """Log probability of what a row did in a step, and what it remembers afterwards."""
    before = tuple(torch.from_numpy(part.copy()).reshape(1, 1, -1) for part in state)
    seen = torch.from_numpy(buffer.observations[step, row])[None]
    action = torch.from_numpy(buffer.actions[step, row])
    with torch.no_grad():
        distribution, after = model.policy.get_distribution(seen, before, torch.zeros(1))
        log_prob = distribution.log_prob(action if model.action_space.shape == () else action[None])
    return float(log_prob), np.stack([part.numpy().ravel() for part in after])


def test_values_at_time_limits_are_those_of_what_robots_remember(monkeypatch):
    model = made(gamma=0.5)
    rewards, rows = np.zeros(16), torch.tensor([2, 11])
    for k, memory in enumerate((*model._memories.pi, *model._memories.vf)):
        memory[:] = torch.rand(memory.shape, generator=torch.Generator().manual_seed(k))
    obs = np.random.default_rng(0).random((16, *model.observation_space.shape), np.float32)
    infos = [{"TimeLimit.truncated": row in (2, 11), "terminal_observation": obs[row]} for row in range(16)]
    model._add_values_at_time_limits(rewards, [1, 2, 11], infos)
    expected = []
    for row in rows.tolist():
        memory = tuple(part[:, row : row + 1] for part in model._memories.vf)
        with torch.no_grad():
            expected.append(0.5 * model.policy.predict_values(torch.from_numpy(obs[[row]]), memory, torch.zeros(1)))
    np.testing.assert_allclose(rewards[rows], torch.cat(expected).numpy().ravel(), rtol=1e-5)
    assert np.flatnonzero(rewards).tolist() == [2, 11]


def test_it_learns_and_gives_the_same_bits_for_a_seed():
    before, one, other = weights(made()), made().learn(768), made().learn(768)
    assert np.array_equal(weights(one), weights(other))
    assert np.abs(weights(one) - before).max() > 1e-3
    assert not np.array_equal(
        one.policy.lstm_actor.weight_hh_l0.detach(), made().policy.lstm_actor.weight_hh_l0.detach()
    )
    assert not np.array_equal(weights(one), weights(made(seed=1).learn(768)))


def test_a_memory_of_its_own_for_the_critic_is_kept_too():
    model = made(policy_kwargs={"net_arch": [8], "lstm_hidden_size": N_CELLS}).learn(384)
    assert not torch.equal(model._memories.pi[0], model._memories.vf[0])
    with pytest.raises(ValueError, match="use_sde=False"):
        made(DRIVEN, use_sde=True)


@pytest.fixture(scope="module")
def trained(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("trained")
    train(tiny_plan(stages=(Stage(steps=256),)), folder)
    return folder


def test_a_training_keeps_a_network_that_chooses_as_its_model(trained):
    network = Network.load(trained / "policy.npz")
    assert network.n_cells == N_CELLS
    assert network.about.card["plan"]["lstm"] == N_CELLS
    assert "sb3-contrib" in network.about.card["versions"]
    assert read_plan(trained / "plan.json").lstm == N_CELLS
    model = SwarmRecurrentPPO.load(trained / "model.zip", device="cpu")

    arena = parallel_env("warehouse_small", n_robots=3, n_objects=20)
    interface = LearnerInterface(DRIVEN, arena.swarm_spec)
    policies = [load_policy(trained / name) for name in ("policy.npz", "model.zip")]
    for policy in policies:
        policy.reset(arena.swarm_spec, np.random.default_rng(0))
    obs, state = arena.reset_batch(1), None
    for tick in range(100):
        if tick % DRIVEN.decision_ticks == 0:
            seen = interface.observe(obs)
            choice, state = model.predict(seen, state=state, deterministic=True)
        actions = interface.command(choice, obs)
        for policy in policies:
            np.testing.assert_allclose(policy.act(obs, arena.active), actions, atol=1e-5)
        obs, *_ = arena.step_batch(actions)
    assert np.abs(choice - model.predict(seen, deterministic=True)[0]).max() > 1e-3


def test_a_training_goes_on_where_it_stopped_and_repeats_by_its_seed(trained, tmp_path):
    whole = train(tiny_plan(), tmp_path / "a").model
    first = SwarmRecurrentPPO.load(trained / "model.zip", device="cpu")
    tiny_plan(stages=(Stage(steps=256),)).write(trained / "plan.json")
    resumed = train(tiny_plan(), trained, resume=True)
    assert resumed.steps == 256
    assert resumed.model.learning_rate == 1e-4
    assert not np.array_equal(weights(first), weights(resumed.model))
    assert np.array_equal(weights(whole), weights(resumed.model))  # stages begin as resumed trainings do


def test_what_cannot_be_is_refused(tmp_path, monkeypatch):
    with pytest.raises(ConfigError, match="lstm only with ppo, got dqn"):
        tiny_plan(algorithm="dqn", interface=NUMBERED)
    with pytest.raises(ConfigError, match="lstm to be a whole number from 0 to 10,000, got -1"):
        tiny_plan(lstm=-1)
    with pytest.raises(ConfigError, match="'lstm_hidden_size': the plan says it in 'lstm'"):
        train(tiny_plan(options={"lstm_hidden_size": 8}), tmp_path / "a")
    with pytest.raises(ConfigError, match="use_sde=False with an LSTM"):
        train(tiny_plan(options={"use_sde": True}), tmp_path / "a")
    monkeypatch.setitem(sys.modules, "sb3_contrib", None)
    monkeypatch.delitem(sys.modules, "swarm_forage_env.training.sb3.recurrent")
    with pytest.raises(ImportError, match="LSTM needs sb3-contrib") as refusal:
        train(tiny_plan(), tmp_path / "a")
    assert install_command("train") in str(refusal.value)
    assert not (tmp_path / "a").exists()


def test_plans_of_earlier_days_have_no_memory():
    written = tiny_plan(lstm=0).to_mapping()
    assert written.pop("lstm") == 0
    assert TrainingPlan.from_mapping(written) == tiny_plan(lstm=0)
