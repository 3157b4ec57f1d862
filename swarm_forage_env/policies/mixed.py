"""MixedPolicy: a swarm in which several policies drive robots beside each other."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, known_keys, table
from swarm_forage_env.contract.codes import Task
from swarm_forage_env.contract.policy import Memories, Policy, RobotStates, SwarmSpec
from swarm_forage_env.contract.types import ActionArray, BoolArray, CodeArray, IntArray, ObsArray
from swarm_forage_env.policies.mixture import mixture_parts, part_sizes
from swarm_forage_env.policies.registry import load_policy, part_labels


class MixedPolicy:
    """Several policies, each with rows of its own.

    Each part sees and does what it would in a swarm of its size: it gets its rows of the observation, the specification
    with its number of robots, and a generator of its own. Part k has child k of the generator of the run's policy
    (`numpy.random.Generator.spawn`), so that a change of one part does not shift the chance of another. A part without
    robots is not asked.

    Attributes:
        part_rows: Rows of each part, in order; set by `reset`.
        labels: Names of the parts for people.
        reads: Observation slices that the parts use together; None = all.
        task: (N,) tasks, where any part has tasks; those of the others are `Task.NONE`.
    """

    task: CodeArray

    def __init__(
        self, mixture: str, *, share: float | None = None, parts: Mapping[str, Mapping[str, Any]] | None = None
    ) -> None:
        """Load the policies of all parts.

        Args:
            mixture: Name of the mixed swarm, see `policies.mixture`.
            share: Share of the part that is written as POLICY=share.
            parts: Parameters of policies, by the policy as the mixture writes it.

        Raises:
            ConfigError: a name that is no mixed swarm, or parameters of a policy that is no part of it.
            ValueError: an unknown policy, or a file that cannot be opened.
        """
        self._mixture, self._share = mixture, share
        found = mixture_parts(mixture)
        given = {name: table(f"parameters of {name}", each) for name, each in table("parts", parts or {}).items()}
        known_keys(given, [part.policy for part in found], "part of the mixed swarm")
        self._policies: list[Policy] = [load_policy(part.policy, given.get(part.policy)) for part in found]
        self.labels = part_labels(mixture)
        self.reads = _union(getattr(policy, "reads", None) for policy in self._policies)

    @property
    def caches(self) -> str | None:
        """Kind of caches that the parts state; None where none states any.

        Raises:
            ConfigError: they state different ones.
        """
        return agreed_caches(dict(zip(self.labels, self._policies, strict=True)))

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Start a run.

        Raises:
            ConfigError: the parts do not add up to the swarm.
        """
        sizes = part_sizes(self._mixture, spec.n_robots, self._share)
        ends = np.cumsum(sizes).tolist()
        self.part_rows = tuple(slice(end - size, end) for size, end in zip(sizes, ends, strict=True))
        self._actions: ActionArray = np.zeros((spec.n_robots, spec.action_size), np.float32)
        chances = rng.spawn(len(sizes))
        everyone = zip(self._policies, self.part_rows, chances, sizes, strict=True)
        self._driving: list[tuple[Policy, slice]] = []
        for policy, rows, chance, size in everyone:
            if size:
                policy.reset(spec.part(rows), chance)
                self._driving.append((policy, rows))
        self._busy: list[tuple[Any, slice]] = [entry for entry in self._driving if hasattr(entry[0], "task")]
        vars(self).pop("task", None)
        if self._busy:
            self.task = np.full(spec.n_robots, Task.NONE, np.int8)
            self._take_tasks()

    def act(self, obs: ObsArray, active: BoolArray) -> ActionArray:
        """Let each part choose the actions of its robots; see `Policy.act`. The array is reused by the next call."""
        for policy, rows in self._driving:
            actions = policy.act(obs[rows], active[rows])
            self._actions[rows, : actions.shape[1]] = actions  # a part without messages says zeros
        self._take_tasks()
        return self._actions

    def _take_tasks(self) -> None:
        for policy, rows in self._busy:
            self.task[rows] = policy.task

    def describe_robot(self, row: int) -> str:
        """Return which part a robot belongs to, and what it is doing, if its policy tells."""
        place, own_row = self._place_of(row)
        policy: Any = self._policies[place]
        if not hasattr(policy, "describe_robot"):
            return self.labels[place]
        return f"{self.labels[place]}: {policy.describe_robot(own_row)}"

    def describe_memories(self) -> Memories:
        """Return where all robots remember things; those of a part that does not tell have no places."""
        told: list[Memories] = []
        for policy, rows in self._driving:
            tell = getattr(policy, "describe_memories", None)
            if tell is not None:
                part: Memories = tell()
                told.append(part._replace(robot=part.robot + rows.start))
        return Memories.together(told)

    def _place_of(self, row: int) -> tuple[int, int]:
        """Return the part to which a robot belongs, and its row within that part."""
        place = next(place for place, rows in enumerate(self.part_rows) if rows.start <= row < rows.stop)
        return place, row - self.part_rows[place].start

    def describe_robots(self) -> RobotStates:
        """Return what all robots are up to; words begin with the part that a robot belongs to."""
        n_robots = len(self._actions)
        activity, words = np.zeros(n_robots, np.int8), list[str]()
        remembered: IntArray = np.zeros(n_robots, np.int32)
        any_remembers = False
        for label, policy, rows in zip(self.labels, self._policies, self.part_rows, strict=True):
            if rows.start == rows.stop:
                continue
            tell = getattr(policy, "describe_robots", None)
            activity[rows] = len(words)
            if tell is None:
                words.append(label)
                continue
            told: RobotStates = tell()
            activity[rows] += told.activity
            words += [f"{label}: {word}" for word in told.words]
            if told.n_remembered is not None:
                remembered[rows], any_remembers = told.n_remembered, True
        return RobotStates(activity, tuple(words), remembered if any_remembers else None)


def agreed_caches(policies: Mapping[str, object]) -> str | None:
    """Return the caches that policies state; None where none of them states any.

    Args:
        policies: Name for people -> a policy, or its class.

    Raises:
        ConfigError: they state different ones.
    """
    stated = {
        name: kind for name, policy in policies.items() if isinstance(kind := getattr(policy, "caches", None), str)
    }
    if len(set(stated.values())) > 1:
        told = ", ".join(f"{name} for {kind}" for name, kind in stated.items())
        raise ConfigError(
            f"Expected parts of a mixed swarm that are made for the same caches, got {told}. Say which there are: "
            "--caches none, static or dynamic."
        )
    return next(iter(stated.values()), None)


def _union(reads: Iterable[Iterable[str] | None]) -> tuple[str, ...] | None:
    """Return all slices that any part uses, each once; None = all."""
    names: dict[str, None] = {}
    for one in reads:
        if one is None:
            return None
        names |= dict.fromkeys(one)
    return tuple(names)
