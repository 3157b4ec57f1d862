"""Trained policies in files: models that stable-baselines3 saved (`*.zip`), networks of our own (`*.npz`).

`policy.policy_class` finds what opens a file by its suffix, in every process, so that a path is a policy wherever a
name is one.
"""

import hashlib
import pickle
from collections.abc import Mapping
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces

from swarm_forage_env._internal.extras import install_command
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.contract.types import ActionArray, BoolArray, ObsArray
from swarm_forage_env.policies.interface import (
    ACTIONS,
    OBSERVATIONS,
    InterfaceConfig,
    LearnerInterface,
    interface_from_mapping,
)
from swarm_forage_env.policies.network import Network, NetworkPolicy
from swarm_forage_env.scenarios.config import CACHE_KINDS

MODEL_NOTE = "swarm_forage_note"
"""Attribute of a model, saved with it, that says what its spaces do not: {"interface": fields, "caches": kind}."""
_DIGEST_DIGITS = 16
MODEL_FAULTS = (
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    AssertionError,
    RuntimeError,
    OSError,
    EOFError,
    pickle.UnpicklingError,
)
"""What stable-baselines3 and torch raise over a file that is no model or has been damaged."""


class ModelError(ValueError):
    """A file that is no model, or a model that cannot steer this swarm."""


class ModelPolicy:
    """A model saved by stable-baselines3 (PPO, A2C, DQN, SAC, TD3, DDPG), acting without exploration.

    A model of one robot is applied to every robot, whatever the swarm size. What it sees and does, of the choices in
    `learning.interface`, is read from the note that our training leaves in the file (`sb3.export.note_interface`);
    without one it is told from the spaces, and a decision lasts one tick. A model of the whole swarm, (N, D) to (N, 3),
    works for its own N only. Nothing is normalised: a model trained behind `VecNormalize` sees other numbers than it
    was trained on.

    Opening a model runs code that the file contains. Open only what you trust.

    Attributes:
        reads: Observation slices that are looked at, None = all.
        caches: World that the model was trained in; there only when the file tells.
    """

    reads: tuple[str, ...] | None = None
    caches: str

    def __init__(self, path: str | Path, *, digest: str | None = None, decision_ticks: int | None = None) -> None:
        """Open the model.

        Args:
            path: The saved file.
            digest: What `file_digest` returned when the run was planned; a file that has changed since is refused.
            decision_ticks: Ticks for which an action is kept; default as in training where the file tells, else 1.

        Raises:
            ImportError: stable-baselines3 is not installed.
            ModelError: the file is missing, has changed, or holds no such model.
            ConfigError: decision_ticks below 1.
        """
        self._path = Path(path)
        self._network, note = _open_model(str(path), _checked_digest(path, digest))
        self._noted = None
        if note is not None:
            self._noted, self.caches = _read_note(note, self._path)
            self.reads = self._noted.reads
        if decision_ticks is None:
            decision_ticks = self._noted.decision_ticks if self._noted else 1
        self._decision_ticks = InterfaceConfig(decision_ticks=decision_ticks).decision_ticks

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Find out how the model sees and steers this swarm.

        Raises:
            ModelError: it sees or does something else.
        """
        self._interface = self._fitting_interface(spec)
        self._ticks_left = 0

    def act(self, obs: ObsArray, active: BoolArray) -> ActionArray:
        """Return the model's deterministic choice, (N, 3) float32."""
        if self._ticks_left == 0:
            seen = obs if self._interface is None else self._interface.observe(obs)
            self._actions, _ = self._network.predict(seen, deterministic=True)
            self._ticks_left = self._decision_ticks
        self._ticks_left -= 1
        if self._interface is None:
            return np.asarray(self._actions, np.float32)
        return self._interface.command(self._actions, obs)

    def _fitting_interface(self, spec: SwarmSpec) -> LearnerInterface | None:
        """Return the interface whose spaces are those of the model; None for a model of the whole swarm."""
        n_robots, size = spec.n_robots, spec.layout.size
        found = describe_spaces(self._network)
        if self._noted is not None:
            return self._noted_interface(self._noted, spec, found)
        if found == (f"Box({n_robots}, {size})", f"Box({n_robots}, 3)"):
            return None
        seen: list[str] = []
        for observation, actions, automatic in product(OBSERVATIONS, ACTIONS, (False, True)):
            config = InterfaceConfig(observation=observation, actions=actions, automatic_gripper=automatic)
            interface = LearnerInterface(config, spec)
            fitting = describe_spaces(interface)
            if found == fitting:
                return interface
            seen.append(" to ".join(fitting))
        raise ModelError(
            f"Expected a model of one robot, from observations to actions {', '.join(seen)}, or of these {n_robots} "
            f"robots together, Box({n_robots}, {size}) to Box({n_robots}, 3); {self._path.name} goes from "
            f"{' to '.join(found)}."
        )

    def _noted_interface(self, noted: InterfaceConfig, spec: SwarmSpec, found: tuple[str, ...]) -> LearnerInterface:
        interface = LearnerInterface(noted, spec)
        fitting = describe_spaces(interface)
        if found != fitting:
            raise ModelError(
                f"Expected a model from {' to '.join(fitting)}, as the note in {self._path.name} says, got one from "
                f"{' to '.join(found)}."
            )
        return interface


