"""`SwarmPPO` is the library's PPO, and does not ask the network about robots that are not at work."""

from typing import Any

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")

import torch
from gymnasium import spaces
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.callbacks import BaseCallback

from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.network import Network
from swarm_forage_env.training.sb3 import ActiveRolloutBuffer, PresentReplayBuffer, SwarmPPO, SwarmVecEnv
from swarm_forage_env.training.sb3.export import export_network
from tests.support import lives

NUMBERED = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5)
DRIVEN = InterfaceConfig(observation="compact", automatic_gripper=True, decision_ticks=5)


def made(kind: type[PPO], interface: InterfaceConfig = NUMBERED, **fields: Any) -> PPO:
    """An algorithm for eight robots in two arenas whose runs are shorter than a rollout."""
    env = SwarmVecEnv("warehouse_small", n_robots=4, n_arenas=2, interface=interface, horizon_s=20.0, **fields)
    return kind(
        "MlpPolicy",
        env,
        n_steps=32,
        batch_size=64,
        n_epochs=2,
        ent_coef=0.01,
        policy_kwargs={"net_arch": [8]},
        rollout_buffer_class=ActiveRolloutBuffer,
        rollout_buffer_kwargs=env.rollout_buffer_kwargs,
        seed=0,
        device="cpu",
    )


def weights(model: PPO) -> np.ndarray:
    return torch.cat([value.flatten() for value in model.policy.state_dict().values()]).numpy()


@pytest.mark.parametrize("interface", [NUMBERED, DRIVEN], ids=["numbers", "values"])
def test_it_learns_what_ppo_learns(interface):
    ours, theirs = (made(kind, interface, first_pickup=1.0, tick=-0.1).learn(256) for kind in (SwarmPPO, PPO))
    for name in ("observations", "actions", "values", "log_probs", "advantages", "returns"):
        numbers = getattr(ours.rollout_buffer, name), getattr(theirs.rollout_buffer, name)
        np.testing.assert_allclose(*numbers, rtol=1e-5, atol=1e-6, err_msg=name)
    told = [[info["r"] for info in model.ep_info_buffer or ()] for model in (ours, theirs)]
    assert told[0] == told[1]
    assert len(told[0]) == 8
    assert np.abs(weights(theirs) - weights(made(PPO, interface))).max() > 1e-3
    np.testing.assert_allclose(weights(ours), weights(theirs), rtol=0.0, atol=2e-6)


def test_it_asks_about_robots_at_work_only(monkeypatch):
    model = made(SwarmPPO, wrappers=["population:malfunction_per_tick=0.05,repair_per_tick=0.05"])
    forward, asked = model.policy.forward, []
    monkeypatch.setattr(model.policy, "forward", lambda rows: (asked.append(rows), forward(rows))[1])
    model.learn(256)
    rows = torch.cat(asked).numpy()
    assert 0 < len(rows) < 256
    buffer = model.rollout_buffer
    assert buffer.at_work(rows).all()
    assert len(buffer.returns) == len(rows)


