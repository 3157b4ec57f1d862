"""Data sets: what the robots of a policy see and do, for imitation and offline reinforcement learning.

    record_dataset(plan_run("warehouse_small", "dpo"), range(4), "results/datasets/dpo")
    dataset = Dataset("results/datasets/dpo")
    for run in dataset.runs():
        print(run.seed, run.rewards.sum())

A folder holds `dataset.json` (the run, the interface, the name of each column) and one `seed_000003.npz` per run, there
whole or not at all. With T decisions of N robots, row i being robot i:

    observations  (T + 1, N, d) float32     actions     (T, N) int64, or (T, N, k) float32
    rewards       (T, N) float64            terminated  (T, N) bool, robots that died in this decision
    truncated     (T, N) bool, at the end   active      (T + 1, N) bool, robots at work; others do not act

`export_minari` makes a Minari data set of the central view: one agent that sees and steers the whole swarm, as
`views.gymnasium.JointForageEnv` with the same scenario, wrappers, interface and seed has it.
"""

import json
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector.utils import batch_space

from swarm_forage_env._internal.archives import read_arrays
from swarm_forage_env._internal.fields import ConfigError, Count, checked, known_keys
from swarm_forage_env._internal.files import alone_in, check_folder, read_json, replacing
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env._internal.wording import install_command
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.contract.types import BoolArray, FloatArray, ObsArray
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface, chosen_interface
from swarm_forage_env.policies.learned import InterfacePolicy
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import build_env
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.workers import each_run
from swarm_forage_env.views.gymnasium import JointForageEnv

if TYPE_CHECKING:
    from minari import MinariDataset

CARD_FILE = "dataset.json"
ARRAYS = ("observations", "actions", "rewards", "terminated", "truncated", "active")
_LONGER_BY_ONE = ("observations", "active")
_MINARI_ID = re.compile(r"(?:[\w-][\w/-]*[\w-]/)?[\w-]+-v\d+")


