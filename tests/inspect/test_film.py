"""Films: number of frames, timing, and refusals before anything is run or written."""

import subprocess
import sys

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.inspect import film as film_module
from swarm_forage_env.inspect.film import record_run
from swarm_forage_env.policies.registry import RandomPolicy, load_policy
from swarm_forage_env.rendering.video import check_film, write_film
from swarm_forage_env.rendering.view import PALETTE, RenderError
from swarm_forage_env.runs.run import run_policy
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.recorder import TOTALS
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import World
from tests.support.drivers import tick_by_tick

Image = pytest.importorskip("PIL.Image")


def pictures(n_frames: int, height: int = 60, width: int = 81):
    """A blue square that crosses the floor."""
    for frame in range(n_frames):
        picture = np.full((height, width, 3), PALETTE.floor, np.uint8)
        picture[20:30, 2 * frame : 2 * frame + 10] = PALETTE.empty
        yield picture


@pytest.fixture
def small():
    return scenario("warehouse_small", n_robots=4, n_objects=10)


def frames_of(path) -> list[np.ndarray]:
    with Image.open(path) as film:
        shown = []
        for frame in range(film.n_frames):
            film.seek(frame)
            shown.append(np.asarray(film.convert("RGB")))
        return shown


def test_a_gif_shows_every_picture_in_true_colours_for_ever(tmp_path):
    path = write_film(pictures(12), tmp_path / "film.gif", fps=20, n_frames=12)
    assert path == tmp_path / "film.gif"
    with Image.open(path) as film:
        assert film.info["duration"] == 50
        assert film.info["loop"] == 0
    for shown, drawn in zip(frames_of(path), pictures(12), strict=True):
        assert np.abs(shown.astype(int) - drawn).max() <= 4


def test_an_mp4_has_every_picture_even_of_odd_size(tmp_path):
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    path = write_film(pictures(12), tmp_path / "film.MP4", fps=10, n_frames=12)
    n_frames, duration_s = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert n_frames == 12
    assert duration_s == pytest.approx(1.2, abs=0.05)
    decode = [
        imageio_ffmpeg.get_ffmpeg_exe(),
        "-v",
        "error",
        "-i",
        str(path),
        "-f",
        "rawvideo",
        "-pix_fmt",
        "rgb24",
        "-",
    ]
    raw = subprocess.run(decode, check=True, capture_output=True).stdout
    shown = np.frombuffer(raw, np.uint8).reshape(12, 60, 82, 3)
    assert shown[5, 25, 15] == pytest.approx(PALETTE.empty, abs=30)


def test_a_film_that_fails_leaves_nothing_behind(tmp_path):
    def broken():
        yield from pictures(3)
        raise RuntimeError("the run broke")

    (tmp_path / "old.gif").write_bytes(b"an older film")
    for name in ("old.gif", "new.gif"):
        with pytest.raises(RuntimeError, match="the run broke"):
            write_film(broken(), tmp_path / name, fps=20, n_frames=9)
    assert [entry.name for entry in tmp_path.iterdir()] == ["old.gif"]
    assert (tmp_path / "old.gif").read_bytes() == b"an older film"


@pytest.mark.parametrize(
    ("name", "fps", "n_frames", "expected"),
    [
        ("film.avi", 20, 10, r"to end in .gif or .mp4, got"),
        ("film", 20, 10, r"to end in .gif or .mp4, got"),
        ("file/film.gif", 20, 10, "to be a folder, but .*file' is a file"),
        ("film.gif", 51, 10, r"fps of a \.gif to be a number in \[1, 50\]"),
        ("film.mp4", 61, 10, r"fps of a \.mp4 to be a number in \[1, 60\]"),
        ("film.gif", 0.5, 10, "fps"),
        ("film.gif", float("nan"), 10, "fps"),
        ("film.gif", 20, 1501, "at most 1500 frames for a GIF, got 1501"),
    ],
)
def test_impossible_films_are_refused(tmp_path, name, fps, n_frames, expected):
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(RenderError, match=expected):
        check_film(tmp_path / name, fps, n_frames)


def test_without_ffmpeg_the_message_tells_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(ImportError, match=r'pip install ".\[render\]"'):
        check_film(tmp_path / "film.mp4", 20, 10)
    assert check_film(tmp_path / "film.gif", 20, 10) == tmp_path / "film.gif"


def test_a_run_is_filmed_from_its_start_to_its_end(small, tmp_path):
    calls = []
    path = record_run(
        small,
        "random",
        tmp_path / "run.gif",
        seconds=10.0,
        speedup=20.0,
        fps=20.0,
        size_px=300,
        progress=lambda done, total: calls.append((done, total)),
    )
    assert calls == [(done, 11) for done in range(1, 12)]
    assert len(frames_of(path)) == 11


class Witness(RandomPolicy):
    """Counts how often it is asked."""

    calls = 0

    def reset(self, task, rng):
        self.caches_seen = task.caches
        super().reset(task, rng)

    def act(self, obs, active):
        self.calls += 1
        return super().act(obs, active)


