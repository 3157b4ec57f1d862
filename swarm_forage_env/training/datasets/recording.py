"""Recording what a policy sees and does: `plan_dataset` says what, `record_dataset` does it."""

import errno
import math
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces

from swarm_forage_env._internal.fields import MOST_SEEDS, ConfigError, several, whole
from swarm_forage_env._internal.files import alone_in, check_folder, replacing
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env._internal.wording import counted
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.contract.policy import Policy, SwarmSpec
from swarm_forage_env.policies import trust
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.policies.learned import InterfacePolicy
from swarm_forage_env.policies.mixture import is_mixture, part_sizes
from swarm_forage_env.policies.model_files import look_at_file
from swarm_forage_env.policies.registry import file_of, is_policy_file, load_policy, part_labels, policy_label
from swarm_forage_env.runs.answer import Sheet
from swarm_forage_env.runs.run import build_env
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.versions import software_versions
from swarm_forage_env.runs.workers import Tell, map_runs
from swarm_forage_env.training.datasets.croissant import describe_dataset
from swarm_forage_env.training.datasets.layout import (
    CARD_FILE,
    Card,
    DatasetError,
    RunSummary,
    chunk_file,
    summary_file,
)

CHUNK_BYTES = 2**25
"""Most bytes of a chunk (our choice: 32 MiB are read at once without thought on any machine)."""
_HEADERS_BYTES = 2_000
"""What names, types and the table of contents of a chunk take at most; six arrays have about 1,500."""


