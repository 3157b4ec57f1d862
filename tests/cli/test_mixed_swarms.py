"""Mixed swarms and kinds of robots on the command line: the rows of their parts, and one line for what is wrong."""

import json

TINY = ("--robots", "4", "--objects", "400", "--horizon", "200", "--set", "physics=compiled", "--jobs", "1")
MIXED = "mixed:ppo_warehouse_small=25%,crw=rest"


def test_the_table_of_a_run_has_a_row_for_each_part(command):
    code, out, err = command("run", "--policy", f"random,{MIXED}", *TINY)
    assert code == 0, err
    rows = [line for line in out.splitlines() if "of which" in line]
    assert ["of which ppo_warehouse_small (1 robot)" in row for row in rows] == [True, False]
    assert "of which crw (3 robots)" in rows[1]
    assert "per robot" in out
    code, out, _ = command("run", "--policy", f"random,{MIXED}", *TINY, "--json")
    alone, mixed = json.loads(out)["controllers"]
    assert (alone["parts"], mixed["controller"]) == ([], "mixed:ppo_warehouse_small=0.25,crw=rest")
    for name in ("deliveries_per_1000_s", "first_pickups_per_1000_s"):
        assert sum(part[name]["mean"] for part in mixed["parts"]) == mixed[name]["mean"]
    assert [part["n_robots"] for part in mixed["parts"]] == [1, 3]
    code, out, _ = command("run", "--policy", MIXED, *TINY, "--performance", "part_2_first_picked", "--json")
    (read,) = json.loads(out)["controllers"]
    assert read["performance"] == mixed["parts"][1]["first_pickups_per_1000_s"]


def test_the_table_of_a_run_has_a_row_for_each_kind_of_robots(command):
    words = ("run", "--policy", "random", *TINY, "--set", "robot_kinds=fast:share=0.25+slow:speed=0.5,lacks=light")
    code, out, err = command(*words)
    assert code == 0, err
    rows = [line for line in out.splitlines() if "of which" in line]
    assert ["of which fast (1 robot)" in row for row in rows] == [True, False]
    assert "of which slow (3 robots)" in rows[1]
    (found,) = json.loads(command(*words, "--json")[1])["controllers"]
    assert (
        sum(part["first_pickups_per_1000_s"]["mean"] for part in found["parts"])
        == (found["first_pickups_per_1000_s"]["mean"])
    )


def test_a_kind_without_robots_has_no_numbers_per_robot(command):
    words = ("run", "--policy", "random", *TINY, "--set", "robot_kinds=few:share=0.01+many")
    code, out, err = command(*words)
    assert code == 0, err
    few, many = (line.split() for line in out.splitlines() if "of which" in line)
    assert (few.count("-"), many.count("-")) == (2, 0)
    (found,) = json.loads(command(*words, "--json")[1])["controllers"]
    few, many = found["parts"]
    assert (few["n_robots"], many["n_robots"]) == (0, 4)
    assert few["deliveries_per_1000_s"]["mean"] == 0.0
    assert few["deliveries_per_robot_per_1000_s"]["mean"] is few["interference_fraction"] is None
    assert many["deliveries_per_robot_per_1000_s"]["mean"] is not None


def test_films_and_information_take_mixed_swarms(command, tmp_path):
    code, _, err = command("record", "--policy", MIXED, "--robots", "4", "--seconds", "8", "--size", "300")
    assert (code, err) == (0, "")
    assert [file.suffix for file in (tmp_path / "results").iterdir()] == [".gif"]
    code, out, _ = command("info", MIXED)
    assert (code, out.count("defined in")) == (0, 2)


def test_what_is_wrong_is_told_in_one_line(command):
    for policy in ("mixed:crw=3,dpo=3", "mixed:crw=x,dpo=rest", "mixed:crv=1,dpo=rest", "mixed:stochm=1,dpo=rest"):
        for name in ("run", "score", "watch"):
            code, _, err = command(name, "--policy", policy, "--robots", "4", "--objects", "400")
            assert (code, err.count("\n")) == (2, 1), (name, policy, err)
