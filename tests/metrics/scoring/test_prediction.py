"""Predictions of policies: what is run, what is fitted, what is held back, and how it is told."""

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from metrics import CurveError, SizeLaw, predict_curves, predict_performance, predict_policy
from metrics.scoring import ask
from metrics.scoring.plots import draw_predictions
from metrics.scoring.prediction import Predictions, law_text, prediction_question
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs import workers
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.store import load
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.studies.ladders import Budget, plan_worlds
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import World
from tests.support.pictures import PNG, keep_figures
from tests.support.run_tables import table_of_totals

WORLD = scenario("warehouse_small", n_objects=20, horizon_s=4.0, interval_s=2.0)
LAW = SizeLaw(name="universal", a=5.0, contention=0.02, coherency=0.002)
"""Its peak is at sqrt(0.98 / 0.002) = 22.1 robots."""
SIZES = (1, 2, 4, 8, 16, 32, 64)


def curves_file(path, law=LAW, *, name="mine"):
    """Write curves of two runs per size, half of the performance in each of two intervals; seeds are nearly alike."""
    lines = ["controller,n_robots,seed,interval,performance"]
    for size in SIZES:
        for seed in (0, 1):
            half = 0.5 * float(law.performance(size)) * (1.0 + 0.01 * (2 * seed - 1))
            lines += [f"{name},{size},{seed},{interval},{half}" for interval in (0, 1)]
    path.write_text("\n".join(lines) + "\n")
    return path


class Failing:
    """Fails in every run."""

    def reset(self, task, rng):
        raise RuntimeError("no")

    def act(self, obs, active):
        return np.zeros((len(obs), 3), np.float32)


def worlds_of(world, **sizes):
    """The worlds that a prediction runs."""
    return tuple(condition.world for condition in prediction_question(["random"], world, **sizes).plan.conditions)


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch):
    """How an interval is told does not need the resamples that make it exact; they take most of the time."""
    few = partial(predict_performance, n_resamples=50)
    monkeypatch.setattr("metrics.scoring.prediction.predict_performance", few)


def test_curves_of_a_known_law_are_predicted(tmp_path):
    (table,) = predict_curves(curves_file(tmp_path / "curves.csv"), hold=[32, 64])
    assert (table.fit, table.hold, table.predicted_sizes) == ((1, 2, 4, 8, 16), (32, 64), (32, 64))
    assert table.prediction.law.name == "universal"
    for size in (32, 64):
        value, lower, upper = table.interval(size)
        assert value == pytest.approx(float(LAW.performance(size)), rel=0.01)
        assert lower <= value <= upper
        assert table.is_inside(size) is True
        assert table.measured(size).mean == pytest.approx(float(LAW.performance(size)))
    assert table.prediction.critical == pytest.approx(22.1, abs=0.5)
    assert Predictions(tables=(table,)).inside_text == "2 of 2 held-back means inside the interval"
    text = str(table)
    assert text.splitlines()[0] == "mine: performance per run, fitted to 1, 2, 4, 8, 16 robots"
    assert "critical size: 22 robots (interval 2" in text
    # 5 * 64 / (1 + 0.02 * 63 + 0.002 * 64 * 63) = 320 / 10.324, measured and predicted.
    assert next(line for line in text.splitlines() if line.startswith("64")).split()[:4] == ["64", "2", "31", "31"]


def test_sizes_of_a_file_are_all_fitted_unless_told_otherwise(tmp_path):
    path = curves_file(tmp_path / "curves.csv")
    (table,) = predict_curves(path)
    assert (table.fit, table.predicted_sizes) == (SIZES, (128, 256))
    assert table.is_inside(128) is None
    assert table.measured(128) is None
    assert Predictions(tables=(table,)).inside_text == ""
    (table,) = predict_curves(path, fit=[2, 4, 8, 16], hold=[64])
    assert (table.fit, table.predicted_sizes) == ((2, 4, 8, 16), (32, 64))
    with pytest.raises(CurveError, match=r"sizes that mine has in .*, 1, 2, 4, 8, 16, 32, 64, got 3"):
        predict_curves(path, fit=[1, 2, 3, 4])


def test_a_prediction_that_misses_says_so(tmp_path):
    """Linear up to 16 robots, and then all of them jam: no law can know."""
    path = tmp_path / "jam.csv"
    rows = [(size, seed, size * (1.0 + 0.02 * seed) if size < 32 else 1.0) for size in SIZES for seed in (0, 1)]
    lines = [f"{size},{seed},0,{value}" for size, seed, value in rows]
    path.write_text("\n".join(["n_robots,seed,interval,performance", *lines]))
    (table,) = predict_curves(path, hold=[32, 64])
    assert [table.is_inside(size) for size in table.hold] == [False, False]
    assert "held back  NO" in str(table)
    assert Predictions(tables=(table,)).inside_text == "0 of 2 held-back means inside the interval"
    assert table.critical_text().startswith("none up to 64 robots, 4 times the largest fitted; ")


