"""Models beside the runs of a study: laws, the mean field, the queue."""

import numpy as np
import pytest

from metrics.queues import PopulationRates, robots_at_work
from metrics.scoring.study_models import MEAN_FIELD, model_figures
from swarm_forage_env.runs.policy_spec import PolicySpec
from swarm_forage_env.studies.study import Axis
from tests.support.foraging_table import ONE, SIZES, foraging_table
from tests.support.made_tables import made_study, made_table
from tests.support.pictures import words_in

TWO = (*ONE, PolicySpec(label="dpo", policy="random"))


@pytest.fixture(scope="module")
def laws():
    (figure,) = model_figures(foraging_table())
    return figure


def test_laws_and_the_mean_field_stand_beside_the_sizes(laws):
    (panel,) = laws.panels
    assert [curve.name for curve in panel.expected] == ["linear", "contention", "universal", "hamann", MEAN_FIELD]
    runs, model = panel.seen[0], panel.expected[-1]
    assert runs.x.tolist() == list(SIZES)
    assert model.y == pytest.approx(runs.y, rel=0.05), "runs that follow the model are found again from two robots"
    assert laws.name == "mine_laws_described"
    assert laws.y_label == "P(N) / N, objects per robot in 4,000 s"


def test_facts_of_laws_have_intervals(laws):
    facts = laws.facts()
    slope = facts.filter(model="linear", parameter="a").row(0, named=True)
    assert slope["lower"] <= slope["value"] <= slope["upper"]
    assert facts.filter(parameter="exponent", model="power, sizes up to 8: sublinear").height == 1
    known = facts.filter(model=MEAN_FIELD, parameter="robots that it knows")
    assert known["value"].to_list() == [2.0]
    assert set(laws.to_frame()["what"]) == {"runs", "model"}


def test_models_are_drawn(laws, tmp_path):
    files = [tmp_path / "laws.svg", tmp_path / "laws.png"]
    laws.draw(files)
    words = {"hamann", "mean field", "robots N", "no interval: fewer than 4 runs tell too little; dashed: models"}
    assert words <= {*words_in(files[0])}


def test_worlds_with_caches_have_no_mean_field():
    (figure,) = model_figures(foraging_table(caches="static"))
    assert MEAN_FIELD not in {curve.name for curve in figure.panels[0].expected}


def test_the_mean_field_is_of_deliveries_only():
    (figure,) = model_figures(foraging_table(performance="free_pickups"))
    assert MEAN_FIELD not in {curve.name for curve in figure.panels[0].expected}


def test_too_few_sizes_have_no_laws():
    assert model_figures(made_table(made_study(), lambda place: 5.0)) == ()


def test_robots_at_work_stand_beside_the_queue():
    spec = made_study(
        "S1g", Axis(name="population_dynamics", values=(0.0, 1.0, 2.0)), policies=TWO, reference=0.0, seeds=(0, 1)
    )
    (figure,) = model_figures(made_table(spec, lambda place: 5.0))
    assert figure.name == "S1g_population_described"
    assert [panel.words for panel in figure.panels] == ["5 departures per 1,000 s", "10 departures per 1,000 s"]
    assert figure.facts()["n_runs"].to_list() == [2, 2], "those of the same seed are the same runs"
    place = next(place for place in spec.places if place.values == (1.0,))
    world, rates = spec.world(place).scenario, spec.world(place).population
    per_s = PopulationRates(lambda_bd=rates.malfunction_per_tick / world.dt_s, mu_bd=rates.repair_per_tick / world.dt_s)
    panel = figure.panels[0]
    assert panel.expected[0].y == pytest.approx(robots_at_work(per_s, world.robots.n_robots, [10, 20, 30, 40]))
    assert panel.seen[0].y == pytest.approx(np.full(4, 4.0))
    assert figure.facts()["observed"].to_list() == [4.0, 4.0]
