"""The command `curves`, on folders as trainings leave them."""

import dataclasses
import json
import re
import sys
from pathlib import Path

import pytest

from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.training.evaluation import (
    EVALUATIONS_FILE,
    PLAN_FILE,
    Evaluation,
    EvaluationPlan,
    WorldEvaluation,
    write_evaluations,
)
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
            steps=steps,
            wall_time_s=1.0,
            cpu_time_s=1.0,
            reached=per,
            worlds=(
                WorldEvaluation(
                    world=PLAN.judging_worlds[0].name,
                    baseline_policy="crw",
                    performance=per,
                    baseline=5.0,
                    ratio=per / 5.0,
                    interference_fraction=0.25,
                ),
            ),
        )
        for steps, per in ((10, 0.0), (20, best), (30, best / 2))
    ]
    write_evaluations(Path(folder, EVALUATIONS_FILE), rows)


def test_trainings_are_drawn_beside_others(command, monkeypatch):
    pytest.importorskip("matplotlib")
    training("first")
    training("second", dataclasses.replace(PLAN, algorithm="a2c"), best=8.0)
    words = ("train", "curves", "first", "second", "--policy", "random,crw")
    code, out, _ = command(*words, "--picture", "both.png")
    assert code == 0
    rows = [re.split(r" {2,}", line) for line in out.splitlines()]
    cells = {row[0]: row[1:] for row in rows}
    assert cells["first"][:3] == ["20", "40.0", "0.250"]
    assert cells["second"][:3] == ["20", "8.0", "0.250"]
    assert cells.keys() >= {"random", "crw"}
    assert Path("both.png").read_bytes().startswith(b"\x89PNG")
    code, out, _ = command(*words, "--picture", "both.png", "--json")
    assert (code, bool(json.loads(out))) == (0, True)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    code, _, err = command("train", "curves", "first", "--policy", "none")
    assert code == 1
    assert "No picture without matplotlib" in err
    assert not Path("first/curves.png").exists()