def _read_note(note: Any, path: Path) -> tuple[InterfaceConfig, str]:
    """Return interface and caches that a note tells.

    Raises:
        ModelError: it tells something else.
    """
    if not isinstance(note, Mapping) or not isinstance(note.get("interface"), Mapping):
        raise ModelError(f"Expected the note in {path} to be a table with interface and caches, got {note!r}.")
    try:
        interface = interface_from_mapping(dict(note["interface"]))
    except ConfigError as error:
        raise ModelError(f"Cannot use the note in {path}: {error}") from error
    if note.get("caches") not in CACHE_KINDS:
        raise ModelError(
            f"Expected caches in the note in {path} to be one of {', '.join(CACHE_KINDS)}, got {note.get('caches')!r}."
        )
    return interface, note["caches"]


def open_network(path: str | Path, *, digest: str | None = None) -> NetworkPolicy:
    """Return the policy of a network file; see `learning.network`.

    Args:
        path: The file.
        digest: As in `ModelPolicy`.

    Raises:
        ModelError: the file is missing or has changed.
        NetworkError: it holds no network.
    """
    _checked_digest(path, digest)
    return NetworkPolicy(Network.load(path))


def file_digest(path: str | Path) -> str:
    """Return a short hash of a policy file, which makes its content part of a run's identity.

    Raises:
        ModelError: the file cannot be read.
    """
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise ModelError(f"Cannot read the policy file {path}: {error.strerror or error}.") from error
    return hashlib.blake2b(content, digest_size=_DIGEST_DIGITS // 2).hexdigest()


def _checked_digest(path: str | Path, planned: str | None) -> str:
    found = file_digest(path)
    if planned not in (None, found):
        raise ModelError(
            f"Expected {path} as it was when the run was planned (digest {planned}), got a file that has changed since "
            f"({found}); plan the run again."
        )
    return found


def describe_spaces(owner: Any) -> tuple[str, str]:
    """Return kind and size of what a model or an interface sees and does, which is what has to agree."""
    return _kind_and_size(owner.observation_space), _kind_and_size(owner.action_space)


def _kind_and_size(space: spaces.Space[Any]) -> str:
    size = space.n if isinstance(space, spaces.Discrete) else ", ".join(map(str, space.shape or ()))
    return f"{type(space).__name__}({size})"


@lru_cache(maxsize=2)
def _open_model(path: str, digest: str) -> tuple[Any, Any]:  # noqa: ARG001 - with the digest a changed file is new
    """Return the policy network of a saved model, in evaluation mode, on the CPU; and its note, None without one.

    The network alone, not the algorithm around it, which for off-policy methods would allocate its replay buffer.
    """
    try:
        from stable_baselines3.common.policies import ActorCriticPolicy  # pyright: ignore[reportMissingImports]
        from stable_baselines3.common.save_util import load_from_zip_file  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise ImportError(f"The model {path} needs stable-baselines3: {install_command('train')}.") from error

    try:
        data, parameters, _ = load_from_zip_file(path, device="cpu")
        if data is None:
            raise ModelError("it holds no description of a policy")
        settings = dict(data["policy_kwargs"])
        settings.pop("device", None)
        if issubclass(data["policy_class"], ActorCriticPolicy):
            settings.setdefault("use_sde", data["use_sde"])  # the other algorithms keep it among the settings
        network = data["policy_class"](data["observation_space"], data["action_space"], lambda _: 0.0, **settings)
        weights: Any = parameters["policy"]
        network.load_state_dict(weights)
    except MODEL_FAULTS as error:
        reason = " ".join(str(error).split())
        raise ModelError(
            f"Expected {path} to be a model saved by stable-baselines3, but it cannot be opened: {reason}."
        ) from error
    network.set_training_mode(False)
    return network, data.get(MODEL_NOTE)