@dataclass(frozen=True, kw_only=True, slots=True)
class DatasetPlan:
    """What is to be recorded."""

    spec: RunSpec
    """The run; its seed is replaced by each of `seeds`."""
    card: Card
    compress: bool = False
    """Whether chunks are compressed: slower, several times smaller."""

    @property
    def chunk_decisions(self) -> int:
        """Decisions in a chunk, the last one of a run aside."""
        return max(1, min(self.card.n_decisions, CHUNK_BYTES // self._decision_bytes))

    @property
    def _decision_bytes(self) -> int:
        """Bytes of one decision of all robots: observation, action, reward and three truth values."""
        action = 8 if self.card.n_actions is not None else 4 * self.card.action_shape[-1]
        return self.spec.scenario.robots.n_robots * (4 * len(self.card.columns) + action + 8 + 3)

    @property
    def run_bytes(self) -> int:
        """Bytes of one run; if it is compressed or ends early, fewer."""
        n_chunks = math.ceil(self.card.n_decisions / self.chunk_decisions)
        n_robots = self.spec.scenario.robots.n_robots
        last_rows = n_chunks * n_robots * (4 * len(self.card.columns) + 1)
        return self.card.n_decisions * self._decision_bytes + last_rows + n_chunks * _HEADERS_BYTES

    def missing(self, folder: Path) -> tuple[int, ...]:
        """Return the seeds whose runs are not yet whole in a folder."""
        return tuple(seed for seed in self.card.seeds if not summary_file(folder, seed).exists())

    def describe(self, folder: Path) -> Sheet:
        """Return what is to be recorded, and how much room it takes in a folder."""
        scenario, config, n_todo = self.spec.scenario, self.card.interface, len(self.missing(folder))
        actions = f"{self.card.n_actions} discrete actions"
        if len(self.card.action_shape) == 2:
            actions = f"commands of {'two' if self.card.action_shape[-1] == 2 else 'three'} numbers"
        room = f"{'at most' if self.compress else 'about'} {n_todo * self.run_bytes / 1e6:,.1f} MB"
        each = counted(self.card.n_decisions, "decision") + f" of {counted(scenario.robots.n_robots, 'robot')}"
        return Sheet(
            rows=[
                ("policy", f"{policy_label(self.spec.policy)} in {self.spec.world.title()}, {scenario.horizon_s:g} s"),
                ("runs", f"{len(self.card.seeds)}, of which {n_todo} to do; {each} each"),
                ("observations", f"{config.observation}, {len(self.card.columns)} columns"),
                ("actions", f"{actions}, one per {counted(config.decision_ticks, 'tick')}"),
                ("room", f"{room} in {folder}"),
            ]
        )


def plan_dataset(
    spec: RunSpec,
    seeds: Sequence[int],
    *,
    observation: str | None = None,
    site_memory: bool | None = None,
    compress: bool = False,
) -> DatasetPlan:
    """Plan a data set. The policy is opened to see how it decides.

    A learned policy is recorded as it was trained: what it saw, which action it chose, once per decision. Other
    policies are recorded in every tick, with their commands as actions.

    Args:
        spec: The run, see `runs.spec.plan_run`.
        seeds: Seeds of the runs, each once.
        observation: "full" or "compact": what is recorded instead of what a learned policy sees, or of "full". All
            neighbours and own sensors of the scenario are then recorded for a learned policy, too, unless it says
            which ones it sees.
        site_memory: Whether the columns of `InterfaceConfig.site_memory` are recorded; None = those that a learned
            policy sees, none for others.
        compress: See `DatasetPlan`.

    Raises:
        ConfigError: seeds that are no different whole numbers, or an unknown kind of observation.
        ValueError: the policy refuses the swarm.
    """
    several("seeds", tuple(seeds), "seeds")
    for seed in seeds:
        whole("a seed", seed, at_least=0)
    if len(set(seeds)) < len(seeds) or len(seeds) > MOST_SEEDS:
        raise ConfigError(f"Expected different seeds, at most {MOST_SEEDS:,}, got {len(seeds)} of them.")
    world = SwarmSpec.of(spec.scenario)
    config = _interface_of(spec, world, observation)
    if site_memory is not None:
        config = replace(config, site_memory=site_memory)
    interface = LearnerInterface(config, world)
    space = interface.action_space
    parts: dict[str, int] = {}
    if is_mixture(spec.policy):
        sizes = part_sizes(spec.policy, world.n_robots, spec.parameters.get("share"))
        parts = dict(zip(part_labels(spec.policy), sizes, strict=True))
    card = Card(
        run=replace(spec, seed=seeds[0]).to_mapping(),
        interface=config,
        seeds=tuple(seeds),
        columns=tuple(part.name for part in interface.layout for _ in range(part.size)),
        n_actions=int(space.n) if isinstance(space, spaces.Discrete) else None,
        parts=parts,
        versions=software_versions(),
    )
    return DatasetPlan(spec=spec, card=card, compress=compress)


def _interface_of(spec: RunSpec, world: SwarmSpec, observation: str | None) -> InterfaceConfig:
    """Return what is recorded: what a learned policy sees and chooses; observations and commands of all others."""
    config = _learned_interface(spec, world)
    if config is None:
        config = InterfaceConfig(observation="full" if observation is None else observation)
        return config.for_scenario(spec.scenario)
    # A learned policy that says nothing of messages sends none, so its actions have no columns for them.
    config = replace(config, message_size=config.message_size or 0)
    if observation is None:
        # Of what else it says nothing, it sees nothing; `for_scenario` would write down what it never saw.
        config = replace(
            config,
            neighbours_seen=config.neighbours_seen or 0,
            sees_kind=bool(config.sees_kind),
            own_sensors=config.own_sensors or (),
        )
    else:
        config = replace(config, observation=observation)
    return config.for_scenario(spec.scenario)


def _learned_interface(spec: RunSpec, world: SwarmSpec) -> InterfaceConfig | None:
    """Return the interface of a learned policy, None for others."""
    if is_mixture(spec.policy):
        return None
    if is_policy_file(spec.policy) and trust.only_looks_at(file_of(spec.policy)):
        return look_at_file(spec.policy, **spec.parameters).interface
    policy = load_policy(spec.policy, spec.parameters)
    if not isinstance(policy, InterfacePolicy):
        return None
    policy.reset(world, stream_rng(spec.seed, Stream.POLICY))
    return policy.interface.config


def record_dataset(
    plan: DatasetPlan,
    folder: str | Path,
    *,
    jobs: int | None = 1,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[RunSummary, ...]:
    """Make the runs that a folder lacks; each chunk is there whole or not at all.

    After an interruption the same call goes on: runs that are whole are kept, the one under way is made again. A folder
    may get more seeds later. Two calls at the same time would remove each other's drafts, so the second is refused.

    Args:
        plan: What to record.
        folder: Where it goes; it is made if it is missing.
        jobs: As in `runs.workers.map_runs`.
        progress: Called with (decisions done, decisions in all) after each chunk; of several processes, after each run.

    Returns:
        One summary per seed of the plan.

    Raises:
        DatasetError: the folder holds another data set, or one of other versions, or another call is writing to it.
        OSError: the folder cannot be written to, or has no room; then nothing has been run.
    """
    folder = Path(folder)
    card = _card_of_folder(plan.card, folder)  # refuses another data set
    _check_room(folder, len(plan.missing(folder)) * plan.run_bytes)
    with alone_in(folder, DatasetError):
        _record_runs(plan, folder, jobs, progress)
        describe_dataset(folder)
    return tuple(RunSummary.read(folder, seed, card) for seed in plan.card.seeds)


def _record_runs(
    plan: DatasetPlan, folder: Path, jobs: int | None, progress: Callable[[int, int], None] | None
) -> None:
    _card_of_folder(plan.card, folder).write(folder)
    for draft in folder.glob(".*.tmp"):  # of a process that was killed
        draft.unlink(missing_ok=True)
    todo = [replace(plan.spec, seed=seed) for seed in plan.missing(folder)]
    in_all, robot_ticks = len(todo) * plan.card.n_decisions, sum(spec.robot_ticks for spec in todo)

    def tell(done: float) -> None:
        if progress is not None:
            progress(round(done / robot_ticks * in_all), in_all)

    for _ in map_runs(partial(_keep_run, plan, folder), todo, jobs=jobs, advance=tell):
        pass


def _keep_run(plan: DatasetPlan, folder: Path, spec: RunSpec, tell: Tell | None) -> None:
    _record_run(plan, spec.seed, folder, lambda done: tell and tell(done, plan.card.n_decisions)).write(folder)


def _card_of_folder(card: Card, folder: Path) -> Card:
    """Return the card with the seeds that the folder has already.

    Raises:
        DatasetError: it differs in anything else.
    """
    if not (folder / CARD_FILE).exists():
        return card
    there = Card.read(folder)
    for name in ("interface", "columns", "versions"):
        if getattr(there, name) != getattr(card, name):
            raise DatasetError(
                f"Expected the data set in {folder} to go on, but it has other {name}; give another --out."
            )
    if replace(there.spec, seed=0) != replace(card.spec, seed=0):
        raise DatasetError(
            f"Expected the data set in {folder} to go on, but it is of another run ({there.spec.describe()}); give "
            "another --out."
        )
    return replace(there, seeds=tuple(dict.fromkeys((*there.seeds, *card.seeds))))


def _check_room(folder: Path, needed: int) -> None:
    check_folder(folder)
    place = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    free = shutil.disk_usage(place).free
    if needed > free:
        raise OSError(
            errno.ENOSPC,
            f"Expected {needed / 1e9:,.1f} GB of free disk for the data set, got {free / 1e9:,.1f} GB; take fewer "
            "seeds, a shorter horizon or compact observations",
            str(folder),
        )


class _Chunk:
    """Arrays of a chunk that is being filled; they are used again for the next one."""

    def __init__(self, plan: DatasetPlan) -> None:
        n_robots, size = plan.spec.scenario.robots.n_robots, plan.chunk_decisions
        is_discrete = plan.card.n_actions is not None
        self.observations = np.empty((size + 1, n_robots, len(plan.card.columns)), np.float32)
        self.actions = np.empty((size, *plan.card.action_shape), np.int64 if is_discrete else np.float32)
        self.rewards = np.zeros((size, n_robots))
        self.terminated = np.zeros((size, n_robots), np.bool_)
        self.truncated = np.zeros((size, n_robots), np.bool_)
        self.active = np.empty((size + 1, n_robots), np.bool_)
        self.length = 0

    @property
    def is_full(self) -> bool:
        return self.length == len(self.rewards)

    def write(self, file: Path, *, compress: bool) -> None:
        """Write what is there and go on with the last observation as the first."""
        n = self.length
        arrays: dict[str, Any] = {
            name: getattr(self, name)[:n] for name in ("actions", "rewards", "terminated", "truncated")
        }
        arrays |= {name: getattr(self, name)[: n + 1] for name in ("observations", "active")}
        with replacing(file, ending=".tmp") as draft, draft.open("wb") as opened:
            (np.savez_compressed if compress else np.savez)(opened, **arrays)
        self.observations[0], self.active[0] = self.observations[n], self.active[n]
        self.rewards[:] = 0.0
        self.terminated[:] = self.truncated[:] = False
        self.length = 0


def _record_run(plan: DatasetPlan, seed: int, folder: Path, tell: Callable[[int], object]) -> RunSummary:
    spec, config = plan.spec, plan.card.interface
    policy: Policy = load_policy(spec.policy, spec.parameters)
    env = build_env(spec.scenario, spec.wrappers, reads=_reads(policy, config))
    world = env.unwrapped
    policy.reset(world.swarm_spec, stream_rng(seed, Stream.POLICY))
    obs = env.reset_batch(seed)
    interface, chunk = LearnerInterface(config, world.swarm_spec), _Chunk(plan)
    interface.observe(obs, chunk.observations[0], decision=0)
    chunk.active[0] = world.active
    lengths: list[int] = []
    gone, over = np.zeros(len(world.active), np.bool_), False
    while not over:
        row, truncated, dead = chunk.length, False, gone
        for tick in range(config.decision_ticks):
            commands = policy.act(obs, world.active)
            if tick == 0:
                is_learned = isinstance(policy, InterfacePolicy)
                chunk.actions[row] = policy.chosen if is_learned else env.unwrapped.checked_actions(commands)
            tasks = getattr(policy, "task", None)
            obs, rewards, dead, truncated = env.step_batch(commands, tasks=tasks)
            chunk.rewards[row] += rewards
            over = truncated or bool(dead.all())
            if over:
                break
        np.logical_and(dead, ~gone, out=chunk.terminated[row])
        if truncated:
            np.logical_not(dead, out=chunk.truncated[row])
        gone = dead.copy()
        interface.observe(obs, chunk.observations[row + 1], decision=config.decisions_in(world.tick))
        chunk.active[row + 1] = world.active
        chunk.length += 1
        if chunk.is_full or over:
            lengths.append(chunk.length)
            chunk.write(chunk_file(folder, seed, len(lengths) - 1), compress=plan.compress)
            tell(sum(lengths))
    env.close()
    counters = world.events.counters
    return RunSummary(
        seed=seed,
        truncated=world.tick >= world.max_cycles,
        chunks=tuple(lengths),
        collected=int(counters[Counter.COLLECTED]),
        first_picked=int(counters[Counter.FIRST_PICKED]),
    )


def _reads(policy: Policy, config: InterfaceConfig) -> tuple[str, ...] | None:
    """Return the slices that the policy or the data set uses; None = all."""
    used: tuple[str, ...] | None = getattr(policy, "reads", None)
    return None if used is None or config.reads is None else (*used, *config.reads)
