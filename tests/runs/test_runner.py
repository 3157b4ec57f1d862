"""From specifications to records: one run, many runs, their progress, failures, interrupts, executors, wrong calls."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest

from metrics import verdict
from swarm_forage_env import (
    build_stack,
    check_determinism,
    check_policy,
    from_callable,
    load_study,
    parse_wrapper,
    plan_run,
    policy_specs,
    run_study,
    with_overrides,
)
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.registry import RandomPolicy
from swarm_forage_env.policies.trust import UntrustedModelError, only_typed
from swarm_forage_env.runs import cluster, progress, runner
from swarm_forage_env.runs.cluster import LOCAL, cluster_executor
from swarm_forage_env.runs.plan import Plan, run_plan
from swarm_forage_env.runs.progress import duration, progress_bar
from swarm_forage_env.runs.record import RecordError
from swarm_forage_env.runs.run import run_one, run_policy
from swarm_forage_env.runs.runner import longest_first, rerun, run_all
from swarm_forage_env.runs.spec import RunSpec, policy_spec
from swarm_forage_env.runs.store import failure_file, load, read_failure, record_file
from swarm_forage_env.runs.workers import WorkerError, each_run
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.world import World

WORLD = scenario("warehouse_small", n_robots=3, n_objects=20, horizon_s=4.0, interval_s=2.0)
SPECS = tuple(RunSpec(world=World(WORLD), policy="random", seed=seed) for seed in range(4))
UNKNOWN = RunSpec(world=World(WORLD), policy="nobody")
REFUSED = RunSpec(world=World(WORLD), policy="random", parameters={"speed": 1})


def run_here(specs, folder=None, **options):
    """Make runs quietly in this process."""
    return run_all(specs, out=folder, jobs=1, **{"progress": False, **options})


def same(some, others):
    """Whether both are the same runs with the same results, in the same order."""
    return list(some) == list(others) and all(some[run_id].equals(others[run_id]) for run_id in some)


class Refusing(Executor):
    """Fails the test when anything is run on it."""

    def submit(self, fn, /, *args, **kwargs):
        pytest.fail("nothing should have been run")


def refuse(self, obs, active):
    raise RuntimeError("I would rather not")


def test_outcomes_come_in_the_order_of_their_specifications(tmp_path):
    found = run_here([SPECS[2], UNKNOWN, SPECS[0], REFUSED, SPECS[0]], tmp_path)
    assert [record.seed for record in found.records.values()] == [2, 0]
    assert [failure.spec for failure in found.failures.values()] == [UNKNOWN, REFUSED]
    assert (found.n_stored, found.n_done) == (0, 2)
    assert {record.run_id for record in load(tmp_path)} == {SPECS[0].run_id, SPECS[2].run_id}


def test_finished_runs_are_read_and_not_repeated(tmp_path):
    first = run_here(SPECS[:2], tmp_path)
    again = run_here(SPECS[:2], tmp_path, executor=Refusing())
    assert (again.n_stored, again.n_done) == (2, 2)
    assert same(first.records, again.records)
    assert run_here(SPECS, tmp_path).n_stored == 2


def test_a_failed_run_says_why_and_is_tried_again(tmp_path, monkeypatch):
    monkeypatch.setattr(RandomPolicy, "act", refuse)
    (failure,) = run_here(SPECS[:1], tmp_path).failures.values()
    assert failure.error == "RuntimeError: I would rather not"
    assert "in refuse" in failure.traceback
    file = failure_file(tmp_path, SPECS[0].run_id)
    assert read_failure(file) == failure
    monkeypatch.undo()
    assert rerun(file).is_same is None
    assert run_here(SPECS[:1], tmp_path).n_done == 1
    assert not file.exists()


def test_the_run_of_a_damaged_file_is_made_again(tmp_path, capsys):
    first = run_here(SPECS, tmp_path)
    one, other, _, intact = (record_file(tmp_path, spec.run_id) for spec in SPECS)
    one.write_bytes(b"damaged")
    other.write_bytes(intact.read_bytes())
    again = run_here(SPECS, tmp_path, progress=True)
    assert (again.n_stored, again.n_done) == (2, 4)
    assert same(again.records, first.records)
    told = capsys.readouterr().err.splitlines()
    assert told[0] == "2 of 4 runs stored already."
    assert told[1].startswith(f"Cannot read {one}: ")
    assert told[1].endswith("Its run is made again. So are those of 1 more files.")
    assert run_here(SPECS, tmp_path, executor=Refusing()).n_stored == 4


def test_ctrl_c_keeps_what_is_finished_and_says_so(tmp_path, monkeypatch):
    reset, started = RandomPolicy.reset, []

    def interrupted_in_the_third_run(self, task, rng):
        started.append(self)
        if len(started) == 3:
            raise KeyboardInterrupt
        reset(self, task, rng)

    monkeypatch.setattr(RandomPolicy, "reset", interrupted_in_the_third_run)
    with pytest.raises(KeyboardInterrupt) as caught:
        run_here(SPECS, tmp_path)
    told = f"Interrupted: 2 of 4 runs are finished. They are in {tmp_path}; the same command does the rest."
    assert str(caught.value) == told
    assert len(load(tmp_path)) == 2
    monkeypatch.undo()
    assert run_here(SPECS, tmp_path).n_stored == 2


@pytest.mark.slow
def test_ctrl_c_ends_the_workers_at_once(tmp_path):
    """A terminal sends it to all processes of a command. A script needs no guard against being read again."""
    script = """
