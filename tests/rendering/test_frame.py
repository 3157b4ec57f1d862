"""Pictures of hand-built states: what is where, in which colour, and that drawing changes no state."""

import copy
import sys
from itertools import product

import numpy as np
import pytest

from swarm_forage_env.contract.codes import ObjectStatus
from swarm_forage_env.rendering import view
from swarm_forage_env.rendering.frame import Trails, render_frame
from swarm_forage_env.rendering.view import (
    CACHE_OPACITY,
    NEST_OPACITY,
    PALETTE,
    SOURCE_OPACITY,
    THEMES,
    RenderError,
    arena_view,
    legend_rows,
)
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.allocation import new_objects
from swarm_forage_env.world.state import CacheState, StepEvents, SwarmState

pytest.importorskip("PIL")


class World:
    """A small warehouse with four robots in the middle of the floor and nothing lying about."""

    def __init__(self, config: ScenarioConfig | None = None) -> None:
        self.config = config or scenario("warehouse_small", n_robots=4, n_objects=10, caches="static")
        n_robots = self.config.robots.n_robots
        self.swarm = SwarmState.empty(n_robots)
        self.swarm.position[:] = [(10.0 + 2.0 * (row % 4), 4.0) for row in range(n_robots)]
        self.objects = new_objects(self.config)
        self.caches = CacheState.empty(2)
        self.events = StepEvents.empty(n_robots)
        self.view = arena_view(self.config, 900)

    def draw(self, tick: int = 100, **options) -> np.ndarray:
        return render_frame(self.config, self.swarm, self.objects, self.caches, self.events, tick=tick, **options)

    def lay(self, row: int, cell: tuple[int, int]) -> None:
        self.objects.status[row] = ObjectStatus.FREE
        self.objects.cell[row] = cell

    def pixel(self, picture: np.ndarray, x: float, y: float, right_px: float = 0.0, down_px: float = 0.0):
        """Colour at arena position (x, y) m, moved by some pixels."""
        column, row = self.view.pixels((x, y))
        return tuple(int(value) for value in picture[int(row + down_px), int(column + right_px)])

    def states(self):
        return (self.swarm, self.objects, self.caches, self.events)


@pytest.fixture
def world() -> World:
    return World()


def mix(ground, tint, share):
    return tuple(a + (b - a) * share for a, b in zip(ground, tint, strict=True))


def arrays_of(state) -> dict[str, np.ndarray]:
    return state._asdict()


def test_a_picture_is_uint8_and_keeps_the_shape_of_the_arena(world):
    picture = world.draw()
    assert picture.dtype == np.uint8
    assert picture.shape == (world.view.height, world.view.width, 3)
    left, top, right, bottom = world.view.box((0.0, 0.0, 32.0, 16.0))
    assert (right - left) / (bottom - top) == pytest.approx(2.0)
    assert world.view.width == 900


def test_drawing_writes_nothing(world):
    world.lay(0, (120, 40))
    world.caches.alive[0], world.caches.count[0], world.caches.cell[0] = True, 3, (80, 40)
    world.swarm.carried_object[1] = 1
    world.events.interfering[2] = True
    trails = Trails(4, 3)
    trails.add(world.swarm)
    trails.add(world.swarm)
    before = copy.deepcopy(world.states())
    for state in world.states():
        for array in arrays_of(state).values():
            array.flags.writeable = False
    world.draw(trails=trails)
    for state, old in zip(world.states(), before, strict=True):
        for name, array in arrays_of(state).items():
            assert array.tobytes() == arrays_of(old)[name].tobytes(), name


def test_grounds_have_their_colours(world):
    picture = world.draw()
    assert world.pixel(picture, 16.0, 8.0) == PALETTE.floor
    assert world.pixel(picture, 2.0, 2.2) == pytest.approx(mix(PALETTE.floor, PALETTE.nest, NEST_OPACITY), abs=1)
    assert world.pixel(picture, 25.0, 8.0) == pytest.approx(mix(PALETTE.floor, PALETTE.source, SOURCE_OPACITY), abs=1)
    assert tuple(picture[0, 0]) == PALETTE.page
    for x, y in ((0.0, 8.0), (31.8, 8.0), (16.0, 0.0), (16.0, 16.0)):
        assert world.pixel(picture, x, y) == PALETTE.wall


