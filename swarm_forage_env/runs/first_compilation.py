"""What a first run compiles, compiled in two processes at a time.

Example: `swarm-forage run` with an empty cache starts one more process, which compiles half of the world's kernels and
then the policy's, while this one compiles the other half and then the kernel that is made of both. What the other
process does is kept in the cache of compiled functions, and only read from there. So it can fail or be killed, and that
costs nothing but time.
"""

import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import replace
from functools import cache
from typing import TextIO

import numpy as np

from swarm_forage_env._internal.compiling import direct, is_new
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import build_stack, compiled_policy_of
from swarm_forage_env.runs.spec import RunSpec, plan_run
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.world.compiled import compile_half, is_first, outermost
from swarm_forage_env.wrappers.recorder import RunRecorder

WAKE_UP_EVERY_S = 0.5
"""The driver never sleeps longer, because with the signal handler of a library (polars) Ctrl-C may not end a sleep."""
_PROGRAM = (
    "import sys; sys.path[:] = {path!r}; from swarm_forage_env.runs.first_compilation import help_out; help_out()"
)
"""What the other process does. It looks for packages where this one does, and does not load a user's script."""


def compile_run(spec: RunSpec) -> None:
    """Compile what a run needs, in two processes; return at once if it is compiled, or could not be kept."""
    if is_first_run(spec):
        with _Helper(spec) as helper:
            compile_half(spec.scenario, 0)
            helper.wait_for_half()
            compile_outermost(spec)
            helper.wait_for_end()


@cache
def compile_world(scenario: ScenarioConfig) -> None:
    """Compile what a reset and a step need, in two processes, for runs that have no policy yet.

    The outermost kernel is left to the first step: there may be one arena or several.
    """
    if is_first(scenario):
        whole = replace(scenario, horizon_s=scenario.interval_s)  # a plan is of whole intervals
        with _Helper(plan_run(whole, "random")) as helper:
            compile_half(scenario, 0)
            helper.wait_for_end()


def is_first_run(spec: RunSpec) -> bool:
    """Return whether the outermost kernel of a run is not compiled yet, and can be kept when it is."""
    return is_new(*outermost(spec.scenario, compiled_policy_of(*_set_up(spec))))


def compile_outermost(spec: RunSpec) -> None:
    """Compile the kernel that is made of both halves."""
    direct(*outermost(spec.scenario, compiled_policy_of(*_set_up(spec))))


def compile_start(spec: RunSpec) -> None:
    """Compile the policy, if it is a kernel, and then a reset, which takes a part of the first half."""
    stack, policy = _set_up(spec)
    compiled = compiled_policy_of(stack, policy)
    if compiled is not None:
        compiled.callback.prepare()
    elif _is_kernel(policy):
        n_robots, columns = spec.scenario.robots.n_robots, stack.unwrapped.layout.size
        policy.act(np.zeros((n_robots, columns), np.float32), np.zeros(n_robots, np.bool_))
    stack.reset_batch(spec.seed)


def _set_up(spec: RunSpec) -> tuple[RunRecorder, Policy]:
    """Return the environment and the policy of a run; the policy is reset if it is a kernel, as its types are asked."""
    policy = load_policy(spec.policy, spec.parameters)
    stack = build_stack(spec.scenario, spec.wrappers, reads=getattr(policy, "reads", None))
    if _is_kernel(policy):
        policy.reset(stack.unwrapped.swarm_spec, stream_rng(spec.seed, Stream.POLICY))
    return stack, policy


def _is_kernel(policy: Policy) -> bool:
    return hasattr(type(policy), "compiled")


class _Helper:
    """The other process, for as long as the context lasts. It ends with this one, however that ends."""

    def __init__(self, spec: RunSpec) -> None:
        """Take the run that is to be prepared."""
        self._spec = spec
        self._half, self._end = threading.Event(), threading.Event()
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> "_Helper":
        """Start the process; where that is not possible, nothing is to be waited for."""
        command = [sys.executable, "-c", _PROGRAM.format(path=sys.path)]
        try:
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
            )
        except OSError:
            self._half.set()
            self._end.set()
            return self
        self._talker = threading.Thread(target=self._talk, args=(self._process,), daemon=True)
        self._talker.start()
        return self

    def __exit__(self, *_: object) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._talker.join(WAKE_UP_EVERY_S)  # it lives on where a policy has started a process that holds the pipe

    def _talk(self, process: "subprocess.Popen[str]") -> None:
        """Tell the process what to do, and note how far it is. It ends when nobody holds its stdin any more."""
        assert process.stdin is not None, "it is a pipe"
        assert process.stdout is not None, "it is a pipe"
        with suppress(OSError, ValueError), process.stdin, process.stdout:
            process.stdin.write(self._spec.to_json() + "\n")
            process.stdin.flush()
            process.stdout.readline()
            self._half.set()
            process.stdout.read()
        self._half.set()
        self._end.set()

    def wait_for_half(self) -> None:
        """Wait until its half is compiled, or it is no more."""
        self._wait(self._half)

    def wait_for_end(self) -> None:
        """Wait until it is no more."""
        self._wait(self._end)

    def _wait(self, event: threading.Event) -> None:
        while not event.wait(WAKE_UP_EVERY_S):
            if self._process is None or self._process.poll() is not None:
                return


def help_out() -> None:
    """Do the part of the other process: its half, then a line on stdout, then the start of the run."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that has started this one
    spec = RunSpec.from_json(sys.stdin.readline())
    threading.Thread(target=_leave_at_end_of, args=(sys.stdin,), daemon=True).start()
    compile_half(spec.scenario, 1)
    print(flush=True)  # noqa: T201 - what the first process waits for
    compile_start(spec)


def _leave_at_end_of(lifeline: TextIO) -> None:
    lifeline.read()
    os._exit(1)
