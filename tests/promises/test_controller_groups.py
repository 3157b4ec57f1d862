"""The tables of `scripts/controller_groups.py`: who comes first, raw and relative to performance."""

import json

import pytest

from metrics import compare_tables
from metrics.scoring.curves_table import study_curves
from metrics.scoring.study_scores import score_study
from metrics.scoring.table import ScoreTable
from scripts.controller_groups import main, markdown
from tests.support.curve_tables import rows, table

PERFORMANCE = {"crw": 10.0, "stochx": 20.0, "dpo": 100.0, "stochm": 200.0}
LOSS = {"crw": 0.5, "stochx": 0.45, "dpo": 0.2, "stochm": 0.15}
"""Share of its performance that each policy loses to noise: raw 5, 9, 20 and 30 objects."""


def document(**performance):
    """What `compare --json` prints: two runs of one interval, undisturbed and with noise."""
    tables = []
    for name, ideal in performance.items():
        noisy = ideal * (1.0 - LOSS[name])
        frame = table(
            rows(9, [[ideal], [ideal]], criterion="none", criterion_value=0.0),
            rows(9, [[noisy], [noisy]], criterion="noise", criterion_value=0.03),
        )
        (study,) = study_curves(frame)
        tables.append(ScoreTable(policy=name, scenario="here", scores=score_study(study)[0]))
    return json.loads(json.dumps(compare_tables(tables).to_mapping()))


def test_who_delivers_little_is_first_by_raw_values_and_last_by_relative_ones():
    lines = markdown(document(**PERFORMANCE)).splitlines()
    assert lines[2] == (
        "| noise_robustness | sigma 0.03 | crw 5, stochx 9, dpo 20, stochm 30 | crw + stochx first (0 of 4) "
        "| stochm 15 %, dpo 20 %, stochx 45 %, crw 50 % | dpo + stochm first (0 of 4) |"
    )
    assert lines[-1] == "| all | 1 | 0 | 0 | 0 | 1 | 0 |"


def test_orders_that_mix_the_groups_and_significant_pairs_are_counted():
    given = document(**(PERFORMANCE | {"dpo": 26.0}))  # loses 5.2 objects, less than stochx
    for difference in given["differences"]:
        if not difference["relative"]:
            difference["better"] = difference["first"]
    lines = markdown(given).splitlines()
    assert "crw 5, dpo 5.2, stochx 9, stochm 30 | mixed (4 of 4)" in lines[2]
    assert lines[-1] == "| all | 0 | 0 | 1 | 0 | 1 | 0 |"


def test_equal_values_of_two_groups_are_no_order():
    row = markdown(document(**(PERFORMANCE | {"dpo": 45.0}))).splitlines()[2]  # loses 9 objects, as stochx does
    assert "crw 5, stochx 9, dpo 9, stochm 30 | mixed" in row


def test_values_at_the_noise_floor_are_marked_and_undefined_ones_have_no_order():
    given = document(**PERFORMANCE)
    for scored in given["tables"]:
        (score,) = scored["scores"]
        score["noise_floor"] = 9.0
    given["tables"][0]["scores"][0]["relative"] = None
    row = markdown(given).splitlines()[2]
    assert "crw 5°, stochx 9°, dpo 20, stochm 30" in row
    assert row.endswith("|  | - |")
    assert markdown(given).splitlines()[-1] == "| all | 1 | 0 | 0 | 0 | 0 | 0 |"


def test_the_script_prints_all_files(tmp_path, capsys):
    file = tmp_path / "small.json"
    file.write_text(json.dumps(document(**PERFORMANCE)))
    assert main([str(file), str(file), "--groups", "crw,stochx/dpo"]) == 0
    printed = capsys.readouterr().out
    assert printed.count("**here**") == 2
    assert "dpo first (0 of 2)" in printed


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["small.json", "--groups", "crw,ppo/dpo"], "got none of ppo"),
        (["small.json", "--groups", "crw"], "two groups as A,B/C,D"),
        (["gone.json"], "gone.json"),
    ],
)
def test_what_is_wrong_is_told(tmp_path, monkeypatch, capsys, words, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.json").write_text(json.dumps(document(**PERFORMANCE)))
    with pytest.raises(SystemExit) as stopped:
        main(words)
    assert stopped.value.code == 2
    assert message in capsys.readouterr().err


def test_comparisons_without_such_measures_are_refused():
    given = document(**PERFORMANCE)
    for scored in given["tables"]:
        scored["scores"] = []
    with pytest.raises(ValueError, match="got none that all of crw, stochx, dpo, stochm have"):
        markdown(given)
