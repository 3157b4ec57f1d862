"""Every measure of the results page once more, from the packed runs beside it, with polars and numpy alone.

    python tests/reference/read_results.py docs/results

Nothing of this project is imported: the formulas are written out from docs/equations.md, in their corrected forms. It
computes the rows of measures.csv anew from <set>.parquet and names those that differ; exit code 1 if there are any.
"""

import math
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import polars as pl

TICK_S = 0.2
REPAIRS = {50: 0.001022222, 200: 0.001005556}
"""Robots -> lowest repair rate of the study per tick; malfunctions are 0.001. A level multiplies both."""
CLOSE = 2e-5
"""Relative difference that the six printed digits allow."""

Line = dict[float, pl.DataFrame]
"""Value of the last axis -> rows of its runs by seed and interval: a policy in one panel of a figure."""
Measured = Iterator[tuple[str, str, float, np.ndarray]]
"""Measure, its form, value of the last axis, and values of runs."""


def paired(*conditions: pl.DataFrame) -> list[pl.DataFrame]:
    """The runs of several conditions whose seed all of them have."""
    seeds = set.intersection(*(set(rows["seed"]) for rows in conditions))
    return [rows.filter(pl.col("seed").is_in(list(seeds))) for rows in conditions]


def curves(rows: pl.DataFrame, column: str) -> np.ndarray:
    """A column as (runs, intervals)."""
    return rows[column].to_numpy().astype(float).reshape(-1, max(1, rows["interval"].n_unique()))


def performance(rows: pl.DataFrame) -> np.ndarray:
    return curves(rows, "performance").sum(axis=1)


def spatial_emergence(few: pl.DataFrame, many: pl.DataFrame, ratio: float) -> np.ndarray:
    """Eq. (2): loss of the smaller swarm in proportion, less that of the larger. Of one robot it is lost to walls."""
    lost = [(curves(of, "performance") * curves(of, "interference_fraction")).sum(axis=1) for of in (few, many)]
    return ratio * lost[0] - lost[1]


def over_sizes(line: Line, study: dict) -> Measured:
    """Measures of a policy over swarm sizes; those of two sizes stand at the larger."""
    for size, rows in line.items():
        yield "raw_performance", "marginal", size, performance(rows)
    for smaller, size in pairwise(line):
        (few, many), ratio = paired(line[smaller], line[size]), size / smaller
        yield "task_emergence", "marginal", size, performance(many) - ratio * performance(few)  # Eq. (3)
        before = np.where(performance(few) > 0.0, performance(few), np.nan)  # of nothing there is no gain
        serial = (before / performance(many) - 1.0 / ratio) / (1.0 - 1.0 / ratio)  # Karp and Flatt
        yield "scalability", "marginal", size, 1.0 - serial  # Eq. (4)
        _, few, many = paired(line.get(1.0, few), few, many)  # Eq. (2) has one robot in both terms, where it cancels
        yield "spatial_emergence", "marginal", size, spatial_emergence(few, many, ratio)
        if 1.0 in line:
            one, many = paired(line[1.0], line[size])
            yield "spatial_emergence", "interactive", size, spatial_emergence(one, many, size)