@pytest.mark.parametrize("interface", [NUMBERED, DRIVEN], ids=["numbers", "values"])
@pytest.mark.parametrize("n_at_work", [8, 3, 0])
def test_choices_are_those_of_the_network_for_robots_at_work_and_zeros_for_others(interface, n_at_work):
    model = made(SwarmPPO, interface)
    shape = model.action_space.shape
    obs = np.random.default_rng(1).normal(size=(8, *model.observation_space.shape)).astype(np.float32)
    at_work = np.isin(np.arange(8), [6, 1, 4, 0, 2, 3, 5, 7][:n_at_work])
    actions, values, log_probs = model._chosen(obs, at_work)
    assert (actions.shape, values.shape, log_probs.shape) == ((8, *shape), (8, 1), (8,))
    for array in (actions, values.numpy(), log_probs.numpy()):
        assert not array[~at_work].any()
    if n_at_work:
        with torch.no_grad():
            rows, chosen = torch.as_tensor(obs[at_work]), torch.as_tensor(actions[at_work])
            expected_values, expected_log_probs, _ = model.policy.evaluate_actions(rows, chosen)
        np.testing.assert_allclose(values.numpy()[at_work], expected_values.numpy(), rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(log_probs.numpy()[at_work], expected_log_probs.numpy(), rtol=1e-5, atol=1e-6)
        assert np.abs(expected_log_probs.numpy()).min() > 0.0


VALUE = 4.0
"""What the network of these tests thinks of every state."""
GAMMA = 0.5
RETURNS = {
    # lambda = 1: discounted rewards to the end of the episode, plus gamma VALUE where it was cut off.
    1.0: [
        [2.0625, 1.5, 1.3125],
        [2.125, 1.0, 0.625],
        [2.25, 0.0, np.nan],
        [2.5, np.nan, np.nan],
        [3.0, np.nan, 3.0],
        [3.0, 3.0, 3.0],
    ],
    # lambda = 0: reward plus gamma times the next value. Robot 2 waits from tick 3 on and is next judged before tick
    # 5, so that what follows tick 2 is worth gamma (0 + gamma (1 + gamma VALUE)) = 0.75.
    0.0: [
        [3.0, 3.0, 3.0],
        [3.0, 3.0, 0.75],
        [3.0, 0.0, np.nan],
        [3.0, np.nan, np.nan],
        [3.0, np.nan, 3.0],
        [3.0, 3.0, 3.0],
    ],
}
"""lambda -> return per tick and robot of the story in `lives`; nan = does not teach."""


class _Story(BaseCallback):
    """Changes the population between the steps of a rollout."""

    def _on_rollout_start(self) -> None:
        self._change(0)

    def _on_step(self) -> bool:
        self._change(self.n_calls)
        return True

    def _change(self, done: int) -> None:
        if done in lives.CHANGES:
            self.training_env.env_method("set_population", **lives.CHANGES[done])


def constant_value_ppo(env: SwarmVecEnv, gae_lambda: float) -> PPO:
    model = PPO(
        "MlpPolicy",
        env,
        n_steps=lives.N_TICKS,
        batch_size=6,
        gamma=GAMMA,
        gae_lambda=gae_lambda,
        policy_kwargs={"net_arch": [4]},
        rollout_buffer_class=ActiveRolloutBuffer,
        rollout_buffer_kwargs=env.rollout_buffer_kwargs,
        seed=0,
        device="cpu",
    )
    with torch.no_grad():
        model.policy.value_net.weight.zero_()
        model.policy.value_net.bias.fill_(VALUE)
    return model


@pytest.mark.parametrize("gae_lambda", sorted(RETURNS))
def test_a_rollout_of_ppo_with_a_death_a_repair_and_a_time_limit_by_hand(gae_lambda):
    env = SwarmVecEnv(**lives.WORLD, interface=InterfaceConfig(observation="compact"))
    model = constant_value_ppo(env, gae_lambda)
    _, callback = model._setup_learn(lives.N_TICKS * lives.N_ROBOTS, _Story())
    model.collect_rollouts(env, callback, model.rollout_buffer, lives.N_TICKS)
    expected = np.array(RETURNS[gae_lambda])
    taught = lives.ACTIVE_BEFORE
    np.testing.assert_array_equal(np.isnan(expected), ~taught)
    np.testing.assert_allclose(model.rollout_buffer.returns[taught], expected[taught], rtol=1e-6)
    batches = list(model.rollout_buffer.get(4))
    assert [len(batch.returns) for batch in batches] == [4, 4, 4, 2]
    drawn = torch.cat([batch.returns for batch in batches]).numpy()
    np.testing.assert_allclose(np.sort(drawn), np.sort(expected[taught]), rtol=1e-6)
    seen = torch.cat([batch.observations for batch in batches]).numpy()
    assert np.all(seen[:, env.interface.active_column] == 1.0)
    assert len(next(model.rollout_buffer.get()).returns) == 14


def filled_replay(present: list[list[bool]]) -> PresentReplayBuffer:
    """A memory whose observations count steps and rows from 1, zeros where nobody is present."""
    shape = np.shape(present)
    buffer = PresentReplayBuffer(shape[0] * shape[1], spaces.Box(-1, 99, (2,)), spaces.Discrete(3), n_envs=shape[1])
    for step, row in enumerate(present):
        obs = np.array([[step + 1, robot + 1] if there else [0, 0] for robot, there in enumerate(row)], np.float32)
        done = np.full(shape[1], step == 1)
        infos = [{"TimeLimit.truncated": step == 1 and robot == 0} for robot in range(shape[1])]
        buffer.add(obs, obs + 0.5, np.zeros(shape[1], np.int64), np.full(shape[1], float(step)), done, infos)
    return buffer


def test_replay_draws_every_present_step_and_no_other():
    present = [[True, False, True], [True, True, False], [False, False, True]]
    samples = filled_replay(present).sample(400)
    drawn = {tuple(pair) for pair in samples.observations.numpy().astype(int).tolist()}
    assert drawn == {(1, 1), (1, 3), (2, 1), (2, 2), (3, 3)}
    steps, robots = samples.observations.numpy().astype(int).T - 1
    np.testing.assert_array_equal(samples.rewards.numpy().ravel(), steps)
    np.testing.assert_array_equal(samples.next_observations.numpy(), samples.observations.numpy() + 0.5)
    # Step 1 ends episodes: by time for robot 0, which is bootstrapped, by death for the others.
    np.testing.assert_array_equal(samples.dones.numpy().ravel(), (steps == 1) & (robots != 0))


@pytest.mark.parametrize(
    ("algorithm", "interface", "fields"),
    [
        (PPO, NUMBERED, {}),
        (PPO, DRIVEN, {}),
        (PPO, DRIVEN, {"neighbours_seen": 3, "neighbour_range_m": 1.5, "message_size": 2}),
        (DQN, NUMBERED, {}),
    ],
)
def test_exported_networks_choose_as_the_model_does(algorithm, interface, fields, tmp_path):
    env = SwarmVecEnv("warehouse_small", n_robots=30, n_objects=100, interface=interface, **fields)
    interface = env.interface.config
    size = {"buffer_size": 100} if algorithm is DQN else {"n_steps": 8, "batch_size": 240}
    model = algorithm("MlpPolicy", env, seed=3, device="cpu", **size)
    network = export_network(model, interface)
    network.save(tmp_path / "network.npz")
    network = Network.load(tmp_path / "network.npz")
    env.seed(0)
    obs = env.reset()
    for _ in range(20):
        expected, _ = model.predict(obs, deterministic=True)
        outputs = network.outputs(obs)
        chosen = outputs.argmax(axis=1) if interface.actions == "discrete" else np.clip(outputs, -1.0, 1.0)
        np.testing.assert_allclose(chosen, expected, atol=1e-5)
        obs, *_ = env.step(expected)


def test_a_wait_is_one_transition_for_lambda_too():
    # One robot, at work in steps 0 and 3 and away between; values 4, rewards 1 at work, gamma = lambda = 1/2.
    buffer = ActiveRolloutBuffer(
        4, spaces.Box(0, 1, (1,)), spaces.Box(-1, 1, (1,)), gamma=0.5, gae_lambda=0.5, active_column=0
    )
    for active in (1.0, 0.0, 0.0, 1.0):
        there, value = np.full(1, active), torch.full((1,), VALUE)
        buffer.add(there[None], np.zeros((1, 1)), there, np.zeros(1), value, torch.zeros(1))
    buffer.compute_returns_and_advantage(torch.full((1,), VALUE), np.zeros(1))
    # Step 3: 1 + 4/2 - 4 = -1. Step 0: 1 + 4/8 - 4 = -2.5, and lambda gamma^3 = 1/16 of the -1 after the wait.
    np.testing.assert_allclose(buffer.advantages[[0, 3], 0], [-2.5625, -1.0])
