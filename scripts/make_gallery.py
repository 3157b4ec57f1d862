"""Make docs/gallery.md: short replays of every scenario, controller and kind of adversity, a picture of each, films.

    python scripts/make_gallery.py [NAME ...]

Without names, everything is made: about five minutes of processor time. Needs the render extra.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from swarm_forage_env import RunSpec, load_policy, parse_wrapper, plan_run, scenario
from swarm_forage_env.rendering.frame import Trails, render_frame
from swarm_forage_env.study.film import record_run
from swarm_forage_env.study.replay.capture import record_replay
from swarm_forage_env.study.replay.files import write_replays
from swarm_forage_env.study.run import LiveRun, build_env

DOCS = Path(__file__).resolve().parent.parent / "docs"
FOLDER = DOCS / "gallery"
HORIZON_S = 1000.0
FRAME_S = 1.0
SEED = 1
TRAIL_S = 40
PICTURE_PX = 560


@dataclass(frozen=True, slots=True)
class Exhibit:
    """One replay: runs side by side, in a world."""

    name: str
    scenario: str
    policies: tuple[str, ...]
    text: str
    """What there is to see."""
    wrapper: str = ""
    """Disturbance of the last run; the others have none."""
    frame_s: float = FRAME_S

    def specs(self) -> list[RunSpec]:
        """The runs, with the same seed."""
        world = scenario(self.scenario, horizon_s=HORIZON_S, physics="compiled")
        last = len(self.policies) - 1
        return [
            plan_run(
                world,
                name,
                seed=SEED,
                wrappers=(parse_wrapper(self.wrapper),) if self.wrapper and index == last else (),
            )
            for index, name in enumerate(self.policies)
        ]


EXHIBITS = (
    Exhibit(
        "warehouse_small",
        "warehouse_small",
        ("crw", "dpo", "stochm", "stochx"),
        "The four scripted controllers in the small warehouse. CRW wanders; DPO goes back to what it remembers; STOCHM "
        "and STOCHX divide the way at caches.",
    ),
    Exhibit(
        "trained_policy",
        "warehouse_small",
        ("crw", "ppo_warehouse_small"),
        "The trained policy beside CRW: straight to the source and straight home.",
    ),
    Exhibit(
        "warehouse_dual",
        "warehouse_dual",
        ("crw", "dpo", "stochm", "stochx"),
        "Two sources, the nest between them.",
    ),
    Exhibit("warehouse_medium", "warehouse_medium", ("crw", "dpo"), "Objects anywhere around the nest.", frame_s=2.0),
    Exhibit("warehouse_quad", "warehouse_quad", ("crw", "dpo"), "Four sources around the nest.", frame_s=2.0),
    Exhibit("search_and_rescue", "search_and_rescue", ("crw", "dpo"), "Clusters of objects that wander slowly."),
    Exhibit(
        "throttle",
        "warehouse_small",
        ("dpo", "dpo"),
        "Throttle: in the second run robots lose up to 80 % of their speed, in waves of 300 s.",
        wrapper="throttle:waveform=sine,amplitude=0.4,offset=0.4,period_s=300",
    ),
    Exhibit(
        "handling_cost",
        "warehouse_small",
        ("dpo", "dpo"),
        "Handling cost: in every other 100 s of the second run, each pick-up and drop takes 20 s.",
        wrapper="handling_cost:waveform=square,amplitude=50,offset=50,period_s=200",
    ),
    Exhibit(
        "sensor_noise",
        "warehouse_small",
        ("dpo", "dpo"),
        "Sensor noise: robots of the second run see obstacles that are not there.",
        wrapper="sensor_noise:sigma=0.05",
    ),
    Exhibit(
        "population",
        "warehouse_small",
        ("dpo", "dpo"),
        "Failures: robots of the second run break, are repaired, and sometimes die where they are.",
        wrapper="population:malfunction_per_tick=0.02,repair_per_tick=0.025,death_per_tick=0.0015",
    ),
)
FILMS = {"dpo": "dpo", "ppo": "ppo_warehouse_small"}
"""File below docs/images -> policy that it shows at work in the small warehouse."""


def draw(exhibit: Exhibit) -> None:
    """Draw the last run of an exhibit at its end, with trails."""
    spec = exhibit.specs()[-1]
    policy = load_policy(spec.policy)
    run = LiveRun(build_env(spec.scenario, spec.wrappers), policy, spec.seed)
    env, trails = run.forage_env, Trails(spec.scenario.robots.n_robots, TRAIL_S + 1)
    for second in range(TRAIL_S + 1):
        run.advance(to_tick=round((HORIZON_S - TRAIL_S + second) / spec.scenario.dt_s))
        trails.add(env.swarm)
    state = (env.swarm, env.objects, env.caches, env.events)
    title = f"{spec.scenario.name}, {spec.policy}".replace("_", " ")
    picture = render_frame(spec.scenario, *state, tick=env.tick, size_px=PICTURE_PX, trails=trails, title=title)
    Image.fromarray(picture).save(FOLDER / f"{exhibit.name}.png", optimize=True)


def show(exhibit: Exhibit) -> None:
    """Make the replay and the picture of an exhibit."""
    replays = [record_replay(spec, frame_s=exhibit.frame_s)[0] for spec in exhibit.specs()]
    path = write_replays(FOLDER / f"{exhibit.name}.html", replays)
    draw(exhibit)
    print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB")


def page() -> str:
    """The page as Markdown."""
    lines = [
        "# Gallery",
        "",
        "Every scenario, every controller and every kind of adversity, a thousand seconds each, as",
        "[replays](replay.md): download a file and open it in a browser. Runs side by side have the same seed.",
        "`scripts/make_gallery.py` makes them.",
    ]
    for exhibit in EXHIBITS:
        title = exhibit.name.replace("_", " ")
        lines += ["", f"## {title[0].upper()}{title[1:]}", "", exhibit.text, ""]
        lines += [f"[![{title}](gallery/{exhibit.name}.png)](gallery/{exhibit.name}.html)", ""]
        lines += [f"[Open the replay](gallery/{exhibit.name}.html): {', '.join(exhibit.policies)}."]
    return "\n".join(lines) + "\n"


def main(names: list[str]) -> None:
    """Make the exhibits of these names, all if there is none; then the page and the films."""
    FOLDER.mkdir(exist_ok=True)
    for exhibit in EXHIBITS:
        if not names or exhibit.name in names:
            show(exhibit)
    (DOCS / "gallery.md").write_text(page(), encoding="utf-8")
    for file, policy in FILMS.items():
        if not names or file in names:
            path = DOCS / "images" / f"{file}.gif"
            world = scenario("warehouse_small", physics="compiled")
            record_run(world, policy, path, seed=SEED, seconds=300.0, speedup=40.0, fps=10.0, size_px=440)
            print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
