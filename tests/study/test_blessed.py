"""The blessed study: what the controllers did when somebody last looked, held against what they do now."""

from pathlib import Path

import pytest

from metrics.scoring import diff_studies
from swarm_forage_env.study.study_file import load_study
from swarm_forage_env.study.study_run import StudyFolder, run_study
from swarm_forage_env.study.study_table import gather_study, read_study

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
