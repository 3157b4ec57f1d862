"""What performance can mean: values worked out by hand."""

import math

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.scenarios.performance import performance_curve, performance_of

TASKS = ("generalist", "harvester", "collector", "starter", "finisher", "transferer", "cache_collector")


def curve(name, **columns):
    given = {key: np.asarray(values) for key, values in columns.items()}
    return performance_curve(name, {"interval": np.arange(len(next(iter(given.values())))), **given})


def balance(**shares):
    return curve("task_balance", **{f"task_share_{task}": [share] for task, share in shares.items()})[0]


def test_columns_are_taken_as_they_are_or_turned_round():
    """A tenth of the time lost is worth 10, half of it 2; no loss at all is 0, because distances need finite curves."""
    found = curve("cache_drops", cache_drops=np.array([3, 0, 5]))
    assert (found.tolist(), found.dtype) == ([3.0, 0.0, 5.0], np.float64)
    assert curve("1/interference_fraction", interference_fraction=[0.1, 0.5, 0.0]) == pytest.approx([10.0, 2.0, 0.0])
    assert curve("deaths", n_active=[1.0]).tolist() == [0.0]
    assert curve("task_share_none", n_active=[1.0]).tolist() == [1.0]
    assert curve("believed_interference_fraction", interference_fraction=[0.3]).tolist() == [0.3]


def test_load_is_objects_per_cache():
    """Six objects in two caches are 3 per cache; before the first cache stands there is no load."""
    loads = {"n_objects_cached": [6.0, 0.0, 5.0], "n_caches": [2.0, 0.0, 0.5]}
    assert curve("cache_load", **loads).tolist() == [3.0, 0.0, 10.0]
    np.testing.assert_allclose(curve("1/cache_load", **loads), [1 / 3, 0.0, 0.1])


def test_balance_of_tasks_is_the_entropy_of_their_shares_among_robots_with_a_task():
    assert balance(**dict.fromkeys(TASKS, 1 / 7)) == pytest.approx(1.0)
    # 1/4 ln 4 + 3/4 ln 4/3 = 0.5623, over ln 7 = 1.9459
    assert balance(harvester=0.25, collector=0.75) == pytest.approx(0.28899, abs=1e-5)
    assert balance(generalist=1.0) == balance(none=1.0) == 0.0
    assert balance(none=0.5, harvester=0.25, collector=0.25) == pytest.approx(math.log(2) / math.log(7))


def test_balance_takes_its_logarithms_from_the_c_library():
    """The last bits of numpy's depend on the processor, and a record holds this curve."""
    shares = np.random.default_rng(0).integers(1, 500, (len(TASKS), 400))
    found = curve("task_balance", **{f"task_share_{task}": row for task, row in zip(TASKS, shares, strict=True)})
    for balance_then, column in zip(found.tolist(), shares.T.tolist(), strict=True):
        total = 0.0
        for share in column:
            total += share / sum(column) * math.log(share / sum(column))
        assert balance_then == -total / math.log(7)


def test_names_units_and_what_adds_up():
    told = [performance_of(name) for name in ("collected", "1/n_active", "cache_load", "1/cache_load", "task_balance")]
    assert [one.unit for one in told] == ["objects", "1/robots", "objects per cache", "1/(objects per cache)", "1"]
    assert [one.title for one in told[:2]] == ["deliveries", "1/robots at work"]
    assert [one.adds_up for one in told] == [True, False, False, False, False]
    with pytest.raises(ConfigError, match="Did you mean '1/collected'"):
        performance_of("1/deliveries")
