"""What laws and a mean-field model say of swarms of 1 to 128 robots, beside what they do: two tables and a picture.

    python scripts/laws_beside_data.py            the tables of docs/laws.md, and docs/images/laws.png
    python scripts/laws_beside_data.py --sizes 1 2 4 8 16 --seeds 4 --horizon 1000

The model knows swarms of one robot and of --small robots only. Runs are kept in --out and not repeated.
"""

import argparse
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from metrics import ForagingRates, Ladder, Summary, aggregate, estimate_rates, fit_ladder, mean_field
from metrics.scoring.plots import COLOURS
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.study.experiments import SIZE_SWEEP_OBJECTS
from swarm_forage_env.study.record import RunRecord
from swarm_forage_env.study.runner import run_all
from swarm_forage_env.study.spec import plan_run
from swarm_forage_env.study.store import RunStore

N_RESAMPLES = 100
SEED = 1
LAW_WORDS = {
    "linear": "a N",
    "contention": "a N / (1 + s (N - 1))",
    "universal": "a N / (1 + s (N - 1) + k N (N - 1))",
    "power": "a N^b",
    "hamann": "a N^b exp(c N)",
}
SYMBOLS = {"a": "a", "contention": "s", "coherency": "k", "exponent": "b", "decay": "c"}
DRAWN = ("linear", "contention", "universal", "hamann")


@dataclass(frozen=True, kw_only=True)
class Data:
    """Runs by swarm size."""

    records: Mapping[int, Sequence[RunRecord]]
    small: int
    """Swarm size from which rates are estimated, beside one robot."""
    n_objects: int
    horizon_s: float

    def totals(self, size: int) -> list[float]:
        """Objects delivered in each run."""
        return [float(record.collected.sum()) for record in self.records[size]]

    def interference(self, size: int) -> Summary:
        """Share of robot time that is lost, over runs."""
        return aggregate([float(record.interference_fraction.mean()) for record in self.records[size]])


def recorded(chosen: argparse.Namespace) -> Data:
    """Make the runs, or read them."""
    n_objects = SIZE_SWEEP_OBJECTS["warehouse_small"]
    specs = {
        size: [
            plan_run(
                scenario(
                    "warehouse_small",
                    n_robots=size,
                    n_objects=n_objects,
                    horizon_s=chosen.horizon,
                    physics="compiled",
                ),
                chosen.policy,
                seed=seed,
            )
            # Small swarms deliver little, and the model rests on these two.
            for seed in range(chosen.small_seeds if size in (1, chosen.small) else chosen.seeds)
        ]
        for size in chosen.sizes
    }
    planned = [spec for of_size in specs.values() for spec in of_size]
    found = run_all(planned, store=RunStore(chosen.out), jobs=chosen.jobs, progress=True)
    records = {record.run_id: record for record in found.records}
    by_size = {size: [records[spec.run_id] for spec in of_size] for size, of_size in specs.items()}
    return Data(records=by_size, small=chosen.small, n_objects=n_objects, horizon_s=chosen.horizon)


def estimated(data: Data, small: int, rng: np.random.Generator | None = None) -> ForagingRates:
    """Rates of swarms of `small` robots and of one; from resampled runs if `rng` is given."""

    def drawn(size: int) -> list[RunRecord]:
        runs = list(data.records[size])
        return runs if rng is None else [runs[k] for k in rng.integers(len(runs), size=len(runs))]

    few, lone = drawn(small), drawn(1)
    return estimate_rates(
        small,
        pickups=[record.free_pickups for record in few],
        deliveries=[record.collected for record in few],
        n_carrying=[record.n_carrying for record in few],
        interference=[record.interference_fraction for record in few],
        interval_s=float(few[0].t_end_s[0]),
        n_objects=data.n_objects,
        lone_interference=[record.interference_fraction for record in lone],
    )


def predicted(rates: ForagingRates, sizes: Sequence[int], horizon_s: float) -> np.ndarray:
    """Objects delivered and mean interference of the model for each size, (S, 2)."""
    solved = [mean_field(rates, size, horizon_s) for size in sizes]
    return np.array([(each.delivered[-1], each.interference.mean()) for each in solved])


def size_lines(data: Data, model: np.ndarray, bounds: np.ndarray) -> Iterator[str]:
    """Yield the table of sizes: measured and by the model, and the two rates that the model takes to be constant."""
    yield "| robots | runs | delivered | mean field | time lost, % | mean field | finds per 1,000 s searched | s home |"
    yield "|--:|--:|---|---|---|---|--:|--:|"
    for k, size in enumerate(data.records):
        totals, lost = aggregate(data.totals(size)), data.interference(size)
        (delivered, share), (low, high), own = model[k], bounds[:, k], estimated(data, size)
        yield (
            f"| {size} | {totals.n_used} | {totals.mean:.1f} ± {totals.upper - totals.mean:.1f} "
            f"| {delivered:.1f} ({low[0]:.1f} to {high[0]:.1f}) "
            f"| {100 * lost.mean:.2f} ± {100 * (lost.upper - lost.mean):.2f} "
            f"| {100 * share:.2f} ({100 * low[1]:.2f} to {100 * high[1]:.2f}) "
            f"| {1000 * own.finding * data.n_objects:.3f} | {own.homing_s:.0f} |"
        )


