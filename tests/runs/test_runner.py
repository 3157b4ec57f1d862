"""From specifications to records: one run, many runs, failures, interrupts, executors."""

import os
from collections import deque
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.policies.registry import RandomPolicy, from_callable
from swarm_forage_env.policies.trust import UntrustedModelError, only_typed
from swarm_forage_env.runs import store as runs_store
from swarm_forage_env.runs import workers
from swarm_forage_env.runs.plan import Condition, Plan
from swarm_forage_env.runs.policy_spec import policy_spec
from swarm_forage_env.runs.run import WARM_UP_TICKS, build_stack, run_one, run_policy, warm_up
from swarm_forage_env.runs.runner import RunsInterrupted, longest_first, run_plan, run_specs
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import DONE, FAILED, MISSING, RunFailure, RunStore
from swarm_forage_env.runs.workers import WorkerError, map_runs, run_each
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.arena import ForagingArena
from swarm_forage_env.wrappers.base import STACK_ORDER
from swarm_forage_env.wrappers.world import World
from tests.support.wrapper_configs import InnerConfig, OuterConfig

WORLD = scenario("warehouse_small", n_robots=3, n_objects=20, horizon_s=4.0, interval_s=2.0)
SPECS = tuple(RunSpec(world=World(WORLD), policy="random", seed=seed) for seed in range(4))
UNKNOWN = RunSpec(world=World(WORLD), policy="nobody")
REFUSED = RunSpec(world=World(WORLD), policy="random", parameters={"speed": 1})


def same(some, others):
    """Whether both are the same runs with the same results, in the same order."""
    return list(some) == list(others) and all(some[run_id].same_results(others[run_id]) for run_id in some)


@pytest.fixture
def one_by_one(monkeypatch):
    """Every run is a task of its own, also on an executor of the caller."""
    monkeypatch.setattr(workers, "BATCH_ROBOT_TICKS", 0)


class RunsOnlyTheFirst(Executor):
    """Makes the first run when it gets it; the others wait for ever."""

    def __init__(self):
        self.futures = []

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        if not self.futures:
            future.set_result(fn(*args, **kwargs))
        self.futures.append(future)
        return future


class Refusing(Executor):
    """Fails the test when anything is run on it."""

    def submit(self, fn, /, *args, **kwargs):
        pytest.fail("nothing should have been run")


class Breaking(Executor):
    """A pool that breaks with one specification; with two workers that takes down the run just before it as well."""

    def __init__(self, deadly, n_workers=2):
        self.deadly = deadly
        self.n_workers = n_workers
        self.doomed = Future()
        self.broken = False

    def submit(self, fn, /, *args, **kwargs):
        if self.broken:
            raise BrokenProcessPool("the pool is not usable any more")
        spec = args[0] if args else None  # the check whether workers start has no arguments
        future = Future()
        if spec == self.deadly:
            self.broken = True
            for lost in (self.doomed, future):
                lost.set_exception(BrokenProcessPool("a process died"))
        elif fn is run_one and self.n_workers > 1 and spec.seed == self.deadly.seed - 1:
            return self.doomed
        else:
            future.set_result(fn(*args))
        return future


def idle(obs):
    return np.zeros((3, 3), np.float32)


def refuse(self, obs, active):
    raise RuntimeError("I would rather not")


def test_a_stored_run_is_read_with_the_performance_that_is_asked_for(tmp_path):
    store = RunStore(tmp_path)
    run_specs(SPECS[:1], store=store, jobs=1)
    other = replace(SPECS[0], world=World(replace(WORLD, performance="n_active")))
    found = run_specs([other], store=store, executor=Refusing())
    assert found.n_stored == 1
    record = found.records[other.run_id]
    assert record.performance.tolist() == [3.0, 3.0]
    assert RunSpec.from_json(record.spec) == other
    assert record.same_results(run_one(other))
    (last,) = run_specs([other, SPECS[0]], store=store, executor=Refusing()).records.values()
    assert last.performance.tolist() == last.collected.tolist()


