"""Maps of the floor, from replays made by hand."""

import dataclasses

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import ObjectStatus
from swarm_forage_env.inspect.descriptions import describe
from swarm_forage_env.inspect.maps import MEANINGS, FloorMaps, draw_maps, floor_maps
from swarm_forage_env.inspect.replay.frames import Replay, Status
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.world import World
from tests.support.networks import network_of
from tests.support.pictures import keep_figures

WORLD = scenario("warehouse_small", n_robots=2, n_objects=1, horizon_s=200.0)


@pytest.fixture
def replay() -> Replay:
    """Robot 0 stands at (10.1, 5.1) m and carries in frame 1, robot 1 drives from (20.1, 2.1) m to the right."""
    metres = np.array([[[10.1, 5.1], [20.1 + frame, 2.1]] for frame in range(4)])
    status = np.zeros((4, 2), np.uint8)
    status[1, 0] = Status.CARRYING
    status[2:, 0] = Status.INTERFERING
    status[3, 1] = Status.ABSENT
    events = [
        (0, 0, ObjectStatus.FREE, 51, 26),
        (1, 0, ObjectStatus.CARRIED, 0, -1),
        (2, 0, ObjectStatus.FREE, 120, 30),
    ]
    return Replay(
        spec=RunSpec(world=World(WORLD), policy="by hand"),
        label="by hand",
        frame_ticks=250,
        end_tick=750,
        position=np.rint(metres / 0.005).astype(np.uint16),
        heading=np.zeros((4, 2), np.uint8),
        status=status,
        activity=None,
        activities=(),
        counters=np.zeros((4, 16), np.int32),
        object_events=np.array(events, np.int32),
        deliveries=np.zeros((0, 4), np.int32),
        cache_events=np.zeros((0, 5), np.int32),
        signals={},
        versions={},
    )


def test_robots_count_where_they_were_at_work(replay):
    maps = floor_maps(replay, side_m=0.4)
    density = maps.arrays["density"]
    assert density.shape == (40, 80)
    assert density[12, 25] * 0.16 == pytest.approx(1.0), "robot 0, in all frames"
    assert [density[5, column] * 0.16 for column in (50, 52, 55)] == pytest.approx([0.25] * 3)
    assert density.sum() * 0.16 == pytest.approx(7 / 4), "two robots, one of them gone in the last frame"
    assert maps.arrays["interference"][12, 25] * 0.16 == pytest.approx(0.5)


def test_objects_count_where_they_lay_and_where_they_were_dropped(replay):
    arrays = floor_maps(replay, side_m=0.4).arrays
    per_event = 1000.0 / 150.0 / 0.16
    assert arrays["pickups"][13, 25] == pytest.approx(per_event), "the middle of cell (51, 26)"
    assert arrays["drops"][12, 25] == pytest.approx(per_event), "where the robot was"
    assert [arrays[name].sum() for name in ("pickups", "drops")] == pytest.approx([per_event] * 2)
    assert arrays.keys() == MEANINGS.keys()


def test_a_difference_is_what_is_more_here(replay):
    other = floor_maps(dataclasses.replace(replay, status=np.full((4, 2), Status.REPAIR, np.uint8), label="other"))
    mine = floor_maps(replay)
    more = mine.minus(other)
    assert (more.label, more.is_difference) == ("by hand minus other", True)
    assert np.array_equal(more.arrays["density"], mine.arrays["density"])
    assert not more.arrays["drops"].any()


def test_squares_smaller_than_cells_are_refused(replay):
    with pytest.raises(ConfigError, match="side_m"):
        floor_maps(replay, side_m=0.1)


def test_maps_of_one_quantity_have_one_scale_and_differences_a_symmetric_one(monkeypatch, tmp_path):
    pytest.importorskip("matplotlib")
    few, many = (
        FloorMaps(label=name, side_m=1.0, size_m=(2.0, 1.0), arrays={"density": np.array([[0.0, value]])})
        for name, value in (("few", 1.0), ("many", 10.0))
    )
    drawn = keep_figures(monkeypatch)
    draw_maps(tmp_path / "unused.png", (few, many, many.minus(few), few.minus(many)))
    scales = [axes.get_images()[0].get_clim() for axes in drawn[0].axes if axes.get_images()]
    assert scales[0] == scales[1] == pytest.approx((0.0, 10.0), rel=0.02)
    assert scales[2] == scales[3] == pytest.approx((-9.0, 9.0), rel=0.02)


def test_the_layers_and_every_field_of_the_interface_of_a_network_are_told(tmp_path):
    interface = InterfaceConfig(observation="compact", actions="discrete", decision_ticks=5, frame_decisions=200)
    network_of(interface, 4, activation="relu", caches="static").save(tmp_path / "mine.npz")
    first, *lines = describe(str(tmp_path / "mine.npz")).notes
    assert first.endswith("mine.npz: a network of 23 x 4 x 11 units (relu)")
    fields = {line.split()[0]: line.split()[-1] for line in lines if line.startswith("    ")}
    assert {*(item.name for item in dataclasses.fields(InterfaceConfig)), "samples", "caches"} == set(fields)
    assert (fields["decision_ticks"], fields["frame_decisions"], fields["caches"]) == ("5", "200", "static")
