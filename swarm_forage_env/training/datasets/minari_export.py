"""A data set as a Minari data set of the central view: one agent that sees and steers the whole swarm.

Its episodes are those of `views.gymnasium.JointForageEnv` with the same scenario, wrappers, interface and seed, and the
same actions: observations (N, d), the sum of the rewards of all robots, termination when all are dead.
"""

import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.vector.utils import batch_space

from swarm_forage_env._internal.wording import install_command
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.policies.interface import LearnerInterface
from swarm_forage_env.training.datasets.layout import DatasetError
from swarm_forage_env.training.datasets.reading import TrajectoryDataset

if TYPE_CHECKING:
    from minari import MinariDataset


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


def export_minari(folder: str | Path, dataset_id: str, **about: Any) -> "MinariDataset":
    """Make a Minari data set in its usual place (the environment variable `MINARI_DATASETS_PATH` chooses another).

    Args:
        folder: A data set of `record_dataset`; one episode for each run that is whole.
        dataset_id: Name of the new data set, such as "swarm_forage/dpo-v0".
        about: More for `minari.create_dataset_from_buffers`, such as `author` or `description`.

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
    dataset = TrajectoryDataset(folder)
    if not dataset.runs:
        raise DatasetError(f"Expected a run in {folder} that is whole, found none; record it to its end.")
    spec = dataset.card.spec
    n_robots = spec.scenario.robots.n_robots
    interface = LearnerInterface(dataset.card.interface, SwarmSpec.of(spec.scenario))
    episodes: list[EpisodeBuffer] = []
    for number, run in enumerate(dataset.runs):
        steps = dataset.steps(run.seed)
        ended = np.zeros(len(steps), np.bool_)
        ended[-1] = True
        all_dead = bool(steps.terminated.any(axis=0).all())
        arrays: dict[str, Any] = {  # it takes arrays, but declares lists
            "observations": steps.observations,
            "actions": steps.actions,
            "rewards": steps.rewards.sum(axis=1),
            "terminations": ended & all_dead,
            "truncations": ended & run.truncated,
        }
        episodes.append(EpisodeBuffer(id=number, seed=run.seed, infos={"active": steps.active}, **arrays))
    told: dict[str, Any] = {
        "algorithm_name": spec.policy,
        "description": f"{spec.scenario.name}, {n_robots} robots, policy {spec.policy}",
        "observation_space": batch_space(interface.observation_space, n_robots),
        "action_space": batch_space(interface.action_space, n_robots),
    }
    with warnings.catch_warnings():
        # It advises to name an author, links and environments; `about` is for those who want to.
        warnings.simplefilter("ignore", UserWarning)
        return minari.create_dataset_from_buffers(dataset_id, buffer=episodes, **{**told, **about})
