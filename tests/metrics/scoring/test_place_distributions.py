"""What a mean hides: spread and breakdowns of the conditions of a study."""

import numpy as np
import polars as pl
import pytest

from metrics.scoring.study_numbers import place_distributions
from swarm_forage_env.studies.study import Axis
from swarm_forage_env.studies.study_table import StudyTable
from tests.support.made_tables import FOUR, made_study, made_table

N_INTERVALS = 20
PER_INTERVAL = 10.0


def studied(axis, curve_of, *, reference=None, n_seeds=4):
    """A study of one policy whose runs have the curves that `curve_of(value, seed)` returns."""
    spec = made_study("mine", axis, reference=reference, seeds=tuple(range(n_seeds)), horizon_s=200.0, interval_s=10.0)
    rows = [
        {"cell": number, "seed": seed, "run_id": f"{number}_{seed}", "state": "done", "interval": interval}
        | {"performance": float(amount), "interference_fraction": 0.1, "n_active": 4.0}
        for number, place in enumerate(spec.places)
        for seed in spec.seeds
        for interval, amount in enumerate(curve_of(place.values[-1], seed))
    ]
    table = StudyTable(spec=spec, frame=pl.DataFrame(rows, infer_schema_length=None), versions=())
    return place_distributions(table).filter(pl.col("policy") == FOUR[0])


def steady(level):
    return np.full(N_INTERVALS, level)


def jammed(level, at):
    return np.where(np.arange(N_INTERVALS) < at, level, 0.0)


def test_breakdowns_are_told_against_the_undisturbed_place():
    def curve(value, seed):
        return jammed(PER_INTERVAL, 8) if value and seed else steady(PER_INTERVAL)

    axis = Axis(name="noise", values=(0.0, 0.02))
    calm, noisy = studied(axis, curve, reference=0.0).iter_rows(named=True)
    assert (calm["broken"], calm["half_broken_s"]) == (0.0, np.inf)
    assert noisy["broken"] == 0.75
    assert noisy["broken_lower"] < 0.75 < noisy["broken_upper"]
    assert noisy["half_broken_s"] == pytest.approx(80.0, abs=30.0), "they stop after 80 s"
    assert (noisy["lowest"], noisy["highest"]) == (80.0, 200.0)
    assert noisy["interquartile_mean"] == 80.0, "the mean of the two in the middle"
    assert noisy["mean"] == 110.0


def test_where_sizes_vary_larger_swarms_are_held_against_the_best():
    def curve(size, seed):
        level = PER_INTERVAL * min(size, 2)
        return jammed(level, 8) if size == 4 and seed == 0 else steady(level)

    broken = studied(Axis(name="population_size", values=(1, 2, 4)), curve)["broken"].to_list()
    assert broken == [None, 0.0, 0.25], "one robot delivers less than two, and is not broken"


@pytest.mark.parametrize(
    ("level", "reference", "why"),
    [(0.5, 0.0, "too few objects to tell a breakdown from chance"), (PER_INTERVAL, None, "nothing to hold it against")],
)
def test_what_cannot_be_told_is_empty(level, reference, why):
    axis = Axis(name="noise", values=(0.0, 0.02))
    rows = studied(axis, lambda value, seed: steady(level), reference=reference)
    assert rows["broken"].null_count() == len(rows), why
    assert rows["interquartile_mean"].to_list() == [N_INTERVALS * level] * 2


def test_a_place_without_runs_has_no_numbers():
    spec = made_study("mine", Axis(name="noise", values=(0.0, 0.02)))
    lost = {(spec.places[0], seed) for seed in spec.seeds}
    first = place_distributions(made_table(spec, lambda place: 5.0, lost=lost)).row(0, named=True)
    assert (first["n_runs"], first["mean"], first["broken"]) == (0, None, None)
