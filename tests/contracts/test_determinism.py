"""Equal seeds give equal runs, bit for bit: between instances, after a reset, and between processes."""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swarm_forage_env import SCENARIO_NAMES
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import load_policy, policy_names
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.study.run import build_stack
from tests.contracts.busy import BusyPolicy, change_population
from tests.contracts.foraging import mild_wrappers, quick_world

ROOT = Path(__file__).resolve().parents[2]
TICKS = 60
CROWDED: dict[str, Any] = {"n_robots": 20, "walk_probability": 0.01}
DENSE = {"warehouse_small": 800, "warehouse_medium": 2000, "search_and_rescue": 272}


def made_for(policy: str) -> tuple[str, ...]:
    """The kinds of caches that a policy can live with: the one it states, else all."""
    stated = getattr(load_policy(policy), "caches", "none") if policy != "busy" else "none"
    return ("none", "static", "dynamic") if stated == "none" else (stated,)


RUNS = [
    (name, caches, policy)
    for policy in ("busy", *policy_names())
    for name in SCENARIO_NAMES
    for caches in made_for(policy)
]


EPISODES = [(name, policy) for name in SCENARIO_NAMES for policy in ("crw", "dpo")]


def make(name: str, caches: str) -> ForageEnv:
    return ForageEnv(scenario(name, caches=caches, n_objects=DENSE[name], **side(name), **CROWDED))


def side(name: str) -> dict[str, float]:
    return {"side_m": 32.0} if name == "search_and_rescue" else {}


def digest(env: ForageEnv, policy: Policy, seed: int) -> str:
    """Fingerprint of everything that a run shows: observations, rewards, terminations, state, counters."""
    seen = hashlib.sha256()
    policy.reset(env.task, stream_rng(seed, Stream.POLICY))
    crowd = np.random.default_rng(seed)
    obs = env.reset_batch(seed)
    for tick in range(TICKS):
        seen.update(obs.tobytes())
        seen.update(env.state().tobytes())
        if isinstance(policy, BusyPolicy) and tick % 7 == 0:
            change_population(env, crowd)
        obs, reward, terminated, _ = env.step_batch(policy.act(obs, env.active), tasks=getattr(policy, "task", None))
        seen.update(reward.tobytes() + terminated.tobytes())
    seen.update(env.events.counters.tobytes() + env.events.interference_sum.tobytes())
    return seen.hexdigest()


def fresh(policy: str) -> Policy:
    return BusyPolicy() if policy == "busy" else load_policy(policy)


def episode_digest(name: str, policy_name: str) -> str:
    """Fingerprint of a whole episode through all wrappers, and of its record."""
    recorder = build_stack(quick_world(name, interval_s=60.0), mild_wrappers())
    policy, world, seen = load_policy(policy_name), recorder.world, hashlib.sha256()
    policy.reset(world.task, stream_rng(17, Stream.POLICY))
    obs, truncated = recorder.reset_batch(17), False
    while not truncated:
        seen.update(obs.tobytes() + world.active.tobytes())
        obs, reward, terminated, truncated = recorder.step_batch(policy.act(obs, world.active))
        seen.update(reward.tobytes() + terminated.tobytes())
    columns = {**recorder.columns(), **recorder.contributed()}
    assert columns["collected"].sum() > 5
    assert columns["malfunctions"].sum() > 5
    for column in columns.values():
        seen.update(column.tobytes())
    return seen.hexdigest()


def all_digests() -> dict[str, str]:
    """Fingerprints of all runs, for another process."""
    runs = {f"{name} {caches} {policy}": digest(make(name, caches), fresh(policy), 17) for name, caches, policy in RUNS}
    return runs | {f"{name} {policy}": episode_digest(name, policy) for name, policy in EPISODES}


@pytest.fixture(scope="module")
def elsewhere() -> dict[str, str]:
    code = "import json; from tests.contracts.test_determinism import all_digests; print(json.dumps(all_digests()))"
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


@pytest.mark.compiled
@pytest.mark.parametrize(("name", "caches", "policy"), RUNS)
def test_a_seed_is_a_run(name, caches, policy, elsewhere):
    env = make(name, caches)
    first = digest(env, fresh(policy), 17)
    assert digest(make(name, caches), fresh(policy), 17) == first, "another instance"
    other = digest(env, fresh(policy), 18)
    assert other != first, "another seed"
    assert digest(env, fresh(policy), 17) == first, "the same instance, reset after another run"
    assert elsewhere[f"{name} {caches} {policy}"] == first, "another process"


@pytest.mark.compiled
@pytest.mark.parametrize(("name", "policy"), EPISODES)
def test_a_seed_is_a_whole_episode_through_all_wrappers(name, policy, elsewhere):
    assert episode_digest(name, policy) == elsewhere[f"{name} {policy}"]


def test_a_reset_in_the_middle_of_a_run_leaves_nothing_behind():
    env = make("warehouse_small", "dynamic")
    expected = digest(env, BusyPolicy(), 5)
    policy = BusyPolicy()
    policy.reset(env.task, np.random.default_rng(0))
    obs = env.reset_batch(99)
    rng = np.random.default_rng(1)
    for _ in range(25):
        change_population(env, rng)
        obs = env.step_batch(policy.act(obs, env.active))[0]
    assert digest(env, BusyPolicy(), 5) == expected


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
