"""Predictions from the scenario alone: what is taken from world and policy, what is run, and how it is told."""

import json
import math

import numpy as np
import pytest

from metrics import CurveError, predict_from_scenario
from metrics.scoring import ask, scenario_question
from metrics.scoring.from_scenario import floor_of, walker_of
from swarm_forage_env.runs.policy_spec import policy_spec
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import World
from tests.support.pictures import PNG

WORLD = scenario("warehouse_small", horizon_s=400.0, interval_s=200.0)


def test_a_robot_of_the_scenario_in_numbers():
    walker = walker_of(policy_spec("crw"), WORLD)
    assert (walker.search_mps, walker.home_mps, walker.nest_mps) == (0.09, 0.08, 0.10)
    # Where the walk is a source of the controllers: the mean cosine of the heading's change is 0.30 after 80 s.
    assert math.exp(-80.0 * walker.turning_per_s) == pytest.approx(0.30, abs=0.01)
    assert walker.seen_m == pytest.approx(0.27, abs=0.001)
    assert walker.handling_s == pytest.approx(0.4)


def test_a_world_in_numbers():
    floor = floor_of(World(WORLD))
    assert floor.nest == pytest.approx((1.6, 1.6, 4.8, 14.4))
    assert floor.interior == pytest.approx((0.2, 0.2, 31.6, 15.8))
    (source,) = floor.sources
    assert source == pytest.approx((24.0, 2.4, 27.2, 13.6))


@pytest.mark.parametrize("policy", ["random", "ppo_warehouse_small"])
def test_policies_without_a_random_walk_are_refused(policy):
    with pytest.raises(CurveError, match=f"as crw and dpo do, got {policy}"):
        predict_from_scenario([policy], WORLD, [1])


@pytest.mark.parametrize("policy", ["stochm", "stochx"])
def test_policies_with_caches_are_refused(policy):
    with pytest.raises(CurveError, match=f"needs no caches, as crw and dpo, got {policy}"):
        predict_from_scenario([policy], WORLD, [1])


def test_a_walk_that_turns_on_the_spot_is_refused():
    with pytest.raises(CurveError, match="never turns on the spot"):
        walker_of(policy_spec("crw", parameters={"wander_max_change_deg": 20.0}), WORLD)


@pytest.mark.parametrize(
    ("world", "words"),
    [
        (World(WORLD, (parse_wrapper("sensor_noise:sigma=0.1"),)), "wrappers"),
        (scenario("warehouse_small", obstacles=((10.0, 4.0, 11.0, 8.0),)), "obstacles"),
        (scenario("warehouse_small", further_nests=((27.0, 4.0, 29.0, 12.0),)), "further nests"),
        (scenario("warehouse_small", performance="n_caches"), "performance n_caches"),
    ],
)
def test_worlds_that_the_model_does_not_know_are_refused_before_any_run(world, words):
    for ask_it in (
        lambda: predict_from_scenario(["crw"], world, [1]),
        lambda: scenario_question(["crw"], world, hold=[1]),
    ):
        with pytest.raises(CurveError, match=f"without {words}"):
            ask_it()


def test_without_runs_there_is_a_prediction_alone():
    (table,) = predict_from_scenario(["crw"], WORLD, [1, 4]).tables
    assert list(table.predicted) == [1, 4]
    assert math.isnan(table.error(4))
    assert table.measures(1, 4).keys() == {"E_S", "E_T", "C"}
    assert table.measures(1, 4, of_runs=True) == {}
    told = json.loads(json.dumps(table.to_mapping(), allow_nan=False))
    assert told["sizes"][1]["runs"] is None
    with pytest.raises(CurveError, match="1 robot or more, got 0"):
        predict_from_scenario(["crw"], WORLD, [0])


@pytest.mark.compiled
def test_held_sizes_are_run_and_told_beside(tmp_path):
    found = ask(scenario_question(["crw", "dpo"], WORLD, [2], hold=[1, 6], seeds=2), progress=False, jobs=1)
    crw, dpo = found.tables
    assert list(crw.predicted) == [1, 2, 6]
    assert list(crw.runs) == list(dpo.runs) == [1, 6]
    assert crw.runs[6].performance.shape == (2, 2)
    assert crw.sheets()[0].title.startswith("crw in ")
    assert dpo.sheets()[0].title.startswith("model of a random searcher, for dpo, in ")
    assert "not a model of dpo" in dpo.sheets()[0].notes[0]
    rows = crw.sheets()[0].rows
    assert [row[0] for row in rows] == ["1", "2", "6"]
    assert rows[1][2] == ""
    assert rows[2][6].endswith(" s")
    told = json.loads(json.dumps(found.to_mapping(), allow_nan=False))
    assert len(told["tables"][1]["sizes"][2]["runs"]["performance"]) == 2
    found.draw(tmp_path / "picture.png")
    assert (tmp_path / "picture.png").read_bytes().startswith(PNG)


@pytest.mark.compiled
def test_prediction_and_runs_of_crw_agree():
    """Not a fit: nothing of the prediction knows these runs. The docs tell how far it carries."""
    world = scenario("warehouse_small", n_objects=512, horizon_s=2000.0, interval_s=500.0)
    (table,) = ask(scenario_question(["crw"], world, [32], hold=[32], seeds=6), progress=False, jobs=1).tables
    found, runs = table.predicted[32], table.runs[32]
    assert abs(table.error(32)) < 0.2
    assert found.interference.mean() == pytest.approx(runs.interference.mean(), rel=0.2)
    assert found.search_s.mean() == pytest.approx(runs.search_s, rel=0.25)
    assert found.home_s.mean() == pytest.approx(runs.home_s, rel=0.15)
    assert np.isfinite(found.encounters).all()
