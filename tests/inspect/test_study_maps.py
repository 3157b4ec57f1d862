"""Maps of the conditions of a study."""

import numpy as np
import polars as pl
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.inspect.maps import floor_maps, mean_maps
from swarm_forage_env.inspect.replay.capture import record_replay
from swarm_forage_env.inspect.study_maps import MOST_PLACES, choose_places, maps_of_places, robot_ticks
from swarm_forage_env.studies.study import Axis, value_words
from swarm_forage_env.studies.study_table import StudyTable
from tests.support.tiny_study import NOBODY, RANDOM, tiny_study

SPEC = tiny_study()


def without_runs(spec):
    """The table of a study of which nothing was run."""
    frame = pl.DataFrame(schema={"cell": int, "run_id": str, "state": str, "collected": int})
    return StudyTable(spec=spec, frame=frame, versions=())


def test_words_choose_places_in_their_order():
    places = choose_places(SPEC, ("policy=twin,population_size=3", "policy=random , noise=0"))
    assert [(place.policy, place.values) for place in places] == [
        ("twin", (3, 0.0)),
        ("twin", (3, 0.02)),
        ("random", (2, 0.0)),
        ("random", (3, 0.0)),
    ]
    assert len(choose_places(SPEC, ("policy=twin", "population_size=2"))) == 6, "a condition named twice counts once"
    assert choose_places(SPEC, ()) == SPEC.places


def test_values_are_named_as_they_are_shown():
    """Here the message that lists the values shows 0.00428571, which is not equal to 0.03 / 7."""
    spec = tiny_study(axes=(Axis(name="noise", values=(0.0, 0.03 / 7, 0.03)),))
    for text in ("0.00428571", "0.004285714285714286", "4.285714285714286e-3"):
        assert {place.values for place in choose_places(spec, (f"noise={text}",))} == {(0.03 / 7,)}
    with pytest.raises(ConfigError, match=r"one of 0, 0\.00428571, 0\.03 in study"):
        choose_places(spec, ("noise=0.0042857",))


def test_values_that_would_look_alike_are_shown_with_all_digits():
    values = (0.0, 0.03 / 7, 0.00428571)
    spec = tiny_study(axes=(Axis(name="noise", values=values),))
    (place, _) = choose_places(spec, ("noise=0.00428571",))
    assert place.values == (0.00428571,)
    assert value_words(values) == {0.0: "0", 0.03 / 7: "0.004285714285714286", 0.00428571: "0.00428571"}
    assert value_words((True, False)) == {True: "true", False: "false"}
    assert value_words((8, 1000001)) == {8: "8", 1000001: "1000001"}


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("policy", "Expected a condition as KEY=VALUE"),
        ("polcy=twin", "Did you mean 'policy'"),
        ("population_size=4", "Expected population_size to be one of 2, 3 in study tiny, got '4'"),
        ("population_size=two", "got 'two'"),
        ("policy=dpo", "Expected policy to be one of random, twin"),
    ],
)
def test_words_that_name_no_place_are_refused(word, message):
    with pytest.raises(ConfigError, match=message):
        choose_places(SPEC, (word,))


def test_too_many_places_are_refused_with_a_way_out():
    spec = tiny_study(axes=(Axis(name="population_size", values=(2, 3, 4, 5, 6)),), reference=2)
    with pytest.raises(
        ConfigError, match=rf"at most {MOST_PLACES} conditions, got 10.*policy=random,population_size=2"
    ):
        choose_places(spec, ())


@pytest.mark.compiled
def test_maps_of_a_place_are_the_means_over_its_runs():
    spec = tiny_study(policies=(RANDOM,), axes=(Axis(name="population_size", values=(2, 3)),), reference=2)
    told = []
    (first, second), changed = maps_of_places(without_runs(spec), spec.places, side_m=1.0, advance=told.append)
    runs = [floor_maps(record_replay(run)[0], side_m=1.0) for run in spec.specs_of(spec.places[1])]
    expected = mean_maps(runs, "")
    assert np.array_equal(second.arrays["density"], expected.arrays["density"])
    assert (first.label, second.label) == ("random population_size=2", "random population_size=3")
    assert (first.n_robots, second.n_robots) == (2, 3)
    assert told == sorted(told)
    assert told[-1] == robot_ticks(spec, spec.places, None)
    assert changed == ()


@pytest.mark.compiled
def test_squares_grow_with_the_arena_and_changed_runs_are_told():
    axes = (Axis(name="side_m", values=(16.0, 32.0)),)
    spec = tiny_study(
        scenario="search_and_rescue", settings={"n_robots": 2}, axes=axes, policies=(RANDOM,), reference=16.0
    )
    run = spec.specs_of(spec.places[1])[0]
    stored = {"cell": [1, 1], "run_id": [run.run_id] * 2, "state": ["done"] * 2, "collected": [5, 5]}
    table = StudyTable(spec=spec, frame=pl.DataFrame(stored), versions=())
    maps, changed = maps_of_places(table, spec.places, n_seeds=1, side_m=0.5)
    assert [(one.side_m, one.arrays["drops"].shape) for one in maps] == [(0.5, (32, 32)), (1.0, (32, 32))]
    assert changed == (run.run_id,)


def test_what_cannot_be_mapped_is_refused():
    with pytest.raises(ConfigError, match="number of seeds"):
        maps_of_places(without_runs(SPEC), SPEC.places, n_seeds=3)
    lost = tiny_study(policies=(NOBODY,))
    with pytest.raises(ConfigError, match="Unknown policy 'nobody'"):
        maps_of_places(without_runs(lost), lost.places[:1])
