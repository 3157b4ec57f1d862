"""Numbers of runs in README.md, docs/ and the paper: made by commands, stored once, written between markers.

    python scripts/update_docs.py       write the stored numbers into all pages
        --check                         say which pages differ from what is stored; exit 1 if any does
        --remake [run]                  run all commands, or one, store what they print, write the pages (half an hour)
        --compare FILE                  compare the deliveries that a run of README's command printed with the stored;
                                        where other versions are installed, only say that they are not compared

The commands are listed below; the store is docs/results.json. Answers to claims and means of measures come of the files
of docs/results/confirmatory, see `results_numbers.py`; explored.runs and others say what the first study ran. A block
looks like `<!-- generated: run.crw -->20.45 ± 0.91<!-- end -->`; `run.table` is all that a command printed.
A number must not begin a line: Markdown takes a comment there for the start of an HTML block, which ends the paragraph.
--remake needs an installation with everything: pip install -e ".[plots,train]" "torch==2.13.0"
"""

import argparse
import json
import platform
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import polars as pl
from scipy.stats import ttest_ind  # pyright: ignore[reportMissingTypeStubs]  (scipy ships none)

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from metrics.benchmark import board_of, read_entry
from metrics.statistics import ROUNDING, aggregate
from scripts.results_numbers import results_fields, runs_fields

ROOT = Path(__file__).resolve().parent.parent
STORE = ROOT / "docs/results.json"
RESULTS = ROOT / "docs/results"
PAGES = [ROOT / "README.md", ROOT / "paper/paper.md", *sorted((ROOT / "docs").rglob("*.md")),
         *sorted((ROOT / "swarm_forage_env/policies/pretrained").glob("*.md"))]  # fmt: skip
BLOCK = re.compile(
    r"(<!-- generated: (?P<source>\w+)\.(?P<field>\w+) -->)(?P<text>.*?)(<!-- end -->)",
    re.DOTALL,
)
BEGINS_A_LINE = re.compile(r"^[ >]*(?:(?:[-*+]|\d+[.)]) +)?<!-- generated: \w+\.\w+ -->(?!\n)", re.MULTILINE)
PACKAGES = ("numpy", "scipy", "numba", "pymunk")
FIVE = ("crw", "dpo", "stochm", "stochx", "ppo_warehouse_small")
WITH_ALL = ("crw", "dpo", "stochm", "stochx", "generalist")
SCENARIOS = {"small": "warehouse_small", "medium": "warehouse_medium", "rescue": "search_and_rescue"}
"""Short name in blocks -> scenario."""
SOURCES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "run": ((f"swarm-forage run {','.join(FIVE)} --scenario warehouse_small --robots 50 --seeds 4",), FIVE),
    "medium": (
        ("swarm-forage run crw,ppo_warehouse_small --scenario warehouse_medium --seeds 4",),
        ("crw", "ppo_warehouse_small"),
    ),
    "trained": (
        (
            "swarm-forage train --scenario warehouse_small --algo ppo",
            "swarm-forage run crw,results/training/warehouse_small_ppo/policy.npz --seeds 4",
        ),
        ("crw", "policy"),
    ),
    **{
        f"generalist_{short}": (
            (f"swarm-forage run {','.join(WITH_ALL)} --scenario {name} --seeds 4",),
            WITH_ALL,
        )
        for short, name in SCENARIOS.items()
    },
    **{
        f"recipe_{short}_{seed}": (
            (
                f"swarm-forage train --scenario {name} --seed {seed} --out trained",
                f"swarm-forage run trained/policy.npz --scenario {name} --seeds 4",
            ),
            ("policy",),
        )
        for short, name in SCENARIOS.items()
        for seed in (0, 1)
        if (short, seed) != ("small", 0)  # that is "trained"
    },
    **{
        f"near_wall{suffix}": (
            (
                "swarm-forage run crw,dpo,stochx,generalist --scenario warehouse_dual --set obstacles=11,2,11.6,14 "
                f"--seeds 4{option}",
            ),
            ("crw", "dpo", "stochx", "generalist"),
        )
        for suffix, option in (("", ""), ("_short", " --horizon 1000"))
    },
    **{
        f"lesson_{size}": (
            (f"swarm-forage run crw,dpo --scenario classroom --robots {size} --seeds 4",),
            ("crw", "dpo"),
        )
        for size in (1, 10, 20, 40)
    },
}
"""Name -> commands, of which the last prints the table, and what its rows are called in blocks."""


