"""Checks for environments and policies of your own: do they keep the rules that the package keeps itself?

    check_env(env)                    an environment, alone or in wrappers
    check_policy(policy)              what a policy returns, reads and remembers
    check_determinism(policy)         whole runs: equal seeds, equal records

Each returns None if all is well, and otherwise raises a `CheckError` about the first fault.
"""

import contextlib
import copy
import io
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from pettingzoo import ParallelEnv

from swarm_forage_env._internal.fields import instance, number, whole
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env._internal.wording import install_command, suggestion
from swarm_forage_env.contract.codes import Task
from swarm_forage_env.contract.layout import LIGHT_IF_CARRYING, ObservationLayout
from swarm_forage_env.contract.policy import COMMANDS, Policy, SwarmSpec, sees_world
from swarm_forage_env.contract.types import ActionArray, BoolArray, ObsArray
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.layer import at_rest
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import LiveRun, build_stack
from swarm_forage_env.runs.spec import policy_spec
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.wrappers.base import SwarmWrapper
from swarm_forage_env.wrappers.world import World, WorldLike, world_of

_INTERVAL_TICKS = 10
"""Length of a recording interval in compared records. Our choice: short, so that small differences are seen."""
_SEED = 0
"""Of environment and policy in `check_policy`."""
_MOMENT = ("observation", "reward", "termination", "truncation")
"""What an agent gets in a tick."""

CHECKED = (
    "Looked at: actions and tasks with robots away, resets, memory of observations, what reads names, rows of robots "
    "that are away, and another number of robots."
)
"""What `check_policy` looks at, in a sentence."""


class CheckError(ValueError):
    """An environment or a policy that breaks a promise; the message says what was expected, what came, what to do."""


def check_env(env: ParallelEnv[str, Any, Any], *, ticks: int = 60) -> None:
    """Check an environment.

    It must pass PettingZoo's own test of parallel environments. Observations and states must lie in their spaces. Equal
    seeds and actions must give equal runs. For a `ForageEnv` or a stack of `SwarmWrapper`s, the arrays of `reset_batch`
    and `step_batch` must hold the same values as the dictionaries of `reset` and `step`. The environment is stepped:
    reset it before you go on.

    Args:
        env: The environment, with or without wrappers.
        ticks: Length of the runs that are compared.

    Raises:
        CheckError: about the first fault that is found.
        ImportError: pytest is not installed, which PettingZoo's test needs.
    """
    whole("ticks", ticks, at_least=1)
    if not isinstance(env, ParallelEnv):
        raise CheckError(
            f"Expected a parallel environment of PettingZoo, got {env!r}; make one with parallel_env(...), or derive "
            "yours from pettingzoo.ParallelEnv."
        )
    _check_parallel_api(env, ticks)
    spaces = {agent: copy.deepcopy(env.action_space(agent)) for agent in env.possible_agents}
    for seed, space in enumerate(spaces.values()):
        space.seed(seed)
    actions = [{agent: space.sample() for agent, space in spaces.items()} for _ in range(ticks)]
    first, again = _dict_run(env, actions), _dict_run(env, actions)
    advice = "reset(seed) must set back everything that a run changes, and draw from generators made from that seed."
    _compare_runs(first, again, "Expected equal seeds and actions to give equal runs", advice)
    if isinstance(env, ForageEnv | SwarmWrapper):
        advice = "override hooks, or both step and step_batch: runs use the arrays, PettingZoo the dictionaries."
        _compare_runs(first, _batch_run(env, actions), "Expected step_batch to give what step gives", advice)


def _check_parallel_api(env: ParallelEnv[str, Any, Any], ticks: int) -> None:
    try:
        from pettingzoo.test import parallel_api_test
    except ImportError as error:
        raise ImportError(f"PettingZoo's tests need pytest: {install_command('test')}.") from error
    before = {name: value for name, value in vars(env).items() if name == "max_cycles"}
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("error", UserWarning)  # some faults are only warnings in PettingZoo
            parallel_api_test(env, num_cycles=ticks)
    except (AssertionError, UserWarning) as error:
        reason = str(error) or "an assertion without a message; the traceback shows which"
        raise CheckError(
            f"Expected an environment that passes PettingZoo's parallel_api_test, got: {reason}"
        ) from error
    finally:  # the test sets a horizon of its own
        vars(env).pop("max_cycles", None)
        vars(env).update(before)


_Run = list[dict[str, tuple[Any, ...]]]
"""What each agent got, tick by tick, see `_MOMENT`."""


