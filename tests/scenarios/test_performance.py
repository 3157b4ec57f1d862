"""What performance can mean: names, units, and values worked out by hand."""

import math

import numpy as np
import pytest

from swarm_forage_env.scenarios.performance import (
    performance_curve,
)

TASKS = ("generalist", "harvester", "collector", "starter", "finisher", "transferer", "cache_collector")


def curve(name, **columns):
    given = {key: np.asarray(values) for key, values in columns.items()}
    n_intervals = len(next(iter(given.values())))
    return performance_curve(name, {"interval": np.arange(n_intervals), **given})


def balance(**shares):
    columns = {f"task_share_{task}": [share] for task, share in shares.items()}
    return curve("task_balance", **columns)[0]


def test_a_recorded_column_is_taken_as_it_is():
    found = curve("cache_drops", cache_drops=np.array([3, 0, 5]))
    assert found.tolist() == [3.0, 0.0, 5.0]
    assert found.dtype == np.float64


def test_one_over_a_column_of_which_less_is_better():
    """A tenth of the time lost is worth 10, half of it 2; no loss at all is 0, because distances need finite curves."""
    found = curve("1/interference_fraction", interference_fraction=[0.1, 0.5, 0.0])
    np.testing.assert_allclose(found, [10.0, 2.0, 0.0])


def test_load_is_objects_per_cache():
    """Six objects in two caches are 3 per cache; before the first cache stands there is no load."""
    loads = {"n_objects_cached": [6.0, 0.0, 5.0], "n_caches": [2.0, 0.0, 0.5]}
    assert curve("cache_load", **loads).tolist() == [3.0, 0.0, 10.0]
    np.testing.assert_allclose(curve("1/cache_load", **loads), [1 / 3, 0.0, 0.1])


def test_balance_of_tasks_is_the_entropy_of_their_shares():
    assert balance(**dict.fromkeys(TASKS, 1 / 7)) == pytest.approx(1.0)
    assert balance(generalist=1 / 3, harvester=1 / 3, collector=1 / 3) == pytest.approx(math.log(3) / math.log(7))
    # 1/4 ln 4 + 3/4 ln 4/3 = 0.5623, over ln 7 = 1.9459
    assert balance(harvester=0.25, collector=0.75) == pytest.approx(0.28899, abs=1e-5)
    assert balance(generalist=1.0) == 0.0


def test_balance_takes_its_logarithms_from_the_c_library():
    """The last bits of numpy's depend on the processor, and a record holds this curve."""
    shares = np.random.default_rng(0).integers(1, 500, (len(TASKS), 400))
    found = curve("task_balance", **{f"task_share_{task}": row for task, row in zip(TASKS, shares, strict=True)})
    for balance_then, column in zip(found.tolist(), shares.T.tolist(), strict=True):
        parts = [share / sum(column) for share in column]
        total = 0.0
        for part in parts:
            total += part * math.log(part)
        assert balance_then == -total / math.log(7)


def test_balance_is_about_robots_that_have_a_task():
    assert balance(none=0.5, harvester=0.25, collector=0.25) == pytest.approx(math.log(2) / math.log(7))
    assert balance(none=1.0) == 0.0