class DatasetError(ValueError):
    """A folder that holds no data set, a damaged one, or another one than was asked for; the message names it."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Steps:
    """Decisions of a run, of all robots or of one of them (then without the axis of robots)."""

    seed: int
    observations: ObsArray
    actions: np.ndarray
    rewards: FloatArray
    terminated: BoolArray
    truncated: BoolArray
    active: BoolArray
    robot: int | None = None

    def __len__(self) -> int:
        return len(self.rewards)

    def of_robot(self, robot: int) -> "Steps":
        """Return what one robot saw and did, from the start to its death or the end of the run."""
        deaths = np.flatnonzero(self.terminated[:, robot])
        end = int(deaths[0]) + 1 if len(deaths) else len(self)
        parts: dict[str, Any] = {name: getattr(self, name)[: end + (name in _LONGER_BY_ONE), robot] for name in ARRAYS}
        return Steps(seed=self.seed, robot=robot, **parts)


class Dataset:
    """The runs of a folder.

    Attributes:
        folder: Where it lies.
        spec: The run, with the seed 0.
        interface: What is seen, and which actions were taken how often.
        columns: Name of the slice that each column of an observation belongs to, d entries.
        files: One per run, by seed.
    """

    def __init__(self, folder: str | Path) -> None:
        """Open a folder; raises DatasetError where it holds no data set."""
        self.folder = Path(folder)
        file = self.folder / CARD_FILE
        card = read_json(file, DatasetError)
        try:
            known_keys(card, ("run", "interface", "columns"), "key of a data set")
            self.spec = RunSpec.from_mapping(card["run"])
            self.interface = chosen_interface(card["interface"])
            self.columns = tuple(map(str, card["columns"]))
        except (KeyError, TypeError, ConfigError) as error:
            raise DatasetError(f"Cannot use {file}: {error}") from error
        self.files = tuple(sorted(self.folder.glob(f"seed_{6 * '[0-9]'}.npz")))

    def runs(self) -> Iterator[Steps]:
        """Yield all runs, one in memory at a time; raises DatasetError where there is none, or a damaged one."""
        if not self.files:
            raise DatasetError(f"Expected a run in {self.folder}, found none; record it to its end.")
        yield from map(read_steps, self.files)

    def episodes(self) -> Iterator[Steps]:
        """Yield the episode of every robot, run by run."""
        for run in self.runs():
            yield from map(run.of_robot, range(run.rewards.shape[1]))

    def transitions(self) -> dict[str, np.ndarray]:
        """Return all decisions of robots that were at work, in memory: arrays of one length by name.

        `observations`, `next_observations`, `actions`, `rewards`, `terminated`, `truncated`; for torch,
        `torch.from_numpy` each.
        """
        found: dict[str, list[np.ndarray]] = {}
        for run in self.runs():
            working = run.active[:-1]
            rows = {name: getattr(run, name)[working] for name in ARRAYS if name not in _LONGER_BY_ONE}
            rows |= {"observations": run.observations[:-1][working], "next_observations": run.observations[1:][working]}
            for name, values in rows.items():
                found.setdefault(name, []).append(values)
        return {name: np.concatenate(parts) for name, parts in found.items()}


def read_steps(file: str | Path) -> Steps:
    """Read a run; raises DatasetError for a file that is damaged or holds other arrays."""
    path = Path(file)
    try:
        arrays: dict[str, Any] = read_arrays(path)
        return Steps(seed=int(path.stem.removeprefix("seed_")), **arrays)
    except (OSError, TypeError, ValueError) as error:
        raise DatasetError(f"Expected {file} to be a run of a data set: {error} Record it again.") from error


def record_dataset(
    spec: RunSpec,
    seeds: Sequence[int],
    folder: str | Path,
    *,
    observation: str | None = None,
    site_memory: bool | None = None,
    jobs: int | None = 1,
    advance: Callable[[float], None] | None = None,
) -> int:
    """Make the runs that a folder lacks, and return how many.

    A learned policy is recorded as it was trained: what it saw, which action it chose, once per decision. Other
    policies are recorded in every tick, with their commands (left wheel, right wheel, gripper) as actions. After an
    interruption the same call goes on; a folder may get more seeds later.

    Args:
        spec: The run, see `runs.spec.plan_run`; its seed is replaced by each of `seeds`.
        seeds: Whole numbers from 0 up.
        folder: Where they go; made if it is missing.
        observation: "full" or "compact": what is recorded instead of what a learned policy sees, or of "full".
        site_memory: Whether the columns of `InterfaceConfig.site_memory` are recorded; None = those that a learned
            policy sees, none for others.
        jobs: As in `runs.workers.each_run`.
        advance: Called with the robot-ticks that are done when a run ends.

    Raises:
        ConfigError: seeds that are no whole numbers, or an unknown kind of observation.
        DatasetError: the folder holds another data set, or another call is writing to it.
        ValueError: the policy refuses the swarm.
    """
    wanted = {*checked("seeds", tuple(seeds), tuple[Count, ...])}
    folder, world = Path(folder), SwarmSpec.of(spec.scenario)
    config = _interface_of(spec, world, observation, site_memory)
    columns = [part.name for part in LearnerInterface(config, world).layout for _ in range(part.size)]
    card = {"run": replace(spec, seed=0).to_mapping(), "interface": asdict(config), "columns": columns}
    card = json.loads(json.dumps(card))
    check_folder(folder)
    with alone_in(folder, DatasetError):
        if (folder / CARD_FILE).exists():
            there = read_json(folder / CARD_FILE, DatasetError)
            differing = [name for name in card if there.get(name) != card[name]]
            if differing:
                raise DatasetError(f"The data set in {folder} has another {differing[0]}; give another folder.")
        with replacing(folder / CARD_FILE) as draft:
            draft.write_text(json.dumps(card, indent=1), encoding="utf-8")
        todo = [replace(spec, seed=seed) for seed in sorted(wanted) if not _file(folder, seed).exists()]
        made = each_run(partial(_keep, config, folder), todo, jobs=jobs)
        for n_made, _ in enumerate(made, 1):
            if advance is not None:
                advance(n_made * spec.robot_ticks)
    return len(todo)


def _file(folder: Path, seed: int) -> Path:
    return folder / f"seed_{seed:06d}.npz"


def _interface_of(
    spec: RunSpec, world: SwarmSpec, observation: str | None, site_memory: bool | None
) -> InterfaceConfig:
    """Return what is recorded: what a learned policy sees and chooses; observations and commands of all others."""
    policy, config = load_policy(spec.policy, spec.parameters), InterfaceConfig().for_scenario(spec.scenario)
    if isinstance(policy, InterfacePolicy):
        policy.reset(world, stream_rng(spec.seed, Stream.POLICY))
        config = policy.interface.config
    chosen: dict[str, Any] = {"observation": observation, "site_memory": site_memory}
    return replace(config, **{name: value for name, value in chosen.items() if value is not None})


def _keep(config: InterfaceConfig, folder: Path, spec: RunSpec) -> None:
    steps = record_steps(spec, config)
    arrays: dict[str, Any] = {name: getattr(steps, name) for name in ARRAYS}
    with replacing(_file(folder, spec.seed), ending=".tmp") as draft, draft.open("wb") as file:
        np.savez_compressed(file, **arrays)


def record_steps(spec: RunSpec, config: InterfaceConfig) -> Steps:
    """Make a run and return what its robots saw and did."""
    policy = load_policy(spec.policy, spec.parameters)
    is_learned = isinstance(policy, InterfacePolicy)
    env = build_env(spec.scenario, spec.wrappers, reads=None)
    world = env.unwrapped
    policy.reset(world.swarm_spec, stream_rng(spec.seed, Stream.POLICY))
    obs = env.reset_batch(spec.seed)
    interface = LearnerInterface(config, world.swarm_spec)
    found: dict[str, list[Any]] = {name: [] for name in ARRAYS}
    found["observations"].append(interface.observe(obs, decision=0))
    found["active"].append(world.active.copy())
    gone, is_over = np.zeros(len(obs), np.bool_), False
    while not is_over:
        earned, dead, truncated = np.zeros(len(obs)), gone, False
        for tick in range(config.decision_ticks):
            commands = policy.act(obs, world.active)
            if tick == 0:
                chosen = np.array(policy.chosen if is_learned else world.checked_actions(commands))
                found["actions"].append(chosen.astype(np.int64) if chosen.dtype.kind == "i" else chosen)
            obs, rewards, dead, truncated = env.step_batch(commands, tasks=getattr(policy, "task", None))
            earned += rewards
            is_over = truncated or bool(dead.all())
            if is_over:
                break
        found["rewards"].append(earned)
        found["terminated"].append(dead & ~gone)
        found["truncated"].append(~dead & truncated)
        gone = dead.copy()
        found["observations"].append(interface.observe(obs, decision=config.decisions_in(world.tick)))
        found["active"].append(world.active.copy())
    env.close()
    arrays: dict[str, Any] = {name: np.array(rows) for name, rows in found.items()}
    return Steps(seed=spec.seed, **arrays)


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
    if not _MINARI_ID.fullmatch(dataset_id):
        raise DatasetError(f"Expected a name of a Minari data set, such as swarm_forage/dpo-v0, got {dataset_id!r}.")
    if dataset_id in minari.list_local_datasets():
        raise DatasetError(f"There is a Minari data set {dataset_id!r}; name another.")


def recorded_env(spec: Mapping[str, Any], interface: Mapping[str, Any], **options: Any) -> JointForageEnv:
    """Return the environment of a recorded run: what `recover_environment` of a Minari data set calls.

    Args:
        spec: Of a run, `RunSpec.to_mapping`; its policy plays no part.
        interface: Fields of the interface that was recorded.
        options: Others of `JointForageEnv`, such as `render_mode`.
    """
    run = RunSpec.from_mapping(spec)
    seen = chosen_interface(dict(interface))
    return JointForageEnv(run.scenario, wrappers=run.wrappers, interface=seen, **options)


def export_minari(folder: str | Path, dataset_id: str, **about: Any) -> "MinariDataset":
    """Make a Minari data set in its usual place (the environment variable `MINARI_DATASETS_PATH` chooses another).

    Args:
        folder: A data set of `record_dataset`; one episode for each run that is whole.
        dataset_id: Name of the new data set, such as "swarm_forage/dpo-v0".
        about: More, or other values, for `minari.create_dataset_from_buffers`, such as `author` or `description`.

    Raises:
        ImportError: minari is not installed.
        DatasetError: the folder holds no data set or no whole run, or see `check_minari`.
    """
    check_minari(dataset_id)
    import minari
    from minari.data_collector import EpisodeBuffer

    dataset = Dataset(folder)
    spec, interface = dataset.spec, LearnerInterface(dataset.interface, SwarmSpec.of(dataset.spec.scenario))
    episodes: list[EpisodeBuffer] = []
    for number, steps in enumerate(dataset.runs()):
        is_last = np.arange(len(steps)) == len(steps) - 1
        arrays: dict[str, Any] = {  # it takes arrays, but declares lists
            "observations": steps.observations,
            "actions": steps.actions,
            "rewards": steps.rewards.sum(axis=1),
            "terminations": is_last & bool(steps.terminated.any(axis=0).all()),
            "truncations": is_last & bool(steps.truncated[-1].any()),
        }
        episodes.append(EpisodeBuffer(id=number, seed=steps.seed, infos={"active": steps.active}, **arrays))
    told: dict[str, Any] = {
        "env": EnvSpec(
            f"swarm_forage/{re.sub('[^-_a-zA-Z0-9]', '_', spec.scenario.name)}-v0",
            entry_point=f"{__name__}:{recorded_env.__name__}",
            kwargs={"spec": spec.to_mapping(), "interface": asdict(dataset.interface)},
        ),
        "algorithm_name": spec.policy,
        "description": f"{spec.world.name}, policy {spec.policy}",
        "observation_space": batch_space(interface.observation_space, spec.scenario.robots.n_robots),
        "action_space": batch_space(interface.action_space, spec.scenario.robots.n_robots),
    }
    with warnings.catch_warnings():
        # It advises to name an author, links and environments; `about` is for those who want to.
        warnings.simplefilter("ignore", UserWarning)
        return minari.create_dataset_from_buffers(dataset_id, buffer=episodes, **{**told, **about})
