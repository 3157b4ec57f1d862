"""Swarms twice and four times as large as the fitted ones achieve what was predicted, as far as the interval says."""

import pytest

from metrics import predict_policy
from swarm_forage_env.scenarios.presets import warehouse_small

pytestmark = [pytest.mark.slow, pytest.mark.compiled]


@pytest.mark.parametrize("policy", ["crw", "dpo"])
def test_held_back_swarms_lie_inside_the_interval(policy):
    world = warehouse_small(horizon_s=4000.0)
    table = predict_policy(policy, world, fit=[4, 8, 16, 32], hold=[64, 128], seeds=4, jobs=1, progress=False)
    print(f"\n{table}")  # noqa: T201 - the finding
    assert [table.is_inside(size) for size in table.hold] == [True, True]
    # An interval that holds everything would say nothing.
    value, lower, upper = table.interval(64)
    assert upper - lower < 2.0 * value
