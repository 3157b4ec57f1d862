"""One run: from a specification to its record.

`LiveRun` is the loop of policy and environment. Records, films and measurements of speed all use it.
"""

import time
from collections.abc import Iterable
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, instance
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.contract.kernel_policy import KernelPolicy
from swarm_forage_env.contract.policy import Policy, sees_world
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.env import ForageEnv, read_only
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.record import Record
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.versions import software_versions
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.wrappers.base import SwarmWrapper, WrapperConfig, needs_no_python, steps_as_made, wrap_in_order
from swarm_forage_env.wrappers.recorder import RunRecorder
from swarm_forage_env.wrappers.registry import wrapper_configs

WARM_UP_TICKS = 5
"""Ticks of a warm-up run under its policy: enough to compile every kernel that each tick calls."""


class LiveRun:
    """A run between its first and its last tick. The constructor resets the environment and the policy.

    Attributes:
        forage_env: The ForageEnv at the bottom of the stack; only read it.
        over: Whether the run has ended: horizon reached, or every robot dead.
    """

    def __init__(self, stack: ForageEnv | SwarmWrapper, policy: Policy, seed: int) -> None:
        """Start a run.

        Args:
            stack: The environment, with or without wrappers and recorder.
            policy: A policy that drives no other run.
            seed: Seed of the environment, of its wrappers and of the policy.
        """
        if isinstance(policy, type) or not all(callable(getattr(policy, name, None)) for name in ("reset", "act")):
            raise ConfigError(f"Expected a policy object with reset and act, got {policy!r}; load_policy makes one.")
        self.forage_env: ForageEnv = stack.unwrapped
        self.over = False
        self._stack = stack
        self._policy = policy
        policy.reset(self.forage_env.swarm_spec, stream_rng(seed, Stream.POLICY))
        self._obs = stack.reset_batch(seed)
        if sees_world(policy):
            policy.see_world(self.forage_env)  # type: ignore[attr-defined] - optional, see Policy
        self._has_tasks = hasattr(policy, "task")

    @property
    def compiled_policy(self) -> KernelPolicy | None:
        """The policy for a run without Python between ticks; None where Python might have a say.

        That is where `needs_no_python` says so, or a recorder that is a subclass or was changed.
        """
        stack = self._stack
        if type(stack) is not RunRecorder or "after_step" in vars(stack) or not steps_as_made(stack):
            return None
        if not hasattr(type(self._policy), "compiled") or not needs_no_python(self.forage_env, stack.stack[1:]):
            return None
        return self._policy.compiled()  # type: ignore[attr-defined] - optional, see Policy

    def advance(self, *, to_tick: int | None = None) -> None:
        """Let policy and environment act in turn until `to_tick` ticks have passed since the start, or the run ends."""
        compiled = self.compiled_policy
        if compiled is not None and isinstance(self._stack, RunRecorder):
            end = self.forage_env.max_cycles
            n_ticks = (end if to_tick is None else min(to_tick, end)) - self.forage_env.tick
            self._stack.run(compiled, max(0, n_ticks))
            self.over = self._stack.complete
            return
        world, policy, has_tasks, obs, over = self.forage_env, self._policy, self._has_tasks, self._obs, self.over
        act, step = policy.act, self._stack.step_batch
        while not over and world.tick != to_tick:
            actions = act(read_only(obs), world.active)
            tasks = policy.task if has_tasks else None  # type: ignore[attr-defined] - optional, see Policy
            obs, _, terminated, truncated = step(actions, tasks=tasks)
            # Checking the first row alone is fast, and in almost every tick it is enough.
            over = truncated or bool(terminated[0] and terminated.all())
        self._obs, self.over = obs, over


def build_env(
    scenario: ScenarioConfig,
    wrappers: Iterable[WrapperConfig | str] = (),
    *,
    reads: tuple[str, ...] | None = None,
) -> ForageEnv | SwarmWrapper:
    """Build the environment with its wrappers, in the documented order.

    Args:
        scenario: The scenario.
        wrappers: Wrapper configurations or words as of `parse_wrapper`, in any order, each kind at most once.
        reads: Observation slices that the policy looks at; default all.
    """
    return wrap_in_order(ForageEnv(scenario, reads=reads), wrapper_configs(wrappers))


def build_stack(
    scenario: ScenarioConfig,
    wrappers: Iterable[WrapperConfig | str] = (),
    *,
    reads: tuple[str, ...] | None = None,
) -> RunRecorder:
    """Build the environment by `build_env`, with a recorder around it; the horizon must be whole intervals."""
    return RunRecorder(build_env(scenario, wrappers, reads=reads))


def run_policy(policy: Policy, spec: RunSpec) -> Record:
    """Drive a policy object through the run that `spec` describes.

    This is for policies without a registered name, such as a closure over a trained model. `spec.policy` is then only
    the name under which the result is stored.

    Args:
        policy: A fresh instance; it drives only this run.
        spec: The run.
    """
    instance("spec", spec, RunSpec, hint="; plan_run(world, policy) makes one")
    started_s = clocks_s()
    recorder = build_stack(spec.scenario, spec.wrappers, reads=getattr(policy, "reads", None))
    LiveRun(recorder, policy, spec.seed).advance()
    recorder.close()
    wall_time_s, cpu_time_s = clocks_s() - started_s
    origin = {
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "wall_time_s": f"{wall_time_s:.3f}",
        "cpu_time_s": f"{cpu_time_s:.3f}",
    }
    return Record(spec=spec, columns=recorder.columns(), made_with=software_versions() | origin)


def clocks_s() -> FloatArray:
    """Return the time and the processor time of this process, s, other runs in it included; differences count."""
    return np.array([time.perf_counter(), time.process_time()])


def run_one(spec: RunSpec) -> Record:
    """Run a specification. The result depends only on `spec`, the machine and the installed versions.

    Raises:
        ValueError: no installed policy has the name, or it refuses its parameters.
    """
    instance("spec", spec, RunSpec, hint="; plan_run(world, policy) makes one")
    return run_policy(load_policy(spec.policy, spec.parameters), spec)


def warm_up(spec: RunSpec) -> None:
    """Make a run of a few ticks and one interval, so that its kernels are compiled and cached before many need them.

    So early in a run a policy may not use the gripper. In the last tick every robot therefore grasps, because the
    kernel of interactions takes longest to compile. Where the whole run is one kernel, it is compiled already.
    """
    length_s = (WARM_UP_TICKS + 1) * spec.scenario.dt_s
    scenario = replace(spec.scenario, horizon_s=length_s, interval_s=length_s)
    policy = load_policy(spec.policy, spec.parameters)
    recorder = build_stack(scenario, spec.wrappers, reads=getattr(policy, "reads", None))
    run = LiveRun(recorder, policy, spec.seed)
    run.advance(to_tick=WARM_UP_TICKS)
    if run.compiled_policy is None:
        grasping = np.zeros((scenario.robots.n_robots, 3), np.float32)
        grasping[:, 2] = Grip.GRASP
        recorder.step_batch(grasping)
    else:
        run.advance()
    recorder.close()
