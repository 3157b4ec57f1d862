"""Every measure of the results page once more, from the packed runs beside it, with polars and numpy alone.

    python tests/reference/read_results.py docs/results

Nothing of this project is imported: the formulas are written out from docs/equations.md, in their corrected forms. It
reads <set>.parquet, computes the rows of measures.csv anew, and says how far they are from what is printed there.
Exit code 1 if a number is not the printed one.
"""

import json
import math
import sys
from collections.abc import Callable, Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import polars as pl

TICK_S = 0.2
REPAIRS = {50: 0.001022222, 200: 0.001005556}
"""Robots -> lowest repair rate of the study per tick; malfunctions are 0.001. A level multiplies both."""
FLOORS_M2 = {"warehouse_small": 32.0 * 16.0, "warehouse_medium": 48.0 * 48.0}
NEAR_M = 2.0
CLOSE = 2e-5
"""Relative difference that the six printed digits allow."""

Runs = dict[str, np.ndarray]
"""Column -> values of a condition (runs, intervals); `seed` (runs,) and `n_robots` beside them."""
Values = np.ndarray


def read(file: Path) -> tuple[dict, str, pl.DataFrame]:
    """A packed study: what was planned, the name of its runs in tables, and its rows."""
    stamp = {key.rpartition(".")[2]: text for key, text in pl.read_parquet_metadata(file).items()}
    study = json.loads(stamp["study"])
    rows = pl.read_parquet(file).filter(pl.col("state") == "done")
    return study, f"{study['name']} {stamp['digest'][:8]}", rows


def runs_of(rows: pl.DataFrame) -> Runs:
    """The runs of one condition, by seed."""
    rows = rows.sort("seed", "interval")
    seeds = rows["seed"].unique().sort().to_numpy()
    numbers = [name for name, kind in rows.schema.items() if kind.is_numeric() and not rows[name].null_count()]
    runs = {name: rows[name].to_numpy().astype(float).reshape(len(seeds), -1) for name in numbers}
    return {**runs, "seed": seeds, "n_robots": rows["n_robots"][0]}


def looked_at(line: dict[float, Runs], study: dict) -> dict[float, Runs]:
    """Of a study that is looked at several times, the first runs of each condition, as many as the last look has."""
    if not study.get("looks"):
        return line
    n_values = len(study["axes"][-1]["values"])
    everywhere = set.intersection(*(set(runs["seed"].tolist()) for runs in line.values()))
    missing = [seed for seed in sorted(study["seeds"]) if seed not in everywhere]
    n_leading = sum(seed < min(missing, default=math.inf) for seed in study["seeds"]) if len(line) == n_values else 0
    last = max((look for look in study["looks"] if look <= n_leading), default=0)
    return {
        value: {name: part[:last] if isinstance(part, np.ndarray) else part for name, part in runs.items()}
        for value, runs in line.items()
    }


def paired(*conditions: Runs) -> list[Runs]:
    """The runs of several conditions whose seed all of them have."""
    seeds = set.intersection(*(set(runs["seed"].tolist()) for runs in conditions))
    kept = [[seed in seeds for seed in runs["seed"].tolist()] for runs in conditions]
    return [
        {name: column[mine] if isinstance(column, np.ndarray) else column for name, column in runs.items()}
        for runs, mine in zip(conditions, kept, strict=True)
    ]


# ------------------------------------------------------------------------------------------------- swarm sizes


def raw_performance(runs: Runs) -> Values:
    return runs["performance"].sum(axis=1)


