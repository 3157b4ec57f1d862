"""Arenas in separate processes: ends, failures and interruptions."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.views import processes
from swarm_forage_env.views.arenas import ArenaBatch
from swarm_forage_env.views.plans import ArenaPlan
from swarm_forage_env.views.processes import ArenaProcessError, ArenaProcesses, open_arenas
from swarm_forage_env.wrappers.world import World

PLAN = ArenaPlan(world=World(scenario("warehouse_small", n_robots=3, n_objects=4)), max_cycles=50)
IDLE = np.zeros((6, 3), np.float32)


@pytest.fixture(scope="module")
def lasting() -> Iterator[ArenaProcesses]:
    """Two arenas in two processes, for tests that leave them alive."""
    opened = ArenaProcesses(PLAN, 2, 2)
    yield opened
    opened.close()


@pytest.fixture
def running(lasting) -> ArenaProcesses:
    """The same, reset."""
    lasting.reset([0, 1], [None, None])
    return lasting


@pytest.fixture
def arenas() -> Iterator[ArenaProcesses]:
    """Two arenas in two processes of their own, reset."""
    opened = ArenaProcesses(PLAN, 2, 2)
    opened.reset([0, 1], [None, None])
    yield opened
    opened.close()


def test_a_process_that_died_is_reported_with_its_exit_code(arenas):
    arenas._processes[1].kill()
    for _ in range(2):
        with pytest.raises(ArenaProcessError, match=r"arenas \[1\] ended with exit code -9"):
            arenas.step(IDLE)


UNGUARDED = """
from swarm_forage_env.views.gymnasium import SwarmVectorEnv
SwarmVectorEnv(n_robots=3, n_processes=1).reset(seed=0)
"""


def test_a_script_without_a_guard_is_told_so(tmp_path):
    script = tmp_path / "train.py"
    script.write_text(UNGUARDED)
    run = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False, timeout=120)
    assert run.returncode == 1
    last = run.stderr.strip().splitlines()[-1]
    assert "ArenaProcessError: The process of arenas [0] ended with exit code 1 while it started" in last
    assert "under `if __name__ == '__main__':`" in last


def test_a_process_that_was_killed_before_its_first_answer_is_not_blamed_on_the_script():
    arenas = ArenaProcesses(PLAN, 2, 2)
    arenas._processes[1].kill()
    with pytest.raises(ArenaProcessError, match=r"arenas \[1\] ended with exit code -9\.$"):
        arenas.reset([0, 1], [None, None])
    arenas.close()


def test_a_plan_that_cannot_be_built_is_refused_at_once_and_leaves_no_process():
    impossible = ArenaPlan(world=PLAN.world, max_cycles=0)
    before = multiprocessing.active_children()
    with pytest.raises(ValueError, match="max_cycles to be a whole number >= 1 or None, got 0"):
        ArenaProcesses(impossible, 2, 2)
    assert multiprocessing.active_children() == before


def test_the_interface_is_known_without_an_environment_in_this_process(monkeypatch):
    monkeypatch.setattr(ForageEnv, "__init__", lambda *_, **__: pytest.fail("an environment was built"))
    arenas = ArenaProcesses(PLAN, 1, 1)
    arenas.close()
    assert arenas.interface.observation_space.shape == (SwarmSpec.of(PLAN.world.scenario).layout.size,)


def test_ctrl_c_is_left_to_the_parent(running):
    for process in running._processes:
        os.kill(process.pid, signal.SIGINT)
    time.sleep(0.2)
    assert running.step(IDLE).rewards.shape == (6,)


def test_an_answer_that_nobody_waited_for_is_not_taken_for_the_next(running):
    for process in range(2):
        running._ask(process, "step", IDLE[:3])  # as when Ctrl-C comes between question and answer
    assert running.get_attribute("tick", [0, 1]) == [1, 1]
    assert running.step(IDLE).obs.shape[0] == 6


def test_processes_end_even_when_their_answers_were_never_read_and_stay_closed(arenas):
    size = 200_000  # more than a pipe holds, so that the process waits for a reader
    for process in range(2):
        arenas._ask(process, "call_method", "__getattribute__", [0] * size, "tick")
    arenas.close()
    assert [process.exitcode for process in arenas._processes] == [0, 0]
    arenas.close()
    with pytest.raises(RuntimeError, match="were closed"):
        arenas.step(IDLE)


class _StrangeError(Exception):
    def __init__(self, first: int, second: int) -> None:
        super().__init__(f"{first} and {second}")
        self.lock = threading.Lock()  # which no library can pickle


def test_errors_that_cannot_travel_are_told_in_words():
    told = processes._portable(_StrangeError(1, 2))
    assert isinstance(told, ArenaProcessError)
    assert str(told) == "_StrangeError: 1 and 2"
    kept = ValueError("as it is")
    assert processes._portable(kept) is kept


def test_arenas_are_opened_here_or_elsewhere():
    assert isinstance(open_arenas(PLAN.world.scenario), ArenaBatch)
    elsewhere = open_arenas(PLAN.world.scenario, n_processes=1)
    assert isinstance(elsewhere, ArenaProcesses)
    with pytest.raises(RuntimeError, match="Call reset before step"):
        elsewhere.step(IDLE[:3])
    elsewhere.close()
