"""The scripts behind entries of the benchmark carry out a plan, with libraries that `scripts/test_bridges` installs."""

import importlib
import json
from dataclasses import replace

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.network import Network
from swarm_forage_env.training.evaluations import read_training
from swarm_forage_env.training.plan import read_plan
from tests.bridges.test_pages import ROOT, check_runs, require, run

PLAN = ROOT / "tests" / "support" / "tiny_plan.toml"
ENTRIES = ROOT / "docs" / "benchmark"
ELSEWHERE = ENTRIES / "plans" / "minute.toml"
MIXED = "qmix"
"""The plan with one world, because a mixer takes one number of robots."""
PLANS = sorted({*(ENTRIES / "plans").glob("*.toml")} - {ELSEWHERE, ENTRIES / "plans" / "qmix_classroom.toml"})


@pytest.mark.parametrize("path", PLANS, ids=lambda path: path.stem)
def test_rivals_train_in_the_training_worlds_as_they_are(path):
    """Their last stages; nothing disturbs them, and no world has another number of robots than its preset."""
    from metrics.benchmark import load_protocol

    given = [each.world for each in load_protocol().worlds if not each.is_held_out]
    if path.stem == MIXED:
        given = [world for world in given if world.scenario.name == "warehouse_small"]
    wanted = {world.scenario.name: world.n_robots for world in given}
    plan = read_plan(path)
    assert plan.sampler is not None
    for sampler in (plan.sampler, *(stage.sampler for stage in plan.stages if stage.sampler)):
        assert {config.name: config.robots.n_robots for config in sampler.corners} == wanted
        assert not sampler.wrappers
        assert not any(world.wrappers for world in sampler.worlds)
    assert plan.stages[-1].sampler is None
    sizes = {config.name: (config.arena.width_m, config.arena.height_m) for config in plan.sampler.corners}
    own = [world.scenario for world in given]
    assert sizes == {config.name: (config.arena.width_m, config.arena.height_m) for config in own}


def test_the_entry_of_a_plan_that_trains_elsewhere_says_so():
    entry = json.loads((ENTRIES / f"{ELSEWHERE.stem}.json").read_text(encoding="utf-8"))
    assert entry["training"]["worlds"] == "other"
    assert ELSEWHERE.name in entry["training"]["command"]


@pytest.fixture
def mappo(monkeypatch):
    require("torchrl", "torchrl")
    monkeypatch.syspath_prepend(ROOT / "scripts")
    return importlib.import_module("torchrl_mappo")


def test_mappo_with_torchrl_carries_out_a_plan(tmp_path):
    require("torchrl", "torchrl")
    words = ["--plan", str(PLAN), "--seed", "3", "--out", "mappo"]
    lines = run([str(ROOT / "scripts" / "torchrl_mappo.py"), *words], tmp_path).splitlines()
    told = [int(line.split()[0].replace(",", "")) for line in lines if "decisions" in line]
    training = read_training(tmp_path / "mappo")
    assert told == [one.steps for one in training.evaluations] == [768, 1152]
    check_runs(tmp_path / "mappo" / "policy.npz")
    about = Network.load(tmp_path / "mappo" / "policy.npz").about
    assert (about.samples, about.card["plan"]["seed"]) == (True, 3)
    assert {"torch", "torchrl"} <= about.card["versions"].keys()


def test_the_critic_of_mappo_with_torchrl_sees_robots_at_work_only(mappo):
    import torch

    obs = torch.tensor([[0.2, -0.5], [0.4, -0.1], [9.0, 9.0], [-0.3, -0.3], [9.0, 9.0], [9.0, 9.0]])
    active = torch.tensor([True, True, False, True, False, False])
    rows = mappo.swarm_rows(obs, active, n_arenas=2)
    expected = [[0.3, -0.3, 0.4, -0.1]] * 3 + [[-0.3, -0.3, -0.3, -0.3]] * 3
    np.testing.assert_allclose(rows, expected, rtol=1e-6)
    assert not mappo.swarm_rows(obs, torch.zeros(6, dtype=torch.bool), n_arenas=2).any()


class ThreeSteps:
    """Two robots of one arena: the first dies in step 1; the run ends by time in step 2, and the next begins."""

    n_arenas = 1
    num_envs = 2
    seen = np.float32([[[0.1], [0.2]], [[0.0], [0.3]], [[0.5], [0.6]], [[0.7], [0.8]]])
    final = np.float32([0.4])
    active = np.array([[True, True], [False, True], [True, True], [True, True]])
    rewards = np.float32([[1.0, 2.0], [0.0, 3.0], [4.0, 5.0]])
    terminated = np.array([[True, False], [True, False], [False, False]])
    truncated = np.array([[False, False], [False, True], [False, False]])

    def __init__(self):
        self.k = 0

    def step(self, actions):
        k, self.k = self.k, self.k + 1
        infos = {"active": self.active[k + 1]}
        if k == 1:
            infos["final_obs"] = np.array([None, self.final], dtype=object)
        return self.seen[k + 1], self.rewards[k], self.terminated[k], self.truncated[k], infos


