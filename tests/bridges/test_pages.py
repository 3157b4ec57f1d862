"""The examples for other learning libraries work: those of the pages and scripts train, each in its own process.

Each needs a library that is too heavy for every test run; `scripts/test_bridges` installs them and runs these tests.
"""

import importlib.util
import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from swarm_forage_env import RunSpec, World, load_policy, parallel_env, run_one, scenario
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.policies.network import Network
from swarm_forage_env.training.evaluations import EVALUATIONS_FILE, POLICY_FILE, read_evaluations

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)
PAGES = {"agilerl": "agilerl", "benchmarl": "benchmarl", "rllib": "ray", "torchrl": "torchrl"}
"""Page in docs/bridges -> module that it needs."""
CURVES = ("agilerl", "benchmarl", "rllib")
"""Pages whose example is evaluated while it trains, and keeps the best network in a folder named like the page."""
LENGTH = re.compile(r"^N_DECISIONS = [\d_]+", re.MULTILINE)
"""How long an example trains: minutes on the page, here until all of its code has run once."""


def require(module: str, page: str) -> None:
    if importlib.util.find_spec(module) is None:
        pytest.skip(f"needs {module}: scripts/test_bridges {page}")


def run(arguments: list[str], folder: Path) -> str:
    result = subprocess.run(
        [sys.executable, "-W", "ignore", *arguments], cwd=folder, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr[-4000:]
    return result.stdout


def check_runs(file: Path) -> None:
    """What was saved is a policy that runs, with numpy alone, in a swarm of another size than it was trained in."""
    small = scenario("warehouse_small", n_robots=8, horizon_s=200.0)
    record = run_one(RunSpec(world=World(small), policy=str(file), seed=1))
    assert record.performance.shape == (1,)


@pytest.mark.parametrize("page", PAGES)
def test_the_example_of_a_page_trains(page, tmp_path):
    require(PAGES[page], page)
    program = "\n".join(EXAMPLE.findall((ROOT / "docs" / "bridges" / f"{page}.md").read_text()))
    program, n_lengths = LENGTH.subn("N_DECISIONS = 1_000", program)
    assert n_lengths == (page in CURVES)
    (tmp_path / "example.py").write_text(f"{program}\nprint('losses', *losses)\n")
    last = run(["example.py"], tmp_path).splitlines()[-1].split()
    assert last[0] == "losses"
    assert len(last) > 1
    assert all(math.isfinite(float(loss)) for loss in last[1:])
    if page not in CURVES:
        check_runs(tmp_path / f"{page}.npz")
        return
    folder = tmp_path / "results" / page
    evaluations = read_evaluations(folder / EVALUATIONS_FILE)
    assert evaluations[-1].steps >= 1000
    assert all(evaluation.baseline > 0.0 for evaluation in evaluations)
    check_runs(folder / POLICY_FILE)


def test_cleanrl_trains(tmp_path):
    require("torch", "cleanrl")
    sizes = {"total-timesteps": 2000, "n-robots": 4, "n-arenas": 2, "num-steps": 64, "minibatch-size": 128}
    words = [*(f"--{name}={size}" for name, size in sizes.items()), "--out=trained"]
    lines = run([str(ROOT / "scripts" / "cleanrl_ppo.py"), *words], tmp_path).splitlines()
    told = [int(line.split()[0].replace(",", "")) for line in lines if "reward" in line]
    assert told == [512, 1024, 1536, 2048]
    assert len(read_evaluations(tmp_path / "trained" / EVALUATIONS_FILE)) == len(lines) - len(told) > 1
    check_runs(tmp_path / "trained" / "policy.npz")
    assert Network.load(tmp_path / "trained" / "policy.npz").about.card["options"]["num_steps"] == 64


def test_the_example_of_stable_baselines3_trains_and_exports(tmp_path):
    require("stable_baselines3", "sb3")
    page = (ROOT / "docs" / "training.md").read_text()
    on_policy, off_policy = [block for block in EXAMPLE.findall(page) if "stable_baselines3" in block]
    (tmp_path / "example.py").write_text(f"{on_policy}\n{off_policy}")
    run(["example.py"], tmp_path)
    check_runs(tmp_path / "policy.npz")
    check_runs(tmp_path / "sac.zip")


def test_a_recurrent_model_runs_with_its_memory(tmp_path):
    """Its actions in a run are those of the model itself, told where the run began."""
    require("sb3_contrib", "sb3")
    from sb3_contrib import RecurrentPPO

    from swarm_forage_env.training.sb3 import SwarmVecEnv
    from swarm_forage_env.training.sb3.export import export_network, note_interface

    config = InterfaceConfig(observation="compact", automatic_gripper=True, decision_ticks=2)
    env = SwarmVecEnv("warehouse_small", n_robots=3, n_objects=20, interface=config)
    model = RecurrentPPO("MlpLstmPolicy", env, n_steps=8, batch_size=24, seed=0, device="cpu")
    note_interface(model, config)
    model.save(tmp_path / "model.zip")
    export_network(model, config).save(tmp_path / "network.npz")

    arena = parallel_env("warehouse_small", n_robots=3, n_objects=20)
    interface = LearnerInterface(config, arena.swarm_spec)
    policy, network = (load_policy(tmp_path / name) for name in ("model.zip", "network.npz"))
    for seed in (1, 2):  # the second run begins without memory, too
        for one in (policy, network):
            one.reset(arena.swarm_spec, np.random.default_rng(0))
        obs, state = arena.reset_batch(seed), None
        for tick in range(12):
            if tick % 2 == 0:
                seen = interface.observe(obs)
                choice, state = model.predict(
                    seen, state=state, episode_start=np.full(3, state is None), deterministic=True
                )
            actions = policy.act(obs, arena.active)
            np.testing.assert_array_equal(actions, interface.command(choice, obs))
            np.testing.assert_allclose(network.act(obs, arena.active), actions, atol=1e-5)
            obs, *_ = arena.step_batch(actions)
    assert np.any(choice != model.predict(seen, deterministic=True)[0])


def test_supersuit_takes_the_parallel_environments_until_the_last_robot_is_dead():
    require("supersuit", "sb3")
    import supersuit

    for interface in (None, {"observation": "compact", "actions": "discrete", "automatic_gripper": True}):
        mortal = parallel_env("warehouse_small", n_robots=3, n_objects=20, max_cycles=40, interface=interface,
                              wrappers=["population:death_per_tick=0.2"])  # fmt: skip
        env = supersuit.frame_skip_v0(supersuit.black_death_v3(mortal), 2)
        env.reset(seed=1)
        n_steps = 0
        while env.agents:
            assert len(env.agents) == 3
            env.step({agent: env.action_space(agent).sample() for agent in env.agents})
            n_steps += 1
        assert 1 < n_steps < 40


def test_torchrl_takes_the_vector_environments():
    require("torchrl", "torchrl")
    import gymnasium
    from torchrl.envs import GymWrapper

    envs = gymnasium.make_vec("swarm_forage/warehouse_small-v0", n_arenas=2, n_robots=3, n_objects=20, max_cycles=5)
    assert GymWrapper(envs).rollout(3)["next", "reward"].shape == (6, 3, 1)


def test_train_ppo_is_as_short_as_promised():
    assert len((ROOT / "scripts" / "train_ppo.py").read_text().splitlines()) < 60


@pytest.mark.slow
def test_train_ppo_trains_and_exports(tmp_path):
    require("stable_baselines3", "sb3")
    run([str(ROOT / "scripts" / "train_ppo.py"), "--steps", "2000", "--out", "example.npz"], tmp_path)
    check_runs(tmp_path / "example.npz")
