"""Does an environment keep the rules of PettingZoo, its spaces and its seeds? And what every check raises."""

import contextlib
import copy
import io
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from pettingzoo import ParallelEnv

from swarm_forage_env._internal.wording import install_command
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.wrappers.base import SwarmWrapper


class CheckError(ValueError):
    """An environment or a policy that breaks a promise; the message says what was expected, what came, what to do."""


def summary(values: Any) -> str:
    """Return kind and range of values, for messages."""
    array = np.asarray(values)
    shown = f"{array.dtype} of shape {array.shape}"
    if array.size and array.dtype.kind in "fiub":
        shown += f" from {array.min():g} to {array.max():g}"
    return shown


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
    if not isinstance(env, ParallelEnv):
        raise CheckError(
            f"Expected a parallel environment of PettingZoo, got {env!r}; make one with parallel_env(...), or derive "
            "yours from pettingzoo.ParallelEnv."
        )
    _check_parallel_api(env, ticks)
    actions = _drawn_actions(env, ticks)
    first, again = _dict_run(env, actions), _dict_run(env, actions)
    _compare_runs(
        first,
        again,
        "Expected equal seeds and actions to give equal runs",
        "reset(seed) must set back everything that a run changes, and draw from generators made from that seed.",
    )
    if isinstance(env, ForageEnv | SwarmWrapper):
        _compare_runs(
            first,
            _batch_run(env, actions),
            "Expected step_batch to give what step gives",
            "override hooks, or both step and step_batch: runs use the arrays, PettingZoo the dictionaries.",
        )


def _check_parallel_api(env: ParallelEnv[str, Any, Any], ticks: int) -> None:
    try:
        from pettingzoo.test import parallel_api_test
    except ImportError as error:
        raise ImportError(f"PettingZoo's tests need pytest: {install_command('test')}.") from error

    has_horizon = "max_cycles" in vars(env)
    horizon = getattr(env, "max_cycles", None)
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
        if has_horizon:
            env.max_cycles = horizon  # pyright: ignore[reportAttributeAccessIssue] - only some environments have one
        else:
            vars(env).pop("max_cycles", None)


_Tick = dict[str, tuple[np.ndarray, float, bool, bool]]
"""Observation, reward, termination and truncation of each agent."""


def _drawn_actions(env: ParallelEnv[str, Any, Any], ticks: int) -> list[dict[str, Any]]:
    spaces = {agent: copy.deepcopy(env.action_space(agent)) for agent in env.possible_agents}
    for number, space in enumerate(spaces.values()):
        space.seed(number)
    return [{agent: space.sample() for agent, space in spaces.items()} for _ in range(ticks)]


def _dict_run(env: ParallelEnv[str, Any, Any], actions: Sequence[dict[str, Any]]) -> list[_Tick]:
    obs, _ = env.reset(seed=1)
    _check_in_spaces(env, obs, 0)
    run: list[_Tick] = [{agent: (np.copy(row), 0.0, False, False) for agent, row in obs.items()}]
    for tick, chosen in enumerate(actions, start=1):
        if not env.agents:
            break
        obs, rewards, terminated, truncated, _ = env.step({agent: chosen[agent] for agent in env.agents})
        _check_in_spaces(env, obs, tick)
        run.append(
            {
                agent: (np.copy(row), float(rewards[agent]), bool(terminated[agent]), bool(truncated[agent]))
                for agent, row in obs.items()
            }
        )
    return run


def _batch_run(env: ForageEnv | SwarmWrapper, actions: Sequence[dict[str, Any]]) -> list[_Tick]:
    """The same with arrays; agents that have left the environment are left out, as in dictionaries."""
    names = env.possible_agents
    obs = env.reset_batch(1)
    run: list[_Tick] = [{name: (obs[row].copy(), 0.0, False, False) for row, name in enumerate(names)}]
    for chosen in actions:
        leaving = run[-1]
        staying = {name for name, (_, _, terminated, truncated) in leaving.items() if not (terminated or truncated)}
        if not staying:
            break
        packed = np.array([chosen[name] if name in staying else np.zeros(3) for name in names], np.float32)
        obs, rewards, terminated, truncated = env.step_batch(packed)
        run.append(
            {
                name: (obs[row].copy(), float(rewards[row]), bool(terminated[row]), truncated)
                for row, name in enumerate(names)
                if name in staying
            }
        )
    return run


def _check_in_spaces(env: ParallelEnv[str, Any, Any], obs: dict[str, Any], tick: int) -> None:
    for agent, row in obs.items():
        space = env.observation_space(agent)
        if not space.contains(row):
            raise CheckError(
                f"Expected the observation of {agent} in its space {space}, got {summary(row)} at tick {tick}; "
                "bring the values into the space, or widen the space."
            )
    space = getattr(env, "state_space", None)
    if space is not None and not space.contains(state := env.state()):
        raise CheckError(f"Expected state() in state_space {space}, got {summary(state)} at tick {tick}.")


def _compare_runs(run: Sequence[_Tick], other: Sequence[_Tick], expected: str, advice: str) -> None:
    # Terminations and truncations are compared, too, so runs with equal ticks have equal lengths.
    for tick, (one, two) in enumerate(zip(run, other, strict=False)):
        if one.keys() != two.keys():
            raise CheckError(
                f"{expected}, got other agents at tick {tick}: {sorted(one.keys() ^ two.keys())}; {advice}"
            )
        for agent, values in one.items():
            for what, mine, theirs in zip(
                ("observation", "reward", "termination", "truncation"), values, two[agent], strict=True
            ):
                if not np.array_equal(mine, theirs, equal_nan=True):
                    raise CheckError(f"{expected}, got another {what} of {agent} at tick {tick}; {advice}")
