"""What processes do in the place of trainings: they must be found by their names, so they stand in a file."""

import os
import signal
import sys
import time
from typing import Any

from swarm_forage_env.training.sb3.seeds import _interrupt
from swarm_forage_env.training.sb3.training import TrainingStatus

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