def law_lines(ladder: Ladder) -> Iterator[str]:
    """Yield the table of laws: parameters, critical size and error."""
    yield "| law | P(N) | parameters | largest at | error |"
    yield "|---|---|---|---|--:|"
    for name, fit in ladder.laws.items():
        parameters = ", ".join(
            f"{SYMBOLS[field]} = {found.value:.3g} ({found.lower:.3g} to {found.upper:.3g})"
            for field, found in fit.parameters.items()
        )
        peak = fit.peak
        place = "-" if math.isinf(peak.lower) else f"{peak.value:.3g} ({peak.lower:.3g} to {peak.upper:.3g})"
        yield f"| `{name}` | {LAW_WORDS[name]} | {parameters} | {place} | {fit.error:.3f} |"
    b = ladder.exponent
    yield ""
    yield f"Exponent up to the best size: {b.value:.3f} ({b.lower:.3f} to {b.upper:.3f}), {ladder.scaling}."


def draw(data: Data, ladder: Ladder, curve: np.ndarray, bounds: np.ndarray, at: np.ndarray, path: Path) -> None:
    """Draw deliveries, deliveries per robot and time lost over the swarm size."""
    from matplotlib.figure import Figure  # not pyplot: no global state, no window system

    figure: Any = Figure(figsize=(12.6, 4.2), layout="constrained")
    total, each, lost = figure.subplots(1, 3)
    sizes = list(data.records)
    measured = [aggregate(data.totals(size)) for size in sizes]
    for panel, divisor, curve_divisor in ((total, np.ones(len(sizes)), np.ones(at.size)), (each, np.array(sizes), at)):
        means = np.array([summary.mean for summary in measured]) / divisor
        half = np.array([summary.upper - summary.mean for summary in measured]) / divisor
        for name, colour in zip(DRAWN, COLOURS[1:], strict=False):
            law = ladder.laws[name].law
            panel.plot(at, law.performance(at) / curve_divisor, "--", color=colour, linewidth=1.2, label=f"law: {name}")
        panel.plot(
            at, curve[:, 0] / curve_divisor, color=COLOURS[0], label=f"mean field, from 1 and {data.small} robots"
        )
        panel.fill_between(
            at,
            bounds[0, :, 0] / curve_divisor,
            bounds[1, :, 0] / curve_divisor,
            color=COLOURS[0],
            alpha=0.15,
            linewidth=0,
        )
        panel.errorbar(sizes, means, yerr=half, fmt="ko", markersize=4, capsize=2, label="runs, mean and 95 % interval")
    seen = [data.interference(size) for size in sizes]
    lost.plot(at, 100 * curve[:, 1], color=COLOURS[0])
    lost.fill_between(at, 100 * bounds[0, :, 1], 100 * bounds[1, :, 1], color=COLOURS[0], alpha=0.15, linewidth=0)
    half = [100 * (summary.upper - summary.mean) for summary in seen]
    lost.errorbar(sizes, [100 * summary.mean for summary in seen], yerr=half, fmt="ko", markersize=4, capsize=2)
    total.set_yscale("log")
    words = (f"objects delivered in {data.horizon_s:,.0f} s", "objects delivered per robot", "robot time lost, %")
    for panel, word in zip((total, each, lost), words, strict=True):
        panel.set_xscale("log", base=2)
        panel.set_xticks(sizes, [str(size) for size in sizes])
        panel.minorticks_off()
        panel.set_xlabel("robots", fontsize=8)
        panel.set_ylabel(word, fontsize=8)
        panel.tick_params(labelsize=8)
        panel.grid(alpha=0.3)
    each.set_ylim(bottom=0.0)
    lost.set_ylim(bottom=0.0)
    handles, labels = total.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False, fontsize=8)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Print the tables and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--policy", default="crw")
    parser.add_argument("--sizes", nargs="+", type=int, default=[1, 2, 4, 8, 16, 32, 64, 128])
    parser.add_argument("--small", type=int, default=4, help="swarm size from which rates are estimated")
    parser.add_argument("--seeds", type=int, default=8, help="runs per size")
    parser.add_argument("--small-seeds", type=int, default=48, help="runs of one robot and of --small robots")
    parser.add_argument("--horizon", type=float, default=2000.0, help="simulated seconds per run")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("results/laws"), help="folder for records")
    parser.add_argument("--picture", type=Path, default=Path("docs/images/laws.png"))
    chosen = parser.parse_args()
    data = recorded(chosen)
    sizes = list(data.records)
    between = [round(math.sqrt(small * large)) for small, large in pairwise(sizes)]
    at = np.unique([*sizes, *between])
    rng = np.random.default_rng(SEED)
    rates = estimated(data, chosen.small)
    resampled = [estimated(data, chosen.small, rng) for _ in range(N_RESAMPLES)]
    curve = predicted(rates, at.tolist(), data.horizon_s)
    spread = np.array([predicted(each, at.tolist(), data.horizon_s) for each in resampled])
    bounds = np.quantile(spread, [0.025, 0.975], axis=0)
    is_run = np.isin(at, sizes)
    ladder = fit_ladder(sizes, [data.totals(size) for size in sizes], seed=SEED)
    print(rates, end="\n\n")
    print("\n".join(size_lines(data, curve[is_run], bounds[:, is_run])), end="\n\n")
    print("\n".join(law_lines(ladder)))
    draw(data, ladder, curve, bounds, at, chosen.picture)


if __name__ == "__main__":
    main()
