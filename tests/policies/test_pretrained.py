"""The policies that come with the package: files complete, import light, performance as promised."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from swarm_forage_env.policies import pretrained
from swarm_forage_env.policies.network import Network
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.training.plan import TrainingPlan, read_plan
from tests.support.stage import OPEN_CELL, load, stand, tidy_world

FOLDER = Path(pretrained.__file__).parent
SHIPPED = sorted(path.stem for path in FOLDER.glob("*.npz"))


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_policy_has_a_card_a_plan_and_a_small_file(name):
    network = Network.load(FOLDER / f"{name}.npz")
    assert TrainingPlan.from_mapping(network.about.card["plan"]) == read_plan(FOLDER / f"{name}.toml")
    card = (FOLDER / f"{name}.md").read_text()
    for word in (f"swarm-forage train --plan {name}", *network.about.card["versions"].values()):
        assert word in card
    assert (FOLDER / f"{name}.npz").stat().st_size < 100_000


def test_shipped_policies_run_by_name_without_torch():
    code = (
        "import sys; sys.modules['torch'] = sys.modules['stable_baselines3'] = None\n"
        "from swarm_forage_env.scenarios.presets import warehouse_small\n"
        "from swarm_forage_env.runs.run import run_one\n"
        "from swarm_forage_env.runs.spec import plan_run\n"
        "world = warehouse_small(n_robots=5, horizon_s=20.0, interval_s=20.0)\n"
        f"print(*(run_one(plan_run(world, name, seed=1)).spec.policy for name in {(*SHIPPED,)}))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert result.stdout.split() == [*SHIPPED], result.stderr


@pytest.mark.parametrize("name", SHIPPED)
def test_a_robot_keeps_its_cargo_when_it_comes_back_to_work(name):
    """It does so in a step that policies do not foresee: for them the robot is still in repair."""
    env, policy = tidy_world(), load_policy(name)
    policy.reset(env.swarm_spec, np.random.default_rng(0))
    load(env, 0, 0)
    stand(env, 0, OPEN_CELL)
    env.step_batch(policy.act(env.arena.observe(), np.zeros(4, np.bool_)))
    assert env.swarm.carried_object.tolist() == [0, -1, -1, -1]
