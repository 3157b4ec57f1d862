"""Crowded runs of every preset with every kind of caches, and of every policy; fingerprints of all their results."""

import hashlib
from itertools import cycle
from typing import Any

import numpy as np

from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import POLICIES as NAMES
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import build_stack
from swarm_forage_env.scenarios.presets import scenario
from tests.support.busy import BusyPolicy, change_population
from tests.support.foraging import NEAR, mild_wrappers, quick_world

TICKS = 60
CROWDED: dict[str, Any] = {"n_robots": 20, "walk_probability": 0.01}
DENSE = {
    "warehouse_small": 800,
    "warehouse_medium": 2000,
    "warehouse_dual": 1200,
    "warehouse_quad": 2000,
    "search_and_rescue": 272,
}


POLICIES = sorted({*NAMES} - {"oracle"})
"""Policies that see observations and not the world."""


def made_for(policy: str) -> tuple[str, ...]:
    """The kinds of caches that a policy can live with: the one it states, else all."""
    stated = getattr(load_policy(policy), "caches", "none") if policy != "busy" else "none"
    return ("none", "static", "dynamic") if stated == "none" else (stated,)


RUNS = [("busy", name, caches) for name, caches in zip(DENSE, cycle(made_for("busy")), strict=False)]
"""The world is asked by a policy that does everything, in every kind of scenario and with every kind of caches."""
RUNS += [(policy, "warehouse_small", made_for(policy)[-1]) for policy in POLICIES]
"""A policy sees observations only, so one preset tells what it does."""
EPISODES = [(name, "dpo") for name in NEAR]


def make(name: str, caches: str) -> ForageEnv:
    return ForageEnv(scenario(name, caches=caches, n_objects=DENSE[name], **side(name), **CROWDED))


def side(name: str) -> dict[str, float]:
    return {"side_m": 32.0} if name == "search_and_rescue" else {}


def digest(env: ForageEnv, policy: Policy, seed: int) -> str:
    """Fingerprint of everything that a run shows: observations, rewards, terminations, state, counters."""
    seen = hashlib.sha256()
    policy.reset(env.swarm_spec, stream_rng(seed, Stream.POLICY))
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
    policy, world, seen = load_policy(policy_name), recorder.unwrapped, hashlib.sha256()
    policy.reset(world.swarm_spec, stream_rng(17, Stream.POLICY))
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
    runs = {f"{name} {caches} {policy}": digest(make(name, caches), fresh(policy), 17) for policy, name, caches in RUNS}
    return runs | {f"{name} {policy}": episode_digest(name, policy) for name, policy in EPISODES}
