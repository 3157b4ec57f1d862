"""Studies that run until claims are decided: tiny runs, and forecasts of made scores."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from metrics import CurveError, verdict
from metrics.claims import CLAIMS, Panel, PanelName
from metrics.claims.looks import LOOKS
from metrics.scoring import Outlook, run_until_decided, study_panels, until_decided
from metrics.scoring.open_claims import both_forms, open_claim
from swarm_forage_env.runs import runner
from swarm_forage_env.runs.cost import MeasuredCost
from swarm_forage_env.runs.policy_spec import PolicySpec, policy_specs
from swarm_forage_env.runs.record import RecordError
from swarm_forage_env.studies.description import status
from swarm_forage_env.studies.study import Axis
from swarm_forage_env.studies.study_folder import StudyFolder, run_study
from swarm_forage_env.studies.study_table import read_study
from tests.support.made_tables import FOUR, made_study, made_table

FEW = (4, 8)
NOISE = PanelName("S1e", "noise_robustness")


def tiny(name="S1e", **changes):
    """A study of noise whose runs are two intervals of two seconds."""
    given = {"policies": policy_specs(FOUR), "horizon_s": 4.0, "interval_s": 2.0}
    given |= {"settings": {"n_objects": 20, "n_robots": 3, "physics": "compiled"}}
    return made_study(name, Axis(name="noise", values=(0.0, 0.02, 0.04)), reference=0.0, **given | changes)


def panels_of(means, *, reached=4, sd=0.2, n_levels=3):
    """A panel of noise with flat curves."""
    rng = np.random.default_rng(5)
    scores = {name: mean + sd * rng.normal(size=(n_levels, 16)) for name, mean in means.items()}
    panel = Panel(
        levels=np.arange(1.0, n_levels + 1.0),
        scores=scores,
        margins=np.full(n_levels, 0.2),
        looks=LOOKS,
        reached=dict.fromkeys(means, reached),
    )
    return {NOISE: panel}


def test_a_claim_has_a_forecast_of_the_runs_that_decide_it():
    equal = dict.fromkeys(FOUR, 1.0)
    found = open_claim(CLAIMS["N1"], False, panels_of(equal))
    assert found.words == "N1"
    assert 8 < found.n_runs <= 192
    assert [statement.policies for (statement,) in found.ways] == [("crw", "stochx")]
    assert open_claim(CLAIMS["N1"], False, panels_of(equal, reached=16, sd=0.01)) == "supported"  # a tie
    assert open_claim(CLAIMS["N1"], False, panels_of(equal, sd=9.0, n_levels=2)).n_runs is None
    assert open_claim(CLAIMS["N1"], False, {}) == "no scores"  # nothing to judge
    assert [is_relative for _, is_relative in both_forms([CLAIMS["N1"], CLAIMS["C1"]])] == [False, True, False]


def test_one_statement_that_fails_is_enough():
    """N2 says that two tie under weak noise and differ under strong noise; these are equal everywhere."""
    found = open_claim(CLAIMS["N2"], False, panels_of(dict.fromkeys(FOUR, 1.0), n_levels=6, sd=0.1))
    assert len(found.ways) == 1
    assert found.ways[0][0].parameters["levels"] == "high"


def test_a_study_runs_until_the_last_look(tmp_path, monkeypatch):
    monkeypatch.setattr(until_decided, "ROUND_S", 0.0)
    spec, folder = tiny(), StudyFolder(tmp_path / "S1e")
    told = []
    found = run_until_decided([(spec, folder)], hours=1.0, looks=FEW, jobs=1, tell=told.append)
    assert folder.study().looks == FEW
    assert max(found.reached.values()) in FEW
    assert {line.policy for line in found.reached} == set(FOUR)
    assert json.loads(found.json())["looks"] == list(FEW)
    assert "first look: S1e crw, dpo, stochm, stochx to 4 runs" in told[len(FOUR)]
    assert "scoring S1e described" in told
    table = read_study(folder.folder)
    table.write(tmp_path / "packed.parquet")
    panels = study_panels(read_study(tmp_path / "packed.parquet")).panels
    assert panels[0].looks == FEW
    assert dict(panels[0].reached) == {line.policy: n_runs for line, n_runs in found.reached.items()}
    words = f"looked at after {', '.join(map(str, FEW))} runs until claims are decided"
    assert words in verdict(table).remarks[-1]
    assert "Runs are made until claims are decided, looks after 4, 8." in str(status(table))
    again = run_until_decided([(spec, folder)], hours=1.0, looks=FEW, jobs=1, tell=told.append)
    assert again.reached == found.reached


def test_verdicts_take_the_levels_of_several_looks():
    """Two policies are within the margin by the interval of one look, and not by that of the first of seven."""
    axis = Axis(name="noise", values=(0.0, 0.02, 0.04))
    spec = made_study("S1e", axis, reference=0.0, seeds=tuple(range(4)))

    def performance(place):
        return 60.0 if place.values[0] == 0.0 else {"crw": 50.0, "stochx": 44.3}.get(place.policy, 45.0)

    once, several = (
        {name: found.verdict for name, found in verdicts_of(made_table(one, performance)).items()}
        for one in (spec, replace(spec, looks=LOOKS))
    )
    assert once["N1"].answer == "supported"
    assert several["N1"].answer != "supported"
    assert several["N1"].n_runs == once["N1"].n_runs == 4
    short = replace(spec, looks=LOOKS, seeds=tuple(range(3)))
    assert verdicts_of(made_table(short, performance))["N1"].verdict.answer in ("no scores", "undecided")


def verdicts_of(table):
    return {one.claim.name: one for one in verdict(table).judged if one.variant == "corrected"}


def test_what_was_interrupted_goes_on(tmp_path, monkeypatch):
    spec, folder = tiny(), StudyFolder(tmp_path / "S1e")
    run_study(replace(spec, seeds=(0, 1)), folder, jobs=1)
    made = runner.run_each

    def two(*args, **options):
        for number, outcome in enumerate(made(*args, **options)):
            if number == 2:
                raise KeyboardInterrupt
            yield outcome

    with monkeypatch.context() as patched:
        patched.setattr(runner, "run_each", two)
        with pytest.raises(KeyboardInterrupt):
            run_until_decided([(spec, folder)], hours=1.0, looks=FEW, jobs=1)
    assert len(folder.store.run_ids()) == 4 * 3 * 2 + 3
    dry = run_until_decided([(spec, folder)], hours=0.0, looks=FEW)
    assert set(dry.reached.values()) == {0}
    assert "before claims are judged, 4 runs of each condition are made" in str(dry)
    run_until_decided([(spec, folder)], hours=1.0, looks=FEW, jobs=1)
    assert len(folder.store.run_ids()) >= 4 * 3 * 4


def test_a_line_whose_runs_fail_gets_no_more(tmp_path):
    broken = PolicySpec(label="dpo", policy="random", parameters={"speed": 3})
    spec = tiny(policies=(*policy_specs(["crw", "stochm", "stochx"]), broken))
    found = run_until_decided([(spec, StudyFolder(tmp_path / "S1e"))], hours=1.0, looks=(4,), jobs=1)
    assert {line.policy: n_runs for line, n_runs in found.reached.items()} == {
        "crw": 4,
        "stochm": 4,
        "stochx": 4,
        "dpo": 0,
    }
    assert "Runs of S1e described dpo failed; it gets no more." in str(found)


def test_what_would_take_longer_than_the_time_is_not_begun(tmp_path, monkeypatch):
    spec, folder = tiny(), StudyFolder(tmp_path / "S1e")
    run_study(replace(spec, seeds=(0,)), folder, jobs=1)
    monkeypatch.setattr(MeasuredCost, "seconds", lambda self, specs: 1e6)
    found = run_until_decided([(spec, folder)], hours=1.0, looks=FEW, jobs=1)
    assert set(found.reached.values()) == {0}
    assert len(folder.store.run_ids()) == 4 * 3
    with ThreadPoolExecutor(1) as executor:  # how fast others are is not known before they have made a run
        assert run_until_decided([(spec, folder)], hours=1.0, looks=FEW, executor=executor).reached == found.reached


def test_nothing_is_left_to_decide():
    waiting = {("S1f",): ("N5",), ("S1c", "S1d"): ("X1", "X5")}
    found = Outlook(wanted=(), reached={}, looks=FEW, n_decided=7, n_unscored=1, waiting=waiting)
    assert str(found).splitlines() == [
        "decided: 7 of 8 answers to claims about these sets alone, under each of the rules, as they are and relative "
        "to performance; 1 without scores",
        "1 claim waits for S1f: N5",
        "2 claims wait for S1c, S1d: X1, X5",
    ]
    assert found.to_mapping()["waiting"][0] == {"for": ["S1f"], "claims": ["N5"]}


def test_claims_that_wait_for_other_sets_are_not_decided(tmp_path):
    found = run_until_decided([(tiny(), StudyFolder(tmp_path / "S1e"))], hours=1.0, looks=(4,), jobs=1)
    assert found.waiting[("S1f",)] == ("N5",)
    assert "1 claim waits for S1f: N5" in str(found)
    forms = [(claim, relative) for claim, relative in both_forms(CLAIMS.values()) if claim.panels]
    alone = [claim for claim, _ in forms if {name.experiment for name in claim.panels} == {"S1e"}]
    n_open = sum(one.open is not None for one in found.wanted)
    assert found.n_decided + found.n_unscored + n_open == len(alone) == 8
    assert f"decided: {found.n_decided} of 8 answers to claims about these sets alone" in str(found)


def test_a_dry_look_leaves_the_folder_alone(tmp_path):
    told = []
    found = run_until_decided([(tiny(), StudyFolder(tmp_path / "none"))], hours=0.0, tell=told.append)
    assert not (tmp_path / "none").exists()
    assert found.to_mapping()["open"][0]["core_hours"] > 0.0, "no run says what it takes, so policies are stepped"
    assert "each policy was stepped for a moment" in str(found)
    assert told == [f"measuring {name}, N = 3" for name in FOUR]
    folder = StudyFolder(tmp_path / "some")
    run_study(replace(tiny(), seeds=(0,)), folder, jobs=1)
    told.clear()
    assert "stepped" not in str(run_until_decided([(tiny(), folder)], hours=0.0, tell=told.append))
    assert told == []


def test_a_moment_is_too_short_for_any_run(tmp_path):
    """What runs take is known before the first one, so that none is begun that cannot end in time."""
    told = []
    spec = tiny(horizon_s=4000.0, interval_s=1000.0)
    found = run_until_decided([(spec, StudyFolder(tmp_path / "S1e"))], hours=1e-7, looks=FEW, jobs=1, tell=told.append)
    assert set(found.reached.values()) == {0}
    assert StudyFolder(tmp_path / "S1e").store.run_ids() == ()
    assert told[-1].startswith("0 runs made; nothing more is begun: 1 s left, and the least that is of use takes about")


def test_a_study_goes_on_with_the_looks_that_it_has(tmp_path):
    spec, folder = tiny(), StudyFolder(tmp_path / "S1e")
    folder.take(replace(spec, seeds=(0, 1, 2, 3), looks=FEW))
    for hours in (0.0, 1e-7):
        assert run_until_decided([(spec, folder)], hours=hours).looks == FEW
        with pytest.raises(RecordError, match=r"after 4, 8 runs, as .*study.json has them, got 4, 16\. .*--seeds 8 or"):
            run_until_decided([(spec, folder)], hours=hours, looks=(4, 16))
    with pytest.raises(RecordError, match="other horizon_s"):
        run_until_decided([(replace(spec, horizon_s=8.0), folder)], hours=0.0)


def test_what_cannot_be(tmp_path):
    spec, folder = tiny(), StudyFolder(tmp_path / "S1e")
    with pytest.raises(CurveError, match="each study once"):
        run_until_decided([(spec, folder), (spec, folder)], hours=0.0)
    with pytest.raises(CurveError, match="paper's sets"):
        run_until_decided([(tiny("mine"), folder)], hours=0.0)
    folder.take(replace(spec, looks=FEW))
    assert folder.take(spec).looks == FEW  # whoever runs more of it later does not forget that it was looked at


@pytest.mark.parametrize("damage", ["{", '"looks": [8, 4]', '"looks": ["often"]'])
def test_a_damaged_study_file_is_told(tmp_path, damage):
    folder = StudyFolder(tmp_path / "S1e")
    folder.take(replace(tiny(), looks=FEW))
    content = json.loads(folder.study_file.read_text())
    if damage != "{":
        content |= json.loads(f"{{{damage}}}")
    folder.study_file.write_text(damage if damage == "{" else json.dumps(content))
    with pytest.raises(RecordError, match="Cannot use"):
        run_until_decided([(tiny(), folder)], hours=1.0, looks=FEW)