def test_lights_shine_over_the_nest(world):
    picture = world.draw()
    for x, y, _ in world.config.arena.lights_m:
        assert world.pixel(picture, x, y) == pytest.approx(PALETTE.light, abs=2)
    assert len(world.config.arena.lights_m) == 3


def test_only_free_objects_lie_on_the_floor(world):
    cell = (127, 44)
    x, y = (cell[0] + 0.5) * CELL_M, (cell[1] + 0.5) * CELL_M
    bare = world.draw()
    world.lay(3, cell)
    assert world.pixel(world.draw(), x, y) == PALETTE.object
    for status in (ObjectStatus.CARRIED, ObjectStatus.CACHED, ObjectStatus.WAITING):
        world.objects.status[3] = status
        np.testing.assert_array_equal(world.draw(), bare)


def test_a_cache_is_a_square_with_the_number_of_its_objects(world):
    bare = world.draw()
    world.caches.alive[1], world.caches.count[1], world.caches.cell[1] = True, 7, (80, 40)
    picture = world.draw()
    half = world.config.cache_side_cells * CELL_M / 2
    x, y = 80.5 * CELL_M, 40.5 * CELL_M
    tint = mix(PALETTE.floor, PALETTE.cache, CACHE_OPACITY)
    for dx, dy in product((-0.9, 0.9), (-0.9, 0.9)):
        assert world.pixel(picture, x + dx * half, y + dy * half) == pytest.approx(tint, abs=1)
    assert world.pixel(picture, x + 1.1 * half, y) == PALETTE.floor
    changed = np.argwhere((picture != bare).any(axis=2))
    left, top, right, bottom = world.view.box((x - half, y - half, x + half, y + half))
    assert changed.min(axis=0) == pytest.approx((top, left), abs=1.5)
    assert changed.max(axis=0) == pytest.approx((bottom, right), abs=1.5)
    world.caches.count[1] = 8
    differs = np.argwhere((world.draw() != picture).any(axis=2)).mean(axis=0)
    assert differs == pytest.approx(world.view.pixels((x, y))[::-1], abs=12), "the number stands in the middle"


@pytest.mark.parametrize(
    ("heading", "right", "up"), [(0.0, 1, 0), (np.pi / 2, 0, 1), (np.pi, -1, 0), (-np.pi / 2, 0, -1)]
)
def test_the_needle_points_where_the_robot_is_heading(world, heading, right, up):
    world.swarm.heading[0] = heading
    picture, reach = world.draw(), 1.7 * world.view.robot_px
    x, y = world.swarm.position[0]
    ahead = world.pixel(picture, x, y, right * reach, -up * reach)
    behind = world.pixel(picture, x, y, -right * reach, up * reach)
    assert np.linalg.norm(np.subtract(ahead, PALETTE.empty)) < np.linalg.norm(np.subtract(ahead, PALETTE.floor))
    assert behind == PALETTE.floor


def test_colours_tell_what_robots_do(world):
    swarm, (x, y) = world.swarm, world.swarm.position[0]
    assert world.pixel(world.draw(), x, y) == PALETTE.empty
    swarm.carried_object[0] = 5
    picture = world.draw()
    assert world.pixel(picture, x, y) == PALETTE.object
    assert world.pixel(picture, x, y, down_px=0.75 * world.view.robot_px) == pytest.approx(PALETTE.carrying, abs=12)
    swarm.carried_object[0] = -1
    swarm.active[0] = False
    picture = world.draw()
    assert np.linalg.norm(np.subtract(world.pixel(picture, x, y), PALETTE.floor)) < 20, "hollow"
    assert world.pixel(picture, x, y, right_px=0.8 * world.view.robot_px) == pytest.approx(PALETTE.repair, abs=12)


