"""Studies as data: conditions, runs, references, identity."""

from dataclasses import replace

import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs.plan import Plan
from swarm_forage_env.runs.spec import policy_spec
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.quirks import AUTHORS_PROGRAM, Quirks
from swarm_forage_env.studies.ladders import BUDGETS, plan_worlds, study_values, wrappers_at
from swarm_forage_env.studies.study import Place, study_of
from swarm_forage_env.studies.study_file import Axis
from swarm_forage_env.wrappers.noise import ActuatorNoiseConfig, SensorNoiseConfig
from swarm_forage_env.wrappers.waveform import Waveform
from tests.support.tiny_study import made_up_study


def study(*axes, **changes):
    return made_up_study(*axes, **{"seeds": (0, 1), "horizon_s": 400.0, "interval_s": 200.0} | changes)


def test_every_combination_is_a_place_and_every_place_has_all_seeds():
    spec = study(
        Axis(name="n_objects", values=(10, 20)),
        Axis(name="population_size", values=(1, 3)),
        policies=("crw", "stochm"),
        rules=("described", "program"),
        reference=1,
    )
    assert len(spec.places) == 2 * 2 * 2 * 2
    assert spec.places[0] == Place("described", "crw", (10, 1))
    assert spec.places[1] == Place("described", "crw", (10, 3))
    assert spec.places[-1] == Place("program", "stochm", (20, 3))
    assert len(spec.plan.specs) == 32
    assert len({run.run_id for run in spec.plan.specs}) == 32
    last = spec.specs_of(spec.places[-1])
    assert spec.plan.specs[-2:] == last
    assert spec.conditions[spec.places[-1]] == spec.plan.conditions[-1]
    assert [run.seed for run in last] == [0, 1]
    world = last[0].scenario
    assert (world.robots.n_robots, world.objects.n_objects, world.caches) == (3, 20, "static")
    assert (world.quirks, world.horizon_s, world.interval_s) == (AUTHORS_PROGRAM, 400.0, 200.0)
    assert spec.world(spec.places[0]).scenario.quirks == Quirks()
    assert spec.plan.robot_ticks == sum(run.robot_ticks for run in spec.plan.specs) == 8 * 2 * (1 + 3) * 2000


def test_the_reference_of_a_place_differs_on_the_last_axis_only():
    spec = study(Axis(name="population_size", values=(2, 4)), Axis(name="throttle", values=(0.0, 0.2)), reference=0.0)
    place = Place("described", "crw", (4, 0.2))
    assert spec.reference_of(place) == Place("described", "crw", (4, 0.0))
    assert spec.reference_of(place) in spec.places
    by_field = study(Axis(name="n_objects", values=(10, 20)))
    assert by_field.reference_of(by_field.places[0]) is None


@pytest.mark.parametrize("criterion", ["population_size", "throttle", "noise", "population_dynamics", "handling_cost"])
def test_the_runs_of_one_criterion_are_those_of_a_score(criterion):
    """One fact in one place: whoever scored a policy before finds its runs again."""
    world = scenario("warehouse_small", horizon_s=400.0)
    budget = replace(BUDGETS["paper"], horizon_s=400.0)
    planned = Plan.product([policy_spec("stochm")], plan_worlds(world, [criterion], budget), seeds=(0, 1)).specs
    values = study_values(world, criterion)
    spec = study(Axis(name=criterion, values=values), policies=("stochm",))
    assert {run.run_id for run in spec.plan.specs} == {run.run_id for run in planned}


def test_sizes_of_search_and_rescue_have_the_arenas_of_its_series():
    spec = study(Axis(name="population_size", values=(1, 12, 115)), scenario="search_and_rescue")
    worlds = [spec.world(place).scenario for place in spec.places]
    assert [(w.arena.width_m, w.robots.n_robots, w.objects.n_objects) for w in worlds] == [
        (16.0, 1, 80), (16.0, 12, 80), (48.0, 115, 368)]  # fmt: skip


def test_a_density_holds_for_all_sizes():
    spec = study(Axis(name="population_size", values=(1, 10, 40)), set={"density": 0.1})
    worlds = [spec.world(place).scenario for place in spec.places]
    areas = [w.arena.width_m * w.arena.height_m for w in worlds]
    assert areas[0] == areas[1], "one robot has the smallest arena of the others"
    assert areas[1] == pytest.approx(100.0, rel=0.1)
    assert areas[2] == pytest.approx(400.0, rel=0.1)
    spec = study(Axis(name="density", values=(0.05, 0.1)), set={"n_robots": 40})
    arenas = [spec.world(place).scenario.arena for place in spec.places]
    assert [arena.width_m * arena.height_m for arena in arenas] == pytest.approx([800.0, 400.0], rel=0.1)


