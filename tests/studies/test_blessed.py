"""The blessed study: what the controllers did when somebody last looked, held against what they do now."""

from pathlib import Path

import polars as pl
import pytest

from metrics.scoring import diff
from swarm_forage_env.studies.study_file import load_study
from swarm_forage_env.studies.study_folder import StudyFolder, run_study
from swarm_forage_env.studies.study_table import StudyTable, gather_study, read_study

BLESSED = Path(__file__).parent.parent / "support"
NAMES = {"blessed": 8, "blessed_noise": 4}
"""Study -> how many conditions it has."""


@pytest.mark.parametrize("name", NAMES)
def test_the_file_holds_the_runs_that_its_study_describes(name):
    """Their identities are stored: what becomes part of an identity later must leave those of old runs as they are."""
    table = read_study(BLESSED / f"{name}.parquet")
    planned = load_study(BLESSED / f"{name}.toml").plan.specs
    assert table.frame["run_id"].unique(maintain_order=True).to_list() == [run.run_id for run in planned]
    assert table.spec.study_id == load_study(BLESSED / f"{name}.toml").study_id


@pytest.mark.compiled
@pytest.mark.parametrize(("name", "n_places"), NAMES.items())
def test_controllers_do_what_they_did(tmp_path, name, n_places):
    """Other versions of numpy change the last bits, a change of the code may, too; neither may change the science."""
    folder = StudyFolder(tmp_path)
    run_study(load_study(BLESSED / f"{name}.toml"), folder, jobs=1)
    found = diff(read_study(BLESSED / f"{name}.parquet"), gather_study(folder))
    assert (len(found.places), found.lacking) == (n_places, ())
    significant = [shift for shift in found.shifts if shift.is_significant]
    assert not found.differs, f"see tests/support/blessed.toml: {significant}"


def changed(table, policy, column, factor):
    """The table with runs of a condition in place of each other, as by chance, and a column of a policy scaled."""
    seeds = {seed: table.spec.seeds[number - 1] for number, seed in enumerate(table.spec.seeds)}
    places = [number for number, place in enumerate(table.spec.places) if place.policy == policy]
    scaled = pl.when(pl.col("cell").is_in(places)).then(factor).otherwise(1.0) * pl.col(column)
    frame = table.frame.with_columns(seed=pl.col("seed").replace_strict(seeds), **{column: scaled})
    return StudyTable(spec=table.spec, frame=frame.sort("cell", "seed", "interval"), versions=table.versions)


def found_in(table, policy, column, factor):
    """Rules in which a policy's column is said to differ, in shares of the rules that there are."""
    found = diff(table, changed(table, policy, column, factor))
    places = {shift.words[:2] for shift in found.shifts if shift.is_significant and shift.column == column}
    assert {place[1] for place in places} <= {policy}, "no other policy is blamed"
    return len(places) / len(table.spec.rules)


@pytest.mark.parametrize(
    ("policy", "column", "factor", "least"),
    [
        *((policy, "performance", 0.7, 1.0) for policy in ("crw", "dpo", "stochm")),
        ("stochx", "performance", 0.3, 1.0),
        ("stochm", "cache_pickups", 0.0, 1.0),
        ("stochx", "cache_pickups", 0.0, 0.5),  # in the program's rules it seldom uses one so early
    ],
)
def test_a_policy_that_lost_what_it_can_do_would_be_found(policy, column, factor, least):
    """A third of its deliveries; of STOCHX, whose runs scatter most, two thirds; all use of caches."""
    blessed = read_study(BLESSED / "blessed.parquet")
    assert found_in(blessed, policy, column, 1.0) == 0.0, "it is not always red"
    assert found_in(blessed, policy, column, factor) >= least
