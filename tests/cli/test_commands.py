"""The console command, as a person uses it: words in, text and exit code out."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from swarm_forage_env.policies import pretrained
from swarm_forage_env.policies.registry import POLICIES, RandomPolicy
from swarm_forage_env.runs.record import Record
from swarm_forage_env.runs.store import load
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES

SHORT = ("--robots", "3", "--set", "n_objects=20", "--horizon", "4", "--set", "interval_s=2", "--jobs", "1")
RUN = ("run", "random", *SHORT)


def test_run_shows_a_table_and_keeps_records_and_a_picture(command, painted):
    code, out, err = command(*RUN, "--seeds", "2")
    assert code == 0
    assert "warehouse_small: 3 robots, 20 objects, 4 s" in out
    for word in ("random", "none", "deliveries", "per 1,000 s", "interference", "simulated s"):
        assert word in out
    assert "± 95% t interval over 2 seeds, wide because so few say little (make 4 or more);" in out
    folder = Path("results/warehouse_small_3_robots_4_s_33b9a3")
    assert [record.seed for record in sorted(load(folder), key=lambda record: record.seed)] == [0, 1]
    assert (folder / "warehouse_small_3_robots_4_s_33b9a3_random.png").read_bytes().startswith(b"\x89PNG")
    assert "2 records in results/warehouse_small_3_robots_4_s_33b9a3" in err


def test_any_column_is_the_performance_and_the_runs_stay(command, monkeypatch):
    command(*RUN, "--seeds", "2")
    monkeypatch.setattr(RandomPolicy, "reset", lambda *_: pytest.fail("a stored run was repeated"))
    code, out, _ = command(*RUN, "--seeds", "2", "--set", "performance=n_active")
    assert code == 0
    assert "robots at" in out
    assert "3.00 ± 0.00" in out
    _, out, _ = command(*RUN, "--set", "performance=n_active", "--json")
    answer = json.loads(out)
    assert answer["performance"] == {"name": "n_active", "unit": "robots", "is_per_1000_s": False}
    assert (answer["runs"][0]["performance"], answer["controllers"][0]["performance"]["mean"]) == (3.0, 3.0)


def test_the_same_command_again_runs_nothing(command, monkeypatch):
    command(*RUN, "--seeds", "2")
    monkeypatch.setattr(RandomPolicy, "reset", lambda *_: pytest.fail("a stored run was repeated"))
    code, out, _ = command(*RUN, "--seeds", "2")
    assert code == 0
    assert "random" in out


def test_json_is_the_only_thing_on_stdout(command):
    code, out, _ = command(*RUN, "--seeds", "2", "--json", "--out", "here")
    assert code == 0
    answer = json.loads(out)
    assert (answer["scenario"], answer["out"], answer["failures"]) == ("warehouse_small", "here", [])
    assert [run["seed"] for run in answer["runs"]] == [0, 1]
    (summary,) = answer["controllers"]
    assert (summary["controller"], summary["caches"], summary["n_runs"]) == ("random", "none", 2)
    record = Record.read(answer["runs"][0]["file"])
    assert answer["runs"][0]["first_pickups_per_1000_s"] == record.per_1000_s("first_picked")


def test_a_dry_run_plans_and_touches_nothing(command):
    code, out, _ = command("run", "random", "--seeds", "3", "--jobs", "2", "--dry-run")
    assert code == 0
    assert out == "3 runs, 0 stored, 3 to do with 7.5e+06 robot-ticks; records go to results/warehouse_small\n"
    assert not list(Path.cwd().iterdir())


def test_set_changes_any_field_with_its_type(command):
    settings = "team=true nest_size_m=2,4 walk_probability=0.5 static_size=3 physics_substeps=0.2,0.2,0.2,0.2,0.2"
    each = (word for setting in settings.split() for word in ("--set", setting))
    _, out, _ = command(*RUN, *each, "--dry-run", "--json")
    world = json.loads(out)[0]["scenario"]
    assert world["reward"]["team"] is True
    assert world["arena"]["nest_size_m"] == [2.0, 4.0]
    assert world["objects"]["walk_probability"] == 0.5
    assert world["cache"]["static_size"] == 3
    assert world["physics_substeps"] == [0.2] * 5


def test_a_density_chooses_the_arena(command):
    words = ("run", "random", "--robots", "20", "--set", "density=0.05", "--horizon", "4", "--jobs", "1")
    assert command(*words, "--set", "interval_s=2")[0] == 0
    (record,) = load(Path("results/warehouse_small_20_robots_4_s_c12cf6"))
    arena = record.spec.scenario.arena
    assert (arena.width_m, arena.height_m) == (28.4, 14.2)  # 400 m^2 = 2 a^2 with a = 14.14 m


def test_wrappers_disturb_the_run_and_are_part_of_its_record(command):
    words = ("--wrapper", "actuator_noise:sigma=0.1", "--wrapper", "throttle:waveform=constant,amplitude=0.2")
    code, out, _ = command(*RUN, *words, "--json")
    assert code == 0
    record = Record.read(json.loads(out)["runs"][0]["file"])
    assert record["adversity"].tolist() == pytest.approx([0.2, 0.2])
    assert "4 s, with throttle: robots lose 20 % of their speed, wheel noise: sigma 0.1" in command(*RUN, *words)[1]
    assert [wrapper["wrapper"] for wrapper in record.spec.to_mapping()["wrappers"]] == ["throttle", "actuator_noise"]


def test_a_failed_run_is_reported_with_the_way_to_run_it_again(command, monkeypatch):
    def refuse(self, obs, active):
        raise RuntimeError("I would rather not")

    with monkeypatch.context() as patch:
        patch.setattr(RandomPolicy, "act", refuse)
        code, out, err = command(*RUN)
        assert code == 1
        assert out.count("\n") == 1
        assert "RuntimeError: I would rather not" in out
        again = err.strip().splitlines()[-1].split("again, alone: swarm-forage ")[1].split()
        code, out, err = command(*again)
        assert (code, out) == (1, "")
        assert err.startswith("Traceback")
        assert err.splitlines()[-2:] == ["RuntimeError: I would rather not", "swarm-forage: the run failed again"]
    code, out, _ = command(*again)
    assert code == 0
    assert "random in warehouse_small, 3 robots" in out


def test_rerun_compares_with_the_record(command):
    command(*RUN)
    (file,) = Path("results/warehouse_small_3_robots_4_s_33b9a3").glob("*.parquet")
    code, out, _ = command("rerun", str(file))
    assert code == 0
    assert f"bit for bit the same as {file}" in out


def test_rerun_notices_a_difference(command, monkeypatch):
    command(*RUN)
    (file,) = Path("results/warehouse_small_3_robots_4_s_33b9a3").glob("*.parquet")
    monkeypatch.setattr(Record, "equals", lambda *_: False)
    code, _, err = command("rerun", str(file))
    assert code == 1
    assert "the results differ" in err


def test_ctrl_c_in_this_process(command, monkeypatch):
    def interrupt(self, task, rng):
        raise KeyboardInterrupt

    command(*RUN)
    monkeypatch.setattr(RandomPolicy, "reset", interrupt)
    code, _, err = command(*RUN, "--seeds", "3")
    assert code == 130
    expected = (
        "swarm-forage: Interrupted: 1 of 3 runs are finished. They are in results/warehouse_small_3_robots_4_s_33b9a3; "
    )
    assert err.splitlines()[-1] == expected + "the same command does the rest."


@pytest.mark.slow
def test_ctrl_c_with_worker_processes(tmp_path):
    words = [
        "run",
        "random",
        "--jobs",
        "2",
        "--seeds",
        "6",
        "--robots",
        "5",
        "--set",
        "n_objects=20",
        "--horizon",
        "10000",
        "--out",
    ]
    program = [sys.executable, "-m", "swarm_forage_env.cli", *words, str(tmp_path)]
    pipe = subprocess.PIPE
    with subprocess.Popen(program, stdout=pipe, stderr=pipe, text=True, start_new_session=True) as process:
        try:
            while not list(tmp_path.glob("*.parquet")) and process.poll() is None:
                time.sleep(0.1)
            os.killpg(process.pid, signal.SIGINT)
            out, err = process.communicate(timeout=10)
        finally:  # whatever went wrong, nothing stays behind
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130
    assert out == ""
    assert re.search(r"\d of \d runs are finished\. They are in ", err)
    assert "Traceback" not in err
    assert 1 <= len(load(tmp_path)) < 6


@pytest.mark.parametrize("name", ["ppo_warehouse_small", str(pretrained.network_file("ppo_warehouse_small"))])
def test_info_describes_a_network_by_its_name_or_file(command, name):
    code, out, _ = command("info", name)
    assert code == 0
    assert "a network of 23 x 64 x 64 x 6 units (tanh)" in out
    assert re.search(r"decision_ticks +5\n", out)
    assert re.search(r"stable-baselines3 +\d", out)


def test_list_names_everything(command):
    code, out, _ = command("list")
    assert code == 0
    for name in (*SCENARIO_NAMES, *POLICIES):
        assert name in out
    assert max(map(len, out.splitlines())) <= 80, "columns of a terminal"


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (
            ("run", "crw", "--scenario", "warehouse_smal"),
            "Did you mean 'warehouse_small'?",
        ),
        (("run", "crw,crv"), "Unknown policy 'crv'. Did you mean 'crw'?"),
        (("run", "crw,gone.npz"), "gone.npz"),
        (("run", ","), "Expected one or more names separated by commas"),
        (("run", "crw", "--robot", "3"), "Unknown option: --robot. Did you mean --robots?"),
        (("list", "columns", "extra"), "Unused Tokens: ['extra']"),
        (("list", "colums"), "Did you mean 'columns'?"),
        (("run", "crw", "--seeds", "0"), 'Invalid value "0" for --seeds. Must be >= 1'),
        (("run", "crw", "--seeds", "many"), 'Invalid value for --seeds: unable to convert "many" into int'),
        (("run", "crw", "--set", "n_objects=100000"), "Expected at most"),
        (
            ("run", "crw", "--set", "density=0.05", "--set", "width_m=64"),
            "either density, which chooses the arena",
        ),
        (("run", "crw", "--set", "n_robot=5"), "Unknown scenario field 'n_robot'. Did you mean 'n_robots'?"),
        (("run", "crw", "--set", "n_robots"), "Expected --set key=value, got 'n_robots'"),
        (("run", "crw", "--set", "n_robots=x"), "Expected robots.n_robots to be a whole number >= 1, got 'x'"),
        (
            ("run", "crw", "--set", "obstacles=a,b,c,d"),
            "Expected arena.obstacles[0][0] to be a finite number",
        ),
        (("run", "crw", "--set", "nest_size_m=1"), "Expected arena.nest_size_m to be (x, y), got 1"),
        (("run", "crw", "--set", "n_robots=3", "--robots", "4"), "Expected n_robots once"),
        (("run", "crw", "--wrapper", "throtle:amplitude=1"), "Unknown wrapper 'throtle'. Did you mean 'throttle'?"),
        (
            ("run", "crw", "--wrapper", "actuator_noise:sigma"),
            "Expected the settings of wrapper actuator_noise",
        ),
        (("record", "--file", "x.avi"), "to end in .gif or .mp4"),
        (("info", "crv"), "Did you mean 'crw'?"),
        (("record", "crv"), "Did you mean 'crw'?"),
        (("rerun", "missing.parquet"), "Cannot read missing.parquet: No such file or directory"),
        (("rerun", "file"), "Cannot read file: it is no Parquet file or a damaged one"),
        (("rnu",), 'Unknown command "rnu". Did you mean "run"?'),
        (("study", "rnu"), 'Unknown command "rnu". Did you mean "run"?'),
    ],
    ids=lambda value: " ".join(value)[:40] if isinstance(value, tuple) else "",
)
def test_a_mistake_is_one_line_and_exit_code_2(command, words, complaint):
    Path("file").write_text("no record")
    code, out, err = command(*words)
    assert code == 2
    assert out == ""
    assert err.startswith("swarm-forage: ")
    assert err.count("\n") == 1
    assert complaint in err
    assert [path.name for path in Path.cwd().iterdir()] == ["file"]


def test_a_folder_that_cannot_be_made_is_one_line(command):
    Path("file").write_text("")
    code, _, err = command(*RUN, "--out", "file/inside")
    assert code == 1
    assert "Errno" not in err
    assert "Not a directory: file" in err
    assert err.count("\n") == 1
