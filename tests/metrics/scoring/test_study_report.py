"""The last part of the report: which versions made the runs, and the command that makes them again."""

from dataclasses import replace

from metrics.scoring.study_report import command_of, version_names
from swarm_forage_env.studies.study_file import load_study
from swarm_forage_env.studies.study_folder import StudyFolder
from tests.support.made_tables import made_study, made_table

FILE = 'name = "mine"\nscenario = "warehouse_small"\npolicies = [{words}]\nrules = ["described"]\n[budget.tiny]\n'


def table_of(spec):
    return replace(made_table(made_study(), lambda place: 1.0), spec=spec)


def test_a_commit_is_shown_where_runs_have_one():
    table = made_table(made_study(), lambda place: 1.0)
    installed = replace(table, versions=({"commit": "", "numpy": "2", "swarm-forage-env": "0.1.0"},))
    assert version_names([installed]) == ["swarm-forage-env", "numpy"]
    checkout = replace(table, versions=({"commit": "abc", "numpy": "2", "swarm-forage-env": "0.1.0"},))
    assert version_names([installed, checkout]) == ["swarm-forage-env", "commit", "numpy"]


def test_the_command_names_the_file_of_the_study(tmp_path):
    place = tmp_path / "my studies" / "mine.toml"
    place.parent.mkdir()
    place.write_text(FILE.format(words='"crw"') + "seeds = 2\n")
    spec = load_study(place, seeds=3)
    folder = StudyFolder(tmp_path / "done")
    folder.take(spec)
    again = folder.study()
    assert again.file == str(place)
    words = f"swarm-forage study run '{place}' --budget tiny --seeds 3 --rules described"
    assert command_of(table_of(again)) == f"{words}  # study mine, identity {spec.study_id}"
    other = place.rename(tmp_path / "moved.toml")
    assert folder.take(load_study(other)).file == str(other), "the same study, wherever its file is"
    assert load_study(other, seeds=3).study_id == spec.study_id
    assert replace(spec, file="") == spec


def test_the_command_leaves_chosen_seeds_to_the_budget_and_trusts_code(tmp_path):
    (tmp_path / "my_module.py").write_text(
        "class Mine:\n    def reset(self, spec, rng): ...\n    def act(self, obs, active): ...\n"
    )
    place = tmp_path / "mine.toml"
    place.write_text(FILE.format(words='"mixed:my_module.py:Mine=1,crw=rest"') + "seeds = [3, 5]\n")
    told = command_of(table_of(load_study(place)))
    assert told.startswith(f"swarm-forage --trust-models study run {place} --budget tiny --rules described")


def test_sets_of_the_paper_go_by_their_names():
    spec = load_study("S1a", "smoke")
    assert spec.file == ""
    assert "file" not in spec.to_mapping()
    assert command_of(table_of(spec)) == "swarm-forage study run S1a --budget smoke --seeds 2 --rules both"


def test_a_study_made_in_python_has_no_file():
    spec = replace(made_study(), name="mine")
    assert command_of(table_of(spec)).startswith("swarm-forage study run FILE ")
