"""The command `curves`, on folders as trainings leave them."""

import dataclasses
import json
import re
import sys
from pathlib import Path

import pytest

from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.training.evaluation_plan import EvaluationPlan
from swarm_forage_env.training.evaluations import EVALUATIONS_FILE, PLAN_FILE, Evaluation, write_evaluations
from swarm_forage_env.training.plan import Stage, TrainingPlan
from swarm_forage_env.wrappers.world import World

PLAN = TrainingPlan(
    world=World(scenario("warehouse_small", n_robots=2, n_objects=20, horizon_s=4.0, interval_s=2.0)),
    stages=(Stage(steps=10), Stage(steps=20)),
    evaluation=EvaluationPlan(every_steps=10, horizon_s=4.0, n_runs=2),
)


def training(folder: str, plan: TrainingPlan = PLAN, *, best: float = 40.0) -> None:
    Path(folder).mkdir(parents=True)
    plan.write(Path(folder, PLAN_FILE))
    rows = [
        Evaluation(
            steps=steps, wall_time_s=1.0, cpu_time_s=1.0, performance=per, baseline=5.0, interference_fraction=0.25
        )
        for steps, per in ((10, 0.0), (20, best), (30, best / 2))
    ]
    write_evaluations(Path(folder, EVALUATIONS_FILE), rows)


@pytest.mark.compiled
def test_trainings_are_drawn_beside_others(command, monkeypatch):
    pytest.importorskip("matplotlib")
    training("first")
    training("second", dataclasses.replace(PLAN, algorithm="a2c"), best=8.0)
    words = ("train", "curves", "first", "second", "--policy", "random,crw", "--jobs", "1")
    code, out, _ = command(*words, "--picture", "both.png")
    assert code == 0
    rows = [re.split(r" {2,}", line) for line in out.splitlines()]
    cells = {row[0]: row[1:] for row in rows}
    assert cells["first, at its best"] == ["20", "40.0", "0.250"]
    assert cells["second, at its best"] == ["20", "8.0", "0.250"]
    assert cells.keys() >= {"random", "crw"}
    assert out.endswith("wrote both.png\n")
    assert Path("both.png").read_bytes().startswith(b"\x89PNG")
    code, out, err = command(*words, "--picture", "both.png", "--json")
    assert code == 0
    assert err.endswith("wrote both.png\n")
    assert json.loads(out)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    code, _, err = command("train", "curves", "first", "--policy", "none")
    assert code == 1
    assert "No picture without matplotlib" in err
    assert not Path("first/curves.png").exists()


def test_what_curves_refuses(command):
    training("first")
    training("elsewhere", dataclasses.replace(PLAN, evaluation=EvaluationPlan(horizon_s=8.0)))
    training("far/first", dataclasses.replace(PLAN, evaluation=EvaluationPlan(horizon_s=8.0)))
    Path("empty").mkdir()
    training("new")
    Path("new", EVALUATIONS_FILE).unlink()
    training("broken")
    Path("broken", EVALUATIONS_FILE).write_text("steps,wall_time_s\nten,1\n")
    training("seeds")
    Path("seeds", EVALUATIONS_FILE).unlink()
    training("seeds/seed_1")
    training("seeds/seed_0")
    for words, message in (
        (("empty",), "Expected the folder of a training, got empty without plan.json"),
        (("new",), "Expected a training with evaluations, got new"),
        (("seeds",), "got seeds with several below it; name them: seeds/seed_0 seeds/seed_1."),
        (("broken",), "Cannot read the evaluations in broken/evaluations.csv"),
        (("first", "elsewhere"), "judged by the same runs, got first and elsewhere"),
        (("first", "far/first"), "judged by the same runs, got first and far/first"),
        (("first", "--policy", "crv"), "Did you mean 'crw'"),
    ):
        code, _, err = command("train", "curves", *words)
        assert code == 2
        assert message in err
        assert err.count("\n") == 1


def drawn(monkeypatch):
    """Names of the trainings of each picture that is drawn."""
    pictures = []
    monkeypatch.setattr(
        "swarm_forage_env.rendering.plots.draw_trainings", lambda _, trainings, **__: pictures.append([*trainings])
    )
    return pictures


def test_a_picture_says_whether_it_shows_one_training_or_several(command, monkeypatch):
    titles = []
    monkeypatch.setattr("swarm_forage_env.rendering.plots.draw_trainings", lambda *_, title, **__: titles.append(title))
    training("a")
    training("b")
    for folders in (("a",), ("a", "b")):
        assert command("train", "curves", *folders, "--policy", "none")[0] == 0
    assert [title.split(" in ")[0] for title in titles] == ["training", "trainings"]


def test_trainings_in_folders_of_one_name_are_told_apart(command, monkeypatch):
    pictures = drawn(monkeypatch)
    training("a/ppo")
    training("b/ppo", best=8.0)
    training("b/a2c")
    code, out, _ = command("train", "curves", "a/ppo", "b/ppo", "b/a2c", "--policy", "none")
    assert code == 0
    assert pictures == [["a/ppo", "b/ppo", "a2c"]]
    assert "b/ppo, at its best" in out
    code, _, err = command("train", "curves", "a/ppo", "b/../a/ppo", "--policy", "none")
    assert code == 2
    assert "Expected each training once" in err


def test_the_place_of_the_picture_is_looked_at_before_anything_is_run(command, monkeypatch):
    pictures = drawn(monkeypatch)
    monkeypatch.setattr("swarm_forage_env.runs.runner.run_specs", lambda *_, **__: pytest.fail("a run was started"))
    training("first")
    Path("taken.png").mkdir()
    told = "swarm-forage: Expected a file to write, got a folder: taken.png\n"
    assert command("train", "curves", "first", "--picture", "taken.png") == (1, "", told)
    assert pictures == []


def test_curves_tell_of_a_picture_that_cannot_be_written(command, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("swarm_forage_env.rendering.plots.draw_trainings", full)
    training("first")
    code, out, err = command("train", "curves", "first", "--policy", "none")
    assert code == 1
    assert "first, at its best" in out
    assert err == "swarm-forage: No picture first/curves.png: No space left on device.\n"
