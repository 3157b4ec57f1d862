"""What studies say of the paper's claims."""

from types import SimpleNamespace

import pytest

from metrics import CLAIMS, CurveError, verdict
from metrics.claims import INTUITIONS
from metrics.scoring import StudyVerdict
from swarm_forage_env.studies.results import StudyTable
from swarm_forage_env.studies.study import load_study
from swarm_forage_env.studies.study_file import Axis
from tests.support.made_tables import made_study, made_table

SIMPLE_FIRST = {"crw": 10.0, "dpo": 11.0, "stochm": 5.0, "stochx": 4.0}


def by_policy(place):
    return SIMPLE_FIRST[place.policy] * place.values[-1]


def answers(found, **where):
    mine = found.frame.filter("is_main", **where)
    return dict(mine.select("claim", "answer").iter_rows())


@pytest.fixture(scope="module")
def both():
    """Of two studies of one set, each under its own rules."""
    told = []
    program = made_table(made_study(rules=("program",)), by_policy)
    found = verdict(made_table(made_study(), by_policy), program, tell=told.append)
    assert told == ["scoring S1a"] * 2
    return found


def test_claims_are_answered_under_all_rules_and_in_all_readings(both):
    found = answers(both, rules="program")
    assert (found["P2"], found["R1"], found["V1"], found["D5"]) == ("supported", "no runs", "supported", "untestable")
    assert both.frame.filter(claim="P2", rules="described")["reading"].to_list() == ["amounts", "bands"]
    assert both.frame.filter(claim="R1", rules="described")["reading"].to_list() == ["amounts", "shares", "bands"]
    lacking = both.frame.filter("is_main", claim="D2", rules="program")["why"].to_list()
    assert lacking == ["no runs of S1h population robustness; no runs of S1b task emergence, S1h population robustness"]
    row = both.frame.filter(claim="P2", rules="described", reading="amounts").row(0, named=True)
    assert [row[name] for name in ("claimed", "reversed", "tied", "open", "n_runs")] == [12, 0, 0, 0, 6]
    assert [row[f"at_{margin}"] for margin in ("0.025", "0.05", "0.1", "0.2")] == ["supported"] * 4
    (part,) = both.parts.filter(claim="P2", rules="described", reading="amounts").iter_rows(named=True)
    assert (part["statement"], part["where"]) == ("crw, dpo - stochm, stochx", "S1a raw performance")
    assert part["mean"] == pytest.approx((10.5 - 4.5) / 7.5, rel=0.02)
    assert part["p"] < 0.001


def test_claims_are_counted_and_at_a_glance(both):
    counts, claims, intuitions, behind, waiting = both.sheets()
    assert counts.frame["rules"].to_list() == ["described", "program"]
    assert {sum(row[1:]) for row in counts.frame.rows()} == {len(CLAIMS)}
    shown = {row[0]: row[2:] for row in claims.frame.rows()}
    assert shown["P2"] == ("supported", "", "supported") * 2
    assert shown["D5"] == ("untestable", "", "untestable") * 2
    assert "R1" not in shown
    assert claims.notes == [f"{len(CLAIMS) - len(shown)} of {len(CLAIMS)} wait for runs."]
    assert intuitions.notes == [f"{len(INTUITIONS)} of {len(INTUITIONS)} wait for runs."]
    assert {"P2", "V1"} <= {*behind.frame["claim"]}
    assert any("no runs of S1e noise robustness" in line for line in waiting.notes)
    told = both.to_mapping()
    assert told["counts"]["program"]["no runs"] == counts.frame["no runs"][1]
    assert [row["n_runs"] for row in told["claims"] if row["claim"] == "V1"] == [0] * 4


def test_claims_about_distances_are_read_as_shares_too():
    spec = made_study("S1e", Axis(name="noise", values=(0.0, 0.01, 0.02, 0.03)), reference=0.0)
    found = verdict(made_table(spec, lambda place: 10.0 * (1.0 - 10.0 * place.values[-1])))
    mine = found.frame.filter(claim="N1")
    assert mine.select("reading", "tied").rows() == [("amounts", 3), ("shares", 3), ("bands", 3)]
    assert mine.filter("is_main")["reading"].to_list() == ["shares"]


def test_the_opposite_order_contradicts_and_no_run_decides_nothing():
    heights = dict(zip(SIMPLE_FIRST, reversed(SIMPLE_FIRST.values()), strict=True))
    table = made_table(made_study(), lambda place: heights[place.policy])
    assert answers(verdict(table))["P2"] == "contradicted"
    nothing = StudyTable(spec=table.spec, frame=table.frame.clear(), versions=())
    assert answers(verdict(nothing))["P2"] == "no runs"


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
