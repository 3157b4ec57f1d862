"""What does a policy return, read and remember?"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env._internal.wording import suggestion
from swarm_forage_env.contract.codes import Task
from swarm_forage_env.contract.layout import LIGHT_IF_CARRYING, ObservationLayout
from swarm_forage_env.contract.policy import Policy, SwarmSpec, sees_world
from swarm_forage_env.contract.types import ActionArray, BoolArray, ObsArray
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.overrides import with_overrides

from .environments import CheckError, summary
from .runs import INTERVAL_TICKS, built, check_compiled, config_for, factory_of


def check_policy(
    policy: Any, scenario: str | ScenarioConfig = "warehouse_small", *, seed: int = 0, ticks: int = 150
) -> None:
    """Check a policy against `contract.policy.Policy`.

    The policy acts for a while, with some robots away and then with all robots away. Its actions must have the right
    shape, type and range, and `task` must hold codes of `Task`. Then it gets the same observations again: after a reset
    it must act in the same way, also if the slices that it does not read hold other values, and if an observation array
    is overwritten after `act`. If it offers `compiled`, a run by that must be the run by `act`. Last it gets another
    number of robots.

    Args:
        policy: A registered name, the path of a policy file, a class that needs no arguments, or an object (which is
            copied).
        scenario: Where it acts; with the caches of `runs.spec.chosen_caches`. Choose one in which your policy meets
            everything that it reacts to.
        seed: Seed of the environment and of the policy.
        ticks: How long it acts.

    Raises:
        CheckError: about the first fault that is found.
        ValueError: an unknown name or scenario.
    """
    subject = built(factory_of(policy))
    config = config_for(subject, scenario)
    world = ForageEnv(config)
    if sees_world(subject):
        raise CheckError(
            "Expected a policy that decides by what robots observe, got one that reads the world (it has see_world): "
            "it is a yardstick and no contestant, and check_determinism alone says something about it."
        )
    reads = _checked_statements(subject, world.layout)
    scenes = list(_act_in(subject, world, seed, ticks, away=True))
    replay = partial(_check_same_actions, subject, world.swarm_spec, seed, scenes)
    replay(
        _kept_apart,
        "Expected reset to begin a new run",
        "make all memory in reset, and draw random numbers from the generator that reset is given only.",
    )
    replay(
        _in_one_buffer,
        "Expected a policy that keeps no reference to the observation array",
        "the next step overwrites the array: copy what must be kept.",
    )
    if reads is not None:
        for filling, words in ((0.0, "zeros"), (None, "other numbers")):
            replay(
                partial(_without_unread, world.layout, reads, filling),
                f"Expected equal actions when the slices that are not in reads = {reads!r} hold {words}",
                "name every slice that act looks at in reads; the others are not computed in runs.",
            )
    check_compiled(subject, config, seed, ticks)
    n_robots = config.robots.n_robots
    other = ForageEnv(with_overrides(config, n_robots=n_robots // 2 if n_robots > 1 else 2))
    for _ in _act_in(subject, other, seed, min(ticks, INTERVAL_TICKS), away=False):
        pass


@dataclass(frozen=True, slots=True)
class _Scene:
    """What a policy saw in a tick, and what it did."""

    obs: ObsArray
    active: BoolArray
    actions: ActionArray


def _act_in(policy: Policy, world: ForageEnv, seed: int, ticks: int, *, away: bool) -> Iterator[_Scene]:
    """Let a policy act in an environment; with `away`, robots leave for repair and come back."""
    obs = world.reset_batch(seed)
    _reset(policy, world.swarm_spec, seed)
    rows = np.arange(world.num_agents)
    everybody = np.ones(len(rows), np.bool_)
    populations = {ticks // 4: rows % 2 == 0, ticks // 2: ~everybody, 3 * ticks // 4: everybody} if away else {}
    for tick in range(ticks):
        if tick in populations:
            world.set_population(active=populations[tick], present=everybody)
        scene = _asked(policy, obs.copy(), world.active.copy(), tick, world.swarm_spec)
        yield scene
        obs, _, _, truncated = world.step_batch(scene.actions, tasks=_checked_tasks(policy, len(rows), tick))
        if truncated:
            return


def _asked(policy: Policy, obs: ObsArray, active: BoolArray, tick: int, spec: SwarmSpec) -> _Scene:
    """Call `act` and check the actions; the scene holds copies."""
    shown, at_work = obs.copy(), active.copy()
    try:
        actions: Any = policy.act(obs, active)
    except Exception as error:
        where = f"with {np.count_nonzero(at_work)} of {len(at_work)} robots active"
        raise CheckError(
            f"Expected act to return actions, got {type(error).__name__} at tick {tick}, {where}: {error}"
        ) from error
    if not (np.array_equal(obs, shown) and np.array_equal(active, at_work)):
        raise CheckError(
            f"Expected act to leave obs and active as they are, got them changed at tick {tick}; they belong to the "
            "environment: work on copies."
        )
    shapes = spec.action_shapes
    expected = f"Expected actions as float32 of shape (n_robots, 3) = {' or '.join(map(str, shapes))} in [-1, 1]"
    if not isinstance(actions, np.ndarray):
        raise CheckError(f"{expected}, got {type(actions).__name__} at tick {tick}; return a numpy array.")
    if actions.shape not in shapes:
        raise CheckError(
            f"{expected}, got shape {actions.shape} at tick {tick}; return one row per robot, inactive ones included."
        )
    if actions.dtype != np.float32:
        raise CheckError(f"{expected}, got {actions.dtype} at tick {tick}; return actions.astype(np.float32).")
    for row in np.flatnonzero(at_work):
        if not (np.abs(actions[row]) <= 1.0).all():  # NaN included
            raise CheckError(f"{expected}, got {actions[row].tolist()} for robot {row} at tick {tick}; np.clip them.")
    # Actions of inactive robots are ignored, so they are not checked.
    return _Scene(shown, at_work, np.where(at_work[:, None], actions, np.float32(0.0)))


def _reset(policy: Policy, spec: SwarmSpec, seed: int) -> None:
    try:
        policy.reset(spec, stream_rng(seed, Stream.POLICY))
    except Exception as error:
        raise CheckError(
            f"Expected reset to prepare for a swarm of {spec.n_robots} robots, got {type(error).__name__}: {error}"
        ) from error


def _checked_tasks(policy: Policy, n_robots: int, tick: int) -> Any:
    """Return `policy.task`, or None if the policy has none."""
    tasks = getattr(policy, "task", None)
    if tasks is None:
        return None
    expected = f"Expected task as int8 of shape (n_robots,) = ({n_robots},) with codes of Task (0 to {len(Task) - 1})"
    if not isinstance(tasks, np.ndarray) or tasks.dtype != np.int8 or tasks.shape != (n_robots,):
        came = summary(tasks) if isinstance(tasks, np.ndarray) else type(tasks).__name__
        raise CheckError(f"{expected}, got {came} at tick {tick}; make the array in reset.")
    if tasks.min() < 0 or tasks.max() >= len(Task):
        raise CheckError(f"{expected}, got codes {np.unique(tasks).tolist()} at tick {tick}; see contract.codes.Task.")
    return tasks


def _check_same_actions(
    policy: Policy,
    spec: SwarmSpec,
    seed: int,
    scenes: Sequence[_Scene],
    shown: Callable[[Sequence[_Scene]], Iterable[ObsArray]],
    expected: str,
    advice: str,
) -> None:
    """Give a policy the observations of `scenes` again, in the form that `shown` makes, and compare its actions."""
    _reset(policy, spec, seed)
    for tick, (scene, obs) in enumerate(zip(scenes, shown(scenes), strict=True)):
        again = _asked(policy, obs, scene.active.copy(), tick, spec).actions
        different = np.flatnonzero((again != scene.actions).any(axis=1))
        if len(different):
            row = different[0]
            raise CheckError(
                f"{expected}, got other actions at tick {tick}: {again[row].tolist()} instead of "
                f"{scene.actions[row].tolist()} for robot {row}; {advice}"
            )


def _kept_apart(scenes: Sequence[_Scene]) -> Iterator[ObsArray]:
    """One array for each tick, never overwritten."""
    return (scene.obs.copy() for scene in scenes)


def _in_one_buffer(scenes: Sequence[_Scene]) -> Iterator[ObsArray]:
    """One array for all ticks, overwritten in each, as the environment does."""
    buffer = np.empty_like(scenes[0].obs)
    for scene in scenes:
        buffer[:] = scene.obs
        yield buffer


def _without_unread(
    layout: ObservationLayout, reads: tuple[str, ...], filling: float | None, scenes: Sequence[_Scene]
) -> Iterator[ObsArray]:
    """Observations in which the slices that are not read hold `filling`; None = random numbers."""
    rng = np.random.default_rng(0)
    for scene in scenes:
        obs = scene.obs.copy()
        for part in layout:
            if part.name not in reads:
                unread = obs[:, layout[part.name]]
                values = rng.uniform(-1.0, 1.0, unread.shape) if filling is None else filling
                is_read = part.name == "light" and LIGHT_IF_CARRYING in reads
                rows = obs[:, layout["carrying"]] < 0.5 if is_read else True  # (N, 1)
                np.copyto(unread, values, where=rows)
        yield obs


def _checked_statements(policy: Policy, layout: ObservationLayout) -> tuple[str, ...] | None:
    """Return `reads` of a policy, None = all; raises CheckError when `reads` names no slice."""
    reads = getattr(policy, "reads", None)
    if reads is None:
        return None
    if isinstance(reads, str):
        raise CheckError(f"Expected reads as a tuple of names of slices, got {reads!r}; write ({reads!r},).")
    for name in reads:
        if name not in (*layout.names, LIGHT_IF_CARRYING):
            raise CheckError(
                f"Expected reads to name slices of the observation, got {name!r}.{suggestion(str(name), layout.names)} "
                f"Known: {', '.join(layout.names)}."
            )
    return tuple(reads)
