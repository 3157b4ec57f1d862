"""Congestion near caches: from tables of runs to scores, panels and the answer to the intuition about it."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from metrics.claims import INTUITIONS, PanelName
from metrics.scoring import judge_claims, study_panels
from metrics.scoring.measures import score_study
from metrics.scoring.run_curves import study_lines
from tests.support.made_tables import made_study, made_table

CONGESTED = INTUITIONS["H23"]
LOST = 100.0
SHARE = 4.0 * np.pi / (32.0 * 16.0)
"""Of the floor of the small warehouse that lies near one cache."""
N_CACHES = {"stochm": 1.0, "stochx": 2.0}


def tables_of(near, *, without=()):
    """Runs of S1a and S1b in three sizes, in which STOCHM loses such a share of its time near its single cache.

    A swarm of one robot is in no interference. STOCHX has two caches and loses hardly any near them, the others none.
    """
    tables = []
    for number, name in enumerate(("S1a", "S1b")):
        table = made_table(made_study(name, seeds=tuple(range(8))), lambda place: 10.0 * place.values[-1])
        places = [table.spec.places[cell] for cell in table.frame["cell"]]
        lost = np.array([LOST * (place.values[-1] > 1) for place in places])
        noise = 0.002 * np.random.default_rng(number).normal(size=len(places))
        shares = np.clip(noise + [near if place.policy == "stochm" else 0.0 for place in places], 0.0, 1.0)
        columns = {
            "interference_ticks": lost,
            "interference_ticks_near_caches": lost * shares,
            "n_caches": [N_CACHES.get(place.policy, 0.0) for place in places],
        }
        kept = {name: pl.Series(values) for name, values in columns.items() if name not in without}
        tables.append(replace(table, frame=table.frame.with_columns(**kept)))
    return tables


def judged(tables):
    return judge_claims(tables, [study_panels(one) for one in tables], ("corrected",), {"H23": CONGESTED})


def test_a_panel_has_the_runs_with_caches_and_interference():
    (panel,) = [one for one in study_panels(tables_of(0.6)[0]).panels if one.measure == "cache_congestion"]
    assert panel.name == PanelName("S1a", "cache_congestion")
    assert panel.x.tolist() == [1.0, 2.0, 4.0]
    assert np.isnan(panel.scores["stochm"][0]).all(), "one robot, no interference"
    np.testing.assert_allclose(panel.scores["stochm"][1:], 0.6 - SHARE, atol=0.01)
    np.testing.assert_allclose(panel.scores["stochx"][1:], -2.0 * SHARE, atol=0.01)
    assert np.isnan(panel.scores["crw"]).all(), "no caches"
    assert panel.for_claims().tie_margins.tolist() == [0.02] * 3


@pytest.mark.parametrize(("near", "answer"), [(0.6, "supported"), (SHARE, "tie"), (0.0, "contradicted")])
def test_the_intuition_is_held_against_an_even_spread(near, answer):
    (one,), waiting = judged(tables_of(near))
    assert (one.verdict.answer, waiting) == (answer, ()), one.verdict.why


def test_runs_without_the_column_let_the_intuition_wait_and_say_why():
    answers, (one,) = judged(tables_of(0.6, without=("interference_ticks_near_caches",)))
    assert answers == ()
    assert one.reasons == ("there is no column interference_ticks_near_caches for every swarm size",)


def test_policies_without_caches_have_no_panel():
    table = tables_of(0.6)[0]
    found = study_panels(replace(table, frame=table.frame.with_columns(n_caches=0.0)))
    assert "cache_congestion" not in {panel.measure for panel in found.panels}
    assert found.missing["cache_congestion", "corrected"] == "there is no cache in any run"
    assert ("cache_congestion", "corrected") not in study_panels(table).missing, "two policies have a panel"


def test_tables_of_scores_have_it_where_it_is_named():
    curves = next(line.curves for line in study_lines(tables_of(0.6)[0]) if line.policy == "stochm")
    assert "cache_congestion" not in {score.measure for score in score_study(curves)[0]}
    named, missing = score_study(curves, ["cache_congestion"])
    assert ([score.at for score in named], missing) == (["N = 1", "N = 2", "N = 4"], {})
    assert named[0].note == "undefined in 8 of 8 runs, which have no interference or no cache"