def _dict_run(env: ParallelEnv[str, Any, Any], actions: Sequence[dict[str, Any]]) -> _Run:
    obs, _ = env.reset(seed=1)
    _check_in_spaces(env, obs, 0)
    run: _Run = [{agent: (np.copy(row), 0.0, False, False) for agent, row in obs.items()}]
    for tick, chosen in enumerate(actions, start=1):
        if not env.agents:
            break
        obs, rewards, ended, cut, _ = env.step({agent: chosen[agent] for agent in env.agents})
        _check_in_spaces(env, obs, tick)
        run.append({agent: (np.copy(row), rewards[agent], ended[agent], cut[agent]) for agent, row in obs.items()})
    return run


def _batch_run(env: ForageEnv | SwarmWrapper, actions: Sequence[dict[str, Any]]) -> _Run:
    """The same with arrays; agents that have left the environment are left out, as in dictionaries."""
    names = env.possible_agents
    obs = env.reset_batch(1)
    run: _Run = [{name: (obs[row].copy(), 0.0, False, False) for row, name in enumerate(names)}]
    for chosen in actions:
        staying = {name for name, (_, _, terminated, truncated) in run[-1].items() if not (terminated or truncated)}
        if not staying:
            break
        packed = np.array([chosen[name] * (name in staying) for name in names], np.float32)
        away, carrying = ~env.unwrapped.active, env.unwrapped.swarm.carried_object >= 0
        obs, rewards, ended, cut = env.step_batch(at_rest(packed, away, carrying))
        rows = [(row, name) for row, name in enumerate(names) if name in staying]
        run.append({name: (obs[row].copy(), rewards[row], ended[row], cut) for row, name in rows})
    return run


def _check_in_spaces(env: ParallelEnv[str, Any, Any], obs: dict[str, Any], tick: int) -> None:
    for agent, row in obs.items():
        space = env.observation_space(agent)
        if not space.contains(row):
            raise CheckError(
                f"Expected the observation of {agent} in its space {space}, got {_summary(row)} at tick {tick}; "
                "bring the values into the space, or widen the space."
            )
    space = getattr(env, "state_space", None)
    if space is not None and not space.contains(state := env.state()):
        raise CheckError(f"Expected state() in state_space {space}, got {_summary(state)} at tick {tick}.")


def _compare_runs(run: _Run, other: _Run, expected: str, advice: str) -> None:
    # Terminations and truncations are compared, too, so runs with equal ticks have equal lengths.
    for tick, (one, two) in enumerate(zip(run, other, strict=False)):
        if one.keys() != two.keys():
            raise CheckError(
                f"{expected}, got other agents at tick {tick}: {sorted(one.keys() ^ two.keys())}; {advice}"
            )
        for agent, moment in one.items():
            for what, mine, theirs in zip(_MOMENT, moment, two[agent], strict=True):
                if not np.array_equal(mine, theirs, equal_nan=True):
                    raise CheckError(f"{expected}, got another {what} of {agent} at tick {tick}; {advice}")


def _summary(values: Any) -> str:
    """Return kind and range of values, for messages."""
    if not isinstance(values, np.ndarray):
        return type(values).__name__
    ends = f" from {values.min():g} to {values.max():g}" if values.size and values.dtype.kind in "fiub" else ""
    return f"{values.dtype} of shape {values.shape}{ends}"


