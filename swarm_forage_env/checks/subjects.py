"""From the arguments of a check to fresh policies and the scenario that they are made for."""

import copy
import inspect
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import PurePath
from typing import Any

from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.spec import chosen_caches
from swarm_forage_env.scenarios.config import CACHE_KINDS, ScenarioConfig
from swarm_forage_env.scenarios.presets import scenario as preset

from .faults import CheckError


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
