"""Does a swarm that delivers more also win rows of the benchmark's measures? The oracle beside the generalist.

    python scripts/oracle_rows.py               runs the oracle in all worlds of version 1; takes half an hour of a core
    python scripts/oracle_rows.py --out FOLDER  keeps the runs there, so that they need not be repeated

The oracle reads the world, so it is no contestant, and the benchmark refuses it. Here it is a yardstick.
"""

import argparse
from dataclasses import replace
from pathlib import Path

from metrics.benchmark.entry import Entry, read_entry
from metrics.benchmark.page import matched
from metrics.benchmark.protocol import Protocol, load_protocol
from metrics.benchmark.running import BenchmarkQuestion
from metrics.benchmark.standing import scripted_entries
from metrics.scoring.question import ask
from swarm_forage_env.runs.answer import Sheet
from swarm_forage_env.runs.plan import Plan
from swarm_forage_env.runs.policy_spec import policy_specs

GENERALIST = Path(__file__).parents[1] / "docs/benchmark/generalist.json"


def compared(entry: Entry, oracle: Entry, protocol: Protocol) -> Sheet:
    """Return the rows of each measure in which both are at least as good as the best of the four, and who does more."""
    sheet = matched([*scripted_entries(protocol), entry, oracle])
    n_more = sum(oracle.performance(of.name).mean() > entry.performance(of.name).mean() for of in protocol.scored)
    return replace(
        sheet,
        title="Rows of a measure in which they are at least as good as the best of the paper's four controllers",
        rows=[row for row in sheet.rows if row[0] in (entry.name, oracle.name)],
        notes=[f"{oracle.name} achieves more than {entry.name} in {n_more} of {len(protocol.scored)} held-out worlds."],
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, help="folder for runs")
    parser.add_argument("--jobs", type=int, help="processes (default: one per core)")
    words = parser.parse_args()
    protocol = load_protocol()
    plan = Plan.product(policy_specs(["oracle"]), [each.world for each in protocol.worlds], protocol.seeds)
    question = BenchmarkQuestion(plan=plan, name="oracle", protocol=protocol)
    oracle = ask(question, out=words.out, jobs=words.jobs)
    print(compared(read_entry(GENERALIST, protocol), oracle, protocol).text())


if __name__ == "__main__":
    main()
