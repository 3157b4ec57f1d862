"""How a policy is found and made: by its registered name, from a file, from a function."""

import re
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from pathlib import Path, PurePath
from typing import Any, ClassVar

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.wording import suggestion
from swarm_forage_env.contract.policy import Policy, SwarmSpec, real_numbers
from swarm_forage_env.contract.types import ActionArray, BoolArray, ObsArray
from swarm_forage_env.policies import trust

POLICIES = {
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


_FILE_WITH_WORDS = re.compile(r"(?P<file>.+?):(?P<words>[a-z_]+=[^/\\:]*)")
_FILE_WITH_CLASS = re.compile(r"(?P<file>.+\.py):(?P<name>[^\W\d]\w*)", re.IGNORECASE)
_WORDS: dict[str, Any] = {"true": True, "false": False}


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
        """Remember which shapes of actions fit."""
        self._shapes = spec.action_shapes

    def act(self, obs: ObsArray, active: BoolArray) -> ActionArray:
        """Return the function's actions, checked for type and shape; raises ValueError otherwise."""
        given = self.function(obs)
        try:
            actions = real_numbers(given)
        except (TypeError, ValueError) as error:
            raise ValueError(
                f"Expected policy {self.name!r} to return real numbers, one row per robot: {error}."
            ) from error
        if actions.shape not in self._shapes:
            raise ValueError(
                f"Expected policy {self.name!r} to return actions with shape (n_robots, 3) = "
                f"{' or '.join(map(str, self._shapes))}, got {actions.shape}; return one row per robot."
            )
        return actions


def from_callable(function: Callable[[ObsArray], ActionArray], *, name: str | None = None) -> CallablePolicy:
    """Wrap `function(obs) -> actions` as a Policy.

    Args:
        function: Takes (N, D) observations, returns (N, 3) actions; with messages, (N, 3 + message_size).
        name: Name under which results are stored; default the function's own name.
    """
    return CallablePolicy(function, name or getattr(function, "__name__", type(function).__name__))


def is_policy_file(name: str) -> bool:
    """Return whether `name` has the suffix of a policy file.

    The interface may be said with it, see `split_interface`, and the class of a Python file, see `split_class`.
    """
    return _opener(split_interface(name)[0]) is not None


def split_interface(policy: str) -> tuple[str, dict[str, Any]]:
    """Return a policy without the interface that is said with its file, and the fields of that interface.

    `model.zip:observation=compact,decision_ticks=5` is the file model.zip, trained with compact observations and five
    ticks per decision. Anything else is returned as it is, with no fields.

    Raises:
        ConfigError: a word that is no field=value.
    """
    found = _FILE_WITH_WORDS.fullmatch(policy)
    if found is None or _opener(found["file"]) is None:
        return policy, {}
    fields: dict[str, Any] = {}
    for word in found["words"].split(","):
        name, equals, value = (part.strip() for part in word.partition("="))
        if not (name and equals and value):
            raise ConfigError(f"Expected the interface of {found['file']} as field=value, got {word!r} in {policy!r}.")
        fields[name] = int(value) if value.isdecimal() else _WORDS.get(value.lower(), value)
    return found["file"], fields


def split_class(policy: str) -> tuple[str, str | None]:
    """Return the Python file and the class of a policy such as `my_module.py:MyPolicy`; else the policy, and None."""
    found = _FILE_WITH_CLASS.fullmatch(policy)
    return (policy, None) if found is None else (found["file"], found["name"])


def named_interface(policy: str, parameters: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """Return a policy without the interface that is said with its file, and its parameters with that interface.

    Raises:
        ConfigError: see `split_interface`, or the interface is among the parameters, too.
    """
    file, interface = split_interface(policy)
    if not interface:
        return file, dict(parameters)
    if "interface" in parameters:
        raise ConfigError(f"Expected the interface of {file} once, got it with the file and as a parameter.")
    return file, {**parameters, "interface": interface}


def policy_label(policy: str) -> str:
    """Return the name of a policy for people: of a file its name without folder and ending, or its class."""
    if not is_policy_file(policy):
        return policy
    return split_class(policy)[1] or PurePath(policy).stem


def file_of(policy: str) -> str:
    """Return a policy without what may stand behind its file: a class, or words of an interface, which are not read."""
    found = _FILE_WITH_WORDS.fullmatch(policy)
    return split_class(policy if found is None else found["file"])[0]


def whole_path(policy: str) -> str:
    """Return a policy file with its whole path, and with the class if it has one."""
    file, name = split_class(policy)
    path = str(Path(file).resolve())
    return path if name is None else f"{path}:{name}"


def _opener(name: str) -> str | None:
    """Return where that is what opens the policy file of that name."""
    return _OPENERS.get(PurePath(split_class(name)[0]).suffix.lower())


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
    file, _ = split_interface(name)
    opener = _opener(file)
    if opener is not None:
        trust.check(file_of(file))
        return partial(_opened, _imported(opener), name)
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
