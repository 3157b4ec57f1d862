"""Draw the pictures of robots at work, and of the window, that README and docs show.

    python scripts/draw_pictures.py [FILE ...]

Robots have trails of 40 s. The window needs no display. Needs the render extra.
"""

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from swarm_forage_env import load_policy, plan_run, scenario
from swarm_forage_env.inspect.watch import Watch
from swarm_forage_env.rendering.frame import Trails, render_frame
from swarm_forage_env.rendering.window import Pressed, Window
from swarm_forage_env.runs.run import LiveRun, build_env

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
PICTURES = {
    "warehouse_small_dpo.png": ("warehouse_small", "dpo", 300.0, 900, "dark"),
    "warehouse_small_ppo.png": ("warehouse_small", "ppo_warehouse_small", 900.0, 900, "dark"),
    "warehouse_quad_dpo.png": ("warehouse_quad", "dpo", 300.0, 700, "dark"),
    "obstacles_crw.png": ("warehouse_small", "crw", 300.0, 700, "dark"),
    "warehouse_small_light.png": ("warehouse_small", "stochm", 300.0, 900, "light"),
}
"""File -> scenario, policy, the time in s at which the picture is taken, its width in pixels, and its theme."""
FIELDS: dict[str, dict[str, Any]] = {
    "obstacles_crw.png": {"obstacles": ((14.0, 0.2, 14.4, 6.0), (14.0, 10.0, 14.4, 15.8), (20.0, 7.0, 21.0, 9.0))}
}
"""File -> scenario fields that are not those of the preset."""
WINDOWS = {"window.png": "dark", "window_light.png": "light"}
"""File -> theme of the window."""
WINDOW_S = 600.0
TRAIL_S = 40.0
SAMPLE_S = 1.0


def draw(file: str, scenario_name: str, policy_name: str, time_s: float, size_px: int, theme: str) -> None:
    """Run a policy with seed 0 and draw the arena as it is at `time_s`."""
    world = scenario(scenario_name, **FIELDS.get(file, {}))
    world = plan_run(world, policy_name).scenario  # with the caches that the policy is made for
    policy = load_policy(policy_name)
    run = LiveRun(build_env(world), policy, 0)
    env = run.forage_env
    trails = Trails(world.robots.n_robots, round(TRAIL_S / SAMPLE_S) + 1)
    for sample in range(round(TRAIL_S / SAMPLE_S) + 1):
        run.advance(to_tick=round((time_s - TRAIL_S + sample * SAMPLE_S) / world.dt_s))
        trails.add(env.swarm)
    title = f"{scenario_name.replace('_', ' ')}, {policy_name}, {world.arena.width_m:g} x {world.arena.height_m:g} m"
    picture = render_frame(
        world,
        env.swarm,
        env.objects,
        env.caches,
        env.events,
        tick=env.tick,
        size_px=size_px,
        trails=trails,
        title=title,
        theme=theme,
    )
    Image.fromarray(picture).save(IMAGES / file, optimize=True)
    print(IMAGES / file)


def draw_window(file: str, theme: str) -> None:
    """Watch DPO with seed 0 until a robot near objects meets another one; raise the throttle and choose the robot."""
    import pygame

    os.environ["SDL_VIDEODRIVER"] = "dummy"
    window, watch = Window(), Watch(scenario("warehouse_small"), "dpo", theme=theme)
    world, interesting = watch.world, np.zeros(0, np.bool_)
    while not interesting.any():
        watch.step()
        near_objects = world.arena.obs[:, world.layout["los_object"]].any(axis=1)
        interesting = world.events.interfering & near_objects & (world.tick * world.scenario.dt_s >= WINDOW_S)
    watch.robot = int(np.flatnonzero(interesting)[0])
    for key in ("t", "t", "space"):
        watch.handle(Pressed(key))
    window.show(watch.scene())
    screen = pygame.display.get_surface()
    assert screen is not None, "a window was shown"
    pixels = pygame.surfarray.array3d(screen).swapaxes(0, 1)
    Image.fromarray(pixels).save(IMAGES / file, optimize=True)
    window.close()
    print(IMAGES / file)


if __name__ == "__main__":
    for name, about in PICTURES.items():
        if name in sys.argv[1:] or not sys.argv[1:]:
            draw(name, *about)
    for name, about in WINDOWS.items():
        if name in sys.argv[1:] or not sys.argv[1:]:
            draw_window(name, about)
