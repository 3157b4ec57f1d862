"""What processes do in the place of trainings: they must be found by their names, so they stand in a file."""

import os
import signal
import time
from pathlib import Path
from typing import Any

from swarm_forage_env.training.evaluations import TrainingStatus

STATUS = TrainingStatus(steps=1, wall_time_s=1.0, episode_return=0.0)


def one_is_killed(job: Any, driver: Any) -> None:
    """Tell a status and end, but for seed 1, whose process is killed."""
    driver.send(STATUS)
    if job.plan.seed == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    driver.send(None)


def last_for_ever(job: Any, report: Any) -> None:
    """Train until an interrupt, and keep something then."""
    try:
        report(STATUS)
        time.sleep(600.0)
    except KeyboardInterrupt:
        Path(job.folder, "kept").touch()
        raise


def last_for_ever_apart(job: Any, driver: Any) -> None:
    """The same in a process that hears as that of a training does."""
    from swarm_forage_env.training.sb3 import seeds

    seeds._train = last_for_ever
    job.folder.mkdir()
    seeds._train_here(job, driver)
