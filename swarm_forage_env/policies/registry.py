"""How a policy is found and made: by its registered name, from a file, from a function."""

import re
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from pathlib import Path, PurePath
from typing import Any, ClassVar, NamedTuple

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, settings
from swarm_forage_env._internal.wording import suggestion
from swarm_forage_env.contract.policy import Policy, SwarmSpec, as_actions
from swarm_forage_env.contract.types import ActionArray, BoolArray, ObsArray
from swarm_forage_env.policies import trust

POLICIES = {
    "beeline": "baselines.beeline:BeelinePolicy",
    "cpfa": "baselines.cpfa:CPFAPolicy",
    "crw": "baselines.crw:CRWPolicy",
    "dpo": "baselines.dpo:DPOPolicy",
    "generalist": "swarm_forage_env.policies.pretrained:Generalist",
    "oracle": "swarm_forage_env.policies.oracle:OraclePolicy",
    "ppo_warehouse_small": "swarm_forage_env.policies.pretrained:PPOWarehouseSmall",
    "random": "swarm_forage_env.policies.registry:RandomPolicy",
    "stochm": "baselines.stochm:STOCHMPolicy",
    "stochx": "baselines.stochx:STOCHXPolicy",
}
"""Name -> where its class is, imported when it is asked for."""
_OPENERS = {
    ".npz": "swarm_forage_env.policies.model_files:open_network",
    ".py": "swarm_forage_env.policies.python_files:open_class",
    ".zip": "swarm_forage_env.policies.model_files:ModelPolicy",
}
"""Suffix of a policy file -> what opens it, called with the path and the parameters of a run."""
_LOCAL_POLICIES: dict[str, Callable[..., Policy]] = {}
"""Names that `local_policy` has given to policies of this process."""


_POLICY_FILE = re.compile(
    r"(?P<path>.*?[^/\\]\.(?:npz|zip|py))(?:(?<=py):(?P<name>[^\W\d]\w*))?(?::(?P<words>[a-z_]+=[^/\\:]*))?",
    re.IGNORECASE,
)
"""A policy file; the class of a Python file may stand behind it, then fields of an interface."""


class RandomPolicy:
    """Random actions, a minimum to beat."""

    reads: ClassVar[tuple[str, ...]] = ()

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Keep the swarm size and the generator."""
        self._shape = (spec.n_robots, spec.action_size)
        self._rng = rng

    def act(self, obs: ObsArray, active: BoolArray) -> ActionArray:
        """Return (N, A) actions drawn uniformly from [-1, 1]: commands, and messages if there are any."""
        return self._rng.uniform(-1.0, 1.0, self._shape).astype(np.float32)


class CallablePolicy:
    """A plain function `obs -> actions` as a policy; see `from_callable`."""

    def __init__(self, function: Callable[[ObsArray], ActionArray], name: str) -> None:
        self.function = function
        self.name = name

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Remember which actions fit."""
        self._spec = spec

    def act(self, obs: ObsArray, active: BoolArray) -> ActionArray:
        """Return the function's actions; raises ActionError for what are none."""
        return as_actions(self.function(obs), self._spec.n_robots, self._spec.message_size)


def from_callable(function: Callable[[ObsArray], ActionArray], *, name: str | None = None) -> CallablePolicy:
    """Wrap `function(obs) -> actions` as a Policy.

    Args:
        function: Takes (N, D) observations, returns (N, 3) actions; with messages, (N, 3 + message_size).
        name: Name under which results are stored; default the function's own name.
    """
    if not callable(function):
        raise ConfigError(f"Expected function to be callable, got {function!r}.")
    return CallablePolicy(function, name or getattr(function, "__name__", type(function).__name__))


class PolicyFile(NamedTuple):
    """What `my_module.py:MyPolicy` or `model.zip:observation=compact,decision_ticks=5` says."""

    path: str
    class_name: str | None
    """Of a Python file."""
    words: str
    """Fields of the interface as they were written."""

    @property
    def whole(self) -> str:
        """The file with its whole path, and with the class if it has one."""
        return ":".join(filter(None, (str(Path(self.path).resolve()), self.class_name)))

    def interface(self) -> dict[str, Any]:
        """Return the fields that are said with the file; raises ConfigError for a word that is no field=value."""
        return settings(f"the interface of {self.path}", self.words) if self.words else {}


