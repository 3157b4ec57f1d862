"""What studies say, asked in Python: verdicts, reports and states as tables in every form."""

from dataclasses import replace

import pytest

from metrics import CLAIMS, CurveError, verdict
from metrics.claims import INTUITIONS
from metrics.claims.claim import READINGS
from swarm_forage_env.studies.description import paper_sets, status
from swarm_forage_env.studies.study_file import Axis
from tests.support.made_tables import made_study, made_table


def table_of(**lost):
    return made_table(made_study(), lambda place: 10.0 * place.values[-1], **lost)


def test_a_verdict_is_a_table_per_variant_and_what_waits():
    told = []
    found = verdict(table_of(), tell=told.append)
    assert told == ["scoring S1a"]
    titles = [sheet.title for sheet in found.sheets()]
    assert titles[:3] == ["how many claims, measures corrected", "all claims at a glance", "what the paper expected"]
    assert titles[3:5] == ["without any run", "rules described, measures corrected"]
    assert titles[-1] == "These claims and intuitions (H) wait:"
    assert [one["claim"] for one in found.to_mapping()["verdicts"]][:2] == ["V1", "V2"]
    assert "| claim | text |" in found.markdown()


def test_claims_are_counted_and_at_a_glance_under_both_rules_of_two_studies():
    program = made_table(made_study(rules=("program",)), lambda place: 10.0 * place.values[-1])
    found = replace(verdict(table_of(), program), is_short=True)
    counts, claims, intuitions = found.sheets()
    assert tuple(counts.frame.columns) == (
        "rules",
        "supported",
        "contradicted",
        "tie",
        "too vague",
        "undecided",
        "no scores",
        "waits",
    )
    assert [row[0] for row in counts.frame.rows()] == ["described", "program"]
    assert {sum(map(int, row[1:])) for row in counts.frame.rows()} == {len(CLAIMS)}
    assert tuple(claims.frame.columns[2:]) == tuple(
        f"{rules}: {word}"
        for rules in ("described", "program")
        for word in ("the paper's bands", "ours", "ours, relative")
    )
    told = found.to_mapping()["counts"]["program"]
    assert [str(n) for n in told.values()] == list(counts.frame.rows()[1][1:])
    answers = {row[0]: row[2:] for row in claims.frame.rows()}
    assert answers["P2"] == ("tie", "tie", "") * 2, "all four achieve the same"
    assert answers["V1"] == ("supported", "supported", "") * 2
    assert answers["D5"] == ("too vague", "too vague", "") * 2
    assert answers["R1"] == ("waits", "waits", "") * 2
    assert len(intuitions.frame.rows()) == len(INTUITIONS)


def test_claims_about_distances_are_read_relative_and_of_mean_curves():
    spec = made_study("S1e", Axis(name="noise", values=(0.0, 0.01, 0.02, 0.03)), reference=0.0)
    found = verdict(made_table(spec, lambda place: 10.0 * (1.0 - 10.0 * place.values[-1])))
    (tie,) = [one for one in found.judged if one.claim.name == "N1" and one.variant == "corrected"]
    assert list(tie.verdict.otherwise) == list(READINGS)[:3]
    assert {other.answer for other in tie.verdict.otherwise.values()} == {"supported"}
    (row,) = [row for sheet in found.sheets()[4:] for row in sheet.frame.rows() if row[0] == "N1"][:1]
    assert row[-1] == "of mean curves: supported\nof mean curves, relative to performance: supported"


def test_a_study_under_the_same_rules_twice_is_refused():
    with pytest.raises(CurveError, match=r"once under the same rules, got S1a \(described\), S1a \(described\)"):
        verdict(table_of(), table_of())


def test_a_verdict_needs_one_of_the_papers_sets():
    other = made_table(made_study("mine"), lambda place: 1.0)
    with pytest.raises(CurveError, match="'swarm-forage study plot' takes any study"):
        verdict(other)


def test_a_status_tells_what_is_missing():
    spec = made_study()
    found = status(table_of(lost={(spec.places[0], spec.seeds[0])}))
    assert not found.is_complete
    assert found.sheets()[0].title.endswith(", 1 missing")
    assert found.sheets()[1].frame.columns[:2] == ["rules", "policy"]
    assert found.sheets()[1].frame.rows()[0][:2] == ("described", "crw")


def test_sets_and_studies_are_described():
    sets = {row["set"]: row for row in paper_sets("reduced").frame.to_dicts()}
    assert sets["S2a"]["left out"] == "walk_probability 0.026; population_size 460, 627, 819"
