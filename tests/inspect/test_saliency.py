"""What a network looks at: networks made by hand that look at one slice."""

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.layout import layout_of
from swarm_forage_env.inspect.saliency import GROUPS, open_network_of, saliency, saliency_of_rows
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.network import Network, NetworkAbout
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.world import World

LAYOUT = layout_of(
    [("light", (1.0, 1.0), "", "left and right"), ("carrying", (1.0,), "", "load"), ("noise", (1.0,), "", "nothing")]
)
CONTINUOUS = InterfaceConfig(automatic_gripper=True)
DISCRETE = InterfaceConfig(actions="discrete", automatic_gripper=True)


def network(weights, interface=DISCRETE) -> Network:
    weights = np.array(weights, np.float32)
    return Network((weights,), (np.zeros(weights.shape[1], np.float32),), NetworkAbout(interface=interface))


def rows(n_rows: int) -> np.ndarray:
    """Half of them carry; light is left or right, noise is anything."""
    rng = np.random.default_rng(0)
    left = rng.random(n_rows) < 0.5
    return np.column_stack((left, ~left, np.arange(n_rows) % 2, rng.random(n_rows))).astype(np.float32)


def test_only_what_the_network_uses_counts():
    to_the_light = network([[9.0, 0.0], [0.0, 9.0], [0.0, 0.0], [0.0, 0.0]])
    found = saliency_of_rows(to_the_light, LAYOUT, rows(4000), np.random.default_rng(1))
    assert found.slices == ("light", "carrying", "noise")
    assert found.n_columns == (2, 1, 1)
    assert found.ranked[0] == 0
    for group in GROUPS:
        # The light of another observation is on the other side in half of the cases.
        assert found.changed[group] == pytest.approx([0.5, 0.0, 0.0], abs=0.03)
        assert found.moved[group] == pytest.approx([0.5 * np.tanh(4.5), 0.0, 0.0], abs=0.03)
    assert found.n_rows == {"all": 4000, "empty": 2000, "carrying": 2000}


def test_groups_of_robots_are_told_apart():
    # The first output wins where a robot is empty, whatever the light; else light decides.
    weights = [[1.0, 0.0], [0.0, 1.0], [-9.0, -9.0], [0.0, 0.0]]
    only_loaded = network(weights)
    shifted = Network(only_loaded.weights, (np.array([9.0, 0.0], np.float32),), only_loaded.about)
    found = saliency_of_rows(shifted, LAYOUT, rows(1000), np.random.default_rng(1))
    assert found.changed["empty"][0] == 0.0
    loaded_only = saliency_of_rows(shifted, LAYOUT, rows(1000)[1::2], np.random.default_rng(1))
    assert np.isnan(loaded_only.changed["empty"]).all()


def test_continuous_commands_move():
    steering = network([[1.0, 0.0], [-1.0, 0.0], [0.0, 0.0], [0.0, 0.0]], CONTINUOUS)
    found = saliency_of_rows(steering, LAYOUT, rows(4000), np.random.default_rng(1))
    assert found.moved is None
    # The left wheel turns from 1 to -1 in half of the cases, the right one never.
    assert found.changed["all"] == pytest.approx([0.5, 0.0, 0.0], abs=0.03)


@pytest.mark.compiled
def test_observations_are_those_of_a_run():
    world = scenario("warehouse_small", n_robots=3, n_objects=20, horizon_s=20.0, interval_s=10.0)
    spec = RunSpec(world=World(world), policy="ppo_warehouse_small", seed=1)
    told = []
    found = saliency(open_network_of("ppo_warehouse_small"), spec, progress=lambda *news: told.append(news))
    assert found.n_rows["all"] == 3 * 20, "three robots decide once a second"
    assert found.changed["all"][found.slices.index("heading")] > 0
    assert found.changed["all"][found.slices.index("active")] == 0, "it is always 1"
    assert told[-1] == (100, 100)
    with pytest.raises(ConfigError, match="seconds"):
        saliency(open_network_of("ppo_warehouse_small"), spec, seconds=21.0)


@pytest.mark.compiled
@pytest.mark.parametrize("frame_decisions", [0, 3])
def test_robots_with_frames_of_their_own_are_asked_in_them(frame_decisions):
    """Robots drive straight on, so in the world as it is their headings stay; in frames they turn and are mirrored."""
    world = scenario("warehouse_medium", n_robots=3, n_objects=20, horizon_s=4.0, interval_s=4.0)
    interface = InterfaceConfig(observation="compact", automatic_gripper=True, frame_decisions=frame_decisions)
    weights = np.zeros((23, 2), np.float32)
    straight = Network((weights,), (np.ones(2, np.float32),), NetworkAbout(interface=interface))
    asked = []

    class Asked(Network):
        def outputs(self, rows):
            asked.append(rows.copy())
            return super().outputs(rows)

    found = saliency(
        Asked(straight.weights, straight.biases, straight.about), RunSpec(world=World(world), policy="straight", seed=1)
    )
    column = found.n_columns[: found.slices.index("heading")]
    headings = asked[0].reshape(20, 3, 23)[:, :, sum(column) : sum(column) + 2]
    ways = [len(np.unique(headings[:, robot].round(3), axis=0)) for robot in range(3)]
    assert min(ways) > 2 if frame_decisions else max(ways) == 1
    assert found.in_frames == bool(frame_decisions)
    assert ("each robot sees in its own frame" in found.text()) == bool(frame_decisions)


def test_policies_without_a_network_are_refused():
    for name in ("crw", "model.zip"):
        with pytest.raises(ConfigError, match=r"Expected a network.*policy\.npz"):
            open_network_of(name)
