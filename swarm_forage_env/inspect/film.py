"""Filming a run: `record_run` drives a policy and writes a GIF or an MP4.

A film is planned and driven like any run, by `runs.spec` and `runs.run`. Drawing reads the state and never writes it,
so filming does not change a run.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from swarm_forage_env._internal.fields import ConfigError, number
from swarm_forage_env._internal.files import check_file
from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.policies.registry import load_policy, policy_label
from swarm_forage_env.rendering.frame import Trails, render_frame
from swarm_forage_env.rendering.video import Frame, check_film, check_picture, write_film, write_picture
from swarm_forage_env.rendering.view import RenderError, arena_view, refusing
from swarm_forage_env.runs.run import LiveRun, build_env
from swarm_forage_env.runs.spec import chosen_caches, pin_policy
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.wrappers.world import World, WorldLike, world_of


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
    theme: str = "dark",
    caches: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Run a policy and film it, or draw it at one time.

    Args:
        world: A `World`, a configuration or the name of a preset; its horizon need not be whole recording intervals.
        policy: Name of an installed policy, path of a policy file, or a fresh policy object.
        path: File to write, .gif or .mp4; with `at_s` .png.
        at_s: Simulated time of the only picture.
        seconds: Simulated time to film.
        seed: Seed of the run; `run_one` with the same seed makes the same run.
        speedup: Simulated seconds per second of film.
        fps: Pictures per second of film.
        size_px: Longer side of the drawn arena.
        trail_s: Simulated time over which the robots' trails fade; 0 for none.
        theme: "dark" or "light".
        caches: "none", "static" or "dynamic"; default what the policy states in `caches`, or what the scenario has if
            the policy states nothing (`runs.spec.chosen_caches`).
        parameters: Keyword arguments of a policy that is given by name or path.
        progress: Called with (pictures done, pictures in all) after each picture of a film.

    Returns:
        The path written.

    Raises:
        RenderError: a value out of range; then nothing has been run or written.
        ConfigError: `parameters` with a policy object.
        OSError: the file cannot be written; then nothing has been run.
        ImportError: Pillow, or for .mp4 imageio with ffmpeg, is not installed.
        ValueError: unknown policy name, or a policy file that cannot be opened or does not fit the scenario.
    """
    given = world_of(world)
    scenario = given.scenario
    with refusing():
        number("trail_s", trail_s, at_least=0.0)
    if at_s is None:
        ticks = _picture_ticks(scenario, seconds, speedup, fps)
        path, n_samples = check_film(path, fps, len(ticks)), round(trail_s * fps / speedup) + 1
    else:
        path, ticks = check_picture(path), _trail_ticks(scenario, at_s, trail_s)
        n_samples = len(ticks)
    arena_view(scenario, size_px, theme)  # refuses a bad size or theme before the run starts
    policy, name, scenario = cast_policy(policy, scenario, caches, parameters)
    arena_words = f"{scenario.arena.width_m:g} x {scenario.arena.height_m:g} m"
    title = World(scenario, given.wrappers).title(name, arena_words, digests=False)
    stack = build_env(scenario, given.wrappers, reads=getattr(policy, "reads", None))
    check_file(path)
    trails = Trails(scenario.robots.n_robots, n_samples) if n_samples > 1 else None

    def frames() -> Iterator[Frame]:
        run = LiveRun(stack, policy, seed)
        env = run.forage_env
        for done, tick in enumerate(ticks, start=1):
            run.advance(to_tick=tick)  # a run that has ended stays as it is
            if trails is not None:
                trails.add(env.swarm)
            if at_s is not None and done < len(ticks):
                continue
            state = (env.swarm, env.objects, env.caches, env.events)
            yield render_frame(
                scenario, *state, tick=env.tick, size_px=size_px, trails=trails, title=title, theme=theme
            )
            if progress is not None:
                progress(done, len(ticks))

    if at_s is not None:
        return write_picture(next(frames()), path)
    return write_film(frames(), path, fps=fps, n_frames=len(ticks), theme=theme)


def cast_policy(
    policy: str | Policy, scenario: ScenarioConfig, caches: str | None, parameters: Mapping[str, Any] | None
) -> tuple[Policy, str, ScenarioConfig]:
    """Return the policy as an object, its name for people, and the scenario with the caches that the run has.

    Arguments and errors are those of `record_run`.
    """
    stating: object = policy
    if isinstance(policy, str):
        name = policy_label(policy)
        found, pinned, stating = pin_policy(policy, parameters or {})
        policy = load_policy(found, pinned)
    elif parameters:
        raise ConfigError(f"Expected parameters with a policy's name or file only, got them with {policy!r}.")
    else:
        name = getattr(policy, "name", type(policy).__name__)
    return policy, name, replace(scenario, caches=chosen_caches(caches, stating, scenario))


def _trail_ticks(scenario: ScenarioConfig, at_s: float, trail_s: float) -> list[int]:
    """Return the ticks of the trail of one picture, one per second, the last that of the picture."""
    with refusing():
        number("at_s", at_s, at_least=0.0, at_most=scenario.horizon_s)
    end = round(at_s / scenario.dt_s)
    back = range(end, -1, -round(1.0 / scenario.dt_s))
    return [tick for tick in back if (end - tick) * scenario.dt_s <= trail_s][::-1]


def _picture_ticks(scenario: ScenarioConfig, seconds: float, speedup: float, fps: float) -> list[int]:
    """Return the ticks to draw, 0 first, evenly spaced up to rounding."""
    with refusing():
        for label, value in (("seconds", seconds), ("speedup", speedup), ("fps", fps)):
            number(label, value, above=0.0)
    if seconds > scenario.horizon_s:
        raise RenderError(
            f"Expected seconds <= {scenario.horizon_s:g}, the scenario's horizon_s, got {seconds:g}; "
            "film less or give the scenario a longer horizon."
        )
    step_s = speedup / fps
    if step_s < scenario.dt_s:
        raise RenderError(
            f"Expected at least one tick of {scenario.dt_s} s per picture, got speedup / fps = {step_s:g} s; "
            f"use fps <= {speedup / scenario.dt_s:g} or raise speedup."
        )
    n_steps = math.floor(seconds / step_s + 1e-9)
    if n_steps < 1:
        raise RenderError(f"Expected seconds >= {step_s:g}, the time between two pictures, got {seconds:g}.")
    return [round(picture * step_s / scenario.dt_s) for picture in range(n_steps + 1)]
