"""Are whole runs of a policy equal: with equal seeds, and with and without Python between ticks?"""

import copy
import inspect
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import PurePath
from typing import Any

import numpy as np

from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import LiveRun, build_env, build_stack
from swarm_forage_env.runs.spec import chosen_caches
from swarm_forage_env.scenarios.config import CACHE_KINDS, ScenarioConfig
from swarm_forage_env.scenarios.presets import scenario as preset
from swarm_forage_env.wrappers.recorder import RunRecorder

from .environments import CheckError

INTERVAL_TICKS = 10
"""Length of a recording interval in compared records. Our choice: short, so that small differences are seen."""


def check_determinism(
    policy: Any,
    scenario: str | ScenarioConfig = "warehouse_small",
    *,
    seeds: Sequence[int] = (0, 1),
    seconds: float = 60.0,
) -> None:
    """Run a policy twice with each seed, in this process, and compare the records and the last positions.

    Args:
        policy: As in `check_policy`; each run gets a fresh one.
        scenario: Where it runs; with the caches of `runs.spec.chosen_caches`.
        seeds: Seeds of the runs.
        seconds: Simulated length of a run, rounded to recording intervals of `INTERVAL_TICKS`.

    Raises:
        CheckError: two runs with one seed differ; names what differs first.
        ValueError: an unknown name or scenario, or no seeds.
    """
    if not len(seeds):
        raise ValueError("Expected seeds to run, got none; give at least one.")
    build = factory_of(policy)
    config = _recorded_often(config_for(built(build), scenario), seconds)
    for seed in seeds:
        policies = (built(build), built(build))
        runs = (_results(build_stack(config, reads=getattr(each, "reads", None)), each, seed) for each in policies)
        different = _first_difference(*runs)
        if different:
            raise CheckError(
                f"Expected two runs with seed {seed} to be equal, got another {different}; draw random numbers from "
                "the generator that reset is given only, and let runs share nothing (class attributes, globals)."
            )


def _recorded_often(config: ScenarioConfig, seconds: float) -> ScenarioConfig:
    """Return a scenario with intervals of `INTERVAL_TICKS`, about as long as this and at least one interval."""
    interval_s = INTERVAL_TICKS * config.dt_s
    return replace(config, interval_s=interval_s, horizon_s=max(1, round(seconds / interval_s)) * interval_s)


def _results(recorder: RunRecorder, policy: Policy, seed: int) -> dict[str, np.ndarray]:
    """Make a run; return its columns, and the poses at its end, which show differences first."""
    run = LiveRun(recorder, policy, seed)
    run.advance()
    swarm = run.forage_env.swarm
    return {
        "position of the robots at the end": swarm.position.copy(),
        "heading of the robots at the end": swarm.heading.copy(),
        **recorder.columns(),
        **recorder.contributed(),
    }


def _first_difference(run: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> str:
    """Return the name of the first result that differs, "" if none does."""
    return next((name for name in run if not np.array_equal(run[name], other.get(name, np.empty(0)))), "")


class _TickByTick(RunRecorder):
    """A recorder with which policies are asked by `act`: `LiveRun` makes compiled runs for the plain one only."""


def check_compiled(policy: Policy, config: ScenarioConfig, seed: int, ticks: int) -> None:
    """Compare a run by `compiled`, if the policy offers it, with one by `act`."""
    if not hasattr(type(policy), "compiled"):
        return
    config = _recorded_often(replace(config, physics="compiled"), ticks * config.dt_s)
    reads = getattr(policy, "reads", None)
    by_act = _results(_TickByTick(build_env(config, reads=reads)), policy, seed)
    try:
        by_compiled = _results(build_stack(config, reads=reads), policy, seed)
    except Exception as error:
        raise CheckError(
            f"Expected what compiled returns to drive a run, got {type(error).__name__}: {error}. "
            "See contract.kernel_policy.CompiledPolicy, or leave compiled out."
        ) from error
    different = _first_difference(by_act, by_compiled)
    if different:
        raise CheckError(
            f"Expected what compiled returns to do what act does, got another {different} in a run of "
            f"{config.horizon_ticks} ticks; let both call one kernel, with the same draws in every tick."
        )


def factory_of(policy: Any) -> Callable[[], Any]:
    """Return what builds a fresh policy: by name, by path, from a class, or as a copy of an object."""
    if isinstance(policy, str | PurePath):
        return partial(load_policy, policy)
    if inspect.isclass(policy):
        return policy
    return partial(copy.deepcopy, policy)


def built(build: Callable[[], Any]) -> Policy:
    """Return a fresh policy; raises CheckError for something that is none."""
    policy = build()
    missing = [name for name in ("reset", "act") if not callable(getattr(policy, name, None))]
    if missing:
        raise CheckError(
            f"Expected a policy with the methods reset and act, got {policy!r} without {' and '.join(missing)}; a "
            "function from observations to actions becomes a policy by from_callable(function)."
        )
    return policy


def config_for(policy: Policy, scenario: str | ScenarioConfig) -> ScenarioConfig:
    """Return a scenario with the caches of `chosen_caches`; raises CheckError for caches that there are not."""
    caches = getattr(policy, "caches", None)
    if caches is not None and caches not in CACHE_KINDS:
        raise CheckError(
            f"Expected caches of the policy to be one of {', '.join(CACHE_KINDS)}, got {caches!r}; leave the attribute "
            "out where it does not matter."
        )
    config = preset(scenario) if isinstance(scenario, str) else scenario
    return replace(config, caches=chosen_caches(None, policy, config))
