"""Worlds unlike those of any training, drawn once: how do policies do there beside the best scripted controller?

    python scripts/unseen_worlds.py                              generalist, the table of docs/generalist.md
    python scripts/unseen_worlds.py --policy a.npz,b.npz         other policies
    python scripts/unseen_worlds.py --draws 1                    a first look, at one world of each kind
    python scripts/unseen_worlds.py --worlds docs/benchmark/validation.toml    in the worlds of a file

Eleven kinds of worlds, five drawn of each by the seed below: directions, shapes, numbers and disturbances that no
shipped training plan has; long walls differ in place and length only. Nobody may choose a plan by them; run them once
for a plan that is fixed. The worlds of a file are not unseen: docs/benchmark/validation.toml has those in which plans
are chosen. The yardstick there is the better of CRW and DPO, because caches of the other two may stand in walls.
"""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from metrics.controllers import PAPER_POLICIES
from swarm_forage_env._internal.fields import ConfigError, known_keys
from swarm_forage_env._internal.files import parse_toml
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.runs.answer import Sheet
from swarm_forage_env.runs.plan import Plan
from swarm_forage_env.runs.policy_spec import PolicySpec, policy_specs
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.training.evaluation_plan import EvaluationPlan
from swarm_forage_env.training.evaluations import finished_runs
from swarm_forage_env.wrappers.registry import wrappers_from_mapping
from swarm_forage_env.wrappers.world import World

DRAWN_BY = 20_261_126
"""Seed of the worlds; the day on which they were drawn."""
RUN_SEED = 50_000
AHEAD = 0.95
"""Share of the best scripted controller that counts as keeping up with it."""
NEED_NO_CACHE = ("crw", "dpo")
"""Controllers that can run wherever there are walls."""
_KEYS = ("horizon_s", "n_runs", "first_seed", "worlds")
"""What a file of worlds may say."""
_N_DRAWS = 5
_HORIZON_S = 4000.0
Drawn = tuple[str, dict[str, Any], dict[str, Any]]
"""Preset, fields and wrappers."""
_SMALL_CACHES = {"side_share": 0.06}
"""Where caches of the usual size have no room; STOCHM and STOCHX have some."""


def places(x_low: float, x_high: float, y_low: float, y_high: float) -> tuple[tuple[float, float], ...]:
    """Return the middles of all cells in a box."""
    return tuple((float(x), float(y)) for x in np.arange(x_low, x_high, 0.2) for y in np.arange(y_low, y_high, 0.2))


def source_in_the_west(rng: np.random.Generator) -> Drawn:
    """The small warehouse turned by half."""
    source = {"placement": "positions", "object_positions_m": places(4.9, 7.8, 2.5, 13.5)}
    return "warehouse_small", {**source, "nest_centre_m": (28.8, 8.0), "n_robots": int(rng.integers(8, 97))}, {}


def source_in_the_south(rng: np.random.Generator) -> Drawn:
    """The small warehouse turned by a quarter."""
    source = {"placement": "positions", "object_positions_m": places(2.5, 13.5, 4.9, 7.8)}
    shape = {"width_m": 16.0, "height_m": 32.0, "nest_centre_m": (8.0, 28.8), "nest_size_m": (12.8, 3.2)}
    return "warehouse_small", {**source, **shape, "n_robots": int(rng.integers(8, 97))}, {}


def corridor(rng: np.random.Generator) -> Drawn:
    """Longer and narrower than in any training."""
    height = float(0.2 * rng.integers(30, 38))  # 6 to 7.4 m
    shape = {"width_m": 52.0, "height_m": height, "nest_centre_m": (5.2, height / 2), "nest_size_m": (5.2, 3.2)}
    return "warehouse_small", {**shape, **_SMALL_CACHES, "n_objects": 80, "n_robots": int(rng.integers(8, 33))}, {}


def few_objects(rng: np.random.Generator) -> Drawn:
    """A larger hall than in any training, with few objects."""
    shape = {"width_m": 64.0, "height_m": 64.0, "nest_centre_m": (32.0, 32.0), "nest_size_m": (9.6, 9.6)}
    numbers = {"n_objects": int(rng.integers(30, 80)), "n_robots": int(rng.integers(16, 65))}
    return "warehouse_medium", {**shape, **numbers}, {}


def far_corner(rng: np.random.Generator) -> Drawn:
    """A nest in a corner of a larger hall."""
    x, y = rng.choice([6.0, 58.0]), rng.choice([6.0, 34.0])
    shape = {"width_m": 64.0, "height_m": 40.0, "nest_centre_m": (float(x), float(y)), "nest_size_m": (7.2, 7.2)}
    return "warehouse_medium", {**shape, "n_objects": 600, "n_robots": int(rng.integers(32, 97))}, {}