def test_a_run_is_a_function_of_its_specification():
    first, second = run_one(SPECS[0]), run_one(SPECS[0])
    assert first.same_results(second)
    assert not first.same_results(run_one(SPECS[1]))
    assert (first.run_id, first.controller, first.n_robots, first.seed) == (SPECS[0].run_id, "random", 3, 0)
    assert RunSpec.from_json(first.spec) == SPECS[0]
    assert first.wall_time_s >= 0.0
    assert {"created", "numpy", "pymunk"} <= first.provenance.keys()


def test_a_policy_object_drives_the_same_run_as_its_name():
    spec = replace(SPECS[0], policy="mine")
    by_object = run_policy(RandomPolicy(), spec)
    assert by_object.controller == "mine"
    np.testing.assert_array_equal(by_object.interference_fraction, run_one(SPECS[0]).interference_fraction)


def test_a_plain_callable_can_be_run():
    record = run_policy(from_callable(idle), SPECS[0])
    assert record.first_picked.sum() == 0
    assert record.n_active.tolist() == [3.0, 3.0]


def test_tasks_of_a_policy_are_recorded():
    class Tasked(RandomPolicy):
        task = np.array([1, 1, 2], np.int8)

    record = run_policy(Tasked(), SPECS[0])
    np.testing.assert_allclose(record.contributed["task_share_generalist"], 2 / 3)
    np.testing.assert_allclose(record.contributed["task_share_harvester"], 1 / 3)


def test_the_stack_is_built_in_the_documented_order():
    env, names = build_stack(WORLD, (InnerConfig(), OuterConfig())), []
    while env is not env.unwrapped:
        names.append(STACK_ORDER[env.stack_position])
        env = env.env
    assert names == ["RunRecorder", "SensorNoise", "ActuatorNoise"]


def test_warm_up_stops_after_a_few_ticks(monkeypatch):
    ticks = []

    def counted(self, obs, active):
        ticks.append(obs)
        return idle(obs)

    monkeypatch.setattr(RandomPolicy, "act", counted)
    warm_up(SPECS[0])
    assert len(ticks) == 5


def test_warm_up_reaches_the_interactions_of_a_policy_that_asks_for_nothing(monkeypatch):
    steps, step = [], ForagingArena.step

    def spied(arena, actions, **options):
        steps.append((arena.tick, actions[:, 2].tolist()))
        return step(arena, actions, **options)

    monkeypatch.setattr(ForagingArena, "step", spied)
    chipmunk = replace(
        SPECS[0].world, scenario=replace(SPECS[0].scenario, physics="chipmunk")
    )  # in Python, tick by tick
    warm_up(replace(SPECS[0], policy="crw", world=chipmunk))
    assert steps[-1] == (WARM_UP_TICKS, [Grip.GRASP] * 3)


def test_outcomes_come_in_the_order_of_their_specifications(tmp_path):
    result = run_specs([SPECS[2], UNKNOWN, SPECS[0], REFUSED, SPECS[0]], store=RunStore(tmp_path), jobs=1)
    planned = [SPECS[2], UNKNOWN, SPECS[0], REFUSED]
    states = dict(zip((spec.run_id for spec in planned), (DONE, FAILED, DONE, FAILED), strict=True))
    assert list(result.states.items()) == list(states.items())
    assert [record.seed for record in result.records.values()] == [2, 0]
    assert [failure.spec for failure in result.failures.values()] == [UNKNOWN, REFUSED]
    assert (result.n_stored, result.count(DONE), result.count(FAILED), result.count(MISSING)) == (0, 2, 2, 0)
    assert set(RunStore(tmp_path).run_ids()) == {SPECS[0].run_id, SPECS[2].run_id}


def test_a_failed_run_says_why_and_how_to_run_it_again(tmp_path):
    store = RunStore(tmp_path)
    (failure,) = run_specs([UNKNOWN], store=store).failures.values()
    assert failure.error.startswith("ConfigError: Unknown policy 'nobody'")
    assert "load_policy" in failure.traceback
    assert store.failures() == (failure,)


def test_finished_runs_are_read_and_not_repeated(tmp_path):
    store = RunStore(tmp_path)
    first = run_specs(SPECS[:2], store=store, jobs=1)
    again = run_specs(SPECS[:2], store=store, executor=Refusing())
    assert again.n_stored == 2
    assert same(first.records, again.records)
    assert run_specs(SPECS, store=store, jobs=1).n_stored == 2


