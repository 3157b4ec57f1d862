"""What studies say of the paper's claims."""

from types import SimpleNamespace

import polars as pl
import pytest

from metrics import CLAIMS, CurveError, verdict
from metrics.claims import INTUITIONS
from metrics.scoring import StudyVerdict
from swarm_forage_env.studies.description import status
from swarm_forage_env.studies.results import StudyTable
from swarm_forage_env.studies.study import load_study
from swarm_forage_env.studies.study_file import Axis
from tests.support.made_tables import made_study, made_table

SIMPLE_FIRST = {"crw": 10.0, "dpo": 11.0, "stochm": 5.0, "stochx": 4.0}


def by_policy(place):
    return SIMPLE_FIRST[place.policy] * place.values[-1]


def answers(found, **where):
    return {row["claim"]: row["answer"] for row in found.frame.filter(sense="", **where).iter_rows(named=True)}


@pytest.fixture(scope="module")
def both():
    """Of two studies of one set, each under its own rules."""
    told = []
    program = made_table(made_study(rules=("program",)), by_policy)
    found = verdict(made_table(made_study(), by_policy), program, tell=told.append)
    assert told == ["scoring S1a"] * 2
    return found


def test_claims_are_answered_under_all_rules_and_in_all_variants(both):
    corrected = answers(both, rules="program", measures="corrected")
    assert corrected["P2"] == "supported"
    assert corrected["R1"] == "waits"
    paper = answers(both, rules="described", measures="paper")
    assert "P2" not in paper, "performance has one variant"
    assert paper.keys() >= {"E1", "E2", "E3"}
    assert answers(both, rules="")["V1"] == "supported"
    lacking = both.frame.filter(claim="D2", rules="program", measures="corrected")["why"].to_list()
    assert lacking == ["S1h, S1b"]


def test_claims_are_counted_and_at_a_glance(both):
    counts, claims, intuitions, behind, waiting = both.sheets()
    assert counts.frame["rules"].to_list() == ["described", "program"]
    assert {sum(row[1:]) for row in counts.frame.rows()} == {len(CLAIMS)}
    shown = {row[0]: row[2:] for row in claims.frame.rows()}
    assert shown["P2"] == ("supported", "supported", "") * 2
    assert shown["D5"] == ("too vague", "too vague", "") * 2
    assert "R1" not in shown
    assert claims.notes == [f"{len(CLAIMS) - len(shown)} of {len(CLAIMS)} wait for runs."]
    assert intuitions.notes == [f"{len(INTUITIONS)} of {len(INTUITIONS)} wait for runs."]
    assert {"P2", "V1"} <= {*behind.frame["claim"]}
    assert any(line.endswith(": for S1e, S1f") for line in waiting.notes)
    told = both.to_mapping()
    assert told["counts"]["program"]["waits"] == counts.frame["waits"][1]
    assert [row["effect"] for row in told["claims"] if row["claim"] == "V1"] == [None]


def test_claims_about_distances_are_read_relative_and_of_mean_curves():
    spec = made_study("S1e", Axis(name="noise", values=(0.0, 0.01, 0.02, 0.03)), reference=0.0)
    found = verdict(made_table(spec, lambda place: 10.0 * (1.0 - 10.0 * place.values[-1])))
    senses = found.frame.filter(claim="N1", measures="corrected")
    assert senses["sense"].to_list() == [
        "",
        "relative to performance",
        "of mean curves",
        "of mean curves, relative to performance",
    ]
    assert {*senses["answer"]} == {"supported"}
    assert found.at_a_glance({"N1": CLAIMS["N1"]})[0][2:] == ("supported",) * 3


def test_the_opposite_order_contradicts_and_no_run_decides_nothing():
    heights = dict(zip(SIMPLE_FIRST, reversed(SIMPLE_FIRST.values()), strict=True))
    table = made_table(made_study(), lambda place: heights[place.policy])
    assert answers(verdict(table), measures="corrected")["P2"] == "contradicted"
    nothing = StudyTable(spec=table.spec, frame=table.frame.clear(), versions=())
    assert answers(verdict(nothing), measures="corrected")["P2"] == "no scores"


def test_a_claim_may_need_two_studies():
    found = verdict(*(made_table(made_study(name), by_policy) for name in ("S1a", "S1b")))
    answered = found.frame.filter(pl.col("answer") != "waits")["claim"]
    assert {"H1", "H3", "H12"} <= {*answered}


def test_search_and_rescue_needs_no_lone_robot_and_what_cannot_be_computed_is_told():
    def of_sizes(*sizes):
        axes = (Axis(name="walk_probability", values=(0.001,)), Axis(name="population_size", values=sizes))
        return verdict(made_table(made_study("S2a", *axes), by_policy)).frame.filter(claim="E9", sense="")

    found = of_sizes(12, 51)
    assert found["measures"].to_list() == ["corrected", "paper"]
    assert "waits" not in found["answer"]
    assert "(described, corrected: there is one swarm size only" in of_sizes(2)["why"][0]


@pytest.mark.parametrize(
    ("specs", "message"),
    [
        ([made_study(), made_study()], r"Expected each study once under the same rules, got S1a \(described\), S1a"),
        ([made_study("mine")], "sets, S1a, .*; got study 'mine'. 'swarm-forage study plot' takes any study"),
        (
            [made_study(policies=({"policy": "random", "label": "crw"},))],
            "Expected scores of dpo, got those of crw",
        ),
    ],
)
def test_what_no_claim_is_about_is_refused(specs, message):
    with pytest.raises(CurveError, match=message):
        verdict(*(made_table(spec, by_policy) for spec in specs))


def test_what_sets_have_less_of_than_the_paper_is_told_in_a_line():
    """A second: it reads sets."""

    def told(budget, *names):
        tables = tuple(SimpleNamespace(spec=load_study(name, budget)) for name in names)
        return StudyVerdict(tables=tables).remarks

    assert told("reduced", "S1a", "S1c") == ("S1c: budget reduced, without throttle 0.2, 0.35",)
    assert told("paper", "S1a", "S1c") == ()
    (smoke,) = told("smoke", "S1a")
    assert smoke.startswith("S1a: budget smoke, runs of 1,000 s instead of 10,000 s, without population_size ")
    *_, looks = StudyVerdict(tables=(SimpleNamespace(spec=load_study("S1a").with_run(looks=(2, 4))),)).remarks
    assert looks.startswith("S1a: judged after 2, 4 runs")


def test_a_status_tells_what_is_missing():
    spec = made_study()
    found = status(made_table(spec, by_policy, lost={(spec.places[0], spec.seeds[0])}))
    assert not found.is_complete
    assert found.sheets()[0].title.endswith(", 1 missing")
    assert found.sheets()[1].frame.rows()[0][:2] == ("described", "crw")
