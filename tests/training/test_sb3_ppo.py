"""`SwarmPPO` is the library's PPO, and does not ask the network about robots that are not at work."""

from typing import Any

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")

import torch
from stable_baselines3 import PPO

from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.training.sb3 import ActiveRolloutBuffer, SwarmPPO, SwarmVecEnv

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
    assert isinstance(buffer, ActiveRolloutBuffer)
    assert buffer.at_work(rows).all()
    assert len(buffer.returns) == len(rows)


@pytest.mark.parametrize("interface", [NUMBERED, DRIVEN], ids=["numbers", "values"])
@pytest.mark.parametrize("n_at_work", [8, 3, 0])
def test_choices_are_those_of_the_network_for_robots_at_work_and_zeros_for_others(interface, n_at_work):
    model = made(SwarmPPO, interface)
    assert isinstance(model, SwarmPPO)
    shape = model.action_space.shape
    assert model.observation_space.shape is not None
    assert shape is not None
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
