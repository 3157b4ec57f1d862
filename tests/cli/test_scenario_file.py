"""`swarm-forage run --scenario FILE.toml`: scenario fields and wrappers from a file."""

import json
from pathlib import Path

import pytest

from swarm_forage_env.runs.store import load

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


@pytest.fixture
def command(command):
    """Run with world.toml in an empty folder; returns exit code, stdout, stderr."""

    def call(text, *words):
        Path("world.toml").write_text(text)
        return command("run", "random", "--jobs", "1", *words)

    return call


def test_a_file_gives_scenario_fields_and_wrappers_and_options_go_before_it(command):
    words = ("--set", "n_objects=9", "--wrapper", "actuator_noise:sigma=0.3")
    assert command(CONFIG, "--scenario", "world.toml", *words)[0] == 0
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
