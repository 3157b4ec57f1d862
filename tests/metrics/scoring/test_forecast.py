"""The queueing model and the runs: both sides of the table, by hand and from a population without an arena."""

import math

import numpy as np
import pytest

import metrics
from metrics import PopulationRates
from metrics.scoring.by_adversity import FORECAST_HEADER, forecast_population
from metrics.scoring.run_curves import RunCurves, StudyCurves
from swarm_forage_env.wrappers.population_process import EventRates, simulate_population

CLOCK = np.array([100.0, 200.0])


def study(level: RunCurves, clock=CLOCK) -> StudyCurves:
    return StudyCurves(controller="mine", experiments=(level,), t_end_s=clock)


def level(rates: PopulationRates | None, **curves) -> RunCurves:
    arrays = {name: np.array(values, dtype=float) for name, values in curves.items()}
    n_runs = len(next(iter(arrays.values())))
    return RunCurves(
        criterion="population_dynamics", value=3.0, n_robots=10, seeds=tuple(range(n_runs)), curves=arrays, rates=rates
    )


def test_observed_times_are_robot_seconds_per_departure():
    rates = PopulationRates(lambda_bd=0.02, mu_bd=0.03)
    (row,) = forecast_population(
        study(
            level(
                rates,
                n_active=[[9.0, 7.0], [10.0, 10.0]],
                malfunctions=[[1.0, 3.0], [1.0, 0.0]],
                repairs=[[1.0, 1.0], [0.0, 1.0]],
                time_in_repair_s=[[10.0, 40.0], [0.0, 70.0]],
            )
        )
    )
    assert row.observed_at_work.mean == pytest.approx(9.0)
    assert row.observed_time_in_s == pytest.approx((8.0 + 10.0) * 200.0 / 5.0)
    assert row.observed_time_out_s == pytest.approx(2.0 * 200.0 / 5.0)
    assert row.observed_time_per_repair_s == pytest.approx((10.0 + 40.0 + 70.0) / 3.0)
    assert row.equilibrium_time_out_s == pytest.approx(100.0)
    assert row.printed_time_out_s == pytest.approx(100.0 + 1.0 / 0.03)
    assert row.predicted_at_work == pytest.approx(10.0 - metrics.mean_away(rates, 10, 200.0))
    assert row.predicted_time_in_s + row.predicted_time_out_s == pytest.approx(10.0 / 0.02)
    assert len(row.cells()) == len(FORECAST_HEADER)


def test_the_dead_do_not_come_back():
    (row,) = forecast_population(study(level(PopulationRates(lambda_d=0.01), n_active=[[9.0, 8.0]], deaths=[[1, 1]])))
    assert row.observed_time_out_s == pytest.approx(1.5 * 200.0 / 2.0)
    assert math.isnan(row.observed_time_per_repair_s)
    assert math.isinf(row.equilibrium_time_out_s)
    assert row.to_mapping()["equilibrium_time_out_s"] is None


@pytest.mark.parametrize(
    ("rates", "curves", "clock"),
    [
        (None, {"n_active": [[9.0, 8.0]]}, CLOCK),
        (PopulationRates(), {"n_active": [[9.0, 8.0]]}, CLOCK),
        (PopulationRates(lambda_d=0.01), {"performance": [[9.0, 8.0]]}, CLOCK),
        (PopulationRates(lambda_d=0.01), {"n_active": [[9.0, 8.0]]}, None),
    ],
    ids=["no rates", "nobody leaves", "robots at work unknown", "no clock"],
)
def test_without_rates_robots_at_work_or_clock_there_is_no_row(rates, curves, clock):
    assert forecast_population(study(level(rates, **curves), clock)) == ()


def test_unrecorded_departures_leave_the_observed_times_open():
    (row,) = forecast_population(study(level(PopulationRates(lambda_d=0.01), n_active=[[9.0, 8.0]])))
    assert math.isnan(row.observed_time_in_s)
    assert row.cells()[5] == "-"


@pytest.mark.parametrize(
    "rates",
    [PopulationRates(lambda_bd=0.008, mu_bd=0.008177776), PopulationRates(lambda_d=0.0015)],
    ids=["malfunctions", "deaths"],
)
def test_prediction_and_observation_agree_for_the_population_of_the_environment(rates):
    """The population process alone, 400 runs of 10,000 ticks; times in ticks."""
    events = EventRates(death=rates.lambda_d, malfunction=rates.lambda_bd, repair=rates.mu_bd)
    histories = [simulate_population(events, 50, 10_000, seed) for seed in range(400)]
    observed = level(
        rates,
        n_active=[[history.n_active.mean()] for history in histories],
        deaths=[[history.tally.deaths] for history in histories],
        malfunctions=[[history.tally.malfunctions] for history in histories],
    )
    observed = RunCurves(
        criterion=observed.criterion, value=1.0, n_robots=50, seeds=observed.seeds, curves=observed.curves, rates=rates
    )
    (row,) = forecast_population(study(observed, np.array([10_000.0])))
    wide = 4.0 * row.observed_at_work.std / math.sqrt(400)
    assert row.observed_at_work.mean == pytest.approx(row.predicted_at_work, abs=wide)
    assert row.observed_time_in_s == pytest.approx(row.predicted_time_in_s, rel=0.05)
    assert row.observed_time_out_s == pytest.approx(row.predicted_time_out_s, rel=0.1)
