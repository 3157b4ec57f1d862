"""Draw two folders of run records beside each other: performance and interference over the size of the swarm.

    python scripts/compare_versions.py BEFORE AFTER PICTURE
    python scripts/compare_versions.py PROGRAM DESCRIBED PICTURE --names program described

Each folder holds one sub-folder per scenario with the records of runs that differ in controller, size and seed, for
example those of `swarm-forage run --robots N --out BEFORE/warehouse_medium` for several N. Prints the table behind the
picture.
"""

import argparse
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from swarm_forage_env.rendering.figures import looks, saved_figure, size_axis
from swarm_forage_env.runs.record import RunRecord
from swarm_forage_env.runs.store import load

Curves = dict[str, dict[int, tuple[float, float]]]
"""Controller -> swarm size -> performance per 1,000 s, and share of robot time in interference; means over seeds."""


def curves(records: tuple[RunRecord, ...]) -> Curves:
    """Return the means over the seeds of each controller and size."""
    runs: dict[tuple[str, int], list[tuple[float, float]]] = defaultdict(list)
    for record in records:
        pair = record.rate_per_1000_s("performance"), float(record.interference_fraction.mean())
        runs[record.controller, record.n_robots].append(pair)
    found: Curves = defaultdict(dict)
    for (controller, size), pairs in sorted(runs.items()):
        performance, interference = np.mean(pairs, axis=0).tolist()
        found[controller][size] = performance, interference
    return found


def tables(scenario: str, before: Curves, after: Curves, names: tuple[str, str]) -> Iterator[str]:
    """Yield the lines of two tables in Markdown: a row per swarm size, a column per controller."""
    for column, (title, decimals) in enumerate((("performance per 1,000 s", 1), ("interference", 3))):
        yield f"| {scenario}: {title}, {names[0]} → {names[1]} | {' | '.join(after)} |"
        yield "|--:|" + "--:|" * len(after)
        for size in sorted({size for sizes in after.values() for size in sizes}):
            row = []
            for controller in after:
                pair = (version.get(controller, {}).get(size) for version in (before, after))
                row.append(" → ".join("-" if found is None else f"{found[column]:.{decimals}f}" for found in pair))
            yield f"| {size} | {' | '.join(row)} |"
        yield ""


def draw(
    scenarios: list[str], before: dict[str, Curves], after: dict[str, Curves], names: tuple[str, str], path: Path
) -> None:
    """Draw one row per scenario: performance on the left, interference on the right; the first folder is dashed."""
    titles = "performance per 1,000 s", "share of robot time in interference"
    with saved_figure(path, (10.0, 3.6 * len(scenarios))) as figure:
        for line, scenario in zip(figure.subplots(len(scenarios), 2, squeeze=False), scenarios, strict=True):
            for version, dash in ((before, "--"), (after, "-")):
                for look, sizes in zip(looks(version[scenario]), version[scenario].values(), strict=True):
                    for panel, column in zip(line, zip(*sizes.values(), strict=True), strict=True):
                        label = look.name if dash == "-" else None
                        panel.plot(list(sizes), column, dash, marker=look.marker, color=look.colour, label=label)
            for panel, title in zip(line, titles, strict=True):
                size_axis(panel, {size for sizes in after[scenario].values() for size in sizes})
                panel.set_title(f"{scenario}: {title}")
            line[0].legend(title=f"dashed: {names[0]}, solid: {names[1]}", fontsize="small")


def main() -> None:
    """Read both folders, print the tables and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--names", nargs=2, default=("before", "after"), help="what the folders are called")
    chosen = parser.parse_args()
    names = (chosen.names[0], chosen.names[1])
    scenarios = sorted(folder.name for folder in chosen.after.iterdir() if folder.is_dir())
    before, after = (
        {name: curves(load(folder / name)) for name in scenarios} for folder in (chosen.before, chosen.after)
    )
    for name in scenarios:
        print("\n".join(tables(name, before[name], after[name], names)))
    draw(scenarios, before, after, names, chosen.picture)


if __name__ == "__main__":
    main()
