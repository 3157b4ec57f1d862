"""Trained policies in files: models saved by stable-baselines3 (`*.zip`), networks in our own format (`*.npz`).

`registry.policy_class` finds what opens a file by its suffix, in every process, so that the path of a file may be given
wherever the name of a policy may.
"""

import hashlib
import pickle
import warnings
from collections.abc import Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.wording import install_command
from swarm_forage_env.contract.policy import COMMANDS, SwarmSpec
from swarm_forage_env.contract.types import ObsArray
from swarm_forage_env.policies.interface import (
    GivenInterface,
    InterfaceConfig,
    chosen_interface,
    interface_from_mapping,
)
from swarm_forage_env.policies.learned import LearnedPolicy, Remember
from swarm_forage_env.policies.network import Network, NetworkPolicy
from swarm_forage_env.scenarios.config import CACHE_KINDS

MODEL_NOTE = "swarm_forage_note"
"""Attribute of a model, saved with it: {"interface": fields, "caches": kind}, which its spaces do not show."""
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
"""Errors that stable-baselines3 and torch raise for a damaged file or one without a model."""


class InterfaceGuessWarning(UserWarning):
    """A model that does not tell its interface runs by the default one, which may not be what it was trained with."""


class ModelError(ValueError):
    """A file that does not hold a model, or a model that cannot steer this swarm."""


class ModelPolicy(LearnedPolicy):
    """A model saved by stable-baselines3 (PPO, A2C, DQN, SAC, TD3, DDPG) or sb3-contrib, acting without exploration.

    A model of one robot is applied to every robot, whatever the swarm size; a recurrent one remembers for each of them.
    Its interface is given by

    * the note that our training leaves in the file (`training.sb3.export.note_interface`),
    * the parameter `interface`, whose fields override those of the note,
    * its spaces, where both are missing and the spaces are those of the environment itself, (D,) to (3,). They do not
      show how many ticks a decision lasts; 1 is taken, and an `InterfaceGuessWarning` says so unless `digest` is given.

    A model of the whole swarm, (N, D) to (N, 3), needs no note either, and works for its own N only. Nothing is
    normalised: a model trained behind `VecNormalize` gets other numbers than in training.

    Opening a model runs code that the file contains. Open only what you trust.

    Attributes:
        caches: Kind of caches that the model was trained with; only set if the file has a note.
    """

    def __init__(self, path: str | Path, *, digest: str | None = None, interface: GivenInterface = None) -> None:
        """Open the model.

        Args:
            path: The saved file.
            digest: Result of `file_digest` when the run was planned; a file that has changed since then is refused.
            interface: What the model sees and does: an `InterfaceConfig` or its fields by name, which are plain values
                for `RunSpec.parameters`. Other fields are those of the note in the file, else the default.

        Raises:
            ImportError: stable-baselines3 is not installed.
            ModelError: the file is missing, has changed, or does not hold such a model.
            ConfigError: an unknown field or value in `interface`.
        """
        self._path = Path(path)
        self._network, note = _open_model(str(path), checked_digest(path, digest))
        noted, caches = (None, None) if note is None else _read_note(note, self._path)
        self._is_told = noted is not None or interface is not None
        self._source = f"the note in {self._path.name}" if interface is None else "the parameter interface"
        super().__init__(
            chosen_interface(interface, noted), remember=deterministic_choice(self._network), caches=caches
        )
        if digest is None and not self._is_told:
            warnings.warn(
                f"{self._path.name} does not tell its interface: it runs with full observations, continuous actions "
                f"and one decision per tick. If it was trained otherwise, say so: {self._path.name}:decision_ticks=5",
                InterfaceGuessWarning,
                stacklevel=2,
            )

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Start a run.

        Raises:
            ModelError: the spaces of the model are not those of its interface, or its interface is not known.
        """
        super().reset(spec, rng)
        found, fitting = describe_spaces(self._network), describe_spaces(self.interface)
        columns, n_robots = spec.layout.size, spec.n_robots
        acts = COMMANDS + (self.interface.config.message_size or 0)
        whole_swarm = (f"Box({n_robots}, {columns})", f"Box({n_robots}, {acts})")
        sees_what_the_environment_shows = fitting == (f"Box({columns})", f"Box({acts})")
        if found == fitting or (found == whole_swarm and sees_what_the_environment_shows):
            return
        name, goes = self._path.name, " to ".join(found)
        if self._is_told:
            raise ModelError(
                f"Expected a model from {' to '.join(fitting)}, as {self._source} says; {name} goes from {goes}."
            )
        raise ModelError(
            f"Expected {name} to tell what it sees and does, but it has no note, and its spaces, {goes}, are neither "
            f"those of the environment, {' to '.join(fitting)}, nor those of these {n_robots} robots together, "
            f"{' to '.join(whole_swarm)}. Give the interface that it was trained with: "
            f"{name}:observation=compact,decision_ticks=5 as the policy, or "
            'load_policy(path, {"interface": {"observation": "compact"}}); or call '
            "training.sb3.export.note_interface(model, interface) before the model is saved."
        )


def deterministic_choice(model: Any) -> Remember:
    """Return how a model of stable-baselines3, or its policy network, chooses without exploration.

    The memory is the state of a recurrent model, a row per robot; other models have none.
    """
    return partial(_predicted, model)


def _predicted(
    model: Any,
    rows: ObsArray,
    memory: Any,
    rng: np.random.Generator,  # noqa: ARG001 - nothing is drawn
) -> tuple[np.ndarray, Any]:
    return model.predict(rows, state=memory, deterministic=True)


def _read_note(note: Any, path: Path) -> tuple[InterfaceConfig, str]:
    """Return the interface and the caches of a note.

    Raises:
        ModelError: the note holds something else.
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


