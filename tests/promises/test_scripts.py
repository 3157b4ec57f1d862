"""Scripts that stay useful run: short, to see that they still fit the packages."""

import importlib
import sys
from pathlib import Path

import pytest

from scripts import count

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.compiled
def test_two_engines_are_compared(run):
    words = ("--policy", "dpo", "--robots", "30", "--seeds", "2", "--horizon", "20", "--all")
    lines = run("compare_engines", *words)[1].splitlines()
    assert len(lines) == 2 + 13 + 2
    assert all(line.startswith("| warehouse_small | dpo | 30 |") for line in lines[2:15])
    assert lines[15:] == [
        "1 of 1 cases have the same numbers in both engines.",
        "In 0 of the 0 rows that differ, the interval of the difference leaves out zero.",
    ]


RANGE, NO_RANGE = "name=low:high[:log][@start]", "expected name=low:high[:log][@start], log from above 0, got"


@pytest.mark.parametrize(
    ("script", "words", "fault"),
    [
        ("compare_engines", "--policy crv", "Unknown policy 'crv'. Did you mean 'crw'?"),
        ("bench", "nothing", "expected some of crw-50, crw-200, "),
        ("bench", "--against .", "expected a revision or a checkout of this project, got /"),
        ("evolve_controller", "dpo rate=3:1", f"argument {RANGE}: {NO_RANGE} 'rate=3:1'"),
        ("evolve_controller", "dpo object_priority=0:1 weight=0:1", "expected numbers of dpo, got 'weight'"),
        ("evolve_network", "--plan plan.toml --out o", "Cannot read"),
    ],
)
def test_bad_arguments_end_in_a_message(script, words, fault, run):
    code, out, err = run(script, *words.split())
    assert code == 2, err
    assert f"{script}.py: error: {fault}" in " ".join(err.split())
    assert out == ""


def test_kernels_that_only_kernels_call_are_seen_as_reached(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(ROOT / "scripts")
    import check_bounds

    names = ("floor._shine-111.py311-called.nbi", "floor.shine-130.py311.nbi", "floor.shine-130.py311-called.nbi")
    for name in (*names, "floor.draw-3.py311-called.1.nbc"):
        (tmp_path / name).touch()
    assert check_bounds.compiled(tmp_path) == {"floor._shine", "floor.shine"}
    assert {"tick.run", *check_bounds.ELSEWHERE} <= check_bounds.kernels()


@pytest.fixture
def bench(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "scripts")
    return importlib.import_module("bench")


@pytest.mark.compiled
@pytest.mark.parametrize("case", ["crw-50", "adverse-200", "network-50", "dict-200", "vec-8x50"])
def test_what_is_measured_is_still_there(case, bench):
    assert bench.CASES[case].measure("compiled", 0.01) > 0.0


def test_a_table_has_values_targets_and_ratios_of_rounds(bench):
    by_cases = {"crw-50": [[200.0, 100.0, 104.0]], "seeds-50": [[300.0, 200.0, 104.0]]}
    rows = bench.rows_of_cases(["crw-50", "seeds-50", "crw-200"], by_cases, against=False)
    assert [(row[0], row[2], row[5]) for row in rows[1:]] == [
        ("crw-50", "104", ""),
        ("seeds-50", "200", "1.50 (1.00 to 2.00) x crw-50"),
        ("crw-200", "-", ""),
    ]
    by_versions = {"crw-50": [[100.0, 100.0], [50.0, 1637.0]]}
    assert bench.rows_of_cases(["crw-50"], by_versions, against=True)[1][-2:] == ["844", "8.44 (0.50 to 16.4)"]
    assert {case.beside for case in bench.CASES.values()} <= {"", *bench.CASES}


def test_a_case_that_cannot_be_measured_gives_its_reason(bench):
    with (
        bench.Subject(sys.executable, bench.CASES_FILE, ROOT) as subject,
        pytest.raises(bench.BenchError, match="nobody: KeyError: 'nobody'"),
    ):
        subject.measure("nobody", "compiled", 0.1)


def test_every_room_that_is_counted_is_there_and_nothing_lies_elsewhere():
    found = dict(count.counted(ROOT))
    assert [room for room, number in found.items() if number == "0 in 0"] == ["elsewhere"]
    assert "-" not in found.values()