import sys
from dataclasses import replace
from swarm_forage_env import plan_run, run_all, scenario

world = scenario("warehouse_small", n_robots=5, n_objects=20)
spec = plan_run(world, "random")
try:
    run_all([replace(spec, seed=seed) for seed in range(9999)], out=sys.argv[1], jobs=2)
except KeyboardInterrupt as interrupt:
    sys.exit(str(interrupt))
"""
    (tmp_path / "script.py").write_text(script)
    words = [sys.executable, str(tmp_path / "script.py"), str(tmp_path / "runs")]
    started = subprocess.Popen(words, start_new_session=True, stderr=subprocess.PIPE, text=True)
    try:
        while not list((tmp_path / "runs").glob("*.parquet")):
            assert started.poll() is None, "it ended before it was interrupted"
        os.killpg(started.pid, signal.SIGINT)
        _, told = started.communicate(timeout=20)
    finally:
        started.kill()
    assert "Traceback" not in told
    assert told.splitlines()[-1].startswith("Interrupted: ")
    with suppress(ProcessLookupError):  # there is none left
        for _ in range(50):  # of what multiprocessing starts beside workers, the last ends a moment later
            os.killpg(started.pid, 0)
            time.sleep(0.1)
        pytest.fail("processes are left")


def test_local_processes_give_the_same_records():
    """Three seconds: two processes start."""
    found = run_all([*SPECS, UNKNOWN], jobs=2, progress=False)
    assert same(found.records, run_here(SPECS).records)
    assert [failure.spec for failure in found.failures.values()] == [UNKNOWN]


@pytest.mark.slow
def test_a_killed_process_ends_the_call(tmp_path):
    (tmp_path / "deadly.py").write_text(
        "import os\nfrom swarm_forage_env import RandomPolicy\n"
        "class Deadly(RandomPolicy):\n    def act(self, obs, active):\n        os._exit(9)\n"
    )
    deadly = replace(UNKNOWN, policy=f"{tmp_path / 'deadly.py'}:Deadly", seed=9)
    with pytest.raises(WorkerError, match=r"was killed, most likely because memory ran out.* with fewer .*--jobs 1"):
        run_all([*SPECS, deadly], out=tmp_path, jobs=2, progress=False)
    assert not (tmp_path / "failures").exists()


def test_runs_that_their_executor_cancels_are_no_failures(tmp_path):
    """So does Dask's when its scheduler has died."""

    class Cancelling(Executor):
        def submit(self, fn, /, *args, **kwargs):
            future = Future()
            if args[0] == SPECS[1]:
                future.cancel()
                future.set_running_or_notify_cancel()
            else:
                future.set_result(fn(*args, **kwargs))
            return future

    with pytest.raises(WorkerError):
        run_here(SPECS, tmp_path, executor=Cancelling())
    assert [record.seed for record in load(tmp_path)]
    assert not (tmp_path / "failures").exists()


on_dask = pytest.mark.skipif(find_spec("distributed") is None, reason="needs the cluster extra")


@pytest.mark.slow
@on_dask
def test_a_cluster_of_this_machine_is_one_word(tmp_path):
    """It makes the same runs, and a run that always kills its worker ends the call."""
    with cluster_executor(LOCAL, 1) as executor:
        found = run_all(SPECS, out=tmp_path, executor=executor, progress=False)
    assert same(found.records, run_here(SPECS).records)
    with pytest.raises(WorkerError, match="A run killed its workers"), cluster_executor(LOCAL, 1) as executor:
        executor.submit(os._exit, 9).result()


