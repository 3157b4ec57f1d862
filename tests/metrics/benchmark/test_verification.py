"""Entries made again, in a tiny protocol: the same numbers, other numbers, and what is within chance."""

from dataclasses import replace

import numpy as np
import pytest

from metrics.benchmark import BenchmarkError, load_protocol, run_benchmark, verify_entry
from metrics.benchmark.entry import EntryPolicy
from metrics.benchmark.verification import Verification, VerifiedWorld
from tests.support.entries import TINY, made_up_entry


@pytest.fixture(scope="module")
def protocol():
    return load_protocol(TINY)


@pytest.fixture(scope="module")
def entry(protocol):
    return run_benchmark(["crw", "random"], name="two", protocol=protocol, jobs=1, progress=False)


def test_an_entry_comes_again(entry, protocol, tmp_path):
    entry.write(tmp_path / "two.json")
    found = verify_entry(tmp_path / "two.json", n_worlds=None, protocol=protocol, jobs=1, progress=False)
    assert found.verdict == "same"
    assert len(found.worlds) == found.n_worlds == 2 * len(protocol.worlds)
    assert {world.policy.name for world in found.worlds} == {"crw", "random"}
    assert "is verified" in found.text()


def test_one_altered_number_of_a_scripted_policy_is_found(entry, protocol, tmp_path):
    world = protocol.worlds[2].name
    runs = {**entry.runs, world: {**entry.runs[world], "performance": ((1e4, 1e4), (1e4, 1e4))}}
    replace(entry, runs=runs).write(tmp_path / "two.json")
    found = verify_entry(tmp_path / "two.json", n_worlds=None, protocol=protocol, jobs=1, progress=False)
    assert found.verdict == "differs"
    assert {each.world for each in found.worlds if not each.is_same} == {world}


def test_a_seed_draws_the_worlds(entry, protocol, tmp_path):
    entry.write(tmp_path / "two.json")

    def drawn(seed):
        found = verify_entry(
            tmp_path / "two.json", n_worlds=3, seed=seed, protocol=protocol, out=tmp_path, jobs=1, progress=False
        )
        return [(world.policy.name, world.world) for world in found.worlds]

    assert drawn(1) == drawn(1)
    assert len(drawn(1)) == 3
    assert drawn(1) != drawn(2)


def test_policies_must_be_those_of_the_entry(entry, protocol, tmp_path):
    entry.write(tmp_path / "two.json")
    with pytest.raises(BenchmarkError, match=r"Expected the 2 policies of .* got 1"):
        verify_entry(tmp_path / "two.json", ["crw"], protocol=protocol)
    with pytest.raises(BenchmarkError, match="got another one in ppo_warehouse_small"):
        verify_entry(tmp_path / "two.json", ["crw", "ppo_warehouse_small"], protocol=protocol)
    made_up_entry(protocol, "mine", lambda k: 1.0).write(tmp_path / "mine.json")
    with pytest.raises(BenchmarkError, match=r"Expected --policy FILE .* mine_0.npz is not installed"):
        verify_entry(tmp_path / "mine.json", protocol=protocol)


@pytest.mark.parametrize(("effect", "share"), [(0.0, (0.90, 0.99)), (0.2, (0.0, 0.1))])
def test_chance_is_told_from_another_policy(effect, share, protocol):
    """Other bits are other seeds: about 95 of 100 entries are within chance, and hardly one that is 20 % better."""
    rng = np.random.default_rng(2)
    entry = made_up_entry(protocol, "model", lambda k: 1.0)
    verdicts: list[str] = []
    for _ in range(300):
        mean = rng.uniform(5.0, 50.0, 8)
        stored, again = (mean[:, None] * rng.normal(1.0 + e, 0.1, (8, 3)) for e in (0.0, effect))
        worlds = tuple(
            VerifiedWorld(policy=EntryPolicy(name="model"), world=str(k), stored=a, again=b, is_exact=False)
            for k, (a, b) in enumerate(zip(stored, again, strict=True))
        )
        verdicts.append(Verification(entry=entry, worlds=worlds, n_worlds=8, other_versions=()).verdict)
    assert share[0] <= verdicts.count("within chance") / len(verdicts) <= share[1]


def verified(pairs, **fields):
    """Return one world for each pair of stored and new runs."""
    worlds = (
        VerifiedWorld(
            policy=EntryPolicy(name="model"), world=str(k), stored=np.array(a), again=np.array(b), is_exact=False
        )
        for k, (a, b) in enumerate(pairs)
    )
    entry = made_up_entry(load_protocol(TINY), "model", lambda k: 1.0)
    return Verification(entry=entry, worlds=tuple(worlds), n_worlds=8, other_versions=(), **fields)


def test_one_forged_world_is_found_among_others_that_scatter():
    honest = [([10.0, 11.0, 9.0], [10.2, 9.9, 10.5]), ([21.0, 20.0, 22.0], [20.5, 21.0, 20.0])]
    assert verified([*honest, ([5.0, 6.0, 7.0], [6.5, 6.0, 5.5])]).verdict == "within chance"
    assert verified([*honest, ([900.0, 901.0, 899.0], [1.0, 1.2, 0.8])]).verdict == "differs"
    assert verified([*honest, ([900.0] * 3, [1.0] * 3)]).verdict == "differs"
    assert verified(honest).verdict == "differs"  # too few to tell


def test_too_few_worlds_decide_nothing_for_chance(protocol, tmp_path):
    policy = tmp_path / "own.py"
    policy.write_text("from baselines.crw import CRWPolicy\n\n\nclass Own(CRWPolicy):\n    pass\n")
    entry = run_benchmark([f"{policy}:Own"], name="own", protocol=protocol, jobs=1, progress=False)
    entry.write(tmp_path / "own.json")
    with pytest.raises(BenchmarkError, match="at least 3 worlds"):
        verify_entry(tmp_path / "own.json", [f"{policy}:Own"], n_worlds=2, protocol=protocol)


def test_stored_runs_are_named(entry, protocol, tmp_path):
    entry.write(tmp_path / "two.json")
    for n_stored in (0, 4):
        found = verify_entry(
            tmp_path / "two.json", n_worlds=2, protocol=protocol, out=tmp_path / "runs", jobs=1, progress=False
        )
        assert found.n_stored == n_stored