def test_a_table_is_ready_for_json(tmp_path):
    (table,) = predict_curves(curves_file(tmp_path / "curves.csv"), hold=[64])
    found = json.loads(json.dumps(table.to_mapping()))
    assert found["law"]["name"] == "universal"
    assert [row["n_robots"] for row in found["fit"]] == [1, 2, 4, 8, 16, 32]
    assert [(row["n_robots"], row["inside"]) for row in found["predictions"]] == [(64, True), (128, None)]
    assert found["critical_size"]["looked_for_up_to"] == 128.0
    assert found["laws"]["linear"]["peak"] is None


def test_laws_are_written_as_formulas():
    assert law_text(LAW) == "universal, P(N) = 5 N / (1 + 0.02 (N - 1) + 0.002 N (N - 1))"
    assert law_text(SizeLaw(name="contention", a=5.0, contention=0.1)) == "contention, P(N) = 5 N / (1 + 0.1 (N - 1))"
    assert law_text(SizeLaw(name="linear", a=5.0)) == "linear, P(N) = 5 N"


def test_worlds_are_those_of_the_size_sweep_of_scores():
    swept = worlds_of("warehouse_small", fit=[1, 6, 12, 25], hold=[50])
    standard = Budget(horizon_s=10_000.0, interval_s=200.0, n_seeds=2, n_sizes=5, n_levels=1)
    assert swept == plan_worlds(scenario("warehouse_small"), ["population_size"], standard)
    assert worlds_of(WORLD, fit=[1, 2, 3, 4])[0].scenario.objects.n_objects == 20
    rescue = worlds_of("search_and_rescue", fit=[1, 12, 51, 115])
    assert [world.scenario.arena.width_m for world in rescue] == [16.0, 16.0, 32.0, 48.0]
    assert [world.scenario.objects.n_objects for world in rescue] == [80, 80, 272, 368]
    with pytest.raises(CurveError, match=r"fill one of its arenas, 1, 12, 51, 115, .*, got 2"):
        worlds_of("search_and_rescue", fit=[1, 2, 12, 51])
    with pytest.raises(CurveError, match="because those grow with the swarm, got an arena 48 m wide with 50 objects"):
        worlds_of(scenario("search_and_rescue", n_objects=50), fit=[1, 12, 51, 115])


def test_sizes_that_are_fitted_by_default_fill_the_arenas_of_the_scenario():
    assert prediction_question(["random"], "warehouse_quad").fit == (1, 2, 4, 8, 16, 32)
    rescue = prediction_question(["random"], "search_and_rescue", hold=[460])
    # 5 % of 16^2, 32^2, 48^2, 64^2 and 80^2 m^2; one robot in 256 m^2 has another density.
    assert (rescue.fit, rescue.hold) == ((12, 51, 115, 204, 320), (460,))
    assert [world.scenario.arena.width_m for _, world in rescue.plan.conditions] == [16.0, 32.0, 48.0, 64.0, 80.0, 96.0]


def test_only_power_law_clusters_grow_with_the_swarm_whatever_the_name():
    own = replace(scenario("warehouse_small", n_objects=77), name="my_hall")
    for world in worlds_of(own):
        assert (world.scenario.arena, world.scenario.objects) == (own.arena, own.objects)
    dense = scenario("warehouse_small", n_robots=50, density=0.05)
    assert {world.scenario.arena for world in worlds_of(dense)} == {dense.arena}
    scattered = scenario("search_and_rescue", placement="random")
    assert {world.scenario.arena for world in worlds_of(scattered)} == {scattered.arena}
    ruins = replace(scenario("search_and_rescue"), name="ruins")
    assert prediction_question(["random"], ruins).fit == (12, 51, 115, 204, 320)
    assert {world.scenario.name for world in worlds_of(ruins)} == {"ruins"}
    # 57 robots in 48 x 48 m are 2.47 %; so 57 / 2304 of 256, 1,024, 4,096, 6,400 m^2.
    sparse = prediction_question(["random"], scenario("search_and_rescue", side_m=48.0, n_robots=57))
    assert sparse.fit == (6, 25, 57, 101, 158)


def predicted(totals, *, fit=(1, 2, 4, 8, 16), hold=(), world=WORLD):
    """Predict from runs that are given by size."""
    question = prediction_question(["random"], world, fit=fit, hold=hold, seeds=2)
    (table,) = question.answer(
        table_of_totals(question.plan, {"random": [totals[size] for size in (*fit, *hold)]})
    ).tables
    return table


def row(table, size):
    return next(line.split() for line in str(table).splitlines() if line.startswith(f"{size} "))


