"""What studies say, asked in Python: verdicts, reports and states as tables in every form."""

import json

import pytest

from metrics import CurveError, report, verdict
from swarm_forage_env.studies.description import describe, paper_sets, status
from tests.support.made_tables import made_study, made_table


def table_of(**lost):
    return made_table(made_study(), lambda place: 10.0 * place.values[-1], **lost)


def test_a_verdict_is_a_table_per_variant_and_what_waits():
    told = []
    found = verdict(table_of(), tell=told.append)
    assert told == ["scoring S1a"]
    titles = [sheet.title for sheet in found.sheets()]
    assert titles[:2] == ["from formulas alone", "rules described, measures corrected"]
    assert titles[-1] == "These claims and intuitions (H) wait:"
    assert [one["claim"] for one in found.to_mapping()["verdicts"]][:2] == ["V1", "V2"]
    assert "| claim | text |" in found.markdown()


def test_a_verdict_needs_one_of_the_papers_sets():
    other = made_table(made_study("mine"), lambda place: 1.0)
    with pytest.raises(CurveError, match="'swarm-forage study plot' and 'report' take any study"):
        verdict(other)


def test_a_report_has_its_tables_in_every_form(tmp_path):
    pytest.importorskip("matplotlib")
    found = report(table_of())
    titles = [sheet.title for sheet in found.sheets()]
    assert titles[:2] == ["claims", "intuitions"]
    assert titles[-3:] == ["what it took", "versions", "make the runs again"]
    for ending in ("md", "txt", "csv", "json"):
        found.write(tmp_path / f"report.{ending}")
    assert "**claims**" in (tmp_path / "report.md").read_text()
    tables = json.loads((tmp_path / "report.json").read_text())["tables"]
    assert tables[0]["header"][:2] == ["name", "text"]


def test_a_status_tells_what_is_missing():
    spec = made_study()
    found = status(table_of(lost={(spec.places[0], spec.seeds[0])}))
    assert not found.is_complete
    assert found.headline.endswith(", 1 missing")
    assert found.sheets()[1].header[:2] == ("rules", "policy")
    assert found.sheets()[1].rows[0][:2] == ("described", "crw")


def test_sets_and_studies_are_described():
    sets = paper_sets("reduced").to_mapping()["sets"]
    assert sets["S2a"]["left_out"]["walk_probability"] == ["0.026"]
    assert describe(made_study()).to_mapping()["n_conditions"] == len(made_study().places)