def warped(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Dynamic time warping of each pair of curves, (runs, intervals) both: the table of its recursion, cell by cell."""
    cost = np.abs(x[:, :, None] - y[:, None, :])
    table = np.full((len(x), x.shape[1] + 1, y.shape[1] + 1), np.inf)
    table[:, 0, 0] = 0.0
    for i, j in np.ndindex(cost.shape[1:]):
        before = np.minimum(np.minimum(table[:, i, j + 1], table[:, i + 1, j]), table[:, i, j])
        table[:, i + 1, j + 1] = cost[:, i, j] + before
    return table[:, -1, -1]


@cache
def mean_at_work(level: float, n: int, ticks: float) -> float:
    """Mean number of robots at work in a run that all begin: a chain's states after a Poisson number of leaps."""
    leave, back = (0.001 * level, REPAIRS[n] * level) if n in REPAIRS else (level, 0.0)  # scenario 2 has deaths alone
    leaps = (np.eye(n + 1, k=1) * leave + np.eye(n + 1, k=-1) * back) / (leave + back)
    leaps += np.diag(1.0 - leaps.sum(axis=1))
    expected = (leave + back) * ticks
    away, time_left, mean = np.eye(n + 1)[0], 1.0, 0.0
    for k in range(int(expected + 10.0 * expected**0.5) + 30):
        time_left -= math.exp(k * math.log(expected) - expected - math.lgamma(k + 1))  # that more than k leaps come
        mean += time_left / expected * (away @ (n - np.arange(n + 1)))
        away = away @ leaps
    return float(mean)


def over_levels(line: Line, study: dict) -> Measured:
    """Measures of a policy over the levels of an adversity, each beside the study's reference."""
    reference, criterion = study["axis"][-1].get("reference", min(line)), study["axis"][-1]["criterion"]
    for level in line.keys() - {reference}:
        ideal, disturbed = paired(line[reference], line[level])
        x, y = curves(ideal, "performance"), curves(disturbed, "performance")
        if criterion == "throttle":  # Eqs. (5) and (6): from performance that falls in proportion to it
            follows = 1.0 - (curves(disturbed, "adversity") - curves(ideal, "adversity"))
            yield "reactivity", "marginal", level, warped(follows * x, y)
        if criterion == "population_dynamics":  # Eq. (12): beyond what robots at work explain, expected and counted
            n, ticks = line[level]["n_robots"][0], line[level]["t_end_s"].max() / TICK_S
            share = mean_at_work(level, n, ticks) / mean_at_work(reference, n, ticks)
            counted = curves(disturbed, "n_active") / curves(ideal, "n_active")
            yield "population_robustness", "marginal", level, (y - share * x).sum(axis=1)
            yield "recorded_population_robustness", "marginal", level, (y - counted * x).sum(axis=1)
        else:  # Eqs. (7) and (8)
            yield {"throttle": "adaptability", "noise": "noise_robustness"}[criterion], "marginal", level, warped(x, y)


def measured(file: Path) -> Iterator[tuple[tuple, np.ndarray]]:
    """What names a row of measures.csv, and the values of its runs that are numbers, of a packed study."""
    study = tomllib.loads(pl.read_parquet_metadata(file)["swarm_forage_env.study"])
    *others, last = (axis.get("criterion") or axis["field"] for axis in study["axis"])
    rows = pl.read_parquet(file).filter(pl.col("error").is_null()).sort(f"axis_{last}", "seed", "interval")
    lines: dict[tuple, Line] = {}
    axes = [f"axis_{name}" for name in (*others, last)]
    for place, condition in rows.group_by("rules", "policy", *axes, maintain_order=True):
        lines.setdefault(place[:-1], {})[float(place[-1])] = condition
    for (rules, policy, *values), line in lines.items():
        where = " ".join(f"{name} {value:g}" for name, value in zip(others, values, strict=True))
        measures = over_sizes if last == "population_size" else over_levels
        for measure, form, value, of_runs in measures(line, study):
            key = (study["name"], measure, form, rules, where, policy, float(f"{value:.6g}"))
            if np.isfinite(of_runs).any():
                yield key, of_runs[np.isfinite(of_runs)]


@cache
def student(n: int) -> float:
    """Student's t that 95 % of means of n runs stay within, in standard errors: its density over atan(t)."""
    angle = np.linspace(0.0, math.pi / 2.0, 20_001)
    density = np.cos(angle) ** (n - 2)
    within = np.cumsum(density) - density / 2.0 - 0.5
    return math.sqrt(n - 1) * math.tan(np.interp(0.95, within / within[-1], angle))


def faults_of(row: dict, values: np.ndarray) -> list[str]:
    """What a printed row has that its runs do not."""
    n, mean, sd = len(values), values.mean(), values.std(ddof=1) if len(values) > 1 else math.nan
    half = student(n) * sd / math.sqrt(n) if n > 1 else math.nan
    found = {"mean": mean, "sd": sd, "lower": mean - half, "upper": mean + half}
    close = CLOSE * max(np.abs(values).max(), np.nan_to_num(half), 1e-9)
    unlike = [name for name in found if not np.isclose(found[name], row[name], rtol=0.0, atol=close, equal_nan=True)]
    faults = [f"{n} runs, printed {row['n_runs']}"] if n != row["n_runs"] else []
    return faults + [f"{name} {found[name]:.6g}, printed {row[name]:.6g}" for name in unlike]


@np.errstate(divide="ignore", invalid="ignore")  # of runs that deliver nothing, which have no value
def main(folder: Path) -> int:
    """Compare all printed measures with the runs; returns the exit code."""
    printed = pl.read_csv(folder / "measures.csv", infer_schema_length=None).with_columns(
        pl.col("others").fill_null(""), pl.col("mean", "lower", "upper", "sd").fill_null(math.nan)
    )
    keys = ("set", "measure", "form", "rules", "others", "policy", "value")
    rows = printed.rows_by_key(keys, named=True, unique=True)
    n_right, wrong = 0, []
    for key, values in (found for file in sorted(folder.glob("*.parquet")) for found in measured(file)):
        faults = faults_of(rows.pop(key), values) if key in rows else ["is not printed"]
        wrong += [f"{', '.join(map(str, key))}: {fault}" for fault in faults]
        n_right += not faults
    wrong += [f"{', '.join(map(str, key))}: no runs of it" for key in rows]
    last = f"{n_right} of {len(printed)} printed measures are those of the runs\n"
    sys.stdout.write("\n".join([*wrong, last]))
    return int(bool(wrong) or not n_right)


if __name__ == "__main__":
    place = Path(sys.argv[1] if len(sys.argv) == 2 else "")
    if not (place / "measures.csv").is_file():
        sys.exit(f"Expected a folder with measures.csv and packed studies, such as docs/results, got {sys.argv[1:]}.")
    sys.exit(main(place))
