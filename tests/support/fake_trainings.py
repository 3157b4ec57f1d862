"""Plans of trainings of seconds, and what processes do in the place of trainings: they must be found by their names."""

import dataclasses
import os
import signal
import sys
import time
from typing import Any

from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.scenarios.presets import warehouse_small
from swarm_forage_env.training.evaluation import EvaluationPlan
from swarm_forage_env.training.plan import Stage, TrainingPlan
from swarm_forage_env.training.sb3.seeds import _interrupt
from swarm_forage_env.training.sb3.training import TrainingStatus
from swarm_forage_env.wrappers.world import World

NUMBERED = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5)


def tiny_plan(**changes) -> TrainingPlan:
    """Two stages of three rollouts, in seconds."""
    plan = TrainingPlan(
        world=World(warehouse_small(n_robots=4, n_objects=20, horizon_s=200.0)),
        interface=NUMBERED,
        n_arenas=2,
        hidden=(8,),
        options={"n_steps": 16, "batch_size": 64},
        stages=(
            Stage(steps=384, scenario={"n_objects": 40}),
            Stage(steps=384, options={"learning_rate": 1e-4, "gamma": 0.9}),
        ),
        evaluation=EvaluationPlan(every_steps=256, horizon_s=200.0, n_runs=1, baseline="random"),
    )
    return dataclasses.replace(plan, **changes)


SHORT = tiny_plan(stages=(Stage(steps=128),))
STATUS = TrainingStatus(steps=1, episode_return=0.0)


def one_is_killed(job: Any, driver: Any) -> None:
    """Tell a status and end, but for seed 1, whose process is killed."""
    driver.send(STATUS)
    if job[0].seed == 1:
        os.kill(os.getpid(), signal.SIGKILL)


def last_for_ever_apart(job: Any, driver: Any) -> None:
    """Train until an interrupt, and keep something then."""
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        driver.send(STATUS)
        time.sleep(600.0)
    except KeyboardInterrupt:
        job[1].mkdir(parents=True)
        (job[1] / "kept").touch()
        sys.exit(143)