@pytest.fixture
def filmed(monkeypatch):
    """What the pictures of films show, one (tick, positions, headings, counters) per picture."""
    shown = []

    def look(scenario, swarm, objects, caches, events, *, tick, **_):
        shown.append((tick, swarm.position.copy(), swarm.heading.copy(), events.counters.copy()))
        return np.zeros((20, 20, 3), np.uint8)

    monkeypatch.setattr(film_module, "render_frame", look)
    return shown


CROWDED = scenario(
    "warehouse_small",
    n_robots=12,
    width_m=8.0,
    height_m=8.0,
    nest_centre_m=(1.0, 4.0),
    nest_size_m=(1.6, 4.0),
    n_objects=60,
    horizon_s=80.0,
    interval_s=20.0,
)
DISTURBED = (
    parse_wrapper("population:malfunction_per_tick=0.01,repair_per_tick=0.02"),
    parse_wrapper("throttle:waveform=constant,amplitude=0.3"),
    parse_wrapper("sensor_noise:sigma=0.02"),
)


@pytest.mark.parametrize(("policy", "wrappers"), [("crw", ()), ("crw", DISTURBED), ("stochm", DISTURBED)])
def test_a_film_shows_the_run_that_its_name_promises(filmed, tmp_path, monkeypatch, policy, wrappers):
    spec = plan_run(CROWDED, policy, wrappers=wrappers, seed=5)
    step, states = ForageEnv.step_batch, {}

    def note(self, *arguments, **options):
        result = step(self, *arguments, **options)
        states[self.tick] = self.swarm.position.copy(), self.swarm.heading.copy(), self.events.counters.copy()
        return result

    with monkeypatch.context() as patch:
        patch.setattr(ForageEnv, "step_batch", note)
        record = run_policy(tick_by_tick(load_policy(policy)), spec)
    options = {"seconds": 80.0, "speedup": 40.0, "fps": 20.0, "seed": 5}
    record_run(World(CROWDED, wrappers), policy, tmp_path / "run.gif", **options)
    assert [tick for tick, *_ in filmed] == list(range(0, 401, 10))
    for tick, *state in filmed[1:]:
        for mine, theirs in zip(state, states[tick], strict=True):
            np.testing.assert_array_equal(mine, theirs)
    counters = filmed[-1][3] - filmed[0][3]  # a static cache is counted when the world is made
    assert counters[Counter.FREE_PICKUPS] > 0
    for name, counter in TOTALS.items():
        assert counters[counter] == record[name].sum(), name


def test_a_run_that_is_over_stays_as_it_ended(filmed, tmp_path):
    deadly = World(scenario("warehouse_small", n_robots=2), (parse_wrapper("population:death_per_tick=0.9"),))
    record_run(deadly, "random", tmp_path / "run.gif", seconds=40.0)
    ticks = [tick for tick, *_ in filmed]
    assert len(ticks) == 41
    assert ticks[-1] == ticks[-2] < 200


def test_parameters_reach_the_policy_of_a_film(filmed, tmp_path):
    world = scenario("warehouse_small", n_robots=4, n_objects=10)
    record_run(world, "crw", tmp_path / "run.gif", seconds=10.0, parameters={"wander_speed_mps": 0.05})
    slow, start = filmed[-1][1], filmed[0][1]
    assert 0.0 < np.linalg.norm(slow - start, axis=1).max() <= 0.05 * 10.0 + 1e-6
    with pytest.raises(ConfigError, match="Expected parameters with a policy's name or file only"):
        record_run(world, Witness(), tmp_path / "run.gif", parameters={"wander_speed_mps": 0.05})


def test_one_seed_gives_one_film(small, tmp_path):
    options = {"seconds": 6.0, "speedup": 20.0, "fps": 10.0, "size_px": 300}
    films = [
        record_run(small, "random", tmp_path / f"{index}.gif", seed=seed, **options).read_bytes()
        for index, seed in enumerate((3, 3, 4))
    ]
    assert films[0] == films[1]
    assert films[0] != films[2]


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"seconds": 0.0}, "seconds"),
        ({"seconds": float("inf")}, "seconds"),
        ({"seconds": 20_000.0}, "seconds <= 10000"),
        ({"seconds": 0.5}, "seconds >= 1"),
        ({"speedup": -1.0}, "speedup"),
        ({"speedup": 1.0}, "fps <= 5"),
        ({"fps": 0.0}, "fps"),
        ({"size_px": 10}, "size_px"),
        ({"trail_s": -1.0}, "trail_s"),
        ({"trail_s": float("nan")}, "trail_s"),
    ],
)
def test_impossible_recordings_are_refused_before_the_run(small, tmp_path, options, expected):
    policy = Witness()
    with pytest.raises(RenderError, match=expected):
        record_run(small, policy, tmp_path / "run.gif", **options)
    assert policy.calls == 0
    assert not list(tmp_path.iterdir())
