"""Runs that are stopped, copied and continued: what a caller sees of them, as bytes."""

import copy
import pickle
from typing import Any

import numpy as np

from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.runs.run import build_stack
from swarm_forage_env.wrappers.base import SwarmWrapper
from swarm_forage_env.wrappers.recorder import RunRecorder
from swarm_forage_env.wrappers.registry import parse_wrapper
from tests.support.crowded_runs import BusyPolicy, change_population
from tests.support.foraging import mild_wrappers, quick_world

SEED = 17


def pickled(value: Any) -> Any:
    """What comes out of the pickle of a value."""
    return pickle.loads(pickle.dumps(value))  # noqa: S301 - what was pickled right here


class Branch:
    """A policy that drives an environment, and everything that it has seen since the branch began."""

    def __init__(self, env: ForageEnv | SwarmWrapper, policy: Policy) -> None:
        """Start a run."""
        self.env, self.policy = env, policy
        policy.reset(env.unwrapped.swarm_spec, stream_rng(SEED, Stream.POLICY))
        self.crowd = np.random.default_rng(SEED)
        self.obs = env.reset_batch(SEED).copy()
        self.seen: list[bytes] = []

    def go_on(self, ticks: int) -> "Branch":
        """Let some ticks pass. Where no wrapper does so, robots die and come back now and then."""
        env, policy, world = self.env, self.policy, self.env.unwrapped
        for _ in range(ticks):
            if isinstance(policy, BusyPolicy) and world.tick % 7 == 0:
                change_population(world, self.crowd)
            actions = policy.act(self.obs, world.active)
            obs, reward, terminated, truncated = env.step_batch(actions, tasks=getattr(policy, "task", None))
            self.obs = obs.copy()
            counted = (world.events.counters, world.events.interference_sum)
            shown = (obs, reward, terminated, world.state(), world.swarm.position, *counted)
            self.seen.append(b"".join(array.tobytes() for array in shown) + bytes([truncated]))
        return self

    def beside(self, env: ForageEnv | SwarmWrapper, obs: np.ndarray) -> "Branch":
        """A branch in another environment that begins as this one is now."""
        other = copy.copy(self)
        other.env, other.obs, other.seen = env, obs.copy(), []
        other.policy, other.crowd = copy.deepcopy(self.policy), copy.deepcopy(self.crowd)
        return other

    def columns(self) -> dict[str, list[Any]]:
        """Columns of the record of the finished run."""
        columns = self.env.columns()
        return {name: column.tolist() for name, column in columns.items()}


def whole_stack(name: str, physics: str, caches: str = "none", **overrides: Any) -> RunRecorder:
    """Recorder and all wrappers around a world in which something happens; 100 s, 500 ticks."""
    world = quick_world(
        name, **{"physics": physics, "caches": caches, "horizon_s": 100.0, "interval_s": 10.0, **overrides}
    )
    cost = parse_wrapper("handling_cost:waveform=square,amplitude=2,offset=3,period_s=30")
    return build_stack(world, (*mild_wrappers(), cost))
