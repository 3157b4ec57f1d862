"""The blessed study: what the controllers did when somebody last looked, held against what they do now."""

from pathlib import Path

import polars as pl
import pytest

from metrics.scoring import diff_studies
from swarm_forage_env.study.study_file import load_study
from swarm_forage_env.study.study_run import StudyFolder, run_study
from swarm_forage_env.study.study_table import StudyTable, gather_study, read_study

BLESSED = Path(__file__).parent.parent / "support"


def test_the_file_holds_the_runs_that_its_study_describes():
    """Their identities are stored: what becomes part of an identity later must leave those of old runs as they are."""
    table = read_study(BLESSED / "blessed.parquet")
    planned = load_study(BLESSED / "blessed.toml").expand()
    assert table.frame["run_id"].unique(maintain_order=True).to_list() == [run.run_id for run in planned]
    assert table.spec.study_id == load_study(BLESSED / "blessed.toml").study_id


@pytest.mark.compiled
def test_controllers_do_what_they_did(tmp_path):
    """Other versions of numpy change the last bits, a change of the code may, too; neither may change the science."""
    folder = StudyFolder(tmp_path)
    run_study(load_study(BLESSED / "blessed.toml"), folder, jobs=1)
    found = diff_studies(read_study(BLESSED / "blessed.parquet"), gather_study(folder))
    assert (len(found.cells), found.lacking) == (16, ())
    significant = [shift for shift in found.shifts if shift.is_significant]
    assert not found.differs, f"see tests/support/blessed.toml: {significant}"


def changed(table, policy, column, factor):
    """The table with each run of a cell in place of another, as if chance were new, and a column of a policy scaled."""
    seeds = {seed: table.spec.seeds[number - 1] for number, seed in enumerate(table.spec.seeds)}
    cells = [number for number, cell in enumerate(table.spec.cells) if cell.policy == policy]
    scaled = pl.when(pl.col("cell").is_in(cells)).then(factor).otherwise(1.0) * pl.col(column)
    frame = table.frame.with_columns(seed=pl.col("seed").replace_strict(seeds), **{column: scaled})
    return StudyTable(spec=table.spec, frame=frame.sort("cell", "seed", "interval"), versions=table.versions)


@pytest.mark.parametrize("policy", ["crw", "dpo", "stochm"])
def test_a_policy_that_lost_a_third_of_its_performance_would_be_found(policy):
    blessed = read_study(BLESSED / "blessed.parquet")
    assert not diff_studies(blessed, changed(blessed, policy, "performance", 1.0)).differs, "it is not always red"
    lines = diff_studies(blessed, changed(blessed, policy, "performance", 0.7)).lines
    assert ("performance", policy) in {(line.column, line.place[1]) for line in lines if line.is_significant}


@pytest.mark.parametrize("policy", ["stochm", "stochx"])
def test_caches_that_nobody_uses_any_more_would_be_found(policy):
    blessed = read_study(BLESSED / "blessed.parquet")
    lines = diff_studies(blessed, changed(blessed, policy, "cache_pickups", 0.0)).lines
    assert ("cache_pickups", policy) in {(line.column, line.place[1]) for line in lines if line.is_significant}