def open_network(path: str | Path, *, digest: str | None = None, interface: GivenInterface = None) -> NetworkPolicy:
    """Return the policy of a network file; see `policies.network`.

    Args:
        path: The file.
        digest: As in `ModelPolicy`.
        interface: None; such a file holds its own.

    Raises:
        ModelError: the file is missing or has changed, or an interface is given.
        NetworkError: it does not hold a network.
    """
    if interface is not None:
        raise ModelError(f"Expected {path} without an interface, got {interface!r}; a network file holds its own.")
    checked_digest(path, digest)
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


def checked_digest(path: str | Path, planned: str | None) -> str:
    """Return the `file_digest` of a policy file, which must be the planned one unless that is None.

    Raises:
        ModelError: the file cannot be read, or has changed.
    """
    found = file_digest(path)
    if planned not in (None, found):
        raise ModelError(
            f"Expected {path} as it was when the run was planned (digest {planned}), got a file that has changed since "
            f"({found}); plan the run again."
        )
    return found


def describe_spaces(owner: Any) -> tuple[str, str]:
    """Return kind and size of the spaces of a model or an interface; a model and its interface must agree in them."""
    return _kind_and_size(owner.observation_space), _kind_and_size(owner.action_space)


def _kind_and_size(space: spaces.Space[Any]) -> str:
    size = space.n if isinstance(space, spaces.Discrete) else ", ".join(map(str, space.shape or ()))
    return f"{type(space).__name__}({size})"


@lru_cache(maxsize=2)
def _open_model(path: str, digest: str) -> tuple[Any, Any]:  # noqa: ARG001 - with the digest a changed file is new
    """Return the policy network of a saved model, in evaluation mode, on the CPU; and its note, or None.

    Only the network is built: the algorithm of an off-policy method would allocate its replay buffer.
    """
    try:
        from stable_baselines3.common.policies import ActorCriticPolicy  # pyright: ignore[reportMissingImports] - an extra
        from stable_baselines3.common.save_util import load_from_zip_file  # pyright: ignore[reportMissingImports] - an extra
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