def test_a_size_that_lost_its_runs_is_left_out_and_not_held_back():
    runs = {1: [5.0, 5.2], 2: [10.0, 9.8], 4: [20.0, 21.0], 8: [40.0, 39.0], 16: [80.0]}
    table = predicted(runs)
    assert (table.fit, table.left_out, table.predicted_sizes) == ((1, 2, 4, 8), (16,), (16, 32))
    assert row(table, 16)[:3] == ["16", "1", "80"]
    assert row(table, 16)[-2:] == ["left", "out"]
    (told,) = table.failures
    assert told.endswith("random in warehouse_small, 16 robots, seed 1, population_size = 16: it broke")
    assert (table.is_inside(16), Predictions(tables=(table,)).inside_text) == (None, "")
    told = table.to_mapping()
    assert [(each["n_robots"], each["runs"]) for each in told["left_out"]] == [(16, [80.0])]
    assert [(each["held_back"], each["measured"]) for each in told["predictions"]] == [([], None)] * 2
    # A lost size that is not predicted has its row, too.
    table = predicted({**runs, 2: [], 16: [80.0, 79.0]})
    assert (table.fit, table.left_out) == ((1, 4, 8, 16), (2,))
    assert row(table, 2)[:3] == ["2", "0", "-"]
    assert row(table, 2)[-2:] == ["left", "out"]


def test_one_held_back_run_gives_no_verdict():
    runs = {1: [5.0, 5.2], 2: [10.0, 9.8], 4: [20.0, 21.0], 8: [40.0, 39.0], 16: [80.0], 20: [100.0, 101.0]}
    table = predicted(runs, fit=(1, 2, 4, 8), hold=(16, 20))
    assert [table.is_inside(size) for size in (16, 20)] == [None, True]
    assert row(table, 16)[-2:] == ["held", "back"]
    assert Predictions(tables=(table,)).inside_text == "1 of 1 held-back mean inside the interval"


def test_the_unit_is_that_of_the_performance(tmp_path):
    runs = {size: [5.0 * size, 5.1 * size] for size in (1, 2, 4, 8)}
    units = {
        "collected": ("objects in 4 s", True),
        "deaths": ("robots in 4 s", True),
        "n_carrying": ("robots summed over intervals", True),
        "1/interference_fraction": ("1/interference_fraction summed over intervals", False),
    }
    for name, told in units.items():
        table = predicted(runs, fit=(1, 2, 4, 8), world=replace(WORLD, performance=name))
        assert (table.unit, table.adds_up) == told
        assert str(table).startswith(f"random in warehouse_small with 20 objects: {told[0]}, fitted to")
        assert ("note: this performance is no sum over robots" in str(table)) is not told[1]
    (table,) = predict_curves(curves_file(tmp_path / "curves.csv"), performance="1/performance")
    assert (table.unit, table.adds_up) == ("1/performance summed over intervals", False)
    # Each of two intervals has half of the performance 5 * 0.99, so 1/x is 2 / 4.95, twice.
    assert table.totals[1][0] == pytest.approx(4.0 / 4.95)


@pytest.mark.compiled
def test_a_policy_is_run_at_every_size_and_the_large_ones_are_held_back(tmp_path):
    world = scenario("warehouse_small", n_objects=20, horizon_s=1000.0)
    options = {"fit": [1, 2, 3, 4], "hold": [6], "seeds": 2, "out": tmp_path, "jobs": 1, "progress": False}
    table = predict_policy("dpo", world, **options)
    assert (table.policy, table.scenario, table.horizon_s) == ("dpo", "warehouse_small with 20 objects", 1000.0)
    assert (table.fit, table.hold, table.predicted_sizes) == ((1, 2, 3, 4), (6,), (6, 8, 16))
    runs = load(tmp_path)
    assert len(runs) == 10
    for size in (1, 2, 3, 4, 6):
        totals = sorted(float(run.performance.sum()) for run in runs if run.n_robots == size)
        assert sorted(table.totals[size]) == totals
    assert sum(map(sum, table.totals.values())) > 0.0
    assert str(predict_policy("dpo", world, **options)) == str(table)


def test_swarms_that_never_deliver_predict_nothing():
    with pytest.raises(CurveError, match="above 0 at some swarm size"):
        predict_policy("random", WORLD, fit=[1, 2, 3, 4], seeds=2, jobs=1, progress=False)


@pytest.mark.parametrize(
    ("sizes", "reason"),
    [
        ({"fit": [1, 2, 4]}, "4 or more different swarm sizes to fit, got 1, 2, 4"),
        ({"fit": [1, 2, 4, 4]}, "4 or more different"),
        ({"fit": [0, 1, 2, 4]}, "swarms of 1 robot or more, got 0"),
        ({"fit": [1, 2, 4, 8], "hold": [8, 16]}, "larger swarms than the fitted 8 robots, got 8"),
        ({"fit": [1, 2, 4, 8], "seeds": 1}, "two or more seeds, got 1"),
    ],
)
def test_sizes_that_predict_nothing_are_refused(sizes, reason):
    with pytest.raises(CurveError, match=reason):
        predict_policy("random", WORLD, **sizes)