def made_with() -> dict[str, str]:
    """Return what the last bits of a result depend on besides this package."""
    return {"machine": platform.machine(), **{name: version(name) for name in PACKAGES}}


def deliveries(table: str) -> list[str]:
    """Return the deliveries per 1,000 s of each row of a printed table, such as "20.45 ± 0.91"."""
    return re.findall(r"^\S.*?  +(\d[\d,.]* ± [\d.]+)\s", table, re.MULTILINE)


def make(name: str) -> dict[str, Any]:
    """Run the commands of a source in an empty folder; returns its fields and what they were made with.

    Raises:
        ValueError: The table has another number of rows than expected.
        CalledProcessError: A command failed.
    """
    commands, labels = SOURCES[name]
    printed = ""
    with tempfile.TemporaryDirectory() as folder:
        for command in commands:
            print(f"{name}: {command}", file=sys.stderr)
            words = [sys.executable, "-m", "swarm_forage_env.cli", *shlex.split(command)[1:]]  # whatever PATH says
            printed = subprocess.run(words, cwd=folder, stdout=subprocess.PIPE, text=True, check=True).stdout
    return {"made_with": made_with(), **fields(printed, labels)}


def fields(printed: str, labels: tuple[str, ...]) -> dict[str, str]:
    """Return the table without the text around it, and the deliveries of each row by its label.

    Raises:
        ValueError: The table has another number of rows than labels.
    """
    found = deliveries(printed)
    if len(found) != len(labels):
        raise ValueError(f"Expected a table with deliveries of {', '.join(labels)}, got:\n{printed}")
    lines = [line.rstrip() for line in printed.rstrip().splitlines()]
    top = next(number for number, line in enumerate(lines) if line.startswith("policy "))
    bottom = next(number for number, line in enumerate(lines) if line.startswith("±"))
    return {"table": "\n".join(lines[top - 1 : bottom + 1]), **dict(zip(labels, found, strict=True))}


def compare(printed: str, stored: dict[str, Any]) -> int:
    """Say how the printed deliveries of README's command differ from the stored ones; returns the exit code.

    The last bits of a result differ between versions of what it is made with, and a run of 10,000 s makes other
    deliveries of them. So the numbers are compared only where these versions are those of the stored numbers.

    Raises:
        ValueError: The table has another number of rows than expected.
    """
    found, here = fields(printed, FIVE), made_with()
    others = [f"{name} {was} then, {here[name]} now" for name, was in stored["made_with"].items() if here[name] != was]
    if others:
        print(f"Deliveries are not compared with the stored ones: {'; '.join(others)}. Last bits differ between them.")
        return 0
    differing = [name for name in FIVE if found[name] != stored[name]]
    for name in differing:
        print(f"{name}: {stored[name]} stored, {found[name]} now; if that is meant to be: scripts/update_docs --remake")
    if not differing:
        print("Deliveries are the stored ones.")
    return 1 if differing else 0