def check_policy(policy: Any, world: WorldLike = "warehouse_small", *, ticks: int = 150) -> None:
    """Check a policy against `contract.policy.Policy`.

    The policy acts for a while, with some robots away and then with all robots away. Its actions must have the right
    shape, type and range, and `task` must hold codes of `Task`. Then it gets the same observations again: after a reset
    it must act in the same way, also if the slices that it does not read hold other values, and if an observation array
    is overwritten after `act`. Robots at work must act in the same way whatever the rows of robots that are away hold.
    The actions of these must be actions, too: a robot that comes back to work in the tick acts by its row, and only
    then. Last it gets another number of robots.

    Args:
        policy: As in `runs.spec.policy_spec`: a name, the path of a file, a class that needs no arguments, an object
            (which is copied), or a function of observations.
        world: Where it acts, with the caches that the policy states and without wrappers. Choose one in which your
            policy meets everything that it reacts to.
        ticks: How long it acts.

    Raises:
        CheckError: about the first fault that is found.
        ValueError: an unknown name or scenario, or caches that there are not.
    """
    whole("ticks", ticks, at_least=1)
    build, chosen = _subject(policy, world)
    subject, env = build(), ForageEnv(chosen.scenario)
    if sees_world(subject):
        raise CheckError(
            "Expected a policy that decides by what robots observe, got one that reads the world (it has see_world): "
            "it is a yardstick and no contestant, and check_determinism alone says something about it."
        )
    reads = _checked_reads(subject, env.layout)
    scenes = list(_act_in(subject, env, ticks, away=True))
    seen = [scene.obs for scene in scenes]
    act_again = partial(_check_same_actions, subject, env.swarm_spec, scenes)
    advice = "make all memory in reset, and draw random numbers from the generator that reset is given only."
    act_again((obs.copy() for obs in seen), "Expected reset to begin a new run", advice)
    expected = "Expected a policy that keeps no reference to the observation array"
    act_again(_in_one_buffer(seen), expected, "the next step overwrites the array: copy what must be kept.")
    if reads is not None:
        expected = f"Expected equal actions when the slices that are not in reads = {reads!r} hold other numbers"
        advice = "name every slice that act looks at in reads; the others are not computed in runs."
        act_again((_without_unread(env.layout, reads, obs) for obs in seen), expected, advice)
    expected = "Expected equal actions of robots at work when the observations of robots that are away are others"
    advice = "look at the rows of act that active names only; others can hold anything."
    early = scenes[: ticks // 2]  # later those at work have been away, and remember it
    _check_same_actions(subject, env.swarm_spec, early, map(_without_away, early), expected, advice)
    n_robots = chosen.n_robots
    other = ForageEnv(with_overrides(chosen.scenario, n_robots=n_robots // 2 if n_robots > 1 else 2))
    for _ in _act_in(subject, other, min(ticks, _INTERVAL_TICKS), away=False):
        pass


class _Scene(NamedTuple):
    """What a policy saw in a tick, and what it did; inactive robots do nothing."""

    obs: ObsArray
    active: BoolArray
    actions: ActionArray


def _act_in(policy: Policy, world: ForageEnv, ticks: int, *, away: bool) -> Iterator[_Scene]:
    """Let a policy act in an environment; with `away`, robots leave for repair and come back."""
    obs = world.reset_batch(_SEED)
    _reset(policy, world.swarm_spec)
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
    """Call `act` and check the actions."""
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
    shapes = sorted({(spec.n_robots, COMMANDS), (spec.n_robots, spec.action_size)})
    expected = f"Expected actions as float32 of shape (n_robots, 3) = {' or '.join(map(str, shapes))} in [-1, 1]"
    if not isinstance(actions, np.ndarray) or actions.dtype != np.float32 or actions.shape not in shapes:
        raise CheckError(
            f"{expected}, got {_summary(actions)} at tick {tick}; return one row per robot, inactive ones included."
        )
    for row in np.flatnonzero(~(np.abs(actions) <= 1.0).all(axis=1)):  # NaN included
        is_away = "" if at_work[row] else ", which is away, but may come back in this tick and then act so"
        raise CheckError(f"{expected}, got {actions[row].tolist()} for robot {row} at tick {tick}{is_away}; clip them.")
    return _Scene(shown, at_work, np.where(at_work[:, None], actions, np.float32(0.0)))


def _reset(policy: Policy, spec: SwarmSpec) -> None:
    try:
        policy.reset(spec, stream_rng(_SEED, Stream.POLICY))
    except Exception as error:
        raise CheckError(
            f"Expected reset to prepare for a swarm of {spec.n_robots} robots, got {type(error).__name__}: {error}"
        ) from error


def _checked_tasks(policy: Policy, n_robots: int, tick: int) -> Any:
    """Return `policy.task`, or None if the policy has none."""
    tasks = getattr(policy, "task", None)
    if tasks is None:
        return None
    if not isinstance(tasks, np.ndarray) or tasks.dtype != np.int8 or tasks.shape != (n_robots,):
        got, advice = _summary(tasks), "make the array in reset"
    elif tasks.min() < 0 or tasks.max() >= len(Task):
        got, advice = f"codes {np.unique(tasks).tolist()}", "see contract.codes.Task"
    else:
        return tasks
    raise CheckError(
        f"Expected task as int8 of shape (n_robots,) = ({n_robots},) with codes of Task (0 to {len(Task) - 1}), got "
        f"{got} at tick {tick}; {advice}."
    )


def _check_same_actions(
    policy: Policy, spec: SwarmSpec, scenes: list[_Scene], shown: Iterable[ObsArray], expected: str,
    advice: str,
) -> None:  # fmt: skip
    """Give a policy the observations of `scenes` again, as `shown` has them, and compare its actions."""
    _reset(policy, spec)
    for tick, (scene, obs) in enumerate(zip(scenes, shown, strict=True)):
        again = _asked(policy, obs, scene.active.copy(), tick, spec).actions
        for row in np.flatnonzero((again != scene.actions).any(axis=1)):
            raise CheckError(
                f"{expected}, got other actions at tick {tick}: {again[row].tolist()} instead of "
                f"{scene.actions[row].tolist()} for robot {row}; {advice}"
            )


def _in_one_buffer(seen: Sequence[ObsArray]) -> Iterator[ObsArray]:
    """One array for all ticks, overwritten in each, as the environment does."""
    buffer = np.empty_like(seen[0])
    for obs in seen:
        buffer[:] = obs
        yield buffer


def _without_unread(layout: ObservationLayout, reads: Sequence[str], observed: ObsArray) -> ObsArray:
    """Return observations in which the slices that are not read hold random numbers."""
    obs, rng = observed.copy(), np.random.default_rng(0)
    for part in layout:
        if part.name not in reads:
            unread = obs[:, layout[part.name]]
            is_read = part.name == "light" and LIGHT_IF_CARRYING in reads
            np.copyto(
                unread,
                rng.uniform(-1.0, 1.0, unread.shape),
                where=obs[:, layout["carrying"]] < 0.5 if is_read else True,
            )
    return obs


def _without_away(scene: _Scene) -> ObsArray:
    """Return observations in which the rows of robots that are away hold random numbers."""
    others = np.random.default_rng(0).uniform(-1.0, 1.0, scene.obs.shape)
    return np.where(scene.active[:, None], scene.obs, others).astype(np.float32)


def _checked_reads(policy: Policy, layout: ObservationLayout) -> tuple[str, ...] | None:
    """Return `reads` of a policy, None = all; raises CheckError when it names no slice."""
    reads = getattr(policy, "reads", None)
    if isinstance(reads, str):
        raise CheckError(f"Expected reads as a tuple of names of slices, got {reads!r}; write ({reads!r},).")
    for name in reads or ():
        if name not in (*layout.names, LIGHT_IF_CARRYING):
            raise CheckError(
                f"Expected reads to name slices of the observation, got {name!r}.{suggestion(str(name), layout.names)} "
                f"Known: {', '.join(layout.names)}."
            )
    return None if reads is None else tuple(reads)


def check_determinism(
    policy: Any,
    world: WorldLike = "warehouse_small",
    *,
    seeds: Sequence[int] = (0, 1),
    seconds: float = 60.0,
) -> None:
    """Run a policy twice with each seed, in this process, and compare the records and the last positions.

    Args:
        policy: As in `check_policy`; each run gets a fresh one.
        world: Where it runs, with the caches that the policy states.
        seeds: Seeds of the runs.
        seconds: Simulated length of a run, rounded to recording intervals of ten ticks.

    Raises:
        CheckError: two runs with one seed differ; names what differs first.
        ValueError: an unknown name or scenario, or no seeds.
    """
    instance("seeds", seeds, Sequence)
    if not len(seeds):
        raise ValueError("Expected seeds to run, got none; give at least one.")
    number("seconds", seconds, above=0.0)
    build, chosen = _subject(policy, world)
    interval_s = _INTERVAL_TICKS * chosen.scenario.dt_s
    length = {"interval_s": interval_s, "horizon_s": max(1, round(seconds / interval_s)) * interval_s}
    chosen = replace(chosen, scenario=replace(chosen.scenario, **length))
    for seed in seeds:
        run, again = (_results(chosen, build(), seed) for _ in range(2))
        for name, values in run.items():
            if not np.array_equal(values, again.get(name, np.empty(0))):
                raise CheckError(
                    f"Expected two runs with seed {seed} to be equal, got another {name}; draw random numbers from the "
                    "generator that reset is given only, and let runs share nothing (class attributes, globals)."
                )


def _results(world: World, policy: Policy, seed: int) -> dict[str, np.ndarray]:
    """Make a run; return the poses at its end, which show differences first, and its columns."""
    recorder = build_stack(world.scenario, world.wrappers, reads=getattr(policy, "reads", None))
    run = LiveRun(recorder, policy, seed)
    run.advance()
    swarm = run.forage_env.swarm
    poses = {f"{what} of the robots at the end": getattr(swarm, what).copy() for what in ("position", "heading")}
    return {**poses, **recorder.columns()}


def _subject(policy: Any, world: WorldLike) -> tuple[Callable[[], Policy], World]:
    """Return what builds a fresh policy, and the world with the caches that the policy states."""
    found, chosen = policy_spec(policy), world_of(world)
    build = found.factory or partial(load_policy, found.policy, found.parameters)
    missing = [name for name in ("reset", "act") if not callable(getattr(build(), name, None))]
    if missing:
        raise CheckError(f"Expected a policy with the methods reset and act, got one without {' and '.join(missing)}.")
    return build, chosen.with_caches(found.caches)
