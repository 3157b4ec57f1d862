"""Trainings of one plan with several seeds: what is trained, what goes on, what fails, and what all come to."""

import dataclasses
import json
import math
import re
import signal
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")

from metrics.statistics import aggregate
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.scenarios.presets import warehouse_small
from swarm_forage_env.training.evaluation_plan import EvaluationPlan, EvaluationWorld
from swarm_forage_env.training.evaluations import (
    EVALUATIONS_FILE,
    MODEL_FILE,
    PLAN_FILE,
    Evaluation,
    WorldEvaluation,
    write_evaluations,
)
from swarm_forage_env.training.plan import Stage, TrainingPlan, read_plan
from swarm_forage_env.training.sb3 import seeds as module
from swarm_forage_env.training.sb3.seeds import train_seeds
from swarm_forage_env.training.sb3.training import train
from swarm_forage_env.training.seeds import TrainingFailure, is_finished, read_seeds, seed_folder
from swarm_forage_env.wrappers.world import World
from tests.support import fake_trainings
from tests.support.fake_trainings import STATUS
from tests.support.pictures import keep_figures

PLAN = TrainingPlan(
    world=World(warehouse_small(n_robots=4, n_objects=20, horizon_s=200.0)),
    interface=InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5),
    n_arenas=2,
    hidden=(8,),
    options={"n_steps": 16, "batch_size": 64},
    stages=(Stage(steps=128),),
    evaluation=EvaluationPlan(every_steps=128, horizon_s=200.0, n_runs=1, baseline="random"),
)


def evaluated(steps: int, performance: float, cpu_time_s: float = 60.0) -> Evaluation:
    return Evaluation(
        steps=steps,
        wall_time_s=1.0,
        performance=performance,
        baseline=5.0,
        interference_fraction=0.25,
        cpu_time_s=cpu_time_s,
    )


def made(folder: Path, seed: int, curve: dict[int, float], plan: TrainingPlan = PLAN, **others) -> None:
    """A folder as a training leaves it."""
    place = seed_folder(folder, seed)
    place.mkdir(parents=True)
    dataclasses.replace(plan, seed=seed).write(place / PLAN_FILE)
    (place / MODEL_FILE).touch()
    write_evaluations(
        place / EVALUATIONS_FILE, [evaluated(steps, reached, **others) for steps, reached in curve.items()]
    )


def fake(monkeypatch, *, fails=()) -> list[tuple[int, bool]]:
    """Trainings are made in no time, or fail; returns seeds, and whether they were resumed."""
    calls: list[tuple[int, bool]] = []

    def train(plan, folder, *, resume, report):
        calls.append((plan.seed, resume))
        if plan.seed in fails:
            raise MemoryError("too large")
        if not resume:
            made(folder.parent, plan.seed, {})
        write_evaluations(folder / EVALUATIONS_FILE, [evaluated(128, 4.0 + plan.seed)])
        report(evaluated(128, 4.0 + plan.seed))

    monkeypatch.setattr(module, "train", train)
    return calls


@pytest.mark.parametrize("jobs", [1, 2])
def test_each_seed_is_trained_in_its_folder_as_alone(jobs, tmp_path, tmp_path_factory):
    told = []
    found = train_seeds(PLAN, [3, 4], tmp_path, jobs=jobs, report=lambda seed, news: told.append((seed, type(news))))
    assert sorted(seed for seed, kind in told if kind is Evaluation) == [3, 4]
    assert {path.name for path in tmp_path.iterdir()} == {"plan.json", "seed_3", "seed_4"}
    alone = tmp_path_factory.mktemp("alone") / "run"
    train(dataclasses.replace(PLAN, seed=4), alone)
    same, other = (np.load(folder / "policy.npz") for folder in (alone, tmp_path / "seed_4"))
    names = [name for name in same.files if name != "about"]  # which tells when it was trained
    assert "weight_0" in names
    assert all(np.array_equal(same[name], other[name]) for name in names)
    assert read_plan(tmp_path / "plan.json") == PLAN
    for seed in (3, 4):
        assert read_plan(tmp_path / f"seed_{seed}" / "plan.json") == dataclasses.replace(PLAN, seed=seed)
        assert is_finished(PLAN, tmp_path / f"seed_{seed}")
    assert [(one.seed, one.policy) for one in found.kept()] == [
        (seed, (tmp_path / f"seed_{seed}" / "policy.npz").as_posix()) for seed in (3, 4)
    ]
    assert all(one.cpu_time_s > 0.0 for one in found.kept())


