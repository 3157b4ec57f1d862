"""`swarm-forage train --seeds`, as a person uses it."""

import re

import pytest

pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")

from tests.training.test_seeds import fake

SETTINGS = ("--set", "n_objects=20", "--set", "evaluation.horizon_s=200")
TINY = ("train", "--robots", "4", "--steps", "128", *SETTINGS, "--jobs", "1")
OUT = ("--out", "all")


@pytest.fixture
def pictures(monkeypatch):
    """Names of the trainings of each picture that is drawn."""
    found = []
    monkeypatch.setattr(
        "swarm_forage_env.rendering.plots.draw_trainings",
        lambda path, trainings, **_: found.append((str(path), [*trainings])),
    )
    return found


def test_seeds_are_trained_drawn_and_told_and_the_same_command_with_resume_does_the_rest(
    command, pictures, monkeypatch
):
    calls = fake(monkeypatch, fails={2})
    code, out, err = command(*TINY, "--seeds", "2", *OUT)
    assert code == 0, err
    assert calls == [(0, False), (1, False)]
    assert pictures == [("all/curves.png", ["seed_0", "seed_1"])]
    assert re.search(r"^  seed +decisions +deliveries per 1,000 s", err, re.MULTILINE)
    assert re.search(r"^     1 +128 +5\.00 +5\.0 +0\.250$", err, re.MULTILINE)
    assert err.endswith("picture all/curves.png\n")
    assert re.search(r"^mean +4\.5 +0\.250$", out, re.MULTILINE)
    assert out.endswith("swarm-forage benchmark all/seed_0/policy.npz all/seed_1/policy.npz --name all\n")
    code, _, err = command(*TINY, "--seeds", "3", *OUT)
    assert (code, err.count("\n")) == (2, 1)
    assert "an unused folder, got all/seed_0 with a training run; resume it" in err
    for words in (TINY, ("train", "--jobs", "1")):  # the plan is in the folder
        code, _, err = command(*words, "--seeds", "3", *OUT, "--resume")
        assert (code, calls.pop()) == (1, (2, False))
        assert "Seed 2 failed: too large" in err
        assert err.endswith("swarm-forage --trust-models train --out all --seeds 3 --resume\n")
    assert "found no plan.json" in command("train", "--seeds", "3", "--out", "none", "--resume")[2]
