"""The records of compiled controllers keep their kinds apart."""

from itertools import permutations

import numpy as np
from numba import from_dtype

from baselines.cache_memory import CACHE
from baselines.cpfa import CPFAPolicy
from baselines.crw import CRWPolicy
from baselines.dpo import DPOPolicy
from baselines.stochx import STOCHXPolicy
from tests.support.observations import make_spec


def test_no_record_passes_for_a_shorter_one():
    """Otherwise numba takes a function compiled for the one for the other as well, with a warning at every call."""
    robots, constants = [], []
    for policy in (CRWPolicy(), DPOPolicy(), CPFAPolicy(), STOCHXPolicy()):
        policy.reset(make_spec(), np.random.default_rng(0))
        robots.append(from_dtype(policy._robots.dtype))
        constants.append(from_dtype(policy._constants.dtype))
    assert robots[0] == robots[1] != robots[2] != robots[3]
    records = [*robots[1:], *constants, from_dtype(CACHE)]
    for one, other in permutations(records, 2):
        assert one.can_convert_to(None, other) is None
