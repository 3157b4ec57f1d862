"""A data set as a Minari data set of the central view: one agent that sees and steers the whole swarm.

Its episodes are those of `views.gymnasium.JointForageEnv` with the same scenario, wrappers, interface and seed, and the
same actions: observations (N, d), the sum of the rewards of all robots, termination when all are dead.
"""

import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector.utils import batch_space

from swarm_forage_env._internal.wording import install_command
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.policies.interface import LearnerInterface, interface_from_mapping
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.training.datasets import Dataset, DatasetError
from swarm_forage_env.views.gymnasium import JointForageEnv

if TYPE_CHECKING:
    from minari import MinariDataset


_RANDOM_RUNS = 3
"""Runs with random actions for the lower reference score (our choice: seconds)."""
_ID = re.compile(r"(?:[\w-]+/)*[\w-]+-v\d+")


def check_minari(dataset_id: str) -> None:
    """Refuse a name under which `export_minari` could make nothing.

    Raises:
        ImportError: minari is not installed.
        DatasetError: it is no name of a Minari data set, or there is one of that name.
    """
    try:
        import minari
    except ImportError as error:
        raise ImportError(f"A Minari data set needs minari: {install_command('minari')}.") from error
    if not _ID.fullmatch(dataset_id):
        raise DatasetError(f"Expected a name of a Minari data set, such as swarm_forage/dpo-v0, got {dataset_id!r}.")
    if dataset_id in minari.list_local_datasets():
        raise DatasetError(
            f"Expected the name of a new Minari data set, got {dataset_id!r}, which is there; name another."
        )


def recorded_env(spec: Mapping[str, Any], interface: Mapping[str, Any], **options: Any) -> JointForageEnv:
    """Return the environment of a recorded run: what `recover_environment` of a Minari data set calls.

    Args:
        spec: Of a run, `RunSpec.to_mapping`; its policy plays no part.
        interface: Fields of the interface that was recorded.
        options: Others of `JointForageEnv`, such as `render_mode`.
    """
    run = RunSpec.from_mapping(spec)
    return JointForageEnv(
        run.scenario, wrappers=run.wrappers, interface=interface_from_mapping(dict(interface)), **options
    )


def _reference_scores(env_spec: EnvSpec, seeds: Sequence[int], returns: Sequence[float]) -> dict[str, float]:
    """Return what 0 and 1 mean in Minari's normalized scores: random actions, and the recorded policy.

    There is no 1 where the recorded policy is not better than random actions.
    """
    env = gymnasium.make(env_spec)
    at_random = [_random_return(env, seed) for seed in seeds[:_RANDOM_RUNS]]
    env.close()
    low, high = float(np.mean(at_random)), float(np.mean(returns))
    return {"ref_min_score": low, **({"ref_max_score": high} if high > low else {})}


def _random_return(env: gymnasium.Env[Any, Any], seed: int) -> float:
    """Return the sum of rewards of a run with actions drawn from the action space."""
    env.reset(seed=seed)
    env.action_space.seed(seed)
    total, over = 0.0, False
    while not over:
        _, reward, terminated, truncated, _ = env.step(env.action_space.sample())
        total, over = total + float(reward), terminated or truncated
    return total


def export_minari(folder: str | Path, dataset_id: str, **about: Any) -> "MinariDataset":
    """Make a Minari data set in its usual place (the environment variable `MINARI_DATASETS_PATH` chooses another).

    Args:
        folder: A data set of `record_dataset`; one episode for each run that is whole.
        dataset_id: Name of the new data set, such as "swarm_forage/dpo-v0".
        about: More, or other values, for `minari.create_dataset_from_buffers`, such as `author` or `description`.

    Raises:
        ImportError: minari is not installed.
        DatasetError: the folder holds no data set, or no whole run.
        ValueError: Minari has a data set of that name, or refuses the name.
    """
    try:
        import minari
        from minari.data_collector import EpisodeBuffer
    except ImportError as error:
        raise ImportError(f"A Minari data set needs minari: {install_command('minari')}.") from error
    dataset = Dataset(folder)
    if not dataset.files:
        raise DatasetError(f"Expected a run in {folder}, found none; record it to its end.")
    spec = dataset.spec
    n_robots = spec.scenario.robots.n_robots
    interface = LearnerInterface(dataset.interface, SwarmSpec.of(spec.scenario))
    episodes: list[EpisodeBuffer] = []
    runs = list(dataset.runs())
    for number, steps in enumerate(runs):
        ended = np.zeros(len(steps), np.bool_)
        ended[-1] = True
        arrays: dict[str, Any] = {  # it takes arrays, but declares lists
            "observations": steps.observations,
            "actions": steps.actions,
            "rewards": steps.rewards.sum(axis=1),
            "terminations": ended & bool(steps.terminated.any(axis=0).all()),
            "truncations": ended & bool(steps.truncated[-1].any()),
        }
        episodes.append(EpisodeBuffer(id=number, seed=steps.seed, infos={"active": steps.active}, **arrays))
    env_spec = EnvSpec(
        f"swarm_forage/{spec.scenario.name}-v0",
        entry_point=f"{__name__}:{recorded_env.__name__}",
        kwargs={"spec": spec.to_mapping(), "interface": asdict(dataset.interface)},
    )
    told: dict[str, Any] = {
        "env": env_spec,
        **_reference_scores(env_spec, [run.seed for run in runs], [np.sum(one.rewards) for one in episodes]),
        "algorithm_name": spec.policy,
        "description": f"{spec.world.name}, policy {spec.policy}",
        "observation_space": batch_space(interface.observation_space, n_robots),
        "action_space": batch_space(interface.action_space, n_robots),
    }
    with warnings.catch_warnings():
        # It advises to name an author, links and environments; `about` is for those who want to.
        warnings.simplefilter("ignore", UserWarning)
        return minari.create_dataset_from_buffers(dataset_id, buffer=episodes, **{**told, **about})
