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
    spec = json.loads(record.spec.to_json())
    world, wrappers = spec["scenario"], spec["wrappers"]
    assert (world["robots"]["n_robots"], world["objects"]["n_objects"], world["horizon_s"]) == (3, 9, 4.0)
    assert world["physics_substeps"] == [0.2] * 5
    assert [(wrapper["wrapper"], wrapper.get("sigma")) for wrapper in wrappers] == [
        ("throttle", None),
        ("actuator_noise", 0.3),
    ]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("n_robots =", "Cannot use world.toml: Invalid value"),
        ("n_robots = 3", "Expected n_robots under [set], where scenario fields go, got it above."),
        ('preset = "classroom"', 'starts from as scenario = "classroom", got preset.'),
        ("scenario = 3", "Cannot use world.toml: Expected scenario to be a non-empty text"),
        ('scenario = "warehouse_smal"', "Unknown scenario 'warehouse_smal'. Did you mean 'warehouse_small'?"),
        ("[set]\nn_robot = 3", "Unknown scenario field 'n_robot'. Did you mean 'n_robots'?"),
        ("[wrapper.throttle]\namplitude = 1", "Unknown key of a world 'wrapper'. Did you mean 'wrappers'?"),
        (
            "[wrappers.throtle]\namplitude = 1",
            "Cannot use world.toml: Unknown wrapper 'throtle'. Did you mean 'throttle'?",
        ),
        (
            "[wrappers.actuator_noise]\nsigma = -1",
            "Cannot use world.toml: Expected actuator_noise.sigma to be a finite number >= 0, got",
        ),
    ],
)
def test_a_mistake_in_the_file_is_one_line_and_exit_code_2(command, text, complaint):
    code, out, err = command(text, "--scenario", "world.toml")
    assert (code, out) == (2, "")
    assert complaint in err
    assert len(err.splitlines()) == 1
