"""Entries made again, in a tiny protocol: the same numbers, and other numbers."""

from dataclasses import replace

import pytest

from metrics.benchmark import SAME, BenchmarkError, load_protocol, run_benchmark, verify_entry
from metrics.benchmark.entry import WorldRuns
from tests.support.entries import TINY, made_up_entry


@pytest.fixture(autouse=True)
def tiny(tmp_path, monkeypatch):
    (tmp_path / "benchmark.toml").write_text(TINY.read_text())
    monkeypatch.setattr("metrics.benchmark.protocol.FOLDER", tmp_path)


@pytest.fixture(scope="module")
def entry():
    return run_benchmark(["crw", "random"], name="two", protocol=load_protocol(TINY), jobs=1, progress=False)


def verified(file, **options):
    return verify_entry(file, jobs=1, progress=False, **options).frame.rows()


def test_an_entry_comes_again(entry, tmp_path):
    entry.write(tmp_path / "two.json")
    found = verified(tmp_path / "two.json", n_worlds=99)
    assert len(found) == 2 * len(entry.runs)
    assert {row[-1] for row in found} == {SAME}
    assert {row[0] for row in found} == {"crw", "random"}


def test_one_altered_number_is_found(entry, tmp_path):
    world = "room, 2 robots"
    runs = {**entry.runs, world: WorldRuns(performance=((1e4, 1e4),) * 2, interference=((0.1, 0.1),) * 2)}
    replace(entry, runs=runs).write(tmp_path / "two.json")
    found = verified(tmp_path / "two.json", n_worlds=99)
    assert {row[1] for row in found if row[-1] != SAME} == {world}


def test_a_seed_draws_the_worlds(entry, tmp_path):
    entry.write(tmp_path / "two.json")

    def drawn(seed):
        return [row[:2] for row in verified(tmp_path / "two.json", n_worlds=3, seed=seed)]

    assert drawn(1) == drawn(1)
    assert len(drawn(1)) == 3
    assert drawn(1) != drawn(2)


def test_policies_must_be_those_of_the_entry(entry, tmp_path):
    entry.write(tmp_path / "two.json")
    for policies in (["crw"], ["crw", "ppo_warehouse_small"]):
        with pytest.raises(BenchmarkError, match=r"Expected the policies of .* \(crw, random\), got others"):
            verify_entry(tmp_path / "two.json", policies)
    made_up_entry(load_protocol(TINY), "mine", lambda k: 1.0).write(tmp_path / "mine.json")
    with pytest.raises(BenchmarkError, match=r"Expected --policy FILE,... for each of mine_0.npz"):
        verify_entry(tmp_path / "mine.json")
