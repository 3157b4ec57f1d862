"""Make docs/gallery.md, short replays of every scenario, controller and kind of adversity, films, and docs/images.

    python scripts/make_gallery.py [NAME ... | --pages]

Without names, everything is made. A NAME is that of a replay, of a film or of a picture in docs/images. `--pages` makes
no run: it puts the present style sheet and scripts around the runs of the stored replays, which is enough after a
change of the page. Needs the render extra.
"""

import base64
import html
import json
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from swarm_forage_env import RunSpec, plan_run, scenario
from swarm_forage_env.inspect.film import record_run
from swarm_forage_env.inspect.replay.capture import record_replay
from swarm_forage_env.inspect.replay.files import write_replays
from swarm_forage_env.policies.registry import policy_label
from swarm_forage_env.rendering.pages import build_replay_page
from swarm_forage_env.scenarios.config import ScenarioConfig

DOCS = Path(__file__).resolve().parent.parent / "docs"
FOLDER = DOCS / "gallery"
HORIZON_S = 1000.0
FRAME_S = 1.0
SEED = 1
TRAIL_S = 40.0


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
    horizon_s: float = HORIZON_S
    fields: Mapping[str, Any] = field(default_factory=dict)
    """Of the scenario."""

    def specs(self) -> list[RunSpec]:
        """The runs, with the same seed."""
        world = scenario(self.scenario, horizon_s=self.horizon_s, physics="compiled", **self.fields)
        last = len(self.policies) - 1
        return [
            plan_run(world, name, seed=SEED, wrappers=[self.wrapper] if self.wrapper and index == last else [])
            for index, name in enumerate(self.policies)
        ]


EXHIBITS = (
    Exhibit(
        "warehouse_small",
        "warehouse_small",
        ("crw", "dpo", "stochm", "stochx"),
        "CRW walks at random, DPO goes back to objects that it remembers, and in STOCHM and STOCHX robots hand objects "
        "over at caches.",
    ),
    Exhibit(
        "trained_policy",
        "warehouse_small",
        ("crw", "ppo_warehouse_small"),
        "Robots of the trained policy drive straight to the source and straight home.",
    ),
    Exhibit(
        "generalist",
        "warehouse_small",
        ("dpo", "generalist"),
        "One network for all scenarios beside the best of the paper's four, in a whole run of 10,000 s.",
        frame_s=10.0,
        horizon_s=10_000.0,
    ),
    Exhibit(
        "generalist_medium",
        "warehouse_medium",
        ("dpo", "generalist"),
        "The same in the medium warehouse.",
        frame_s=10.0,
        horizon_s=10_000.0,
    ),
    Exhibit(
        "generalist_rescue",
        "search_and_rescue",
        ("dpo", "generalist"),
        "The same in search and rescue: robots return to where they picked up an object, or saw one on their way home.",
        frame_s=10.0,
        horizon_s=10_000.0,
    ),
    Exhibit(
        "oracle",
        "warehouse_medium",
        ("generalist", "oracle"),
        "The network beside a yardstick that sees the whole world.",
        frame_s=2.0,
    ),
    Exhibit(
        "talk",
        "warehouse_small",
        (str(FOLDER / "silent.npz"), str(FOLDER / "talk.npz")),
        "One rich heap at a time. In the second run, robots tell each other where they picked up last.",
        frame_s=3.0,
        horizon_s=3000.0,
        fields={
            "n_robots": 24,
            "n_objects": 64,
            "width_m": 32.0,
            "height_m": 32.0,
            "nest_centre_m": (16.0, 16.0),
            "nest_size_m": (4.0, 4.0),
            "placement": "heap",
        },
    ),
    Exhibit(
        "cpfa",
        "warehouse_small",
        ("crw", "cpfa"),
        "CPFA robots go out straight, search, and return to where they found many objects.",
    ),
    Exhibit(
        "warehouse_dual",
        "warehouse_dual",
        ("crw", "dpo", "stochm", "stochx"),
        "Two sources, with the nest between them.",
    ),
    Exhibit("warehouse_medium", "warehouse_medium", ("crw", "dpo"), "Objects all around the nest.", frame_s=2.0),
    Exhibit("warehouse_quad", "warehouse_quad", ("crw", "dpo"), "Four sources around the nest.", frame_s=2.0),
    Exhibit("search_and_rescue", "search_and_rescue", ("crw", "dpo"), "Objects lie in clusters and drift slowly."),
    Exhibit(
        "throttle",
        "warehouse_small",
        ("dpo", "dpo"),
        "In the second run, robots lose up to 80 % of their speed, in waves of 300 s.",
        wrapper="throttle:waveform=sine,amplitude=0.4,offset=0.4,period_s=300",
    ),
    Exhibit(
        "handling_cost",
        "warehouse_small",
        ("dpo", "dpo"),
        "In the second run, each pick-up and drop takes 20 s during every other 100 s.",
        wrapper="handling_cost:waveform=square,amplitude=50,offset=50,period_s=200",
    ),
    Exhibit(
        "sensor_noise",
        "warehouse_small",
        ("dpo", "dpo"),
        "In the second run, robots see obstacles that do not exist.",
        wrapper="sensor_noise:sigma=0.05",
    ),
    Exhibit(
        "actuator_noise",
        "warehouse_small",
        ("dpo", "dpo"),
        "In the second run, wheels turn faster or slower than commanded.",
        wrapper="actuator_noise:sigma=0.5",
    ),
    Exhibit(
        "population",
        "warehouse_small",
        ("dpo", "dpo"),
        "In the second run, robots break down, are repaired, and sometimes die where they stand.",
        wrapper="population:malfunction_per_tick=0.02,repair_per_tick=0.025,death_per_tick=0.0015",
    ),
)


