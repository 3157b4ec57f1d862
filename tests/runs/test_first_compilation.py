"""What a first run compiles in two processes: the same kernels as in one, and nothing else changes."""

import subprocess
import sys
import time
from concurrent.futures import Future
from dataclasses import replace

import pytest

from baselines.crw import CRWPolicy
from swarm_forage_env._internal.compiling import is_compiled, is_new
from swarm_forage_env.runs import first_compilation as first_run
from swarm_forage_env.runs import workers
from swarm_forage_env.runs.first_compilation import compile_outermost, compile_run, compile_start, is_first_run
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.world.compiled import compile_half, parts_of
from swarm_forage_env.world.kernels import tick
from swarm_forage_env.wrappers.world import World
from tests.support.foraging import quick_world


def run_of(physics: str, policy: str = "crw") -> RunSpec:
    world = quick_world("warehouse_small", physics=physics, n_robots=2, horizon_s=2.0, interval_s=2.0)
    return RunSpec(world=World(world), policy=policy)


compiled_only = pytest.mark.skipif(not is_compiled(tick.run), reason="needs the compiler")


@compiled_only
@pytest.mark.parametrize(("physics", "policy", "outermost"), [
    ("compiled", "crw", tick.run), ("compiled", "random", tick.whole), ("chipmunk", "crw", tick.meet_and_close),
])  # fmt: skip
def test_what_is_compiled_beforehand_is_what_a_run_calls(physics, policy, outermost):
    spec = run_of(physics, policy)
    compile_outermost(spec)
    assert not is_first_run(spec)
    before = list(outermost.signatures)
    run_one(spec)
    assert outermost.signatures == before


HALVES_THEN_THE_WHOLE = """
import sys
from swarm_forage_env.runs.first_compilation import compile_outermost
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.world.compiled import compile_half, parts_of
spec = RunSpec.from_json(sys.stdin.read())
parts = [function.get_overload.__self__ for half in (0, 1) for function, *_ in parts_of(spec.scenario, half)]
for half in (0, 1):
    compile_half(spec.scenario, half)
assert not sum(sum(part.stats.cache_hits.values()) for part in parts), "something was kept before"
compile_outermost(spec)
for part in parts:
    print(part.__name__, len(part.signatures))
"""


