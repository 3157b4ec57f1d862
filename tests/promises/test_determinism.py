"""Equal seeds give equal runs, bit for bit: between instances, after a reset, and between processes."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.support.crowded_runs import EPISODES, RUNS, digest, episode_digest, fresh, make

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def elsewhere() -> dict[str, str]:
    code = "import json; from tests.support.crowded_runs import all_digests; print(json.dumps(all_digests()))"
    process = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env=os.environ | {"PYTHONHASHSEED": "12345"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 0, process.stderr
    return json.loads(process.stdout)


@pytest.mark.parametrize(("policy", "name", "caches"), RUNS)
def test_a_seed_is_a_run(policy, name, caches, elsewhere):
    env = make(name, caches)
    first = digest(env, fresh(policy), 17)
    assert digest(make(name, caches), fresh(policy), 17) == first, "another instance"
    other = digest(env, fresh(policy), 18)
    assert other != first, "another seed"
    assert digest(env, fresh(policy), 17) == first, "the same instance, reset after another run"
    assert elsewhere[f"{name} {caches} {policy}"] == first, "another process"


@pytest.mark.parametrize(("name", "policy"), EPISODES)
def test_a_seed_is_a_whole_episode_through_all_wrappers(name, policy, elsewhere):
    assert episode_digest(name, policy) == elsewhere[f"{name} {policy}"]


def test_the_world_does_not_depend_on_who_draws_actions():
    """Placement, start poses and object motion come from the run's seed alone."""
    one, other = make("search_and_rescue", "none"), make("search_and_rescue", "none")
    one.reset_batch(4)
    other.reset_batch(4)
    still, driving = np.zeros((20, 3), np.float32), np.ones((20, 3), np.float32)
    driving[:, 2] = still[:, 2] = -1.0  # nobody touches an object
    for _ in range(40):
        one.step_batch(still)
        other.step_batch(driving)
    np.testing.assert_array_equal(one.objects.floor, other.objects.floor)
    assert not np.array_equal(one.swarm.position, other.swarm.position)