@dataclass(frozen=True, slots=True)
class Film:
    """One short film: a run of an exhibit, from its start."""

    name: str
    caption: str
    exhibit: str
    run: int = -1
    """Which of its runs."""
    seconds: float = 300.0
    """Simulated time; films of large swarms are shorter, since each picture takes more bytes."""


FILMS = (
    Film("film_crw", "CRW: a random walk", "warehouse_small", 0),
    Film("film_dpo", "DPO: remembers objects", "warehouse_small", 1),
    Film("film_stochm", "STOCHM: static caches", "warehouse_small", 2),
    Film("film_stochx", "STOCHX: dynamic caches", "warehouse_small", 3),
    Film("film_trained", "a trained policy", "trained_policy"),
    Film("film_generalist", "one network for all scenarios", "generalist_rescue"),
    Film("film_throttle", "throttled robots", "throttle"),
    Film("film_handling_cost", "long pick-ups and drops", "handling_cost"),
    Film("film_sensor_noise", "sensor noise", "sensor_noise"),
    Film("film_actuator_noise", "noisy wheels", "actuator_noise"),
    Film("film_population", "failures and deaths", "population"),
    Film("film_medium", "objects anywhere", "warehouse_medium", seconds=240.0),
    Film("film_quad", "four sources", "warehouse_quad", seconds=240.0),
    Film("film_search_and_rescue", "search and rescue", "search_and_rescue"),
    Film("film_talk", "robots that tell each other", "talk", seconds=450.0),
)
WALLS = ((14.0, 0.2, 14.4, 6.0), (14.0, 10.0, 14.4, 15.8), (20.0, 7.0, 21.0, 9.0))
PICTURES: dict[str, tuple[ScenarioConfig, str, dict[str, Any]]] = {
    "warehouse_small_dpo.png": (scenario("warehouse_small"), "dpo", {"at_s": 300.0}),
    "warehouse_small_ppo.png": (scenario("warehouse_small"), "ppo_warehouse_small", {"at_s": 900.0}),
    "warehouse_quad_dpo.png": (scenario("warehouse_quad"), "dpo", {"at_s": 300.0, "size_px": 700}),
    "obstacles_crw.png": (scenario("warehouse_small", obstacles=WALLS), "crw", {"at_s": 300.0, "size_px": 700}),
    "small.gif": (scenario("warehouse_small"), "ppo_warehouse_small", {"speedup": 30.0, "fps": 10.0, "size_px": 560}),
}
"""File in docs/images -> the world, the policy and how it is drawn; the film is README's."""
FILM_COLUMNS = 5
FILM_LOOK: dict[str, Any] = {"speedup": 30.0, "fps": 6.0, "size_px": 300, "trail_s": 10.0}
MOST_FILM_BYTES = 400_000
"""The page shows all films at once."""


