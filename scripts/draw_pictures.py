"""Draw the pictures of robots at work and README's film.

    python scripts/draw_pictures.py [FILE ...] [--out FOLDER]    default all of them, docs/images

Robots have trails of 40 s. Needs the extra render.
"""

import argparse
from pathlib import Path
from typing import Any

from swarm_forage_env import scenario
from swarm_forage_env.inspect.film import record_run

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
FILM = "small.gif"
"""The trained policy in the small warehouse: a hundred pictures of 300 s, half a megabyte."""
TRAIL_S = 40.0


def draw(file: Path, scenario_name: str, policy_name: str, time_s: float, size_px: int, theme: str) -> None:
    """Run a policy with seed 0 and draw the arena as it is at `time_s`."""
    world = scenario(scenario_name, **FIELDS.get(file.name, {}))
    print(record_run(world, policy_name, file, at_s=time_s, size_px=size_px, trail_s=TRAIL_S, theme=theme))


def film(file: Path) -> None:
    """Film the policy that was trained in the small warehouse, until the first robots have delivered."""
    record_run(
        scenario("warehouse_small"), "ppo_warehouse_small", file, seconds=300.0, speedup=30.0, fps=10.0, size_px=560
    )
    print(file)


def main() -> None:
    """Draw what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    known = (*PICTURES, FILM)
    parser.add_argument("files", nargs="*", metavar="FILE", help=f"default all: {', '.join(known)}")
    parser.add_argument("--out", type=Path, default=IMAGES, metavar="FOLDER", help="where they go")
    arguments = parser.parse_args()
    unknown = [name for name in arguments.files if name not in known]
    if unknown:
        parser.error(f"expected some of {', '.join(known)}, got {unknown[0]!r}")
    for name in arguments.files or known:
        if name in PICTURES:
            draw(arguments.out / name, *PICTURES[name])
        elif name == FILM:
            film(arguments.out / name)


if __name__ == "__main__":
    main()