def test_failed_runs_are_tried_again(tmp_path, monkeypatch):
    store = RunStore(tmp_path)
    monkeypatch.setattr(RandomPolicy, "act", refuse)
    assert run_specs(SPECS[:1], store=store).count(FAILED) == 1
    monkeypatch.undo()
    assert run_specs(SPECS[:1], store=store).count(DONE) == 1
    assert store.failures() == ()


def test_a_damaged_file_is_put_aside_and_its_run_made_again(tmp_path, capsys):
    store = RunStore(tmp_path)
    first = run_specs(SPECS, store=store, jobs=1)
    damaged = store.path(SPECS[1].run_id)
    damaged.write_bytes(b"damaged")
    again = run_specs(SPECS, store=store, jobs=1, progress=True)
    assert (again.n_stored, again.count(DONE)) == (3, 4)
    assert same(again.records, first.records)
    assert f"Run again: Cannot read {damaged}" in capsys.readouterr().err
    assert damaged.with_name(f"{damaged.name}.damaged").read_bytes() == b"damaged"
    assert run_specs(SPECS, store=store, executor=Refusing()).n_stored == 4


def test_records_stay_in_the_store_alone_if_nobody_asks_for_them(tmp_path):
    store = RunStore(tmp_path)
    for n_stored in (0, 4):
        found = run_specs([*SPECS, UNKNOWN], store=store, jobs=1, keep=False)
        assert (found.records, found.n_stored) == ({}, n_stored)
        assert (found.count(DONE), found.count(FAILED)) == (4, 1)
        assert list(found.failures) == [UNKNOWN.run_id]
    assert set(store.run_ids()) == {spec.run_id for spec in SPECS}


def test_ctrl_c_keeps_what_is_finished_and_says_so(tmp_path, monkeypatch):
    store, reset = RunStore(tmp_path), RandomPolicy.reset
    started = []

    def interrupted_in_the_third_run(self, task, rng):
        started.append(self)
        if len(started) == 3:
            raise KeyboardInterrupt
        reset(self, task, rng)

    monkeypatch.setattr(RandomPolicy, "reset", interrupted_in_the_third_run)
    with pytest.raises(RunsInterrupted, match="2 of 4 runs are finished and kept") as caught:
        run_specs(SPECS, store=store, jobs=1)
    result = caught.value.result
    assert [record.seed for record in result.records.values()] == [0, 1]
    assert (result.count(DONE), result.count(MISSING)) == (2, 2)
    assert len(store.run_ids()) == 2
    monkeypatch.undo()
    assert run_specs(SPECS, store=store, jobs=1).n_stored == 2


def test_closing_the_iterator_cancels_the_rest(one_by_one):
    executor = RunsOnlyTheFirst()
    outcomes = run_each(SPECS, executor=executor)
    next(outcomes)
    outcomes.close()
    assert [future.cancelled() for future in executor.futures] == [False, True, True, True]


def test_any_executor_gives_the_same_records():
    with ThreadPoolExecutor(2) as pool:
        threaded = run_specs([*SPECS, UNKNOWN], executor=pool)
        assert pool.submit(int).result() == 0  # still open
    in_process = run_specs(SPECS, jobs=1)
    assert same(threaded.records, in_process.records)
    assert [failure.spec for failure in threaded.failures.values()] == [UNKNOWN]


def test_runs_that_their_executor_cancels_are_no_failures(one_by_one):
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

    seen = []
    with pytest.raises(WorkerError, match="1 run is not done"):
        seen.extend(run_each(SPECS, executor=Cancelling()))
    assert {outcome.spec if isinstance(outcome, RunFailure) else outcome.seed for outcome in seen} == {0, 2, 3}


def test_a_broken_executor_that_is_not_ours_ends_the_runs(one_by_one):
    seen = []
    with pytest.raises(WorkerError, match="2 runs are not done"):
        seen.extend(run_each(SPECS, executor=Breaking(SPECS[1])))
    assert {failure.spec for failure in seen} == set(SPECS[:2])


