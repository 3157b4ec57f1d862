"""Busy policies in crowded runs of every preset with every kind of caches; fingerprints of all their results."""

import hashlib
from itertools import cycle
from typing import Any

import numpy as np

from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.contract.policy import Policy, SwarmSpec
from swarm_forage_env.contract.types import ActionArray, BoolArray, ObsArray
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import POLICIES as NAMES
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import build_stack
from swarm_forage_env.scenarios.presets import scenario
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
    columns = recorder.columns()
    assert columns["collected"].sum() > 5
    assert columns["malfunctions"].sum() > 5
    for column in columns.values():
        seen.update(column.tobytes())
    return seen.hexdigest()


def all_digests() -> dict[str, str]:
    """Fingerprints of all runs, for another process."""
    runs = {f"{name} {caches} {policy}": digest(make(name, caches), fresh(policy), 17) for policy, name, caches in RUNS}
    return runs | {f"{name} {policy}": episode_digest(name, policy) for name, policy in EPISODES}


class BusyPolicy:
    """Drives about at random, grasps when empty, and lets go in a random way after a random while."""

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Start with all robots grasping."""
        self._rng = rng
        self._carrying = spec.layout["carrying"]
        self._wheels = np.full((spec.n_robots, 2), 0.5)
        self._release = np.full(spec.n_robots, Grip.GRASP)

    def act(self, obs: ObsArray, active: BoolArray) -> ActionArray:
        """Return (N, 3) actions."""
        rng, n_robots = self._rng, len(obs)
        steered = rng.random(n_robots) < 0.05
        turn = np.where(rng.random(n_robots) < 0.2, 0.4, 0.02) * rng.uniform(-1, 1, n_robots)
        self._wheels[steered] = np.column_stack((0.5 - turn, 0.5 + turn))[steered]
        changed = rng.random(n_robots) < 0.03
        bands = (Grip.GRASP, Grip.RELEASE, Grip.DELIVER, Grip.SITE, Grip.CREATE_CACHE, Grip.CREATE_CACHE)
        self._release[changed] = rng.choice(bands, n_robots)[changed]
        carrying = obs[:, self._carrying].ravel() > 0.5
        return np.column_stack((self._wheels, np.where(carrying, self._release, Grip.GRASP))).astype(np.float32)


def change_population(env: ForageEnv, rng: np.random.Generator) -> None:
    """Let some robots die, come back elsewhere, break or be repaired."""
    swarm = env.swarm
    n_robots = len(swarm.active)
    present = swarm.present ^ (rng.random(n_robots) < 0.05)
    present[0] = True
    active = present & (rng.random(n_robots) < 0.8)
    born = present & ~swarm.present
    arena = env.scenario.arena
    places = rng.uniform((0.5, 0.5), (arena.width_m - 0.9, arena.height_m - 0.5), (n_robots, 2))
    swarm.position[born] = places[born]
    swarm.heading[born] = rng.uniform(-np.pi, np.pi, n_robots)[born]
    env.set_population(active=active, present=present)