def test_mappo_with_torchrl_values_what_would_have_followed_a_time_limit_and_nothing_after_death(mappo):
    import torch

    envs, learner = ThreeSteps(), mappo.Learner(1, 2, (8,))

    def value(rows, active):
        seen = torch.tensor(rows)
        return learner.value(seen, mappo.swarm_rows(seen, torch.tensor(active), 1)).detach().numpy()[:, 0]

    options = {**mappo.OPTIONS, "n_steps": 3, "gae_lambda": 0.0, "gamma": 0.9}
    batch, obs, active = mappo.rollout(envs, learner, envs.seen[0], envs.active[0], options)
    ended = value([[0.5], [0.4]], [False, True])  # the swarm as it was, not as the next run begins
    expected = [
        1.0,  # died: nothing follows
        2.0 + 0.9 * value(envs.seen[1], envs.active[1])[1],
        3.0 + 0.9 * ended[1],
        4.0 + 0.9 * value(envs.seen[3], envs.active[3])[0],
        5.0 + 0.9 * value(envs.seen[3], envs.active[3])[1],
    ]
    np.testing.assert_allclose(batch["value_target"][:, 0], expected, rtol=1e-5)  # the dead row teaches nothing
    assert np.array_equal(obs, envs.seen[3])
    assert active.all()


def test_mappo_with_torchrl_draws_its_actions_and_is_paid_for_doubt(mappo):
    import torch
    from tensordict import TensorDict

    torch.manual_seed(0)
    learner = mappo.Learner(1, 4, (8,))
    seen = TensorDict({"observation": torch.ones(200, 1), "swarm": torch.zeros(200, 2)}, [200])
    step = learner.actor(seen)
    assert len(step["action"].unique()) == 4
    with torch.no_grad():
        learner.body[-1].bias[0] += 2.0
        batch = learner.actor(seen.clone())
    batch["advantage"], batch["value_target"] = torch.zeros(200, 1), torch.zeros(200, 1)

    def doubt():
        logits = learner.body(torch.ones(1, 1))
        return float(torch.distributions.Categorical(logits=logits).entropy().detach())

    before = doubt()
    learner.update(batch, {**mappo.OPTIONS, "ent_coef": 1.0, "vf_coef": 0.0})
    assert doubt() > before


def test_a_plan_for_another_algorithm_is_refused_by_mappo_with_torchrl(mappo, tmp_path):
    plan = read_plan(PLANS[[path.stem for path in PLANS].index("dqn")])
    with pytest.raises(ConfigError, match=r"a plan of ppo .* got a plan of dqn"):
        mappo.carry_out(plan, tmp_path)
    plan = read_plan(PLAN)
    with pytest.raises(ConfigError, match=r"an LSTM of 0 cells, got .* an LSTM of 8 cells"):
        mappo.carry_out(replace(plan, lstm=8), tmp_path)
    with pytest.raises(ConfigError, match=r"options among n_steps, .* got batch_size, colour, learning_rate, n_steps"):
        mappo.carry_out(replace(plan, options={**plan.options, "colour": 1}), tmp_path)


def test_a_recurrent_rival_carries_out_a_plan(tmp_path):
    require("sb3_contrib", "sb3")
    (tmp_path / "plan.toml").write_text(
        PLAN.read_text().replace("hidden = [16]", 'hidden = [16]\nlstm = 8\nactivation = "relu"')
    )
    words = ["--plan", "plan.toml", "--seed", "3", "--out", "recurrent"]
    lines = run([str(ROOT / "scripts" / "recurrent_ppo.py"), *words], tmp_path).splitlines()
    told = [int(line.split()[0].replace(",", "")) for line in lines if "decisions" in line]
    training = read_training(tmp_path / "recurrent")
    assert told == [one.steps for one in training.evaluations] == [640, 960]  # 10 robots; no rows to spare
    check_runs(tmp_path / "recurrent" / "policy.npz")
    network = Network.load(tmp_path / "recurrent" / "policy.npz")
    assert (network.n_cells, network.about.activation, network.about.card["plan"]["seed"]) == (8, "relu", 3)


def test_a_recurrent_rival_learns_from_rows_of_robots_only(monkeypatch):
    require("sb3_contrib", "sb3")
    monkeypatch.syspath_prepend(ROOT / "scripts")
    from recurrent_ppo import UsedRows

    from swarm_forage_env.training.sb3 import SwarmVecEnv

    plan = read_plan(PLAN)
    env = UsedRows(SwarmVecEnv(**plan.arenas_of(plan.stages[0])), {})
    env.seed(5)
    every = SwarmVecEnv(**plan.arenas_of(plan.stages[0]))
    every.seed(5)
    used = [0, 1, 2, 3, 6, 7, 8, 9, 10, 11]
    np.testing.assert_array_equal(env.reset(), every.reset()[used])
    actions = np.arange(10) % 6
    whole = np.zeros(12, int)
    whole[used] = actions
    for _ in range(20):
        ours, theirs = env.step(actions), every.step(whole)
        for mine, wanted in zip(ours[:3], theirs[:3], strict=True):
            np.testing.assert_array_equal(mine, wanted[used])
        assert [sorted(info) for info in ours[3]] == [sorted(theirs[3][row]) for row in used]
    mortal = UsedRows(SwarmVecEnv("warehouse_small", n_robots=3, n_objects=20, interface=plan.interface,
                                  wrappers=["population:death_per_tick=0.2"]), {})  # fmt: skip
    mortal.seed(1)
    mortal.reset()

    def live():
        for _ in range(40):
            mortal.step(np.zeros(3, int))

    with pytest.raises(SystemExit, match="robots that come or go"):
        live()