def test_a_killed_worker_ends_the_runs_and_the_same_call_does_the_rest(monkeypatch, tmp_path):
    @contextmanager
    def breaking_pool(n_workers):
        yield Breaking(SPECS[2], n_workers)

    monkeypatch.setattr(workers, "_process_pool", breaking_pool)
    store = RunStore(tmp_path)
    with pytest.raises(WorkerError, match="was killed, most likely because memory ran out"):
        run_specs(SPECS, store=store, jobs=2)
    assert SPECS[0].run_id in store
    assert store.failure_path(SPECS[2].run_id).exists()
    assert len(run_specs(SPECS, store=store, jobs=1).records) == len(SPECS)


def test_a_store_that_cannot_be_written_to_is_told_before_the_first_run(full_disk, tmp_path):
    with pytest.raises(OSError, match="File too large") as caught:
        run_specs(SPECS, store=RunStore(tmp_path / "runs"), executor=Refusing())
    assert caught.value.filename == str(tmp_path / "runs")
    assert list(tmp_path.iterdir()) == []


def test_workers_that_cannot_start_are_an_error_with_a_hint(monkeypatch):
    @contextmanager
    def dead_pool(n_workers):
        yield Breaking(None)

    monkeypatch.setattr(workers, "_process_pool", dead_pool)
    with pytest.raises(WorkerError, match="if __name__ == '__main__'"):
        list(workers._run_in_pool(deque([SPECS[:1]]), 2))


