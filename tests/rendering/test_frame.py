"""Pictures of hand-built states: what is where, in which colour, and that drawing changes no state."""

import base64
import copy
import json
import re
from importlib import resources
from itertools import product

import numpy as np
import pytest

from swarm_forage_env.contract.codes import ObjectStatus
from swarm_forage_env.rendering.frame import Trails, render_frame
from swarm_forage_env.rendering.pages import (
    PLAY_SCRIPTS,
    REPLAY_SCRIPTS,
    SHARED_SCRIPTS,
    build_play_page,
    build_replay_page,
)
from swarm_forage_env.rendering.view import (
    CACHE_OPACITY,
    NEST_OPACITY,
    SOURCE_OPACITY,
    Palette,
    arena_view,
    legend_rows,
    text_width,
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

    def draw(self, **options) -> np.ndarray:
        return render_frame(self.config, self.swarm, self.objects, self.caches, self.events, tick=100, **options)

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
        for array in state._asdict().values():
            array.flags.writeable = False
    world.draw(trails=trails)
    for state, old in zip(world.states(), before, strict=True):
        for name, array in state._asdict().items():
            assert array.tobytes() == old._asdict()[name].tobytes(), name


def test_grounds_have_their_colours(world):
    picture = world.draw()
    assert world.pixel(picture, 16.0, 8.0) == Palette.floor
    assert world.pixel(picture, 2.0, 2.2) == pytest.approx(mix(Palette.floor, Palette.nest, NEST_OPACITY), abs=1)
    assert world.pixel(picture, 25.0, 8.0) == pytest.approx(mix(Palette.floor, Palette.source, SOURCE_OPACITY), abs=1)
    assert tuple(picture[0, 0]) == Palette.page
    for x, y in ((0.0, 8.0), (31.8, 8.0), (16.0, 0.0), (16.0, 16.0)):
        assert world.pixel(picture, x, y) == Palette.wall


def test_only_free_objects_lie_on_the_floor(world):
    cell = (127, 44)
    x, y = (cell[0] + 0.5) * CELL_M, (cell[1] + 0.5) * CELL_M
    bare = world.draw()
    world.lay(3, cell)
    assert world.pixel(world.draw(), x, y) == Palette.object
    for status in (ObjectStatus.CARRIED, ObjectStatus.CACHED, ObjectStatus.WAITING):
        world.objects.status[3] = status
        np.testing.assert_array_equal(world.draw(), bare)


def test_a_cache_is_a_square_with_the_number_of_its_objects(world):
    bare = world.draw()
    world.caches.alive[1], world.caches.count[1], world.caches.cell[1] = True, 7, (80, 40)
    picture = world.draw()
    half = world.config.cache_side_cells * CELL_M / 2
    x, y = 80.5 * CELL_M, 40.5 * CELL_M
    tint = mix(Palette.floor, Palette.cache, CACHE_OPACITY)
    for dx, dy in product((-0.9, 0.9), (-0.9, 0.9)):
        assert world.pixel(picture, x + dx * half, y + dy * half) == pytest.approx(tint, abs=1)
    assert world.pixel(picture, x + 1.1 * half, y) == Palette.floor
    changed = np.argwhere((picture != bare).any(axis=2))
    left, top, right, bottom = world.view.box((x - half, y - half, x + half, y + half))
    assert changed.min(axis=0) == pytest.approx((top, left), abs=1.5)
    assert changed.max(axis=0) == pytest.approx((bottom, right), abs=1.5)
    world.caches.count[1] = 8
    differs = np.argwhere((world.draw() != picture).any(axis=2)).mean(axis=0)
    assert differs == pytest.approx(world.view.pixels((x, y))[::-1], abs=12), "the number stands in the middle"


def near(seen, colour, most=25.0) -> bool:
    """Whether a pixel has a colour, edges and all."""
    return bool(np.linalg.norm(np.subtract(seen, colour)) < most)


def test_the_needle_points_where_the_robot_is_heading(world):
    world.swarm.heading[0] = heading = 0.4 * np.pi
    picture, reach = world.draw(), 1.7 * world.view.robot_px
    x, y = world.swarm.position[0]
    right, down = reach * np.cos(heading), -reach * np.sin(heading)
    assert near(world.pixel(picture, x, y, right, down), Palette.empty, 90)
    assert world.pixel(picture, x, y, -right, -down) == Palette.floor


@pytest.mark.parametrize(
    ("state", "middle", "place", "seen"),
    [
        ({}, "empty", (0.5, 0.5), "empty"),
        ({"carried_object": 5}, "object", (0.0, 0.75), "carrying"),
        ({"active": False}, "floor", (0.8, 0.0), "repair"),
        ({"active": False, "present": False}, "floor", (0.8, 0.0), "floor"),
        ({"active": False, "present": False, "dead": True}, "repair", (0.5, 0.5), "repair"),
        ({"active": False, "present": False, "dead": True}, "repair", (0.8, 0.0), "floor"),
        ({"interfering": True}, "empty", (0.0, 1.65), "interference"),
        ({"interfering": True, "active": False}, "floor", (0.0, 1.65), "floor"),
    ],
)
def test_colours_and_shapes_tell_what_robots_do(world, state, middle, place, seen):
    for name, value in state.items():
        getattr(world.events if name == "interfering" else world.swarm, name)[0] = value
    picture, radius = world.draw(), world.view.robot_px
    x, y = world.swarm.position[0]
    assert near(world.pixel(picture, x, y), getattr(Palette, middle))
    assert near(world.pixel(picture, x, y, radius * place[0], radius * place[1]), getattr(Palette, seen), 60)


def test_obstacles_are_walls_and_the_legend_names_what_the_world_has():
    config = scenario("warehouse_small", n_robots=2, n_objects=2, obstacles=((10.0, 5.0, 11.0, 7.0),))
    walled = World(config)
    picture = walled.draw()
    assert walled.pixel(picture, 10.1, 6.9) == walled.pixel(picture, 10.9, 5.1) == Palette.wall
    assert walled.pixel(picture, 11.2, 6.0) == Palette.floor
    there, elsewhere = (
        {name for row in legend_rows(one, 900, 20.0) for name, _, _ in row}
        for one in (config, scenario("search_and_rescue"))
    )
    assert {"obstacle", "source", "nest"} <= there
    for width in range(240, 400, 10):
        narrow = legend_rows(config, width, 7.0)
        assert len(narrow) > 1
        assert max(x + text_width(name, 9.0) + 1.45 * 9.0 for row in narrow for name, x, _ in row) < width
    assert not {"obstacle", "source", "cache"} & elsewhere


FOLDER = resources.files("swarm_forage_env.rendering")
PAGES = {
    "replay_page": (build_replay_page("", {}, []), SHARED_SCRIPTS + REPLAY_SCRIPTS),
    "play_page": (build_play_page(), PLAY_SCRIPTS),
}


def test_data_come_back_whatever_they_hold():
    header = {"name": "</script><b>", "list": [1, None, 2.5]}
    page = build_replay_page("a <title> & more", header, [b"", bytes(range(256))])
    told, *blocks = re.findall(r'<script type="(?:application/json|text/plain)"[^>]*>(.*?)</script>', page)
    assert (json.loads(told), *map(base64.b64decode, blocks)) == (header, b"", bytes(range(256)))
    assert "<title>a &lt;title&gt; &amp; more</title>" in page


@pytest.mark.parametrize("folder", PAGES)
def test_every_script_is_in_its_page_which_loads_nothing(folder):
    page, scripts = PAGES[folder]
    files = {file.name: file.read_text() for file in FOLDER.joinpath(folder).iterdir() if file.name.endswith(".js")}
    assert files.keys() == set(scripts)
    assert all(script in page for script in files.values())
    assert re.findall(r"https?:|//[\w.]+\.\w+/|\b(?:src|href)=\"(?!data:,\")|@import|url\(", page) == []
    asked = ["place"] if folder == "play_page" else []  # relative to the address with the token
    assert re.findall(r"\bfetch\((\w+)", page) == asked