@compiled_only
@pytest.mark.slow
def test_the_halves_are_what_the_whole_is_made_of(monkeypatch, tmp_path):
    """With an empty cache: what others have kept would hide that a half is compiled for arguments of other types."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    spec = run_of("compiled")
    program = [sys.executable, "-c", HALVES_THEN_THE_WHOLE]
    ran = subprocess.run(program, input=spec.to_json(), capture_output=True, text=True, check=True)
    signatures = dict(line.split() for line in ran.stdout.splitlines())
    names = {function.__name__ for half in (0, 1) for function, *_ in parts_of(spec.scenario, half)}
    assert signatures == dict.fromkeys(names, "1"), "the whole asked for other types than those of the halves"


@compiled_only
def test_what_is_compiled_is_not_new_and_what_cannot_be_kept_is_not_either(monkeypatch, tmp_path):
    example = 3.0 + 1.0j, *(None,) * 4, 3.0, None  # nobody calls it so, and nothing is compiled here
    assert is_new(tick.whole, *example)
    monkeypatch.setattr(tick.whole._cache, "_cache_path", str(tmp_path / "none"))
    assert not is_new(tick.whole, *example)


@pytest.fixture
def done(monkeypatch):
    """What this process compiles in a first run, with nothing to compile."""
    found: list[str] = []
    monkeypatch.setattr(first_run, "is_first_run", lambda spec: True)
    monkeypatch.setattr(first_run, "compile_half", lambda config, half: found.append(f"half {half}"))
    monkeypatch.setattr(first_run, "compile_outermost", lambda spec: found.append("outermost"))
    return found


@pytest.mark.parametrize("program", ["raise SystemExit(1)", "import os; os.kill(os.getpid(), 9)", "print()"])
def test_another_process_that_fails_changes_nothing(done, monkeypatch, program):
    monkeypatch.setattr(first_run, "_PROGRAM", program)
    compile_run(run_of("compiled"))
    assert done == ["half 0", "outermost"]


def test_a_process_that_outlives_the_other_one_is_not_waited_for(done, monkeypatch):
    child = "import subprocess, sys; subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(30)'])"
    monkeypatch.setattr(first_run, "_PROGRAM", child)
    monkeypatch.setattr(first_run, "WAKE_UP_EVERY_S", 0.05)
    started = time.monotonic()
    compile_run(run_of("compiled"))
    assert done == ["half 0", "outermost"]
    assert time.monotonic() - started < 20.0, "a child of the other process still holds its pipe"


def test_a_world_of_a_training_may_last_as_long_as_it_likes(done, monkeypatch):
    monkeypatch.setattr(first_run, "is_first", lambda config: True)
    monkeypatch.setattr(first_run, "_PROGRAM", "print()")
    first_run.compile_world(replace(run_of("compiled").scenario, horizon_s=3.4))
    assert done == ["half 0"]


def test_without_another_process_this_one_does_its_part(done, monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "executable", str(tmp_path / "none"))
    compile_run(run_of("compiled"))
    assert done == ["half 0", "outermost"]


def test_ctrl_c_ends_the_other_process(done, monkeypatch):
    started, popen = [], subprocess.Popen

    def noted(*arguments, **options):
        started.append(popen(*arguments, **options))
        return started[-1]

    def interrupted(config, half):
        raise KeyboardInterrupt

    monkeypatch.setattr(first_run, "_PROGRAM", "import time; time.sleep(600)")
    monkeypatch.setattr(subprocess, "Popen", noted)
    monkeypatch.setattr(first_run, "compile_half", interrupted)
    with pytest.raises(KeyboardInterrupt):
        compile_run(run_of("compiled"))
    assert started[0].poll() is not None


SLOW_HELPER = """
import time
from swarm_forage_env.runs import first_compilation as first_run
def compile_half(config, half):
    print("begun", half, flush=True)
    time.sleep(600)
first_run.compile_half = compile_half
first_run.help_out()
"""


def test_the_other_process_ends_when_the_first_is_killed():
    helper = subprocess.Popen(
        [sys.executable, "-c", SLOW_HELPER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        helper.stdin.write(run_of("compiled").to_json() + "\n")
        helper.stdin.flush()
        assert helper.stdout.readline() == "begun 1\n"
        helper.stdin.close()  # as the system does it for a process that is killed
        assert helper.wait(60) == 1
    finally:
        helper.kill()
        helper.wait()
        helper.stdout.close()


class Noting:
    """An executor that notes what it is given; `is_first_run` says yes."""

    def __init__(self) -> None:
        self.given = []

    def submit(self, function, *arguments):
        self.given.append((function, *arguments[1:]))
        future = Future()
        future.set_result(True)
        return future


def test_workers_of_a_pool_compile_the_halves_before_what_is_made_of_them():
    pool = Noting()
    assert workers._warm_up_workers(pool, [run_of("compiled")])
    halves = [(compile_half, 0), (compile_half, 1)]
    assert pool.given == [(is_first_run,), *halves, (compile_outermost,), (compile_start,), (workers.warm_up,)]


@pytest.mark.parametrize("physics", ["compiled", "chipmunk"])
def test_the_start_of_a_run_is_its_policy_and_a_reset(physics, monkeypatch):
    ticks, act = [], CRWPolicy.act

    def noted(policy, obs, active):
        ticks.append(obs.shape)
        return act(policy, obs, active)

    if physics == "chipmunk":  # with compiled bodies such a policy would be asked in every tick
        monkeypatch.setattr(CRWPolicy, "act", noted)
    compile_start(run_of(physics))
    assert len(ticks) == (physics == "chipmunk")