def cache_congestion(runs: Runs, scenario: str) -> Values:
    """Time lost near caches beyond their share of the floor, which grows with the swarm in search and rescue."""
    floor = FLOORS_M2.get(scenario) or (16.0 * max(1, round((runs["n_robots"] / 12.8) ** 0.5))) ** 2
    lost, n_caches = runs["interference_ticks"], runs["n_caches"]
    even = lost * np.minimum(1.0, n_caches * math.pi * NEAR_M**2 / floor)
    known = (lost.sum(axis=1) > 0.0) & n_caches.any(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = (runs["interference_ticks_near_caches"] - even).sum(axis=1) / lost.sum(axis=1)
    return np.where(known, found, np.nan)


def spatial_emergence(one: Runs, few: Runs, many: Runs) -> Values:
    """Eq. (2): loss of the smaller swarm in proportion, less that of the larger. Of one robot it is lost to walls."""
    lost = [runs["performance"] * runs["interference_fraction"] for runs in (one, few, many)]
    ratio = many["n_robots"] / few["n_robots"]
    if few["n_robots"] == 1:
        return (many["n_robots"] * lost[0] - lost[2]).sum(axis=1)
    return (ratio * lost[1] - lost[2]).sum(axis=1)


def task_emergence(few: Runs, many: Runs) -> Values:
    """Eq. (3): performance beyond growth in proportion to the robots."""
    return raw_performance(many) - many["n_robots"] / few["n_robots"] * raw_performance(few)


def scalability(few: Runs, many: Runs) -> Values:
    """Eq. (4): one minus Karp and Flatt's serial fraction."""
    ratio = many["n_robots"] / few["n_robots"]
    with np.errstate(divide="ignore", invalid="ignore"):
        speedup = raw_performance(many) / raw_performance(few)
        return 1.0 - (1.0 / speedup - 1.0 / ratio) / (1.0 - 1.0 / ratio)


# ----------------------------------------------------------------------------------------- adversity, noise, failures


def warped(x: np.ndarray, y: np.ndarray) -> Values:
    """Dynamic time warping of each pair of curves, (runs, intervals) both: the table of its recursion, cell by cell."""
    cost = np.abs(x[:, :, None] - y[:, None, :])
    table = np.full((len(x), x.shape[1] + 1, y.shape[1] + 1), np.inf)
    table[:, 0, 0] = 0.0
    for i in range(x.shape[1]):
        for j in range(y.shape[1]):
            before = np.minimum(np.minimum(table[:, i, j + 1], table[:, i + 1, j]), table[:, i, j])
            table[:, i + 1, j + 1] = cost[:, i, j] + before
    return table[:, -1, -1]


def distance(ideal: Runs, disturbed: Runs) -> Values:
    """Eqs. (7) and (8): how far performance is from that without the adversity."""
    return warped(ideal["performance"], disturbed["performance"])


def reactivity(ideal: Runs, disturbed: Runs) -> Values:
    """Eqs. (5) and (6): how far it is from performance that falls in proportion to the throttle."""
    follows = 1.0 - (disturbed["adversity"] - ideal["adversity"])
    return warped(follows * ideal["performance"], disturbed["performance"])


def recorded_robustness(ideal: Runs, failing: Runs) -> Values:
    """Performance beyond what the robots at work explain."""
    return (failing["performance"] - failing["n_active"] / ideal["n_active"] * ideal["performance"]).sum(axis=1)


def robustness(ideal: Runs, failing: Runs, levels: tuple[float, float], ticks: float) -> Values:
    """Eq. (12) with the expected share of robots at work in a run that begins with all of them."""
    n = failing["n_robots"]
    at_work = [1.0 - mean_away(*rates(level, n), n, ticks) / n for level in levels]
    return (failing["performance"] - at_work[1] / at_work[0] * ideal["performance"]).sum(axis=1)


def rates(level: float, n: int) -> tuple[float, float]:
    """Robots that leave the swarm and that come back per tick: failures and repairs, or deaths in scenario 2."""
    return (0.001 * level, REPAIRS[n] * level) if n in REPAIRS else (level, 0.0)


@cache
def mean_away(leave: float, back: float, n: int, ticks: float) -> float:
    """Mean number of robots away until then, by the exponential of the chain's generator and of its integral."""
    chain = leave * np.eye(n + 1, k=1) + back * np.eye(n + 1, k=-1)
    chain -= np.diag(chain.sum(axis=1))
    block = np.block([[chain, np.eye(n + 1)], [np.zeros((n + 1, 2 * n + 2))]]) * ticks
    halvings = max(0, math.ceil(math.log2(np.abs(block).sum(axis=1).max()))) + 2
    small, term, power = block / 2.0**halvings, np.eye(2 * n + 2), np.eye(2 * n + 2)
    for order in range(1, 16):
        term = term @ small / order
        power += term
    for _ in range(halvings):
        power = power @ power
    return float(power[0, n + 1 :] @ np.arange(n + 1)) / ticks


PAIRS: dict[str, dict[str, Callable[..., Values]]] = {
    "throttle": {"reactivity": reactivity, "adaptability": distance},
    "noise": {"noise_robustness": distance},
    "population_dynamics": {"population_robustness": robustness, "recorded_population_robustness": recorded_robustness},
}
"""Criterion -> measures of a level beside its reference."""


def over_sizes(line: dict[float, Runs], study: dict) -> Iterator[tuple[str, str, float, Values]]:
    """Measures of a policy over swarm sizes: name, form, size, values of runs."""
    sizes = sorted(line)
    one = line[sizes[0]]
    for size in sizes:
        yield "raw_performance", "marginal", size, raw_performance(line[size])
        if "interference_ticks_near_caches" in line[size]:
            yield "cache_congestion", "marginal", size, cache_congestion(line[size], study["scenario"])
    for smaller, size in pairwise(sizes):
        few, many = paired(line[smaller], line[size])
        yield "task_emergence", "marginal", size, task_emergence(few, many)
        yield "scalability", "marginal", size, scalability(few, many)
        # Without a robot alone its terms cancel; with one, only seeds count that it has, too.
        three = paired(one, line[smaller], line[size]) if one["n_robots"] == 1 else [few, few, many]
        yield "spatial_emergence", "marginal", size, spatial_emergence(*three)
        if one["n_robots"] == 1:
            alone, many = paired(one, line[size])
            yield "spatial_emergence", "interactive", size, spatial_emergence(alone, alone, many)


def over_levels(criterion: str, line: dict[float, Runs], study: dict) -> Iterator[tuple[str, str, float, Values]]:
    """Measures of a policy over the levels of an adversity, each beside the study's reference."""
    reference = study["reference"]
    for level in sorted(line):
        if level != reference:
            ideal, disturbed = paired(line[reference], line[level])
            for name, measure in PAIRS[criterion].items():
                told = ((reference, level), study["horizon_s"] / TICK_S) if measure is robustness else ()
                yield name, "marginal", level, measure(ideal, disturbed, *told)


def measured(file: Path) -> Iterator[tuple[tuple, Values]]:
    """What names a row of measures.csv, and the values of its runs that are numbers."""
    study, runs, rows = read(file)
    *others, last = (axis["name"] for axis in study["axes"])
    lines: dict[tuple, dict[float, Runs]] = {}
    for place, condition in rows.group_by("reading", "policy", *(f"axis_{name}" for name in (*others, last))):
        lines.setdefault(place[:-1], {})[float(place[-1])] = runs_of(condition)
    for (rules, policy, *values), whole in lines.items():
        line = looked_at(whole, study)
        where = " ".join(f"{name} {value:g}" for name, value in zip(others, values, strict=True))
        found = over_sizes(line, study) if last == "population_size" else over_levels(last, line, study)
        for measure, form, value, of_runs in found:
            yield (runs, measure, form, rules, where, policy, float(f"{value:.6g}")), of_runs[np.isfinite(of_runs)]


def share_within(reach: float, n: int) -> float:
    """Probability that Student's t with n - 1 degrees of freedom is within +-reach: the integral of its density."""
    free = n - 1
    t = np.linspace(0.0, reach, 20_001)
    front = math.exp(math.lgamma((free + 1) / 2) - math.lgamma(free / 2)) / math.sqrt(free * math.pi)
    density = front * (1.0 + t**2 / free) ** (-(free + 1) / 2)
    return float(2.0 * ((density[1:] + density[:-1]) / 2.0 * np.diff(t)).sum())


def faults_of(row: dict, values: Values) -> list[str]:
    """What a printed row has that its runs do not."""
    n, mean, sd = len(values), values.mean(), values.std(ddof=1) if len(values) > 1 else math.nan
    size = max(abs(mean), np.abs(values).max(), 1e-9)
    faults = [f"{n} runs, printed {row['n_runs']}"] if n != row["n_runs"] else []
    for name, value in (("mean", mean), ("sd", sd)):
        printed = math.nan if row[name] is None else row[name]
        if abs(value - printed) > CLOSE * size or math.isnan(value) != math.isnan(printed):
            faults.append(f"{name} {value:.6g}, printed {printed:.6g}")
    if n > 1 and sd > CLOSE * size:
        share = share_within((row["upper"] - row["lower"]) / 2.0 * math.sqrt(n) / sd, n)
        if abs(share - 0.95) > 1e-3:
            faults.append(f"an interval of {share:.1%}, printed as one of 95 %")
    return faults


def main(folder: Path) -> int:
    """Compare all printed measures with the runs; returns the exit code."""
    keys = ("runs", "measure", "form", "rules", "others", "policy", "value")
    printed = pl.read_csv(folder / "measures.csv", infer_schema_length=None).with_columns(
        pl.col("others").fill_null("")
    )
    rows = {tuple(row[key] for key in keys): row for row in printed.iter_rows(named=True)}
    n_right, wrong = 0, []
    for file in sorted(folder.glob("*.parquet")):
        for key, values in measured(file):
            row = rows.pop(key, None)
            if not len(values):
                faults = [] if row is None else [f"{row['n_runs']} runs printed, none found"]
            else:
                faults = ["is not printed"] if row is None else faults_of(row, values)
            wrong += [f"{', '.join(map(str, key))}: {fault}" for fault in faults]
            n_right += row is not None and not faults
    wrong += [f"{', '.join(map(str, key))}: no runs of it" for key in rows]
    wrong.append(f"{n_right} of {n_right + len(wrong)} printed measures are those of the runs")
    sys.stdout.write("\n".join(wrong) + "\n")
    return int(len(wrong) > 1 or not n_right)


if __name__ == "__main__":
    place = Path(sys.argv[1] if len(sys.argv) == 2 else "")
    if not (place / "measures.csv").is_file():
        sys.exit(f"Expected a folder with measures.csv and packed studies, such as docs/results, got {sys.argv[1:]}.")
    sys.exit(main(place))
