"""The script that trains QMIX carries out a plan; `scripts/test_bridges torchrl` installs what it needs."""

import importlib

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.network import Network
from swarm_forage_env.training.plan import read_plan
from tests.bridges.test_pages import ROOT, check_runs, require, run
from tests.bridges.test_rivals import PLAN as PLAN_OF_PPO

PLAN = """
algorithm = "dqn"
n_arenas = 2
hidden = [16]
interface = { observation = "compact", actions = "discrete", automatic_gripper = true, decision_ticks = 5 }
options = { train_freq = 16, gradient_steps = 2, batch_size = 8, learning_starts = 32, n_steps = 3 }
sampler.scenario = { horizon_s = 20.0, interval_s = 20.0, nest_progress = 0.05 }
sampler.worlds = [{ scenario = { preset = "warehouse_small", n_robots = 4, n_objects = 20 } }]
stages = [{ steps = 384 }, { steps = 256, options = { gamma = 0.9 } }]
[evaluation]
every_steps = 256
[[evaluation.worlds]]
scenario = { preset = "warehouse_small", n_robots = 5, n_objects = 20, horizon_s = 200.0 }
baseline = "random"
"""


@pytest.fixture
def qmix(monkeypatch):
    require("torchrl", "torchrl")
    monkeypatch.syspath_prepend(ROOT / "scripts")
    return importlib.import_module("torchrl_qmix")


def test_qmix_carries_out_a_plan(tmp_path):
    require("torchrl", "torchrl")
    (tmp_path / "plan.toml").write_text(PLAN)
    for out in ("one", "two"):
        words = ["--plan", "plan.toml", "--seed", "3", "--out", out]
        lines = run([str(ROOT / "scripts" / "torchrl_qmix.py"), *words], tmp_path).splitlines()
        told = [int(line.split()[0].replace(",", "")) for line in lines if "decisions" in line]
        assert told == [256, 384, 640]
    check_runs(tmp_path / "one" / "policy.npz")
    one, two = (Network.load(tmp_path / out / "policy.npz") for out in ("one", "two"))
    assert (one.about.samples, one.about.card["plan"]["seed"]) == (False, 3)
    assert one.about.card["evaluation"]["steps"] in told
    assert all(np.array_equal(mine, other) for mine, other in zip(one.weights, two.weights, strict=True)), "equal seeds"


def test_qmix_refuses_worlds_of_several_numbers_of_robots_and_plans_of_others(qmix, tmp_path):
    another = ', { scenario = "warehouse_small" }]\nstages'
    several = PLAN.replace("]\nstages", another)
    (tmp_path / "plan.toml").write_text(several)
    plan = read_plan(tmp_path / "plan.toml")
    with pytest.raises(SystemExit, match="fixed numbers of robots"):
        qmix.Training(plan, tmp_path / "out").carry_out()
    other = read_plan(PLAN_OF_PPO)
    with pytest.raises(ConfigError, match=r"a plan of dqn .* got a plan of ppo"):
        qmix.Training(other, tmp_path / "other")


def test_the_mixer_of_qmix_values_no_robot_less_where_its_own_value_is_higher(qmix):
    import torch

    torch.manual_seed(0)
    mixer, seen = qmix.SwarmMixer(5, 3, 8), torch.rand(4, 3, 5)
    values = torch.randn(4, 3, 1, requires_grad=True)
    mixed = mixer(values, seen)
    mixed.sum().backward()
    assert mixed.shape == (4, 1)
    assert values.grad is not None
    assert (values.grad > 0.0).all()
    assert (mixer(values, seen + 0.5) != mixed).all(), "it sees the swarm"


class FiveSteps:
    """An arena of two robots; its first run ends by time in step 2."""

    n_arenas, n_robots = 1, 2
    seen = np.arange(12, dtype=np.float32).reshape(6, 2, 1) / 10
    final = np.float32([[0.7], [0.9]])

    def __init__(self):
        self.k = 0

    def step(self, actions):
        k, self.k = self.k, self.k + 1
        infos = {"active": np.ones(2, bool)}
        if k == 2:
            infos["final_obs"] = np.array([*self.final, None], dtype=object)[:2]
        is_over = np.full(2, k == 2)
        return self.seen[k + 1], np.float32([k, 1.0]), np.zeros(2, bool), is_over, infos


def test_qmix_adds_up_what_the_swarm_earns_in_some_decisions_and_stops_where_a_run_ends(qmix):
    learner = qmix.Learner(1, 2, 2, (8,), qmix.OPTIONS)
    options = {**qmix.OPTIONS, "train_freq": 5, "n_steps": 2, "gamma": 0.5}
    batch, obs = qmix.rollout(FiveSteps(), learner, FiveSteps.seen[0], options, 0.5, np.random.default_rng(0))
    rewards = 1.0 + np.arange(5)
    np.testing.assert_allclose(batch["agents", "observation"][0], FiveSteps.seen[:5])
    np.testing.assert_allclose(
        batch["next", "reward"].flatten(), [1.0 + 0.5 * 2.0, 2.0 + 0.5 * 3.0, 3.0, 4.0 + 0.5 * 5.0, rewards[4]]
    )
    assert batch["steps_to_next_obs"].flatten().tolist() == [2, 2, 1, 2, 1]
    led_to = [FiveSteps.seen[2], FiveSteps.final, FiveSteps.final, FiveSteps.seen[5], FiveSteps.seen[5]]
    np.testing.assert_allclose(batch["next", "agents", "observation"][0], led_to)
    np.testing.assert_array_equal(obs, FiveSteps.seen[5])
    assert not batch["next", "terminated"].any()


def test_qmix_learns_which_of_the_actions_of_a_robot_pays_the_swarm(qmix):
    import torch
    from tensordict import TensorDict

    torch.manual_seed(0)
    options = {**qmix.OPTIONS, "gradient_steps": 150, "gamma": 0.1, "learning_rate": 0.01}
    learner = qmix.Learner(2, 3, 2, (8,), options)
    which = torch.eye(2).expand(300, 2, 2)  # each robot sees which one it is
    actions = torch.randint(3, (300, 2))
    pays = (actions[:, 0] == 2).float() + (actions[:, 1] == 1).float()
    over = torch.zeros(300, 1, dtype=torch.bool)
    following = {"agents": {"observation": which}, "reward": pays[:, None], "done": over, "terminated": over}
    learner.memory.extend(
        TensorDict({"agents": {"observation": which, "action": actions}, "next": following}, [300]).exclude()
    )
    learner.update(options)
    rng, nobody = np.random.default_rng(0), np.zeros(2, bool)
    assert learner.choose(np.eye(2, dtype=np.float32), nobody, rng).tolist() == [2, 1]
    drawn = learner.choose(np.zeros((200, 2), np.float32), np.ones(200, bool), rng)
    assert sorted(set(drawn.tolist())) == [0, 1, 2], "who explores takes any"