@pytest.mark.slow
@on_dask
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # Dask leaves coroutines behind
def test_a_scheduler_that_does_not_answer_is_told(monkeypatch):
    """Dask would wait ten seconds for a thread of its own to start, which is too short on a busy machine."""
    monkeypatch.setattr("distributed.utils._CollectErrorThread", None)
    monkeypatch.setattr(cluster, "CONNECT_WITHIN_S", 0.2)
    told = "Expected local or the address of a Dask scheduler, got '{}'".format
    calls = [((f"{kind}://127.0.0.1:9",), told(f"{kind}://127.0.0.1:9")) for kind in ("tcp", "tls", "ucx")]
    for given, message in [*calls, (("tcp://127.0.0.1:9", 3), "no number of workers for a running scheduler")]:
        with pytest.raises(ConfigError, match=message), cluster_executor(*given):
            pytest.fail("there should be no executor")


def test_long_runs_come_first_and_then_a_run_of_each_policy():
    large = replace(SPECS[0], world=World(replace(WORLD, horizon_s=8.0)))
    assert longest_first([*SPECS[:2], UNKNOWN, large]) == (large, SPECS[0], UNKNOWN, SPECS[1])


def test_stored_runs_of_other_versions_are_pointed_out(tmp_path, monkeypatch, capsys):
    run_here(SPECS[:2], tmp_path)
    run_here(SPECS[:2], tmp_path, progress=True)
    assert capsys.readouterr().err == "2 of 2 runs stored already.\n"
    monkeypatch.setattr(runner, "software_versions", lambda: {"numba": "0.0"})
    run_here(SPECS[:2], tmp_path, progress=True)
    assert "2 of 2 runs stored already, 2 by other code or versions" in capsys.readouterr().err


def plan_of(*policies):
    return Plan.product(policies, [World(WORLD)], seeds=(0, 1))


def test_a_plan_runs_what_only_this_process_can_build(tmp_path):
    """Its runs are made here, after all others, which any executor may make."""
    plan = plan_of(policy_spec(RandomPolicy, label="mine"), policy_spec("random"))
    with ThreadPoolExecutor(1) as executor:
        table = run_plan(plan, out=tmp_path, executor=executor)
    first, second = map(table.of, plan.conditions)
    assert [record.spec.policy for record in (*first, *second)] == ["mine"] * 2 + ["random"] * 2
    assert all(one.equals(other) for one, other in zip(first, second, strict=True))
    assert table.folder == tmp_path
    assert len(run_plan(plan, out=tmp_path, executor=Refusing()).records) == 4


def test_runs_of_a_policy_without_a_name_are_not_stored(tmp_path):
    plan = plan_of(policy_spec(RandomPolicy))
    with pytest.raises(ValueError, match=r"for the policy RandomPolicy, by which its runs in .* are found again"):
        run_plan(plan, out=tmp_path)
    assert list(tmp_path.iterdir()) == []
    assert len(run_plan(plan).of(plan.conditions[0])) == 2


def test_a_stored_run_is_made_again(tmp_path):
    run_here(SPECS[:1], tmp_path)
    file = record_file(tmp_path, SPECS[0].run_id)
    again = rerun(file)
    assert (again.is_same, again.record.run_id) == (True, SPECS[0].run_id)
    assert {"created", "numpy", "pymunk"} <= again.record.made_with.keys()
    replace(again.record, columns={**again.record.columns, "n_active": np.zeros(2)}).write(file)
    assert rerun(file).is_same is False
    run_here([UNKNOWN], tmp_path)
    with pytest.raises(RecordError, match=r"Cannot run .* again: Unknown policy 'nobody'"):
        rerun(failure_file(tmp_path, UNKNOWN.run_id))


def seed_of(spec):
    if spec.seed == 9:
        raise ConfigError("nine is none")
    return spec.seed


def test_what_a_function_of_runs_raises_is_raised_here():
    assert list(each_run(seed_of, SPECS, jobs=1)) == [(spec, spec.seed) for spec in SPECS]
    with ThreadPoolExecutor(1) as executor, pytest.raises(ConfigError, match="nine is none"):
        list(each_run(seed_of, [*SPECS, replace(SPECS[0], seed=9)], executor=executor))


@pytest.mark.slow
def test_other_processes_open_no_models_that_this_one_may_not(tmp_path):
    (tmp_path / "mine.zip").write_bytes(b"")
    specs = [RunSpec(world=World(WORLD), policy=str(tmp_path / "mine.zip"), seed=seed) for seed in (0, 1)]
    with only_typed([]), pytest.raises(UntrustedModelError):
        list(each_run(seed_of, specs, jobs=2))


