"""One run: from a specification to its record."""

import time
from collections.abc import Iterable
from datetime import UTC, datetime
from typing import Any

import numpy as np

from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.study.record import RunRecord, software_versions
from swarm_forage_env.study.spec import RunSpec
from swarm_forage_env.wrappers.base import WrapperConfig, wrap_in_order
from swarm_forage_env.wrappers.recorder import RunRecorder

WARM_UP_TICKS = 5
"""Ticks of a warm-up run under its policy: enough to reach every kernel that a tick always calls."""


def build_stack(
    scenario: ScenarioConfig, wrappers: Iterable[WrapperConfig] = (), *, reads: tuple[str, ...] | None = None
) -> RunRecorder:
    """Build the environment with its wrappers, in the documented order, and a recorder around them.

    Args:
        scenario: The world.
        wrappers: Wrapper configurations in any order, each kind at most once.
        reads: Observation slices that the policy looks at; default all.
    """
    return RunRecorder(wrap_in_order(ForageEnv(scenario, reads=reads), wrappers))


def run_policy(policy: Policy, spec: RunSpec) -> RunRecord:
    """Drive a policy object through the run that `spec` describes.

    For policies that cannot be named, such as a closure over a trained model; `spec.policy` is then only the name
    under which the result is stored.

    Args:
        policy: A fresh instance; it drives this one run.
        spec: The run.
    """
    started = time.perf_counter()
    recorder = build_stack(spec.scenario, spec.wrappers, reads=getattr(policy, "reads", None))
    _drive(recorder, policy, spec.seed)
    recorder.close()
    columns: dict[str, Any] = recorder.columns()
    origin = {
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "wall_time_s": f"{time.perf_counter() - started:.3f}",
    }
    return RunRecord(
        run_id=spec.run_id,
        scenario=spec.scenario.name,
        controller=spec.policy,
        n_robots=spec.scenario.robots.n_robots,
        criterion=spec.criterion,
        criterion_value=spec.criterion_value,
        seed=spec.seed,
        **columns,
        contributed=recorder.contributed(),
        spec=spec.to_json(),
        provenance=software_versions() | origin,
    )


def run_one(spec: RunSpec) -> RunRecord:
    """Run a specification; a function of nothing but `spec`, the machine and the installed versions.

    Raises:
        ValueError: no installed policy has the name, or it refuses its parameters.
    """
    return run_policy(load_policy(spec.policy, spec.parameters), spec)


def warm_up(spec: RunSpec) -> None:
    """Step a run a few ticks, so that its kernels are compiled and cached before many processes need them.

    A policy may ask for nothing so early in a run, so one more tick has every robot grasp: interactions are the
    dearest kernel to compile.
    """
    policy = load_policy(spec.policy, spec.parameters)
    recorder = build_stack(spec.scenario, spec.wrappers, reads=getattr(policy, "reads", None))
    _drive(recorder, policy, spec.seed, max_ticks=WARM_UP_TICKS)
    grasping = np.zeros((spec.scenario.robots.n_robots, 3), np.float32)
    grasping[:, 2] = Grip.GRASP
    recorder.step_batch(grasping)
    recorder.close()


def _drive(recorder: RunRecorder, policy: Policy, seed: int, *, max_ticks: int | None = None) -> None:
    """Run the loop of policy and world until the run ends or `max_ticks` have passed."""
    world = recorder.unwrapped
    policy.reset(world.swarm_spec, stream_rng(seed, Stream.POLICY))
    obs = recorder.reset_batch(seed)
    has_tasks = hasattr(policy, "task")
    while not recorder.complete and world.tick != max_ticks:
        tasks = policy.task if has_tasks else None  # type: ignore[attr-defined]
        obs, _, _, _ = recorder.step_batch(policy.act(obs, world.active), tasks=tasks)
