"""The same runs give the same bits as before: presets x controllers x rules x wrappers, and batches for learners."""

import json

import pytest

from tests.support.golden_runs import AS_THEN, FILE, batch_fingerprint, golden_batches, golden_specs, run_fingerprint

STORED = json.loads(FILE.read_text(encoding="utf-8"))
SPECS = golden_specs()
BATCHES = golden_batches()
CHANGED = (
    "Results have changed. If they were meant to: python -m tests.support.golden_runs and a line in the changelog."
)

pytestmark = [*AS_THEN]


def test_every_run_has_a_fingerprint():
    names = {*SPECS, *BATCHES}
    assert names == set(STORED["fingerprints"])
    compiled = {name for name in names if not name.endswith("/chipmunk")}
    assert len({STORED["fingerprints"][name] for name in compiled}) == len(compiled)


@pytest.mark.parametrize("name", SPECS)
def test_a_run_gives_the_same_bits(name):
    assert run_fingerprint(SPECS[name]) == STORED["fingerprints"][name], CHANGED


@pytest.mark.parametrize("name", BATCHES)
def test_a_batch_for_learners_gives_the_same_bits(name):
    assert batch_fingerprint(*BATCHES[name]) == STORED["fingerprints"][name], CHANGED