def test_what_is_finished_is_kept_and_the_rest_goes_on(tmp_path, monkeypatch):
    calls = fake(monkeypatch)
    made(tmp_path, 0, {128: 4.0})
    made(tmp_path, 1, {64: 4.0})
    found = train_seeds(PLAN, range(3), tmp_path, jobs=1, resume=True)
    assert calls == [(1, True), (2, False)]
    assert [*found.trainings] == [0, 1, 2]
    longer = PLAN.longer(256)
    train_seeds(longer, range(1), tmp_path, jobs=1, resume=True)
    assert calls[2:] == [(0, True)]
    assert read_plan(tmp_path / "plan.json") == longer


def test_a_training_that_fails_ends_no_other(tmp_path, monkeypatch):
    fake(monkeypatch, fails={1})
    told = []
    found = train_seeds(PLAN, range(3), tmp_path, jobs=1, report=lambda seed, news: told.append((seed, news)))
    assert [*found.failures] == [1]
    assert found.failures[1].startswith(f"MemoryError: too large ({__file__}, line "), "this file is the user's"
    assert told[1] == (1, TrainingFailure(found.failures[1]))
    assert [*found.trainings] == [0, 2]


def test_what_cannot_begin_is_refused_before_anything_is_trained(tmp_path, monkeypatch):
    calls = fake(monkeypatch)
    for jobs in (0, -1):
        with pytest.raises(ConfigError, match=rf"jobs .or None. to be a whole number >= 1, got {jobs}"):
            train_seeds(PLAN, (0, 1), tmp_path, jobs=jobs)
    for seeds, message in (((), "seeds to have at least 1"), ((1, 1), "Expected different seeds, got 1, 1")):
        with pytest.raises(ConfigError, match=message):
            train_seeds(PLAN, seeds, tmp_path)
    with pytest.raises(ConfigError, match="Unknown option 'gama'"):
        train_seeds(dataclasses.replace(PLAN, options={"gama": 0.9}), range(2), tmp_path)
    replay = {"buffer_size": 400, "learning_starts": 128, "batch_size": 16}
    with pytest.raises(ConfigError, match=r"more steps than the 128 after which dqn begins to learn .*, got 128"):
        train_seeds(dataclasses.replace(PLAN, algorithm="dqn", options=replay), range(2), tmp_path)
    late = dataclasses.replace(
        PLAN,
        algorithm="dqn",
        options=replay,
        stages=tuple(
            Stage(steps=steps, options={"learning_starts": starts}) for steps, starts in ((100, 500), (9, 150))
        ),
    )
    with pytest.raises(ConfigError, match="more steps than the 150 after which"):
        train_seeds(late, range(2), tmp_path)
    assert not list(tmp_path.iterdir())
    made(tmp_path, 1, {64: 4.0})
    with pytest.raises(ConfigError, match=r"an unused folder, got .*seed_1 with a training run; resume it"):
        train_seeds(PLAN, range(2), tmp_path)
    with pytest.raises(ConfigError, match=r"seed_1.plan\.json to resume its training, got another plan: hidden"):
        train_seeds(dataclasses.replace(PLAN, hidden=(16,)), range(2), tmp_path, resume=True)
    PLAN.write(tmp_path / "plan.json")
    with pytest.raises(ConfigError, match=r"for further trainings there, got another plan: hidden"):
        train_seeds(dataclasses.replace(PLAN, hidden=(16,)), range(5, 7), tmp_path)
    with pytest.raises(ConfigError, match=r"several trainings, got .*seed_1, which is that of one"):
        train_seeds(PLAN, range(2), tmp_path / "seed_1")
    assert calls == []