def two_nests(rng: np.random.Generator) -> Drawn:
    """Objects anywhere, and two nests."""
    x = float(rng.integers(34, 41))
    fields = {"nest_centre_m": (8.0, 24.0), "nest_size_m": (4.8, 6.4), "further_nests": ((x, 34.0, x + 6.0, 40.0),)}
    return "warehouse_medium", {**fields, **_SMALL_CACHES, "n_robots": int(rng.integers(32, 97))}, {}


def gates(rng: np.random.Generator) -> Drawn:
    """Two walls with a gate each on the way."""
    boxes: list[tuple[float, float, float, float]] = []
    for x in (9.0, 21.0):
        low = float(rng.integers(3, 8))
        boxes += [(x, 0.2, x + 0.4, low), (x, low + 5.0, x + 0.4, 15.8)]
    return "warehouse_small", {"obstacles": tuple(boxes), **_SMALL_CACHES, "n_robots": int(rng.integers(8, 49))}, {}


def larger_swarm(rng: np.random.Generator) -> Drawn:
    """More robots than any training has."""
    preset = ("warehouse_small", "warehouse_medium", "search_and_rescue")[rng.integers(3)]
    return preset, {"n_robots": int(rng.integers(112, 257)), **({"side_m": 64.0} if preset[0] == "s" else {})}, {}


def late_throttle(rng: np.random.Generator) -> Drawn:
    """Robots lose half of their speed in the second half of the run."""
    throttle = {"waveform": "step", "amplitude": float(rng.uniform(0.45, 0.6)), "start_s": 2000.0}
    return "search_and_rescue", {"n_robots": int(rng.integers(16, 65))}, {"throttle": throttle}


def rough_sensing(rng: np.random.Generator) -> Drawn:
    """More noise than any training has, and deaths."""
    wrappers = {
        "sensor_noise": {"sigma": float(rng.uniform(0.04, 0.06))},
        "actuator_noise": {"sigma": float(rng.uniform(0.12, 0.2))},
        "population": {"death_per_tick": 0.0005},
    }
    return "warehouse_dual", {"n_robots": int(rng.integers(16, 97))}, wrappers


def long_wall(rng: np.random.Generator) -> Drawn:
    """One wall of 6 to 10 m on the way; added when one had stopped a generalist, and drawn before any run."""
    length_dm = int(rng.integers(60, 101))
    x_dm = int(rng.choice([*range(80, 121), *range(165, 221)]))  # clear of caches in the middle
    y_dm = int(rng.integers(2, 159 - length_dm))
    wall = (x_dm / 10, y_dm / 10, (x_dm + 8) / 10, (y_dm + length_dm) / 10)
    numbers = {"n_robots": int(rng.integers(8, 65)), "n_objects": int(rng.integers(40, 201))}
    return "warehouse_small", {"obstacles": (wall,), **_SMALL_CACHES, **numbers}, {}


KINDS: tuple[Callable[[np.random.Generator], Drawn], ...] = (
    source_in_the_west,
    source_in_the_south,
    corridor,
    few_objects,
    far_corner,
    two_nests,
    gates,
    larger_swarm,
    late_throttle,
    rough_sensing,
    long_wall,
)


def worlds(kind: Callable[[np.random.Generator], Drawn], n_draws: int, horizon_s: float) -> list[World]:
    """Return worlds of a kind; the first are the same, however many are drawn."""
    rng = np.random.default_rng((DRAWN_BY, KINDS.index(kind)))
    drawn = [kind(rng) for _ in range(n_draws)]
    return [
        World(scenario(preset, physics="compiled", horizon_s=horizon_s, **fields), wrappers_from_mapping(wrappers))
        for preset, fields, wrappers in drawn
    ]


def shares(
    asked: Sequence[PolicySpec],
    there: Sequence[World],
    jobs: int,
    *,
    yardstick: Sequence[str] = PAPER_POLICIES,
    seeds: Sequence[int] = (RUN_SEED,),
) -> FloatArray:
    """Return performance as a share of the best controller of the yardstick, (policies, worlds).

    Where no scripted controller brings anything home, it is 1 for a policy that does not, either, else infinite.
    """
    scripted = policy_specs(list(yardstick))
    every = {policy.label: policy for policy in (*asked, *scripted)}
    if any(every[policy.label] != policy for policy in asked):
        raise SystemExit(f"Expected files of other names than {', '.join(yardstick)}, which are the yardstick.")
    table = finished_runs(Plan.product(every.values(), there, seeds), jobs=jobs, progress=True)

    def means(policies: Sequence[PolicySpec]) -> FloatArray:
        runs = [[table.of(one) for one in table.plan.of_policy(policy.label)] for policy in policies]
        made = [[[one.performance.mean() for one in world] for world in own] for own in runs]
        return np.array(made, np.float64).mean(axis=-1)

    best, own = means(scripted).max(axis=0), means(asked)
    return np.divide(own, best, out=np.where(own > 0.0, np.inf, 1.0), where=best > 0.0)