def test_an_estimate_goes_by_work_and_leaves_out_the_start(monkeypatch, capsys):
    """Four minutes of start, then parts of ten per second."""
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    with progress_bar("0/4 runs", 1200.0) as tell:
        bar_clock = [(240.0, 300.0), (270.0, 600.0), (275.0, 700.0), (300.0, 900.0)]
        for place, (now[0], done) in enumerate(bar_clock, start=1):
            tell(done, text=f"{place}/4 runs")
    assert capsys.readouterr().err.splitlines() == [
        "1/4 runs",
        "2/4 runs, about 60 s left",
        "4/4 runs, about 30 s left",
    ]


def test_nothing_is_shown_where_nobody_asks(capsys, monkeypatch):
    monkeypatch.setattr(progress, "LINE_EVERY_S", 0.0)
    with progress_bar("runs", shown=False) as tell:
        tell(1, 2)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("seconds", "told"), [(0.2, "1 s"), (89, "89 s"), (90, "2 min"), (5399, "90 min"), (5400, "1.5 h")]
)
def test_times_are_told_in_the_unit_that_people_use(seconds, told):
    assert duration(seconds) == told


PLAN = Plan.product("random", WORLD, seeds=(0,))
NOISE = "sensor_noise:sigma=0.1"


def test_one_or_several_names_or_objects_are_taken_by_all_alike():
    world = World(WORLD, (parse_wrapper(NOISE),))
    assert plan_run(WORLD, "random", wrappers=[NOISE]).world == World(WORLD, [NOISE]) == world
    assert [type(layer).__name__ for layer in build_stack(WORLD, [NOISE]).stack] == ["RunRecorder", "SensorNoise"]
    assert PLAN.specs == Plan.product(policy_specs(["random"]), [World(WORLD)], seeds=[0]).specs == (SPECS[0],)
    assert load_study("S1a", seeds=[0, 1], rules="program").run == load_study("S1a", seeds=2, rules=["program"]).run


class Somewhere(RandomPolicy):
    caches = "some"


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: plan_run(WORLD, "crw", wrappers=NOISE), "wrappers as a list of configurations or words"),
        (lambda: plan_run(WORLD, "crw", parameters=["x"]), "parameters to be a table of values by name"),
        (lambda: run_one("crw"), r"spec to be a RunSpec, got 'crw'; plan_run\(world, policy\) makes one"),
        (lambda: run_policy("crw", SPECS[0]), "a policy object with reset and act, got 'crw'; load_policy makes one"),
        (lambda: run_all(SPECS[0]), r"specs to be an Iterable, got RunSpec.* Plan.product\(...\).specs are many"),
        (lambda: run_all([SPECS[0]], executor=4), "executor to be an Executor, got 4; jobs= sets the number"),
        (lambda: run_plan("crw"), r"plan to be a Plan, got 'crw'; Plan.product\(policies, worlds, seeds\)"),
        (lambda: Plan.product("crw", WORLD, seeds=3), r"seeds to be an Iterable, got 3; range\(n\)"),
        (lambda: run_study("S1a", "out"), r"spec to be a StudySpec, got 'S1a'; load_study\(file\) reads one"),
        (lambda: check_policy("random", 7), "scenario to be a ScenarioConfig"),
        (lambda: check_determinism("random", WORLD, seeds=2), "seeds to be a Sequence, got 2"),
        (lambda: with_overrides("classroom", n_robots=3), r"config to be a ScenarioConfig.* scenario\(name\)"),
        (lambda: scenario("hall.toml"), r"the name of a scenario, got the file hall.toml; read_world\('hall.toml'\)"),
        (lambda: parse_wrapper(parse_wrapper(NOISE)), "a wrapper to be a text"),
        (lambda: verdict("results"), r"a study to be a StudyTable, got 'results'; read_study\(path\) reads one"),
        (lambda: policy_specs(policy_specs("crw"), caches="static"), "a name, a file or an object for parameters"),
        (lambda: from_callable(3), "function to be callable, got 3"),
        (lambda: policy_specs(Somewhere), "caches of the policy to be one of none, static, dynamic, got 'some'"),
    ],
)
def test_a_wrong_call_is_told_in_a_line(call, told):
    with pytest.raises(ConfigError, match=f"Expected {told}") as error:
        call()
    assert "\n" not in str(error.value)