def test_a_swarm_without_room_is_refused():
    with pytest.raises(ConfigError):
        prediction_question(["random"], "warehouse_small", fit=[1, 2, 4, 8], hold=[100_000])


def test_failed_runs_are_named():
    with pytest.raises(CurveError, match=r"got them at 0; the first failure: .*RuntimeError: no"):
        predict_policy(Failing, WORLD, fit=[1, 2, 3, 4], seeds=2, jobs=1, progress=False)


def test_wrappers_of_the_world_are_in_all_runs(tmp_path, monkeypatch):
    slow = parse_wrapper("throttle:waveform=constant,amplitude=0.3")
    options = {"fit": [1, 2, 3, 4], "hold": [6], "seeds": 2, "out": tmp_path, "jobs": 1, "progress": False}
    world = World(replace(WORLD, performance="n_active"), (slow,))
    table = predict_policy("random", world, **options)
    assert (table.fit, table.hold) == ((1, 2, 3, 4), (6,))
    runs = load(tmp_path)
    assert len(runs) == 10
    for run in runs:
        (config,) = json.loads(run.spec)["wrappers"]
        assert (config["wrapper"], config["waveform"]["amplitude"]) == ("throttle", 0.3)
        assert run.contributed["throttle"].tolist() == [0.3, 0.3]
    # Asked again, the stored runs answer; they are not those of the calm world.
    with monkeypatch.context() as patch:
        patch.setattr(workers, "run_one", lambda spec: pytest.fail("a stored run was repeated"))
        question = prediction_question(["random"], world, fit=[1, 2, 3, 4], hold=[6], seeds=2)
        (again,) = ask(question, out=tmp_path, jobs=1, progress=False).tables
    assert str(again) == str(table)
    calm = prediction_question(["random"], world.scenario, fit=[1, 2, 3, 4], hold=[6], seeds=2)
    assert {spec.run_id for spec in calm.plan.specs}.isdisjoint(run.run_id for run in runs)


def test_failed_runs_are_those_of_their_policy(monkeypatch):
    def failing(spec):
        if spec.policy == "crw" and spec.world.n_robots == 3:
            raise RuntimeError("out of luck")
        return run_one(spec)

    monkeypatch.setattr(workers, "run_one", failing)
    question = prediction_question(
        ["random", "crw"], replace(WORLD, performance="n_active"), fit=[1, 2, 3, 4, 5], seeds=2
    )
    random, crw = ask(question, jobs=1, progress=False).tables
    assert (random.policy, random.fit, random.left_out, random.failures) == ("random", (1, 2, 3, 4, 5), (), ())
    assert (crw.policy, crw.fit, crw.left_out) == ("crw", (1, 2, 4, 5), (3,))
    (told,) = crw.failures
    assert "crw in warehouse_small, 3 robots" in told
    assert told.endswith("and 1 more of its runs: RuntimeError: out of luck")


def test_stored_runs_of_classes_need_a_name(tmp_path):
    with pytest.raises(ValueError, match="Expected name= for the policy Failing"):
        predict_policy(Failing, WORLD, fit=[1, 2, 3, 4], seeds=2, out=tmp_path, progress=False)
    assert not list(tmp_path.iterdir())


def test_the_picture_shows_runs_law_interval_and_critical_size(tmp_path, monkeypatch):
    mine = predict_curves(curves_file(tmp_path / "a.csv"), hold=[32, 64])
    linear = predict_curves(curves_file(tmp_path / "b.csv", SizeLaw(name="linear", a=2.0), name="other"))
    draw_predictions([*mine, *linear], tmp_path / "prediction.png")
    assert (tmp_path / "prediction.png").read_bytes().startswith(PNG)
    figures = keep_figures(monkeypatch)
    draw_predictions([*mine, *linear], tmp_path / "prediction.png")
    figure = figures[0]
    first, second = figure.axes
    assert first.get_title() == "mine"
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["95% interval", "fitted law", "fitted runs", "held-back runs", "critical size"]
    lines = {line.get_label(): line for line in first.get_lines()}
    assert lines["fitted law"].get_linestyle() == "--"
    assert len(lines["fitted runs"].get_xdata()) == 10
    assert lines["held-back runs"].get_xdata().tolist() == [32, 32, 64, 64]
    assert "critical size" not in [line.get_label() for line in second.get_lines()]
    draw_predictions([*mine, *linear] * 2 + [*mine], tmp_path / "five.png")
    assert [axes.axison for axes in figures[1].axes] == [True] * 5 + [False]