def renew(exhibit: Exhibit) -> None:
    """Write the replay of an exhibit with the present page around its stored runs."""
    path = FOLDER / f"{exhibit.name}.html"
    text = path.read_text(encoding="utf-8")
    (title,) = re.findall("<title>(.*?)</title>", text)
    header, *blocks = re.findall(r'<script type="(?:application/json|text/plain)"[^>]*>(.*?)</script>', text)
    page = build_replay_page(html.unescape(title), json.loads(header), [base64.b64decode(block) for block in blocks])
    path.write_text(page, encoding="utf-8")


def page() -> str:
    """The page as Markdown."""
    lines = [
        "# Gallery",
        "",
        "A click on a film opens its [replay](look.md#replays). Runs side by side have one seed; most last 1,000 s.",
        "",
        *table_of_films(),
        "",
    ]
    for exhibit in EXHIBITS:
        title = exhibit.name.replace("_", " ")
        names = ", ".join(map(policy_label, exhibit.policies))
        lines += [f"- [{title}](gallery/{exhibit.name}.html) ({names}): {exhibit.text}"]
    return "\n".join(lines) + "\n"


def table_of_films() -> list[str]:
    """The films as lines of a table in Markdown: each shows its caption and leads to its replay."""
    lines: list[list[str]] = []
    for first in range(0, len(FILMS), FILM_COLUMNS):
        row = FILMS[first : first + FILM_COLUMNS]
        pictures = [f"[![{film.caption}](gallery/{film.name}.gif)](gallery/{film.exhibit}.html)" for film in row]
        captions = [film.caption for film in row]
        lines += [captions, pictures] if lines else [captions, ["---"] * len(row), pictures]
    return [f"| {' | '.join(cells)} |" for cells in lines]


def make(names: list[str]) -> None:
    """Make the exhibits and films of these names, all if there is none."""
    known = [*(one.name for one in (*EXHIBITS, *FILMS)), *PICTURES]
    unknown = {*names}.difference(known)
    if unknown:
        sys.exit(f"Expected names among {', '.join(known)}, or --pages, got {', '.join(sorted(unknown))}.")
    FOLDER.mkdir(exist_ok=True)
    for exhibit in EXHIBITS:
        if not names or exhibit.name in names:
            replays = [record_replay(spec, frame_s=exhibit.frame_s) for spec in exhibit.specs()]
            tell(write_replays(FOLDER / f"{exhibit.name}.html", replays))
    for film in FILMS:
        if not names or film.name in names:
            (exhibit,) = (one for one in EXHIBITS if one.name == film.exhibit)
            spec, file = exhibit.specs()[film.run], FOLDER / f"{film.name}.gif"
            tell(record_run(spec.world, spec.policy, file, seconds=film.seconds, seed=SEED, **FILM_LOOK))
            if file.stat().st_size > MOST_FILM_BYTES:
                sys.exit(f"Expected films of at most {MOST_FILM_BYTES / 1e3:.0f} kB; make it shorter or smaller.")
    for name, (world, policy, options) in PICTURES.items():
        if not names or name in names:
            tell(record_run(world, policy, DOCS / "images" / name, trail_s=TRAIL_S, **options))


def tell(file: Path) -> None:
    """Say which file was written."""
    print(f"{file.name}: {file.stat().st_size / 1e3:.0f} kB", flush=True)


def main(words: list[str]) -> None:
    """Make what is asked for, or renew its pages; then write the page of the gallery."""
    if words == ["--pages"]:
        for exhibit in EXHIBITS:
            renew(exhibit)
    else:
        make(words)
    (DOCS / "gallery.md").write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
