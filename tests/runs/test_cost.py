"""What a study costs, from a moment of each kind of run."""

from dataclasses import replace

import numpy as np
import pytest

from swarm_forage_env.runs import cost as calibration
from swarm_forage_env.runs.cost import Cost, MeasuredCost, calibrate, kind_of
from swarm_forage_env.studies.study import RULES_NAMES, Axis
from tests.support.tiny_study import tiny_study

STUDY = tiny_study(
    axes=(Axis(name="population_size", values=(1, 2, 4, 8, 16)), Axis(name="noise", values=(0.0, 0.02))),
    reference=None,
)


def test_costs_between_measured_sizes_are_in_proportion():
    cost = Cost(n_robots=np.array([2.0, 10.0]), start_s=np.array([0.0, 8.0]), tick_s=np.array([0.1, 0.9]))
    place = STUDY.places[4]
    (spec, _) = STUDY.specs_of(place)
    assert (spec.scenario.robots.n_robots, spec.scenario.horizon_ticks) == (4, 20)
    assert cost.seconds(spec) == pytest.approx(2.0 + 0.3 * 20)


def test_what_runs_took_tells_what_others_will_take():
    """Per robot-tick: of the same kind, else of the same policy, else of all."""
    spec_of = {(place.policy, *place.values): STUDY.specs_of(place)[0] for place in STUDY.places}
    known, noisy, other = spec_of["random", 4, 0.0], spec_of["random", 8, 0.02], spec_of["twin", 16, 0.0]
    cost = MeasuredCost()
    assert cost.seconds([known]) is None
    cost.add(known, 4.0)
    assert cost.seconds([known, spec_of["random", 16, 0.0]]) == pytest.approx(4.0 + 16.0)
    assert cost.seconds([noisy]) == pytest.approx(8.0), "the policy took so long elsewhere"
    cost.add(noisy, 80.0)
    assert cost.seconds([spec_of["random", 1, 0.02]]) == pytest.approx(10.0)
    assert cost.seconds([known]) == pytest.approx(4.0), "without noise it is as quick as before"
    assert cost.seconds([other]) == pytest.approx(16 * 84.0 / 12), "static caches are new, the policy is not"
    assert cost.seconds([]) == 0.0


def test_a_policy_of_which_nothing_is_known_takes_what_all_others_take():
    quick, slow, unknown = (replace(STUDY.plan.specs[0], policy=policy) for policy in ("a", "b", "c"))
    cost = MeasuredCost()
    for spec, seconds in ((quick, 1.0), (quick, 1.0), (slow, 10.0)):
        cost.add(spec, seconds)
    assert cost.seconds([unknown]) == pytest.approx(4.0), "the mean of the three"
    assert cost.seconds([quick, slow]) == pytest.approx(11.0)


def test_three_sizes_of_every_kind_are_measured(monkeypatch):
    told = []
    monkeypatch.setattr(calibration, "MEASURE_S", 0.001)
    costs = calibrate(STUDY.plan.specs, tell=told.append)
    assert set(costs) == {kind_of(run) for run in STUDY.plan.specs}
    assert len(costs) == 4, "two kinds of caches, with and without noise"
    for cost in costs.values():
        assert cost.n_robots.tolist() == [1.0, 4.0, 16.0]
        assert (cost.tick_s > 0.0).all()
        assert (cost.start_s > 0.0).all()
    assert len(told) == 12


def test_rules_and_walking_objects_are_kinds_of_their_own():
    """The authors' program and objects that walk are other code in every tick."""
    worlds = tiny_study(
        axes=(Axis(name="walk_probability", values=(0.0, 0.001, 0.051)),), reference=None, rules=tuple(RULES_NAMES)
    )
    kinds = {place: kind_of(worlds.specs_of(place)[0]) for place in worlds.places if place.policy == "random"}
    assert len(set(kinds.values())) == 4, "two sets of rules, with objects that stay and objects that walk"
    assert all(
        (kinds[a] == kinds[b]) == (a.rules == b.rules and bool(a.values[0]) == bool(b.values[0]))
        for a in kinds
        for b in kinds
    )


def test_a_run_that_is_short_is_measured_to_its_end():
    one = replace(STUDY, axes=(), horizon_s=2.0)
    costs = calibrate(one.plan.specs[:1])
    assert costs[kind_of(one.plan.specs[0])].tick_s > 0.0