def test_a_cross_marks_where_a_robot_died_and_nothing_where_none_was_born(world):
    swarm, (x, y) = world.swarm, world.swarm.position[0]
    swarm.present[0] = swarm.active[0] = False
    assert world.pixel(world.draw(), x, y) == PALETTE.floor
    swarm.dead[0] = True
    picture, arm_px = world.draw(), 0.6 * world.view.robot_px
    assert world.pixel(picture, x, y, right_px=arm_px, down_px=arm_px) == pytest.approx(PALETTE.repair, abs=12)
    assert np.linalg.norm(np.subtract(world.pixel(picture, x, y, right_px=arm_px), PALETTE.floor)) < 20


def test_interference_is_a_ring_around_robots_at_work(world):
    x, y = world.swarm.position[0]
    ring_px = 1.55 * world.view.robot_px + 0.5
    world.events.interfering[0] = True
    ring = world.pixel(world.draw(), x, y, down_px=ring_px)
    assert ring == pytest.approx(PALETTE.interference, abs=40)
    assert world.pixel(world.draw(), x, y) == PALETTE.empty
    world.swarm.active[0] = False
    assert world.pixel(world.draw(), x, y, down_px=ring_px) == PALETTE.floor


def test_robots_without_a_body_are_not_drawn(world):
    world.swarm.present[0] = world.swarm.active[0] = False
    assert world.pixel(world.draw(), *world.swarm.position[0]) == PALETTE.floor
    assert world.pixel(world.draw(), *world.swarm.position[1]) == PALETTE.empty


@pytest.mark.parametrize("size_px", [0, -5, 239, 4001, 900.5, True, "900", None])
def test_impossible_sizes_are_refused(world, size_px):
    with pytest.raises(RenderError, match="size_px"):
        world.draw(size_px=size_px)


def test_the_legend_names_only_what_the_world_has():
    rows = legend_rows(scenario("search_and_rescue"), 900, 20.0)
    names = {name for row in rows for name, _, _ in row}
    assert "cache" not in names
    assert "source" not in names


def test_obstacles_have_the_colour_of_walls_and_a_place_in_the_legend():
    config = scenario("warehouse_small", n_robots=2, n_objects=2, obstacles=((10.0, 5.0, 11.0, 7.0),))
    walled = World(config)
    picture = walled.draw()
    assert walled.pixel(picture, 10.1, 6.9) == walled.pixel(picture, 10.9, 5.1) == PALETTE.wall
    assert walled.pixel(picture, 11.2, 6.0) == PALETTE.floor
    assert "obstacle" in {name for row in legend_rows(config, 900, 20.0) for name, _, _ in row}
    assert "obstacle" not in {name for row in legend_rows(scenario("warehouse_small"), 900, 20.0) for name, _, _ in row}


def test_trails_fade_towards_the_past(world):
    trails = Trails(4, 30)
    for step in range(30):
        world.swarm.position[0] = (10.0 + 0.1 * step, 10.0)
        trails.add(world.swarm)
    picture = world.draw(trails=trails)
    blue = [world.pixel(picture, x, 10.0)[2] for x in (10.5, 11.2, 12.0, 12.6)]
    assert blue == sorted(blue)
    assert blue[0] < blue[-1]
    assert world.pixel(world.draw(), 12.0, 10.0) == PALETTE.floor


def test_trails_of_another_world_are_refused(world):
    with pytest.raises(RenderError, match="4 robots, got 5"):
        world.draw(trails=Trails(5, 3))
    with pytest.raises(RenderError, match="n_samples"):
        Trails(4, 1)


def test_without_pillow_the_message_tells_what_to_install(world, monkeypatch):
    monkeypatch.setitem(sys.modules, "PIL", None)
    view.text_font.cache_clear()
    arena_view.cache_clear()
    with pytest.raises(ImportError, match=r'pip install ".\[render\]"'):
        world.draw()


# Colour vision


def test_a_light_picture_shows_the_same_in_other_colours(world):
    light = THEMES["light"]
    picture = world.draw(theme="light")
    assert picture.shape == world.draw().shape
    assert tuple(picture[0, 0]) == light.page
    assert world.pixel(picture, 16.0, 8.0) == light.floor
    assert world.pixel(picture, *world.swarm.position[0]) == light.empty
    with pytest.raises(RenderError, match="Expected theme to be one of dark, light, got 'lite'"):
        world.draw(theme="lite")
