"""Draw the pictures of robots at work that README and docs show.

    python scripts/draw_pictures.py

Each shows the small warehouse with trails of 40 s. Needs the render extra.
"""

from pathlib import Path

from PIL import Image

from swarm_forage_env import load_policy, scenario
from swarm_forage_env.rendering.frame import Trails, render_frame
from swarm_forage_env.study.run import LiveRun, build_env

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
PICTURES = {"warehouse_small_dpo.png": ("dpo", 300.0), "warehouse_small_ppo.png": ("ppo_warehouse_small", 900.0)}
"""File -> policy, and the time in s at which the picture is taken."""
TRAIL_S = 40.0
SAMPLE_S = 1.0


def draw(file: str, policy_name: str, time_s: float) -> None:
    """Run a policy with seed 0 and draw the arena as it is at `time_s`."""
    small = scenario("warehouse_small")
    policy = load_policy(policy_name)
    run = LiveRun(build_env(small), policy, 0)
    env = run.forage_env
    trails = Trails(small.robots.n_robots, round(TRAIL_S / SAMPLE_S) + 1)
    for sample in range(round(TRAIL_S / SAMPLE_S) + 1):
        run.advance(to_tick=round((time_s - TRAIL_S + sample * SAMPLE_S) / small.dt_s))
        trails.add(env.swarm)
    title = f"warehouse small, {policy_name}, {small.arena.width_m:g} x {small.arena.height_m:g} m"
    picture = render_frame(
        small, env.swarm, env.objects, env.caches, env.events, tick=env.tick, size_px=900, trails=trails, title=title
    )
    Image.fromarray(picture).save(IMAGES / file, optimize=True)
    print(IMAGES / file)


if __name__ == "__main__":
    for name, (policy, seconds) in PICTURES.items():
        draw(name, policy, seconds)