def test_a_second_command_in_the_folder_is_refused_while_the_first_is_under_way(tmp_path, monkeypatch):
    calls = fake(monkeypatch)

    def again(seed, news):
        with pytest.raises(ConfigError, match="Expected to be the only one that writes to"):
            train_seeds(PLAN, range(2), tmp_path, jobs=1, resume=True)

    assert not train_seeds(PLAN, range(1), tmp_path, jobs=1, report=again).failures
    assert calls == [(0, False)]


def test_a_process_that_is_killed_ends_no_other_training(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_train_here", fake_trainings.one_is_killed)
    told = []
    found = train_seeds(PLAN, range(3), tmp_path, jobs=2, report=lambda *news: told.append(news))
    assert sorted(seed for seed, news in told if news == STATUS) == [0, 1, 2]
    assert [*found.failures] == [1]
    assert "its process was killed, most likely because memory ran out" in found.failures[1]
    assert not found.trainings


@pytest.mark.parametrize(("code", "how"), [(3, "exit code 3"), (0, "exit code 0"), (-signal.SIGSEGV, "signal 11")])
def test_how_a_process_ended_is_no_guess(code, how):
    assert module._how_it_ended(code).startswith(f"its process ended with {how} before")


def test_an_interrupt_lets_processes_keep_what_they_have(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_train_here", fake_trainings.last_for_ever_apart)
    begun = set()

    def stop(seed, news):
        begun.add(seed)
        if begun == {0, 1}:
            raise KeyboardInterrupt

    started = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        train_seeds(PLAN, range(4), tmp_path, jobs=2, report=stop)
    assert time.monotonic() - started < 300.0  # nobody slept to the end
    assert sorted(path.parent.name for path in tmp_path.glob("*/kept")) == ["seed_0", "seed_1"]


def test_the_table_has_what_is_kept_and_its_mean(tmp_path):
    for seed, best in ((0, 10.0), (1, 14.0), (2, 15.0)):
        made(tmp_path, seed, {64: best, 128: 1.0}, cpu_time_s=60.0 * (seed + 2))
    made(tmp_path, 3, {64: 99.0})
    found = read_seeds(PLAN, tmp_path, range(5), {3: "diverged"})
    title, header, *rows, law, failed, flatter, command = found.text().splitlines()
    assert title.startswith("4 trainings by ppo in warehouse_small")
    assert header.split("  ")[0] == "seed"
    cells = {row.split()[0]: row.split()[1:] for row in rows}
    assert cells["0"] == ["64", "10.0", "2.00", "0.250", "2", "min"]
    of_means = aggregate([10.0, 14.0, 15.0])
    assert cells["mean"] == ["13.0", "2.60", "0.250"]
    assert cells["95"][1:4] == [f"{of_means.lower:.1f}", "to", f"{of_means.upper:.1f}"]
    assert law == "95 %: Student's interval of the mean over trainings."
    assert failed == "Seed 3 failed and is not in the mean: diverged"
    assert "flatter" in flatter
    assert command.startswith("swarm-forage benchmark ")
    assert [Path(word).parent.name for word in command.split() if word.endswith("policy.npz")] == [
        f"seed_{seed}" for seed in range(3)
    ], "one that failed is in no entry"
    assert command.endswith(f"--name {tmp_path.name}")
    mapping = json.loads(found.json())
    assert mapping["means"]["ratio"]["mean"] == pytest.approx(2.6)
    assert [one["cpu_time_s"] for one in mapping["trainings"]] == [120.0, 180.0, 240.0, 60.0]
    assert mapping["failures"] == {"3": "diverged"}


def test_the_interval_of_a_share_ends_at_0(tmp_path):
    for seed, share in enumerate((0.0, 0.0, 0.3)):
        made(tmp_path, seed, {128: 10.0})
        one = dataclasses.replace(evaluated(128, 10.0), interference_fraction=share)
        write_evaluations(seed_folder(tmp_path, seed) / EVALUATIONS_FILE, [one])
    of = read_seeds(PLAN, tmp_path, range(3)).means()["interference_fraction"]
    assert (of.mean, of.lower) == (pytest.approx(0.1), 0.0)
    assert of.upper == pytest.approx(aggregate([0.0, 0.0, 0.3]).upper)


def test_one_training_has_a_mean_and_no_interval(tmp_path):
    made(tmp_path, 0, {64: 10.0})
    found = read_seeds(PLAN, tmp_path, range(1))
    assert "95 %" not in found.text()
    assert json.loads(found.json())["means"]["performance"] == {"mean": 10.0, "lower": None, "upper": None, "n": 1}
    assert not read_seeds(PLAN, tmp_path / "elsewhere", range(1)).has_picture


def test_in_several_worlds_ratios_are_what_counts(tmp_path):
    judged_in = EvaluationWorld(scenario=PLAN.scenario, name="one", baseline="crw")
    plan = dataclasses.replace(PLAN, evaluation=EvaluationPlan(worlds=(judged_in,)))
    world = WorldEvaluation(
        world="one", performance=3.0, baseline=2.0, ratio=1.5, interference_fraction=0.2, baseline_policy="crw"
    )
    one = dataclasses.replace(evaluated(64, 1.5), worlds=(world,), baseline=1.0)
    made(tmp_path, 0, {64: 1.5}, plan)
    write_evaluations(seed_folder(tmp_path, 0) / EVALUATIONS_FILE, [one])
    found = read_seeds(plan, tmp_path, range(1))
    assert [(kept.ratio, kept.performance) for kept in found.kept()] == [(1.5, 1.5)]
    assert re.search(
        r"decisions +mean ratio to the baselines +interference +processor time\n0 +64 +1\.50 ", found.text()
    )


def test_an_algorithm_without_network_file_keeps_its_last_model(tmp_path):
    plan = dataclasses.replace(
        PLAN, algorithm="sac", options={}, interface=dataclasses.replace(PLAN.interface, actions="continuous")
    )
    made(tmp_path, 0, {64: 10.0, 128: 4.0}, plan)
    (kept,) = read_seeds(plan, tmp_path, range(1)).kept()
    assert (Path(kept.policy).name, kept.steps) == ("model.zip", 128)


def test_dotted_lines_stand_where_stages_really_ended(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    figures = keep_figures(monkeypatch)
    plan = dataclasses.replace(PLAN, stages=(Stage(steps=60), Stage(steps=60), Stage(steps=60)))
    made(tmp_path, 0, {102: 10.0}, plan)  # rollouts of 51, so the first stage has two
    read_seeds(plan, tmp_path, range(1)).draw(tmp_path / "one.png")
    made(tmp_path, 1, {102: 10.0, 153: 20.0, 204: 30.0}, plan)
    read_seeds(plan, tmp_path, [1]).draw(tmp_path / "two.png")
    dotted = [
        [line.get_xdata()[0] for line in figure.axes[0].lines if line.get_linestyle() == ":"] for figure in figures
    ]
    np.testing.assert_allclose(dotted, np.array([[102, 120], [102, 153]]) / 1e6)


def test_the_mean_is_drawn_as_far_as_all_have_come(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    figures = keep_figures(monkeypatch)
    made(tmp_path, 0, {64: 10.0, 128: 20.0, 192: 30.0})
    read_seeds(PLAN, tmp_path, range(3)).draw(tmp_path / "one.png")
    made(tmp_path, 1, {96: 11.0, 160: 21.0})
    made(tmp_path, 2, {64: 0.0})
    read_seeds(PLAN, tmp_path, range(3), {2: "diverged"}).draw(tmp_path / "three.png")
    alone, together = (figure.axes[0] for figure in figures)
    assert not alone.collections
    assert [line.get_label() for line in alone.lines[:1]] == ["seed_0"]
    *each, mean, _ = together.lines[:5]
    assert len(each) == 3
    assert {line.get_label() for line in each} == {"each of 3"}
    np.testing.assert_allclose(mean.get_xdata(), np.array([96, 128, 160]) / 1e6)
    np.testing.assert_allclose(mean.get_ydata(), [13.0, 18.0, 23.0])
    band = together.collections[0].get_paths()[0].vertices
    assert math.isclose(band[:, 1].max(), aggregate([25.0, 21.0]).upper)
    assert [text.get_text().split("\n")[0] for text in figures[1].legends[0].get_texts()] == [
        "each of 3", "mean with its", "random"
    ]  # fmt: skip
