"""Curves of a study's table: lines of figures, references found by the axes, scores."""

import pytest

from metrics.scoring.frame import scores
from metrics.scoring.run_curves import study_lines
from swarm_forage_env import read_study, run_study
from swarm_forage_env.runs.store import record_file
from swarm_forage_env.studies.study_file import Axis
from tests.support.tiny_study import RANDOM, tiny_study


@pytest.fixture
def made(tmp_path):
    """Run a study in this process and return its table."""

    def make(*axes, **changes):
        run_study(tiny_study(*axes, policies=(RANDOM,), **changes), tmp_path, jobs=1)
        return read_study(tmp_path)

    return make


def test_a_line_is_what_differs_on_the_last_axis(made):
    table = made(Axis(name="walk_probability", values=(0.0, 0.5)), Axis(name="noise", values=(0.0, 0.02, 0.03)))
    lines = study_lines(table)
    assert [(line.rules, line.policy, line.others) for line in lines] == [
        ("described", "random", {"walk_probability": 0.0}),
        ("described", "random", {"walk_probability": 0.5}),
    ]
    for line in lines:
        assert [place.values[-1] for place in line.places] == [0.0, 0.02, 0.03]
        pairs = line.curves.levels("noise")
        assert [(reference.criterion, level.value) for reference, level in pairs] == [("none", 0.02), ("none", 0.03)]
        found, missing = scores([line.curves], ["noise_robustness"])
        assert found.select("x", "seed").rows() == [(0.02, 0), (0.02, 1), (0.03, 0), (0.03, 1)]
        assert missing == {}


def test_sizes_are_scored_from_the_smallest(made):
    (line,) = study_lines(made(Axis(name="population_size", values=(1, 2)), reference=1))
    found, missing = scores([line.curves], ["scalability", "time_emergence", "raw_performance"])
    assert set(found["measure"]) == {"scalability", "time_emergence", "raw_performance"}
    assert missing == {}
    assert line.curves.horizon_s == 4.0


def test_the_lowest_rates_may_be_the_reference(made):
    """The authors compare with their lowest level; both forms of the measure then use the same runs."""
    (line,) = study_lines(made(Axis(name="population_dynamics", values=(1.0, 2.0, 4.0)), reference=1.0,
                               set={"n_robots": 4, "n_objects": 20}))  # fmt: skip
    pairs = line.curves.levels("population_dynamics")
    assert [(reference.value, level.value) for reference, level in pairs] == [(1.0, 2.0), (1.0, 4.0)]
    assert all(reference.rates.lambda_bd == pytest.approx(0.005) for reference, _ in pairs), "0.001 per tick of 0.2 s"
    found, _ = scores([line.curves], ["population_robustness"])
    assert found["x"].unique(maintain_order=True).to_list() == [2.0, 4.0]


def test_lost_runs_are_counted(made, tmp_path):
    table = made(Axis(name="noise", values=(0.0, 0.02)))
    noisy = table.spec.places[-1]
    record_file(tmp_path / "runs", table.spec.specs_of(noisy)[1].run_id).unlink()
    (line,) = study_lines(read_study(tmp_path))
    reference, level = line.curves.experiments
    assert (reference.n_lost, level.n_lost, level.seeds) == (0, 1, (0,))
