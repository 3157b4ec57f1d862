"""The command `ablate`: tables, JSON, and what it refuses."""

import json
import re
from pathlib import Path

import pytest

ABLATE = ("ablate", "--scenario", "warehouse_small", "--robots", "8,16", "--policy", "crw,stochm", "--seeds", "2",
          "--horizon", "200", "--jobs", "1", "--set", "interval_s=200")  # fmt: skip
QUIRKS = ("--quirks", "explore_double_start,integer_estimates,dynamic_cache_merges_all")


@pytest.mark.compiled
def test_tables_show_both_readings_and_what_each_quirk_moves(command):
    code, out, _ = command(*ABLATE, *QUIRKS)
    assert code == 0
    assert len(re.findall(r"^\| warehouse_small \| (8|16) \| (crw|stochm) \|", out, re.MULTILINE)) == 4
    assert "| quirk | crw 8 | stochm 8 | crw 16 | stochm 16 | order at 8 | order at 16 |" in out
    assert "each quirk switched off in the authors' program" in out
    assert "| `integer_estimates` | = |" in out, "CRW has no tasks"
    assert "`dynamic_cache_merges_all`" not in out, "there is no such cache"
    code, again, err = command(*ABLATE, *QUIRKS)
    assert again == out
    assert "all runs are stored already" in err or "runs are stored already" in err
    code, out, _ = command(*ABLATE, *QUIRKS, "--json")
    answer = json.loads(out)
    assert len(answer["effects"]) == 2 * 2 * 2 * 3
    (one,) = (e for e in answer["effects"] if (e["n_robots"], e["policy"], e["rules"], e["quirk"]) ==
              (8, "crw", "DESCRIBED", "integer_estimates"))  # fmt: skip
    assert (one["is_same"], one["n_runs"]) == (True, 1)
    assert one["interference"] == {"mean": 0.0, "lower": None, "upper": None}
    assert "task_share_none" not in one
    assert len(answer["rules"]) == 2 * 2 * 2
    assert answer["performance"] == "deliveries per 1,000 s"
    assert answer["failures"] == []


@pytest.mark.compiled
def test_without_quirks_only_the_readings_are_compared(command):
    code, out, _ = command(*ABLATE, "--quirks", "none", "--policy", "crw")
    assert code == 0
    assert "quirk |" not in out
    assert out.count("| crw |") == 2


@pytest.mark.compiled
def test_worlds_may_be_disturbed_and_performance_another(command):
    words = ("--quirks", "obstacle_behind_counts", "--policy", "crw", "--robots", "8")
    disturbed = ("--wrapper", "sensor_noise:sigma=0.01,groups=proximity", "--performance", "n_carrying")
    code, out, _ = command(*ABLATE, *words, *disturbed)
    assert code == 0
    assert "**Both rules: robots carrying" in out
    assert "per 1,000 s" not in out
    assert "| `obstacle_behind_counts` |" in out


def test_dry_run_makes_nothing(command):
    code, out, err = command(*ABLATE, *QUIRKS, "--dry-run")
    assert code == 0
    assert out.startswith("64 runs, 64 to do, records go to results/ablation")
    assert "A quirk that changes nothing needs one run instead of 2." in err
    assert not Path("results").exists()


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--robots", "8,many"), "Expected --robots as whole numbers separated by commas, such as 5,20, got '8,many'"),
        (("--quirks", "integer_estimate"), "Did you mean 'integer_estimates'?"),
        (("--policy", "crv"), "Did you mean 'crw'?"),
        (("--seeds", "1"), "Expected --seeds to be a number >= 2"),
    ],
)
def test_a_mistake_is_one_line_and_exit_code_2(command, words, complaint):
    code, out, err = command("ablate", *words)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert complaint in err
    assert not Path("results").exists()
