"""`metrics` and the environment may not import each other, so some facts are in both; they must agree."""

import numpy as np
import pytest

from metrics import MEASURES, waveform
from metrics.scoring.curves_file import study_curves
from metrics.scoring.run_curves import CRITERIA, CURVE_COLUMNS
from swarm_forage_env.runs.record import Record
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.studies import ladders
from swarm_forage_env.wrappers import world as worlds
from swarm_forage_env.wrappers.population import PopulationConfig
from swarm_forage_env.wrappers.throttle import ThrottleConfig
from swarm_forage_env.wrappers.waveform import Waveform
from swarm_forage_env.wrappers.world import UNDISTURBED, World

TICKS = np.arange(1, 50_001)
DT_S = 0.2


@pytest.mark.parametrize(("period_s", "phase"), [(10_000.0, 0.0), (2_000.0, 0.3), (777.0, 0.0)])
@pytest.mark.parametrize("kind", ["sine", "square", "sawtooth"])
def test_waveforms_agree_at_every_tick_of_a_run(kind, phase, period_s):
    signal = Waveform(kind=kind, amplitude=0.4, offset=0.35, period_s=period_s, phase=phase).signal(DT_S)
    measured = waveform(kind, TICKS, frequency=DT_S / period_s, amplitude=0.4, offset=0.35, phase=phase)
    np.testing.assert_allclose(measured, [signal(tick) for tick in TICKS.tolist()], rtol=0.0, atol=1e-13)


def test_criteria_have_the_same_names():
    assert {*ladders.CRITERIA, worlds.UNDISTURBED} == set(CRITERIA)
    assert worlds.UNDISTURBED == UNDISTURBED
    assert {measure.varies for measure in MEASURES.values()} <= set(ladders.CRITERIA)


@pytest.fixture(scope="module")
def record() -> Record:
    """A run in which every column that measures read has something in it."""
    wave = Waveform(kind="square", amplitude=0.2, offset=0.2, period_s=4.0)
    population = PopulationConfig(death_per_tick=0.02, malfunction_per_tick=0.3, repair_per_tick=0.3)
    world = scenario("warehouse_small", n_robots=4, n_objects=20, horizon_s=12.0, interval_s=3.0)
    disturbed = World(world, (ThrottleConfig(waveform=wave), population), criterion="throttle", value=0.2)
    return run_one(RunSpec(world=disturbed, policy="random", seed=3))


def test_arrays_hold_what_the_record_holds(record):
    (study,) = study_curves(record.frame)
    (runs,) = study.experiments
    assert (study.controller, runs.criterion, runs.value, runs.n_robots) == ("random", "throttle", 0.2, 4)
    assert runs.seeds == (3,)
    np.testing.assert_array_equal(study.t_end_s, [3.0, 6.0, 9.0, 12.0])
    columns = record.columns
    assert runs.curves.keys() == {
        name
        for name, column in CURVE_COLUMNS.items()
        if name in columns and column.kind in ("amount", "fraction", "number")
    }
    for name, curve in runs.curves.items():
        np.testing.assert_array_equal(curve, [columns[name]], err_msg=name)


def test_conditions_are_the_mean_of_the_waveform_over_each_interval(record):
    (study,) = study_curves(record.frame)
    wave = waveform("square", np.arange(1, 61), frequency=DT_S / 4.0, amplitude=0.2, offset=0.2)
    np.testing.assert_allclose(study.experiments[0].curves["adversity"][0], wave.reshape(4, 15).mean(axis=1))