def policy_file(policy: str) -> PolicyFile | None:
    """Return what the word for a policy file says, None for the name of a policy."""
    found = _POLICY_FILE.fullmatch(policy)
    return None if found is None else PolicyFile(found["path"], found["name"], found["words"] or "")


def is_policy_file(name: str) -> bool:
    """Return whether `name` is that of a policy file."""
    return policy_file(name) is not None


def named_interface(policy: str, parameters: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """Return a policy without the interface that is said with its file, and its parameters with that interface.

    Raises:
        ConfigError: a word that is no field=value, or the interface is among the parameters, too.
    """
    found = policy_file(policy)
    if found is None or not found.words:
        return policy, dict(parameters)
    if "interface" in parameters:
        raise ConfigError(f"Expected the interface of {found.path} once, got it with the file and as a parameter.")
    return policy.removesuffix(f":{found.words}"), {**parameters, "interface": found.interface()}


def policy_label(policy: str) -> str:
    """Return the name of a policy for people: of a file its name without folder and ending, or its class."""
    found = policy_file(policy)
    return policy if found is None else found.class_name or PurePath(found.path).stem


def file_of(policy: str) -> str:
    """Return a policy without what may stand behind its file."""
    found = policy_file(policy)
    return policy if found is None else found.path


def _imported(place: str) -> Callable[..., Policy]:
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


def policy_class(name: str) -> Callable[..., Policy]:
    """Return the class (or factory) registered under `name`, or what opens the policy file of that name.

    Raises:
        ValueError: no policy has that name; the message lists the known ones.
        UntrustedModelError: a file that runs code, and the console command was not told to trust it.

    What opens a file takes no interface where one is said with the file: see `named_interface`.
    """
    if name in _LOCAL_POLICIES:
        return _LOCAL_POLICIES[name]
    file = policy_file(name)
    if file is not None:
        trust.check(file.path)
        return partial(_opened, _imported(_OPENERS[PurePath(file.path).suffix.lower()]), name)
    if name in POLICIES:
        return _imported(POLICIES[name])
    raise ConfigError(
        f"Unknown policy {name!r}.{suggestion(name, POLICIES)} Known: {', '.join(POLICIES)}. Give one of your own by "
        "its file: policy.npz, model.zip, my_module.py:MyPolicy (docs/policies.md)."
    )


def _opened(opener: Callable[..., Policy], name: str, **parameters: Any) -> Policy:
    file, chosen = named_interface(name, parameters)
    return opener(file, **chosen)


@contextmanager
def local_policy(name: str, factory: Callable[..., Policy]) -> Generator[None]:
    """While the context lasts, `name` means `factory`; in this process only, so run with jobs=1.

    Args:
        name: A name that no policy has.
        factory: Builds a fresh policy for each run.

    Raises:
        ValueError: the name is taken, or looks like a policy file.
    """
    if name in _LOCAL_POLICIES or name in POLICIES or is_policy_file(name):
        raise ValueError(f"Expected a name of its own for the policy, got {name!r}, which stands for another one.")
    _LOCAL_POLICIES[name] = factory
    try:
        yield
    finally:
        del _LOCAL_POLICIES[name]


def load_policy(name: str | PurePath, parameters: Mapping[str, Any] | None = None) -> Policy:
    """Return a fresh policy by registered name or from a policy file, built with keyword `parameters`.

    Raises:
        TypeError: `name` is neither text nor a path.
        ValueError: no policy has that name; the message lists the known ones. Or an interface is given twice.
    """
    if not isinstance(name, str | PurePath):  # pyright: ignore[reportUnnecessaryIsInstance] - people pass None
        raise TypeError(f"Expected the name of a policy or of a policy file, got {name!r}.")
    return policy_class(str(name))(**dict(parameters or {}))
