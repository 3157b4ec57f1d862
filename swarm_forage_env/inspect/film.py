"""Filming a run: `record_run` drives a policy and writes a GIF or an MP4, or one PNG.

A film is planned and driven like any run, by `runs.spec` and `runs.run`. Drawing reads the state and never writes it,
so filming does not change a run.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from swarm_forage_env._internal.fields import ConfigError, number
from swarm_forage_env._internal.files import check_file, replacing
from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.rendering.frame import Trails, render_frame
from swarm_forage_env.rendering.video import Frame, check_film, write_film
from swarm_forage_env.rendering.view import arena_view
from swarm_forage_env.runs.run import LiveRun, build_env
from swarm_forage_env.runs.spec import policy_spec
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.wrappers.world import WorldLike, world_of


def record_run(
    world: WorldLike,
    policy: str | Policy,
    path: str | Path,
    *,
    at_s: float | None = None,
    seconds: float = 300.0,
    seed: int = 0,
    speedup: float = 20.0,
    fps: float = 20.0,
    size_px: int = 900,
    trail_s: float = 20.0,
    caches: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Run a policy and film it, or draw it at one time.

    Args:
        world: A `World`, a configuration or the name of a preset.
        policy: Name of an installed policy, path of a policy file, or a policy object, of which a copy acts.
        path: File to write, .gif or .mp4; with `at_s` .png.
        at_s: Simulated time of the only picture.
        seconds: Simulated time to film.
        seed: Seed of the run; `run_one` with the same seed makes the same run.
        speedup: Simulated seconds per second of film.
        fps: Pictures per second of film.
        size_px: Longer side of the drawn arena.
        trail_s: Simulated time over which the robots' trails fade; 0 for none.
        caches: "none", "static" or "dynamic"; default what the policy states in `caches`, or what the scenario has if
            the policy states nothing.
        parameters: Keyword arguments of a policy that is given by name or path.
        progress: Called with (pictures done, pictures in all) after each picture of a film.

    Returns:
        The path written.

    Raises:
        ConfigError: a value out of range, or `parameters` with a policy object; then nothing has been run or written.
        OSError: the file cannot be written; then nothing has been run.
        ImportError: Pillow, or for .mp4 imageio with ffmpeg, is not installed.
        ValueError: unknown policy name, or a policy file that cannot be opened or does not fit the scenario.
    """
    given, path = world_of(world), Path(path)
    number("trail_s", trail_s, at_least=0.0)
    if at_s is None:
        ticks = _film_ticks(given.scenario, seconds, speedup, fps)
        check_film(path, fps, len(ticks))
        shown, n_samples = ticks, round(trail_s * fps / speedup) + 1
    elif path.suffix.lower() == ".png":
        ticks = _trail_ticks(given.scenario, at_s, trail_s)
        shown, n_samples = ticks[-1:], len(ticks)
    else:
        raise ConfigError(f"Expected a picture's path to end in .png, got {str(path)!r}; for a film, leave --at out.")
    check_file(path)
    arena_view(given.scenario, size_px)  # refuses a bad size before the run starts
    spec = policy_spec(policy, parameters=parameters, caches=caches)
    driver: Policy = load_policy(spec.policy, spec.parameters) if spec.factory is None else spec.factory()
    given = given.with_caches(spec.caches)
    arena = given.scenario.arena
    look = {"title": given.title(spec.label, f"{arena.width_m:g} x {arena.height_m:g} m"), "size_px": size_px}
    run = LiveRun(build_env(given.scenario, given.wrappers, reads=getattr(driver, "reads", None)), driver, seed)
    trails = Trails(given.n_robots, n_samples) if n_samples > 1 else None
    pictures = _pictures(run, ticks, shown[0], trails, progress, look)
    if at_s is None:
        write_film(pictures, path, fps=fps)
    else:
        write_picture(next(pictures), path)
    return path


def _pictures(
    run: LiveRun,
    ticks: Sequence[int],
    first: int,
    trails: Trails | None,
    progress: Callable[[int, int], None] | None,
    look: Mapping[str, Any],
) -> Iterator[Frame]:
    """Look at a run at these ticks, and draw it from the first picture on."""
    env = run.forage_env
    for done, tick in enumerate(ticks, start=1):
        run.advance(to_tick=tick)  # a run that has ended stays as it is
        if trails is not None:
            trails.add(env.swarm)
        if tick >= first:
            state = (env.swarm, env.objects, env.caches, env.events)
            yield render_frame(env.scenario, *state, tick=env.tick, trails=trails, **look)
            if progress is not None:
                progress(done, len(ticks))


def write_picture(frame: Frame, path: Path) -> None:
    """Write one picture, (H, W, 3) uint8, as PNG, whole or not at all."""
    from PIL import Image

    with replacing(path, ending=".png") as draft:
        Image.fromarray(frame).save(draft, optimize=True)


def _trail_ticks(scenario: ScenarioConfig, at_s: float, trail_s: float) -> list[int]:
    """Return the ticks of the trail of one picture, one per second, the last that of the picture."""
    number("at_s", at_s, at_least=0.0, at_most=scenario.horizon_s)
    end = round(at_s / scenario.dt_s)
    back = range(end, -1, -round(1.0 / scenario.dt_s))
    return [tick for tick in back if (end - tick) * scenario.dt_s <= trail_s][::-1]


def _film_ticks(scenario: ScenarioConfig, seconds: float, speedup: float, fps: float) -> list[int]:
    """Return the ticks to draw, 0 first, evenly spaced up to rounding."""
    number("seconds (of a run of horizon_s)", seconds, above=0.0, at_most=scenario.horizon_s)
    number("fps", fps, above=0.0)
    number(f"speedup (a tick of {scenario.dt_s} s or more per picture)", speedup, at_least=scenario.dt_s * fps)
    number("seconds (of two pictures or more)", seconds, at_least=speedup / fps)
    n_steps = math.floor(seconds * fps / speedup + 1e-9)
    return [round(picture * speedup / fps / scenario.dt_s) for picture in range(n_steps + 1)]
