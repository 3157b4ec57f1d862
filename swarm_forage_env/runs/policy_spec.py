"""PolicySpec: a policy as it is run, whatever it was given as: a name, a file, an object, a class or a function."""

import copy
import inspect
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

from swarm_forage_env._internal.fields import ConfigError, one_of, table, text
from swarm_forage_env.policies.registry import from_callable, policy_label
from swarm_forage_env.runs.spec import pin_policy, stated_caches
from swarm_forage_env.scenarios.config import CACHE_KINDS

PolicyLike: TypeAlias = Any
"""A registered name; the path of a trained policy (*.zip of stable-baselines3, *.npz); a policy object or class; a
function without arguments that returns a policy; a function of observations (N, D) that returns actions (N, 3)."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PolicySpec:
    """A policy as it is run."""

    label: str
    """Name in tables."""
    policy: str
    """Registered name, path of a policy file, or the name under which runs of an object are stored."""
    parameters: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """Keyword arguments of the policy; of a file with its digest."""
    caches: str | None = None
    """Which caches its runs have; None = those of the world."""
    factory: Callable[..., Any] | None = field(default=None, compare=False)
    """Builds the policy in this process; None if worker processes can load it by its name."""
    is_named: bool = field(default=True, compare=False)
    """Whether its runs may be stored: a name tells which policy a stored run belongs to."""

    def __post_init__(self) -> None:
        text("the label of a policy", self.label)
        text("a policy", self.policy)
        table(f"parameters of {self.label!r}", self.parameters)
        if self.caches is not None:
            one_of(f"caches of {self.label!r}", self.caches, CACHE_KINDS)


def policy_spec(
    policy: PolicyLike, *, label: str = "", parameters: Mapping[str, Any] | None = None, caches: str | None = None
) -> PolicySpec:
    """Look a policy up and return it as it is run.

    Args:
        policy: See `PolicyLike`.
        label: Name in tables; default the registered name, of a file its name without the ending.
        parameters: Keyword arguments of a registered policy, a file or a class.
        caches: Which caches its runs have; default those that it states, else those of the world.

    Raises:
        ConfigError: there is no such policy, or its file cannot be opened.
        TypeError: something that is no policy.
        ValueError: parameters where none can be given.
    """
    if not isinstance(policy, str | Path):
        return _built_here(policy, label, parameters or {}, caches)
    try:
        found, pinned, stating = pin_policy(policy, parameters or {})
    except ConfigError:
        raise
    except ValueError as error:
        raise ConfigError(str(error)) from error
    return PolicySpec(
        label=label or policy_label(found),
        policy=found,
        parameters=pinned,
        caches=caches or stated_caches(stating),
    )


def policy_specs(
    policies: Sequence[PolicyLike] | Mapping[str, PolicyLike],
    *,
    parameters: Mapping[str, Any] | None = None,
    caches: str | None = None,
) -> tuple[PolicySpec, ...]:
    """Return several policies as they are run, each with a name of its own.

    Args:
        policies: Policies, or a mapping from names to policies.
        parameters: As in `policy_spec`, the same for all.
        caches: As in `policy_spec`.

    Raises:
        ConfigError: equal names; for the rest see `policy_spec`.
    """
    named = policies.items() if isinstance(policies, Mapping) else [("", policy) for policy in policies]
    return _told_apart(
        tuple(policy_spec(policy, label=name, parameters=parameters, caches=caches) for name, policy in named)
    )


def _told_apart(specs: tuple[PolicySpec, ...]) -> tuple[PolicySpec, ...]:
    """If files have equal names, add their folders to the names, or use whole paths."""
    for n_parts in (2, 0):  # folder and file, all
        counts = Counter(spec.label for spec in specs)
        specs = tuple(
            replace(spec, label=str(Path(*Path(spec.policy).parts[-n_parts:]))) if counts[spec.label] > 1 else spec
            for spec in specs
        )
    labels = [spec.label for spec in specs]
    if len(set(labels)) < len(labels):
        raise ConfigError(f"Expected policies of different names, got {', '.join(labels)}; give a mapping from names.")
    return specs


def _built_here(given: Any, label: str, parameters: Mapping[str, Any], caches: str | None) -> PolicySpec:
    """A policy object, a class or a function, which only this process can make."""
    if not callable(given) and not _is_policy(given):
        raise TypeError(
            "Expected a policy as a registered name, the path of a trained one, an object or class with reset and act, "
            f"or a function of observations, got {given!r}."
        )
    name: str = label or getattr(given, "__name__", type(given).__name__)
    if inspect.isclass(given) or (not _is_policy(given) and _takes_nothing(given)):
        factory = given
    elif parameters:
        raise ValueError(f"Expected parameters with a name, a file or a class only, got them with {given!r}.")
    else:
        acts: Any = given
        factory = partial(copy.deepcopy, given) if _is_policy(given) else partial(from_callable, acts, name=name)
    return PolicySpec(
        label=name,
        policy=name,
        parameters=parameters,
        caches=caches or stated_caches(given),
        factory=factory,
        is_named=bool(label),
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
