"""The table of measures agrees with the measures."""

import math
import re
from pathlib import Path

import pytest

import metrics
from metrics import METRICS
from metrics.scoring.scores import MEASURE_CRITERIA

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.mark.parametrize("name", METRICS)
def test_measures_are_named_after_public_functions(name):
    assert METRICS[name].function is getattr(metrics, name)


@pytest.mark.parametrize("name", METRICS)
def test_neutral_values_lie_in_the_range(name):
    measure = METRICS[name]
    assert measure.lowest < measure.highest
    assert measure.neutral is None or measure.lowest <= measure.neutral <= measure.highest


def test_distances_are_best_at_zero():
    distances = {name for name, measure in METRICS.items() if measure.is_distance}
    assert distances == {"reactivity", "adaptability", "noise_robustness"}
    for name in distances:
        best = METRICS[name]
        assert (best.higher_is_better, best.neutral, best.lowest, best.highest) == (False, 0.0, 0.0, math.inf)


INDEPENDENT = {
    "t_lost_fraction": lambda f: f([0.0], 4),
    "performance_lost": lambda f: f([4.0], [0.1], 4, [1.0], [0.1]),
    "spatial_emergence": lambda f: f([2.0], [0.1], 2, [4.0], [0.1], 4, [1.0], [0.1]),
    "time_emergence": lambda f: f([0.1], 2, [0.1], 4),
    "task_emergence": lambda f: f([2.0], 2, [4.0], 4),
    "interference_gain": lambda f: f([2.0], [0.1], 2, [4.0], [0.1], 4),
    "undisturbed_gain": lambda f: f([2.0], [0.1], 2, [4.0], [0.1], 4),
    "scalability": lambda f: f([2.0], 2, [4.0], 4),
    "reactivity": lambda f: f([2.0], [1.0], 0.5, 0.0),
    "adaptability": lambda f: f([2.0], [2.0]),
    "noise_robustness": lambda f: f([2.0], [2.0]),
    "population_robustness": lambda f: f([2.0], [2.0], metrics.PopulationRates(), horizon=10),
    "recorded_population_robustness": lambda f: f([2.0], [4.0], [2.0], 4.0),
    "availability": lambda f: f(4, 2, 0.0),
}


@pytest.mark.parametrize("name", [name for name, measure in METRICS.items() if measure.neutral is not None])
def test_an_undisturbed_swarm_of_independent_robots_has_the_neutral_value(name):
    measure = METRICS[name]
    assert INDEPENDENT[name](measure.function) == pytest.approx(measure.neutral, abs=1e-12)


@pytest.mark.parametrize("name", METRICS)
def test_every_measure_stands_on_the_page_of_measures(name):
    assert f"`{name}`" in (DOCS / "metrics.md").read_text()


@pytest.mark.parametrize("criterion", sorted(set(MEASURE_CRITERIA.values())))
def test_the_page_of_scores_says_what_is_varied_for_which_measure(criterion):
    what_is_run = (DOCS / "scoring.md").read_text().split("\n## ")[1]
    (row,) = re.findall(rf"^\| `{criterion}` \|.*\|(.+)\|$", what_is_run, re.MULTILINE)
    assert re.findall(r"`(\w+)`", row) == [name for name, varied in MEASURE_CRITERIA.items() if varied == criterion]