def test_values_that_the_paper_does_not_have():
    world = scenario("warehouse_small")
    (throttle,) = wrappers_at(world, "throttle", 0.17)
    assert throttle.waveform == Waveform(kind="square", amplitude=0.17, offset=0.17, period_s=5000.0)
    assert throttle.carriers
    (cost,) = wrappers_at(world, "handling_cost", 30.0)
    assert (cost.waveform.amplitude, cost.waveform.offset) == (30.0, 31.0)
    assert wrappers_at(world, "noise", 0.02) == (SensorNoiseConfig(sigma=0.02), ActuatorNoiseConfig(sigma=0.02))
    assert wrappers_at(world, "noise", 0.0) == ()
    (population,) = wrappers_at(world, "population_dynamics", 2.5)
    assert population.malfunction_per_tick == pytest.approx(0.0025)
    assert population.repair_per_tick == pytest.approx(0.001022222 * 2.5)
    (deaths,) = wrappers_at(scenario("search_and_rescue"), "population_dynamics", 0.0002)
    assert deaths.death_per_tick == pytest.approx(0.0002)
    assert (deaths.malfunction_per_tick, deaths.repair_per_tick) == (0.0, 0.0)


def test_fields_of_wrappers_and_switches_of_the_scenario_are_axes_too():
    spec = study(
        Axis(name="integer_estimates", values=(False, True)),
        Axis(name="caches", values=("none", "dynamic")),
        Axis(name="sensor_noise.sigmas.position", values=(0.1,)),
        wrappers={"sensor_noise": {"sigma": 0.01}},
        policies=("stochm",),
    )
    last = spec.specs_of(spec.places[-1])[0]
    assert last.scenario.quirks.integer_estimates
    assert last.scenario.caches == "dynamic", "the axis goes before what the policy states"
    assert last.wrappers == (SensorNoiseConfig(sigma=0.01, sigmas={"position": 0.1}),)


def test_a_quirk_is_switched_alone_on_in_the_description_and_off_in_the_program():
    spec = study(Axis(name="quirk", values=("none", "explore_double_start")), rules=("described", "program"))
    found = {place: spec.world(place).scenario.quirks for place in spec.places}
    assert found == {
        Place("described", "crw", ("none",)): Quirks(),
        Place("described", "crw", ("explore_double_start",)): Quirks(explore_double_start=True),
        Place("program", "crw", ("none",)): AUTHORS_PROGRAM,
        Place("program", "crw", ("explore_double_start",)): replace(AUTHORS_PROGRAM, explore_double_start=False),
    }


def test_two_adversities_in_one_run_are_labelled_by_the_last():
    spec = study(Axis(name="throttle", values=(0.2,)), Axis(name="noise", values=(0.0, 0.02)))
    calm, noisy = (spec.world(place) for place in spec.places)
    assert (calm.criterion, calm.value, len(calm.wrappers)) == ("throttle", 0.2, 1)
    assert (noisy.criterion, noisy.value, len(noisy.wrappers)) == ("noise", 0.02, 3)


def test_what_was_chosen_stands_at_the_end_of_the_file():
    spec = study(
        Axis(name="noise", values=(0.0, 0.02)),
        set={"physics": "compiled", "nest_size_m": (3.2, 6.4)},
        wrappers={"population": {"death_per_tick": 0.001}},
    ).with_run(seeds=(3, 5))
    again = study_of(spec.to_toml())
    assert again == spec
    assert (again.seeds, again.text) == ((3, 5), spec.text)
    assert again.plan.specs == spec.plan.specs
    assert study_of(spec.to_toml(), "small").seeds == (0, 1), "a budget that is named is chosen anew"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"set": {"n_object": 3}}, "Did you mean 'n_objects'"),
        ({"set": {"horizon_s": 3.0}}, "the budget of a study sets it"),
        ({"rules": ("descibed",)}, "Did you mean 'described'"),
        ({"policies": ("crw", "crw")}, "Expected different policies"),
        ({"seeds": (1, 1)}, "Expected different seeds"),
        ({"wrappers": {"population": 3}}, r"Expected `object`, got `int` in wrappers"),
        ({"interval_s": 300.0}, "whole number of intervals"),
    ],
)
def test_nonsense_is_refused(changes, message):
    with pytest.raises(ConfigError, match=message):
        study(Axis(name="population_size", values=(1, 2)), **changes)


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        ([("nois", (0.1,))], "Did you mean 'noise'"),
        ([("horizon_s", (400.0,))], "Unknown axis"),
        ([("sensor_noise.sigm", (0.1,))], "Did you mean 'sensor_noise.sigma'"),
        ([("quirk", ("explore_double_strat",))], "Unknown quirk.* Did you mean 'explore_double_start'"),
        ([("quirk", ("none",)), ("scattered_sites", (True,))], "Expected quirks from one place"),
        ([("noise", ())], "one or more different numbers"),
        ([("noise", (0.0, "much"))], "one or more different numbers"),
        ([("population_size", (1.5,))], "population_size to be a whole number"),
        ([("population_size", (2,)), ("n_robots", (2,))], "one axis for the swarm size"),
        ([("noise", (0.1,)), ("sensor_noise.sigma", (0.1,))], "sensor_noise from one place"),
    ],
)
def test_axes_that_cannot_be_are_refused(axes, message):
    with pytest.raises(ConfigError, match=message):
        study(*(Axis(name=name, values=values) for name, values in axes))