def between(found: FloatArray) -> str:
    """Return the least and the largest share, or the only one."""
    least, largest = f"{found.min():.2f}", f"{found.max():.2f}"
    return least if found.size == 1 else f"{least} to {largest}"


def counts(found: FloatArray, rival: str) -> list[tuple[str, ...]]:
    """Return the last rows of a table, of shares (policies, worlds)."""
    return [
        (f"worlds with at least {AHEAD:g}", *(f"{np.count_nonzero(one >= AHEAD)} of {one.size}" for one in found)),
        (f"better than {rival}", *(f"{np.count_nonzero(one > 1.0)} of {one.size}" for one in found)),
        ("median", *(f"{np.median(one):.2f}" for one in found)),
    ]


def in_drawn_worlds(asked: Sequence[PolicySpec], n_draws: int, horizon_s: float, jobs: int) -> Sheet:
    """Return the table of worlds of all kinds."""
    there = [world for kind in KINDS for world in worlds(kind, n_draws, horizon_s)]
    found = shares(asked, there, jobs)  # all at once, so that one estimate is of all that is left
    of_kinds = zip(KINDS, np.split(found, len(KINDS), axis=1), strict=True)
    rows = [(kind.__name__.replace("_", " "), *map(between, own)) for kind, own in of_kinds]
    return Sheet(
        title=f"Performance as a share of the best scripted controller, {horizon_s:,.0f} s, one run of each",
        header=("worlds", *(policy.label for policy in asked)),
        rows=rows + counts(found, "all four"),
    )


def in_worlds_of(file: Path, asked: Sequence[PolicySpec], jobs: int) -> Sheet:
    """Return the table of the worlds of a file, with the file's numbers of seconds and of runs."""
    try:
        given = parse_toml(file.read_text(encoding="utf-8"))
        known_keys(given, _KEYS, prefix="")
        plan = EvaluationPlan.from_mapping(given)
    except OSError as error:
        raise ConfigError(f"Cannot read the file of worlds {file}: {error.strerror or error}.") from error
    except ValueError as error:
        raise ConfigError(f"Expected worlds as in docs/benchmark/validation.toml, got {file}: {error}") from error
    there = list(map(plan.timed, plan.worlds))
    if not there:
        raise ConfigError(f"Expected [[worlds]] in {file}, got none.")
    found = shares(asked, there, jobs, yardstick=NEED_NO_CACHE, seeds=plan.seeds)
    rows = [(world.name, *(f"{one:.2f}" for one in own)) for world, own in zip(there, found.T, strict=True)]
    rival = " and ".join(NEED_NO_CACHE)
    lasting = "" if plan.horizon_s is None else f"{plan.horizon_s:,.0f} s, "
    return Sheet(
        title=f"Performance as a share of the better of {rival}, {lasting}means of {len(plan.seeds)} runs",
        header=("world", *(policy.label for policy in asked)),
        rows=rows + counts(found, rival),
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--policy", default="generalist", help="names or files, separated by commas")
    parser.add_argument("--draws", type=int, help=f"worlds of each kind (default: {_N_DRAWS})")
    parser.add_argument("--horizon", type=float, help=f"seconds of a run (default: {_HORIZON_S:g})")
    parser.add_argument("--worlds", type=Path, help="file of other worlds, with its own seconds of a run")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default: 1)")
    words = parser.parse_args()
    if words.worlds and (words.draws or words.horizon is not None):
        parser.error("expected --worlds without --draws and --horizon, which are of worlds that are drawn")
    try:
        asked = policy_specs(words.policy.split(","))
        if words.worlds:
            sheet = in_worlds_of(words.worlds, asked, words.jobs)
        else:
            horizon_s = _HORIZON_S if words.horizon is None else words.horizon
            sheet = in_drawn_worlds(asked, words.draws or _N_DRAWS, horizon_s, words.jobs)
    except ConfigError as error:
        raise SystemExit(str(error)) from error
    print(sheet.text())


if __name__ == "__main__":
    main()
