"""Policies made ready to be run, given as a name, a file, an object, a class or a function."""

import copy
import inspect
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from metrics.checks import CurveError

if TYPE_CHECKING:
    from swarm_forage_env.scenarios.config import ScenarioConfig

PolicyLike: TypeAlias = Any
"""A registered name; the path of a trained policy (*.zip of stable-baselines3, *.npz); a policy object or class; a
function without arguments that returns a policy; a function of observations (N, D) that returns actions (N, 3)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Contestant:
    """A policy as it is run."""

    label: str
    """Name in tables."""
    policy: str
    """Name in run specifications."""
    parameters: Mapping[str, Any]
    caches: str
    """Which caches its runs have."""
    factory: Callable[..., Any] | None = None
    """Builds the policy in this process; None if worker processes can load it by its name."""
    is_named: bool = True
    """Whether its runs may be stored: a name tells which policy a stored run belongs to."""


def contestants_of(
    policies: Sequence[PolicyLike] | Mapping[str, PolicyLike],
    parameters: Mapping[str, Any],
    scenario: "ScenarioConfig",
    caches: str | None,
) -> tuple[Contestant, ...]:
    """Return the policies as they are run, each with a name of its own.

    Args:
        policies: As in `compare_policies`.
        parameters: Keyword arguments of registered policies and classes.
        scenario: Where they run.
        caches: Which caches were asked for; default see `swarm_forage_env.runs.spec.chosen_caches`.

    Raises:
        TypeError: something that is no policy.
        ValueError: an unknown policy, parameters where none can be given, or equal names.
    """
    named = policies.items() if isinstance(policies, Mapping) else [(None, policy) for policy in policies]
    return _told_apart(tuple(_contestant(policy, name, parameters, scenario, caches) for name, policy in named))


def _told_apart(contestants: tuple[Contestant, ...]) -> tuple[Contestant, ...]:
    """If files have equal names, add their folders to the names, or use whole paths.

    Raises:
        CurveError: policies still have equal names.
    """
    for n_parts in (2, 0):  # folder and file, all
        counts = Counter(contestant.label for contestant in contestants)
        contestants = tuple(
            replace(contestant, label=str(Path(*Path(contestant.policy).parts[-n_parts:])))
            if counts[contestant.label] > 1
            else contestant
            for contestant in contestants
        )
    labels = [contestant.label for contestant in contestants]
    if len(set(labels)) < len(labels):
        raise CurveError(f"Expected policies of different names, got {', '.join(labels)}; give a mapping from names.")
    return contestants


def _contestant(
    policy: PolicyLike, name: str | None, parameters: Mapping[str, Any], scenario: "ScenarioConfig", asked: str | None
) -> Contestant:
    """Find out what was given as a policy."""
    from swarm_forage_env.policies.registry import from_callable, policy_label
    from swarm_forage_env.runs.spec import chosen_caches, pin_policy

    if isinstance(policy, (str, Path)):
        found, pinned, stating = pin_policy(policy, parameters)
        label = name or policy_label(found)
        return Contestant(label=label, policy=found, parameters=pinned, caches=chosen_caches(asked, stating, scenario))
    if not callable(policy) and not _is_policy(policy):
        raise TypeError(
            "Expected a policy as a registered name, the path of a trained one, an object or class with reset and act, "
            f"or a function of observations, got {policy!r}."
        )
    label = name or getattr(policy, "__name__", type(policy).__name__)
    given: Any = policy
    if inspect.isclass(given) or (not _is_policy(given) and _takes_nothing(given)):
        factory = given
    elif parameters:
        raise ValueError(f"Expected parameters with a name, a file or a class only, got them with {given!r}.")
    else:
        factory = partial(copy.deepcopy, given) if _is_policy(given) else partial(from_callable, given, name=label)
    return Contestant(
        label=label,
        policy=label,
        parameters=parameters,
        caches=chosen_caches(asked, given, scenario),
        factory=factory,
        is_named=name is not None,
    )


def _is_policy(policy: Any) -> bool:
    return callable(getattr(policy, "act", None)) and callable(getattr(policy, "reset", None))


def _takes_nothing(function: Any) -> bool:
    """Whether a function can only be a factory: it could not take observations."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except ValueError:  # some compiled functions have no signature; they are taken for policies
        return False
    return not any(p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD, p.VAR_POSITIONAL) for p in parameters)
