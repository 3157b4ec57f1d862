"""Trained policies in files: models saved by stable-baselines3 (`*.zip`), networks in our own format (`*.npz`).

`registry.policy_class` finds what opens a file by its suffix, in every process, so that the path of a file may be given
wherever the name of a policy may.
"""

import hashlib
import itertools
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces

from swarm_forage_env._internal.fields import ConfigError, checked, one_of, table
from swarm_forage_env._internal.wording import install_command
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.contract.types import ObsArray
from swarm_forage_env.policies.interface import (
    ACTIONS,
    OBSERVATIONS,
    GivenInterface,
    InterfaceConfig,
    any_swarm,
    chosen_interface,
)
from swarm_forage_env.policies.learned import LearnedPolicy
from swarm_forage_env.policies.network import Network, NetworkPolicy
from swarm_forage_env.scenarios.config import CACHE_KINDS

MODEL_NOTE = "swarm_forage_note"
"""Attribute of a model, saved with it: {"interface": fields, "caches": kind, "samples": whether it draws}."""
_DIGEST_DIGITS = 16


class ModelError(ValueError):
    """A file that does not hold a model, or a model that cannot steer this swarm."""


class ModelPolicy(LearnedPolicy):
    """A model saved by stable-baselines3 (PPO, A2C, DQN, SAC, TD3, DDPG) or sb3-contrib.

    A model of one robot is applied to every robot, whatever the swarm size; a recurrent one remembers for each of them.
    A model of a whole swarm, (N, d) to (N, k), works for its own N only. Discrete actions are drawn by their
    probabilities where the model has some (PPO, A2C), as in its training; all others are its best ones. What it sees
    and does is told by

    * the note that our training leaves in the file (`training.sb3.export.note_interface`),
    * the parameter `interface`, whose fields override those of the note,
    * its spaces. They do not show how many ticks a decision lasts, so without a note that has to be said.

    Nothing is normalised: a model trained behind `VecNormalize` gets other numbers than in training.

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
                for `RunSpec.parameters`. Other fields are those of the note in the file, or follow from its spaces.

        Raises:
            ImportError: stable-baselines3 is not installed.
            ModelError: the file is missing, has changed, or does not hold such a model; its spaces are not those of its
                interface; or nothing says how many ticks a decision lasts.
            ConfigError: an unknown field or value in `interface`.
        """
        name = Path(path).name
        network, note = _open_model(str(path), checked_digest(path, digest))
        found, self._n_robots = describe_spaces(network), _n_rows(network.observation_space)
        config, caches, draws = None, None, has_probabilities(network)
        if note is not None:
            config, caches, samples = _read_note(note, name)
            draws = draws and samples
        if note is None and not isinstance(interface, InterfaceConfig):
            said = dict(interface or {})
            chosen_interface(said)  # refuses unknown fields and values
            if "decision_ticks" not in said:
                raise ModelError(
                    f"Expected the ticks of a decision for {name}, which has no note of its training, got none; say "
                    f"{name}:decision_ticks=1 if it decides in every tick."
                )
            config = _deduced(found, tuple(said.items()))
            if config is None:
                raise ModelError(
                    f"Expected {name} to see and do what an interface says, but it has no note, and goes from "
                    f"{' to '.join(found)}. Say what it was trained with, such as {name}:neighbours_seen=3, or call "
                    "training.sb3.export.note_interface(model, interface) before it is saved."
                )
        config = chosen_interface(interface, config)
        fitting = describe_spaces(any_swarm(config))
        if found != fitting:
            source = f"the note in {name}" if interface is None else "the parameter interface"
            raise ModelError(
                f"Expected a model from {' to '.join(fitting)}, as {source} says; {name} goes from "
                f"{' to '.join(found)}."
            )
        super().__init__(config, self._predicted, caches=caches)
        self._name, self._network, self._draws = name, network, draws

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Start a run; raises ModelError where the model is one of another number of robots together."""
        if self._n_robots not in (None, spec.n_robots):
            raise ModelError(f"Expected the {self._n_robots} robots that {self._name} steers, got {spec.n_robots}.")
        self._memory: Any = None  # of a recurrent model, a row per robot
        super().reset(spec, rng)

    def _predicted(self, rows: ObsArray, rng: np.random.Generator) -> np.ndarray:
        """Choose an action for each row; the chance is that of the run."""
        import torch  # pyright: ignore[reportMissingImports] - an extra

        with torch.random.fork_rng(devices=()):
            # The generator itself: torch.manual_seed traces the stack, which takes longer than a decision.
            torch.default_generator.manual_seed(int(rng.integers(2**31)) if self._draws else 0)
            actions, self._memory = self._network.predict(rows, state=self._memory, deterministic=not self._draws)
        return actions


@lru_cache(maxsize=64)  # every run opens its model anew
def _deduced(found: tuple[str, str], said: tuple[tuple[str, Any], ...]) -> InterfaceConfig | None:
    """Return the interface with such spaces and with what is said of it; None where there is none."""
    for seen, done, grips, remembers in itertools.product(OBSERVATIONS, ACTIONS, (False, True), (False, True)):
        fields = {"observation": seen, "actions": done, "automatic_gripper": grips, "site_memory": remembers}
        try:
            config = chosen_interface({**fields, **dict(said)})
        except ConfigError:  # no messages beside discrete actions
            continue
        if describe_spaces(any_swarm(config)) == found:
            return config
    return None


def has_probabilities(network: Any) -> bool:
    """Whether a policy network has probabilities of discrete actions: of PPO and A2C, not of DQN."""
    return isinstance(network.action_space, spaces.Discrete) and hasattr(network, "get_distribution")


def _read_note(note: Any, name: str) -> tuple[InterfaceConfig, str, bool]:
    """Return interface, caches and whether actions are drawn, as a note says; raises ModelError for something else."""
    try:
        values = table("it", note)
        interface = chosen_interface(table("interface", values.get("interface")))
        one_of("caches", values.get("caches"), CACHE_KINDS)
        checked("samples", values.get("samples"), bool)
    except ConfigError as error:
        raise ModelError(f"Cannot use the note in {name}: {error}") from error
    return interface, values["caches"], values["samples"]


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
    """Return kind and size of the spaces of a model or an interface, of one robot; the two must agree in them."""
    return _kind_and_size(owner.observation_space), _kind_and_size(owner.action_space)


def _kind_and_size(space: spaces.Space[Any]) -> str:
    if isinstance(space, spaces.Discrete):
        return f"Discrete({space.n})"
    shape = space.shape or ()
    own = shape if _n_rows(space) is None else shape[1:]
    return f"{type(space).__name__}({', '.join(map(str, own))})"


def _n_rows(space: spaces.Space[Any]) -> int | None:
    """Return how many robots a space is of together, None where it is of one."""
    return space.shape[0] if space.shape is not None and len(space.shape) == 2 else None


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
    except Exception as error:  # torch and the library raise many kinds
        reason = " ".join(str(error).split())
        raise ModelError(
            f"Expected {path} to be a model saved by stable-baselines3, but it cannot be opened: {reason}."
        ) from error
    network.set_training_mode(False)
    return network, data.get(MODEL_NOTE)
