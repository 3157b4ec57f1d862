"""The table of measures agrees with the measures."""

import math

import pytest

import metrics
from metrics import METRICS


@pytest.mark.parametrize("name", METRICS)
def test_rows_are_named_after_public_functions(name):
    assert METRICS[name].function is getattr(metrics, name)


@pytest.mark.parametrize("name", METRICS)
def test_neutral_values_lie_in_the_range(name):
    row = METRICS[name]
    assert row.lowest < row.highest
    assert row.neutral is None or row.lowest <= row.neutral <= row.highest


def test_distances_are_best_at_zero():
    distances = {name for name, row in METRICS.items() if row.is_distance}
    assert distances == {"reactivity", "adaptability", "noise_robustness"}
    for name in distances:
        row = METRICS[name]
        assert (row.higher_is_better, row.neutral, row.lowest, row.highest) == (False, 0.0, 0.0, math.inf)


INDEPENDENT = {
    "t_lost_fraction": lambda f: f([0.0], 4),
    "performance_lost": lambda f: f([4.0], [0.1], 4, [1.0], [0.1]),
    "spatial_emergence": lambda f: f([2.0], [0.1], 2, [4.0], [0.1], 4, [1.0], [0.1]),
    "task_emergence": lambda f: f([2.0], 2, [4.0], 4),
    "scalability": lambda f: f([2.0], 2, [4.0], 4),
    "reactivity": lambda f: f([2.0], [1.0], 0.5, 0.0),
    "adaptability": lambda f: f([2.0], [2.0]),
    "noise_robustness": lambda f: f([2.0], [2.0]),
    "population_robustness": lambda f: f([2.0], [2.0], metrics.PopulationRates(), horizon=10),
    "availability": lambda f: f(4, 2, 0.0),
}


@pytest.mark.parametrize("name", [name for name, row in METRICS.items() if row.neutral is not None])
def test_an_undisturbed_swarm_of_independent_robots_has_the_neutral_value(name):
    row = METRICS[name]
    assert INDEPENDENT[name](row.function) == pytest.approx(row.neutral, abs=1e-12)