def known(store: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the store with the fields of docs/results, the benchmark, and talking."""
    return {
        **store,
        "explored": runs_fields(RESULTS),
        "results": results_fields(RESULTS / "confirmatory", RESULTS),
        "benchmark": benchmark_fields(),
        "talk": talk_fields(),
    }


def benchmark_fields() -> dict[str, str]:
    """Return the table of the benchmark, how many worlds it has, each score, and what the worst training won."""
    board = board_of([read_entry(file) for file in sorted((ROOT / "docs/benchmark").glob("*.json"))])
    fields = {"board": board.markdown().strip(), "worlds": str(len(board.protocol.held_out))}
    for standing in board.standings:
        won = (standing.shares.mean(axis=2) > 1.0 + ROUNDING).sum(axis=1)
        fields[standing.entry.name] = f"{standing.score.value:.2f}"
        fields[f"{standing.entry.name}_worst"] = f"{won.min()} of {fields['worlds']}"
    return fields


def talk_fields() -> dict[str, str]:
    """Return what swarms deliver that talk and that do not, and what it brings, with 95 % intervals over trainings."""
    runs = pl.read_csv(ROOT / "docs/benchmark/talk.csv")
    trainings = runs.group_by("swarm", "training", maintain_order=True).agg(pl.col("per_1000_s").mean())
    talk, silent = (trainings.filter(swarm=name)["per_1000_s"].to_numpy() for name in ("talk", "silent"))
    limits = ttest_ind(talk, silent, equal_var=False).confidence_interval()
    shares = [f"{100 * value / silent.mean():.0f}" for value in (talk.mean() - silent.mean(), limits.low, limits.high)]
    means = {name: aggregate(values) for name, values in (("talk", talk), ("silent", silent))}
    return {
        **{name: f"{mean.mean:.1f} ({mean.lower:.1f} to {mean.upper:.1f})" for name, mean in means.items()},
        "gain": "{} % ({} to {} %)".format(*shares),
    }


def written(text: str, store: dict[str, dict[str, Any]]) -> str:
    """Return a page with its blocks as they are stored."""

    def block(match: re.Match[str]) -> str:
        if match["source"] not in store:
            raise SystemExit(f"No numbers are stored of {match['source']}; --remake {match['source']} makes them.")
        value = store[match["source"]][match["field"]]
        if match["field"] == "table":
            value = f"\n```\n{value}\n```\n"
        elif value.startswith("|"):  # Markdown's own
            value = f"\n\n{value}\n\n"
        return f"{match[1]}{value}{match[5]}"

    return BLOCK.sub(block, text)


def broken_lines(text: str) -> list[int]:
    """Return the numbers of the lines of a page that a number begins, so that their paragraphs break."""
    return [text.count("\n", 0, found.start()) + 1 for found in BEGINS_A_LINE.finditer(text)]


def main(words: Sequence[str] | None = None) -> int:
    """Do what the options say, those of the command line where none are given; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing, exit 1 if a page differs")
    parser.add_argument("--remake", nargs="*", choices=list(SOURCES), metavar="NAME", help=", ".join(SOURCES))
    parser.add_argument("--compare", type=Path, metavar="FILE", help="what README's command printed")
    arguments = parser.parse_args(words)
    store = json.loads(STORE.read_text(encoding="utf-8"))
    if arguments.compare:
        return compare(arguments.compare.read_text(encoding="utf-8"), store["run"])
    if arguments.remake is not None:
        for name in arguments.remake or SOURCES:
            store[name] = make(name)
            store = {source: store[source] for source in SOURCES if source in store}  # in the order of the list
            STORE.write_text(json.dumps(store, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    broken = [f"{page.relative_to(ROOT)}:{line}" for page in PAGES for line in broken_lines(page.read_text("utf-8"))]
    for place in broken:
        print(f"{place}: expected a word before the number of a run, whose comment breaks the paragraph here")
    store = known(store)
    differing_pages = [
        page for page in PAGES if written(page.read_text(encoding="utf-8"), store) != page.read_text(encoding="utf-8")
    ]
    for page in differing_pages:
        print(f"{page.relative_to(ROOT)}: {'differs from what is stored' if arguments.check else 'written'}")
        if not arguments.check:
            page.write_text(written(page.read_text(encoding="utf-8"), store), encoding="utf-8")
    return 1 if broken or (arguments.check and differing_pages) else 0


if __name__ == "__main__":
    sys.exit(main())
