"""Films: number of frames, timing, and refusals before anything is run or written."""

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.inspect import film as film_module
from swarm_forage_env.inspect.film import record_run
from swarm_forage_env.policies.registry import RandomPolicy
from swarm_forage_env.rendering.video import write_film
from swarm_forage_env.rendering.view import Palette
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.recorder import TOTALS
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import World
from tests.support.drivers import states_of
from tests.support.foraging import CROWDED

Image = pytest.importorskip("PIL.Image")
ImageSequence = pytest.importorskip("PIL.ImageSequence")


def pictures():
    """A blue square that crosses the floor."""
    for frame in range(12):
        picture = np.full((60, 81, 3), Palette.floor, np.uint8)
        picture[20:30, 2 * frame : 2 * frame + 10] = Palette.empty
        yield picture


def frames_of(path) -> list[np.ndarray]:
    with Image.open(path) as film:
        return [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(film)]


def test_a_gif_shows_every_picture_in_true_colours_for_ever(tmp_path):
    write_film(pictures(), tmp_path / "film.gif", fps=20)
    with Image.open(tmp_path / "film.gif") as film:
        assert (film.info["duration"], film.info["loop"]) == (50, 0)
    for shown, drawn in zip(frames_of(tmp_path / "film.gif"), pictures(), strict=True):
        assert np.abs(shown.astype(int) - drawn).max() <= 4


@pytest.mark.slow
def test_an_mp4_has_every_picture_even_of_odd_size(tmp_path):
    imageio_ffmpeg, imageio = pytest.importorskip("imageio_ffmpeg"), pytest.importorskip("imageio.v2")
    write_film(pictures(), tmp_path / "film.MP4", fps=10)
    n_frames, duration_s = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "film.MP4"))
    assert (n_frames, duration_s) == (12, pytest.approx(1.2, abs=0.05))
    with imageio.get_reader(tmp_path / "film.MP4") as film:
        shown = film.get_data(5)
    assert shown.shape == (60, 82, 3)
    assert shown[25, 15] == pytest.approx(Palette.empty, abs=30)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"path": "run.avi"}, r"to end in .gif or .mp4, got"),
        ({"at_s": 1.0}, r"to end in .png, got"),
        ({"fps": 51.0}, r"fps of a \.gif to be a number from 1 to 50"),
        ({"seconds": 2000.0}, "at most 1500 frames for a GIF, got 2001"),
        ({"seconds": 0.5}, "seconds .*two pictures.* >= 1"),
        ({"parameters": {"wander_speed_mps": 0.05}}, "parameters with a name, a file or a class only"),
    ],
)
def test_impossible_recordings_are_refused_before_the_run(tmp_path, monkeypatch, options, expected):
    monkeypatch.setattr(RandomPolicy, "reset", lambda *_: pytest.fail("a run was started"))
    policy, world = RandomPolicy(), scenario("warehouse_small", n_robots=4, n_objects=10)
    path = tmp_path / options.pop("path", "run.gif")
    with pytest.raises(ConfigError, match=expected):
        record_run(world, policy, path, **options)
    assert not list(tmp_path.iterdir())


@pytest.fixture
def filmed(monkeypatch):
    """What the pictures of films show, one (tick, positions, headings, counters) per picture."""
    shown = []

    def look(scenario, swarm, objects, caches, events, *, tick, **_):
        shown.append((tick, swarm.position.copy(), swarm.heading.copy(), events.counters.copy()))
        return np.zeros((20, 20, 3), np.uint8)

    monkeypatch.setattr(film_module, "render_frame", look)
    return shown


DISTURBED = (
    parse_wrapper("population:malfunction_per_tick=0.01,repair_per_tick=0.02"),
    parse_wrapper("throttle:waveform=constant,amplitude=0.3"),
    parse_wrapper("sensor_noise:sigma=0.02"),
)


def test_a_film_shows_the_run_that_its_name_promises(filmed, tmp_path, monkeypatch):
    states, record = states_of(plan_run(CROWDED, "stochm", wrappers=DISTURBED, seed=5), monkeypatch)
    options = {"seconds": 80.0, "speedup": 40.0, "fps": 20.0, "seed": 5}
    record_run(World(CROWDED, DISTURBED), "stochm", tmp_path / "run.gif", **options)
    assert [tick for tick, *_ in filmed] == list(range(0, 401, 10))
    for tick, *state in filmed[1:]:
        swarm, _, counters = states[tick]
        for mine, theirs in zip(state, (swarm.position, swarm.heading, counters), strict=True):
            np.testing.assert_array_equal(mine, theirs)
    counters = filmed[-1][3] - filmed[0][3]  # a static cache is counted when the world is made
    assert counters[Counter.FREE_PICKUPS] > 0
    for name, counter in TOTALS.items():
        assert counters[counter] == record[name].sum(), name