def test_thread_settings_are_put_back(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    with workers.single_threaded_children():
        assert {os.environ[name] for name in workers.THREAD_SETTINGS} == {"1"}
    assert os.environ["OMP_NUM_THREADS"] == "7"
    assert "MKL_NUM_THREADS" not in os.environ


def test_long_runs_come_first():
    large = replace(SPECS[0], world=World(replace(WORLD, horizon_s=8.0)))
    assert longest_first([*SPECS[:2], large]) == (large, *SPECS[:2])


@pytest.mark.parametrize("jobs", [0, -1])
def test_jobs_must_be_positive(jobs):
    with pytest.raises(ValueError, match="Expected jobs to be a whole number >= 1"):
        run_specs(SPECS, jobs=jobs)


def test_nothing_to_do_is_no_error():
    assert run_specs([]).states == {}


def test_progress_where_stderr_is_no_terminal_is_plain(tmp_path, capsys):
    store = RunStore(tmp_path)
    run_specs(SPECS[:1], store=store, jobs=1)
    run_specs([*SPECS[:2], UNKNOWN], store=store, jobs=1, progress=True)
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.splitlines() == [
        "1 of 3 runs is stored already.",
        "1/3 runs, an estimate follows when the first run ends",
        "3/3 runs, all done, 1 failed",
    ]


def test_stored_runs_of_other_versions_are_pointed_out(tmp_path, monkeypatch, capsys):
    store = RunStore(tmp_path)
    run_specs(SPECS[:2], store=store, jobs=1)
    run_specs(SPECS[:2], store=store, jobs=1, progress=True)
    assert capsys.readouterr().err == "2 of 2 runs are stored already.\n"
    monkeypatch.setattr(runs_store, "software_versions", lambda: {"numba": "0.0"})
    run_specs(SPECS[:2], store=store, jobs=1, progress=True)
    assert "2 of them were made by other code or other versions" in capsys.readouterr().err
    run_specs(SPECS[:1], store=store, jobs=1, progress=True)
    assert "1 of them was made by other code or other versions" in capsys.readouterr().err


def test_local_processes_give_the_same_records(tmp_path):
    pooled = run_specs([*SPECS, UNKNOWN], store=RunStore(tmp_path), jobs=2)
    in_process = run_specs(SPECS, jobs=1)
    assert same(pooled.records, in_process.records)
    (failure,) = pooled.failures.values()
    assert failure.error.startswith("ConfigError: Unknown policy '")
    assert "load_policy" in failure.traceback


@pytest.mark.slow
def test_dask_gives_the_same_records():
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        remote = run_specs([*SPECS, UNKNOWN], executor=client.get_executor())
    in_process = run_specs(SPECS, jobs=1)
    assert same(remote.records, in_process.records)
    assert [failure.spec for failure in remote.failures.values()] == [UNKNOWN]


def plan_of(*policies, seeds=(0, 1)):
    return Plan.product(policies, [World(WORLD)], seeds=seeds)


def test_a_plan_runs_what_only_this_process_can_build(tmp_path):
    """Its runs are made here, after all others, which any executor may make."""
    elsewhere, mine = policy_spec("random"), policy_spec(RandomPolicy, label="mine")
    plan = plan_of(mine, elsewhere)
    with ThreadPoolExecutor(1) as executor:
        table = run_plan(plan, store=RunStore(tmp_path), executor=executor)
    first, second = plan.conditions
    assert [record.controller for record in table.of(first)] == ["mine"] * 2
    assert [record.controller for record in table.of(second)] == ["random"] * 2
    for one, other in zip(table.of(first), table.of(second), strict=True):
        assert one.same_columns(other)
    assert (table.n_stored, table.folder) == (0, tmp_path)
    assert run_plan(plan, store=RunStore(tmp_path), executor=Refusing()).n_stored == 4


def test_a_plan_goes_on_after_runs_that_fail():
    def fails(obs):
        raise RuntimeError("I would rather not")

    plan = plan_of(policy_spec(fails), policy_spec("random"))
    table = run_plan(plan, jobs=1)
    first, second = plan.conditions
    assert [failure.error for failure in table.failures_of(first)] == ["RuntimeError: I would rather not"] * 2
    assert len(table.of(second)) == 2


def test_runs_of_a_policy_without_a_name_are_not_stored(tmp_path):
    plan = plan_of(policy_spec(RandomPolicy))
    with pytest.raises(ValueError, match=r"for the policy RandomPolicy, by which its runs in .* are found again"):
        run_plan(plan, store=RunStore(tmp_path))
    assert list(tmp_path.iterdir()) == []
    (condition,) = plan.conditions
    assert len(run_plan(plan).of(condition)) == 2


def test_a_name_that_another_policy_has_is_refused():
    with pytest.raises(ValueError, match="Expected a name of its own for the policy, got 'crw'"):
        run_plan(plan_of(policy_spec(RandomPolicy, label="crw")))


def test_conditions_of_one_run_share_it():
    """Two names of one policy are the same runs."""
    one, other = policy_spec("random"), policy_spec("random", label="again")
    plan = Plan(conditions=(Condition(one, World(WORLD)), Condition(other, World(WORLD))), seeds=(0,))
    table = run_plan(plan, jobs=1)
    assert len(table.records) == 1
    assert table.of(plan.conditions[0]) == table.of(plan.conditions[1])


def seed_of(spec, tell):
    if tell is not None:
        tell(1, 2)
    if spec.seed == 9:
        raise ConfigError("nine is none")
    return spec.seed


@pytest.mark.parametrize(("jobs", "told"), [(1, 3), (2, 3)])
def test_any_function_of_runs_is_mapped_in_their_order(jobs, told):
    specs = [RunSpec(world=World(WORLD), policy="random", seed=seed) for seed in (2, 0, 1)]
    done: list[float] = []
    assert list(map_runs(seed_of, specs, jobs=jobs, advance=done.append)) == [2, 0, 1]
    assert len(done) == told
    assert done == sorted(done)
    with pytest.raises(ConfigError, match="nine is none"):
        list(map_runs(seed_of, [*specs, replace(specs[0], seed=9)], jobs=jobs))
    with pytest.raises(ConfigError, match=r"Expected jobs to be .*, got 0"):
        list(map_runs(seed_of, specs, jobs=0))


def test_other_processes_open_no_models_that_this_one_may_not(tmp_path):
    (tmp_path / "mine.zip").write_bytes(b"")
    specs = [RunSpec(world=World(WORLD), policy=str(tmp_path / "mine.zip"), seed=seed) for seed in (0, 1)]
    with only_typed([]), pytest.raises(UntrustedModelError):
        list(map_runs(seed_of, specs, jobs=2))
