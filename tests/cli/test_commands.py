"""The console command, as a person uses it: words in, text and exit code out."""

import json
from pathlib import Path

import pytest

from swarm_forage_env.cli.options import WorldOptions
from swarm_forage_env.cli.worlds import described_world
from swarm_forage_env.inspect.descriptions import _scenario_lines
from swarm_forage_env.policies.registry import RandomPolicy
from swarm_forage_env.runs.record import Record
from swarm_forage_env.runs.store import load
from swarm_forage_env.scenarios.overrides import field_sections
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario

SHORT = ("--robots", "3", "--set", "n_objects=20", "--horizon", "4", "--set", "interval_s=2", "--jobs", "1")
RUN = ("run", "random", *SHORT)


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


@pytest.mark.parametrize("name", SCENARIO_NAMES)
def test_info_prints_each_field_as_set_takes_it(name):
    walls = ((4.0, 1.0, 4.4, 1.4), (6.0, 1.0, 6.4, 1.4))
    config = scenario(name, **({"obstacles": walls} if name == "classroom" else {}))
    told = dict(line.strip().split(maxsplit=1) for line in _scenario_lines(config, "") if len(line.split()) > 1)
    fields = [field for field in field_sections() if field in told]
    assert len(fields) > 50
    words = tuple(f"{field}={told[field]}" for field in fields)
    assert described_world(WorldOptions(scenario=name, settings=words))[0].scenario == config


CONFIG = """
scenario = "warehouse_small"

[set]
n_robots = 3
n_objects = 20
horizon_s = 4.0
interval_s = 2
physics_substeps = [0.2, 0.2, 0.2, 0.2, 0.2]

[wrappers.throttle]
waveform = "constant"
amplitude = 0.2

[wrappers.actuator_noise]
sigma = 0.1
"""


def test_a_file_gives_scenario_fields_and_wrappers_and_options_go_before_it(command):
    Path("world.toml").write_text(CONFIG)
    words = ("--set", "n_objects=9", "--wrapper", "actuator_noise:sigma=0.3", "--jobs", "1")
    assert command("run", "random", "--scenario", "world.toml", *words)[0] == 0
    (folder,) = Path("results").glob("world_*")
    (record,) = load(folder)
    spec = json.loads(json.dumps(record.spec.to_mapping()))
    world, wrappers = spec["scenario"], spec["wrappers"]
    assert (world["robots"]["n_robots"], world["objects"]["n_objects"], world["horizon_s"]) == (3, 9, 4.0)
    assert world["physics_substeps"] == [0.2] * 5
    assert [(wrapper["wrapper"], wrapper.get("sigma")) for wrapper in wrappers] == [
        ("throttle", None),
        ("actuator_noise", 0.3),
    ]
