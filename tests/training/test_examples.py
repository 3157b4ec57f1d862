"""The examples for other learning libraries train, in a process of their own, where the library is installed."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from swarm_forage_env import RunSpec, World, run_one, scenario

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"
NEEDS = {
    "agilerl_ppo": "agilerl",
    "benchmarl_ippo": "benchmarl",
    "cleanrl_ppo": "torch",
    "mappo": "torch",
    "optuna_search": "optuna",
    "rllib_ppo": "ray",
    "sb3_contrib_recurrent_ppo": "sb3_contrib",
    "stable_baselines3_ppo": "stable_baselines3",
    "torchrl_ppo": "torchrl",
}
"""Example -> module that it needs."""
LENGTH = re.compile(r"^N_DECISIONS = [\d_]+", re.MULTILINE)
"""How long an example trains: minutes, here until all of its code has run once."""
PLANNED = ("mappo", str(EXAMPLES.parents[1] / "tests/support/tiny_plan.toml"), "1", "policy.npz")
"""An example that trains by a plan, and what it is told."""


def test_every_example_of_a_library_is_short_and_tried():
    paths = [path for path in EXAMPLES.glob("*.py") if path.name != "leave_rules_out.py"]
    assert {path.stem for path in paths} == set(NEEDS)
    assert all(len(path.read_text().splitlines()) < (120 if path.stem in PLANNED else 80) for path in paths)


@pytest.mark.slow
@pytest.mark.parametrize("name", NEEDS)
def test_an_example_trains_a_policy_that_runs(name, tmp_path):
    if importlib.util.find_spec(NEEDS[name]) is None:
        pytest.skip(f"needs {NEEDS[name]}, see docs/libraries.md")
    program, n_lengths = LENGTH.subn("N_DECISIONS = 1_000", (EXAMPLES / f"{name}.py").read_text())
    assert n_lengths == (name not in ("optuna_search", *PLANNED))
    (tmp_path / "example.py").write_text(program)
    command = [sys.executable, "-W", "ignore", "example.py", *(PLANNED[1:] if name in PLANNED else ())]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-4000:]
    policy = next(tmp_path.rglob("policy.*"))
    small = scenario("warehouse_small", n_robots=8, horizon_s=200.0)
    record = run_one(RunSpec(world=World(small), policy=str(policy), seed=1))
    assert np.isfinite(record["performance"]).all()
