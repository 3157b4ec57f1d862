"""The public names and arguments, and that the package needs nothing of the environment."""

import inspect
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

import metrics
import metrics.claims
import metrics.scoring
from tests.support.public_names import homes_of

FOLDER = Path(metrics.__file__).parent
SIGNATURES = {
    "t_lost_fraction": "n_interfering, n",
    "cache_congestion": "lost_near, lost, n_caches, *, floor, reach",
    "performance_lost": "perf, t_lost, n, perf_one, t_lost_one, *, variant='corrected'",
    "spatial_emergence": "perf1, t_lost1, n1, perf2, t_lost2, n2, perf_one, t_lost_one, *, variant='corrected', "
    "reduce='sum'",
    "task_emergence": "perf1, n1, perf2, n2, *, reduce='sum'",
    "time_emergence": "t_lost1, n1, t_lost2, n2, *, reduce='mean'",
    "interference_gain": "perf1, t_lost1, n1, perf2, t_lost2, n2, *, relative=False",
    "undisturbed_gain": "perf1, t_lost1, n1, perf2, t_lost2, n2, *, relative=False",
    "scalability": "perf1, n1, perf2, n2, *, variant='corrected', reduce=None, zero_policy='nan'",
    "efficiency": "perf, n, *, reduce='last'",
    "raw_performance": "perf, *, reduce='last'",
    "dtw": "x, y, *, ground='value', clock=None, window=None, per_interval=False",
    "aligned_l1": "x, y",
    "waveform": "kind, ticks, *, frequency=0.0, amplitude=0.0, offset=0.0, phase=0.0",
    "environment_scaling": "v, i_ec, *, model='linear', clip=False",
    "environment_distance": "v, i_ec, *, ground='value', clock=None",
    "reactivity": "perf_ideal, perf, v, i_ec, *, model='linear', variant='corrected', clock=None",
    "adaptability": "perf_ideal, perf, *, variant='corrected', clock=None",
    "noise_robustness": "perf_ideal, perf, *, variant='corrected', clock=None",
    "PopulationRates": "lambda_d=0.0, lambda_bd=0.0, mu_b=0.0, mu_bd=0.0",
    "queue_statistics": "rates, n=None, *, per_robot=False",
    "mean_away": "rates, n, horizon, *, per_robot=False",
    "robots_at_work": "rates, n, interval_ends, *, per_robot=False",
    "compare_population": "n_active, rates, n, interval_ends, *, per_robot=False, level=0.95",
    "population_robustness": "perf, perf_ideal, rates, *, horizon, n=None, ideal_rates=None, weight='transient', "
    "reduce='sum'",
    "recorded_population_robustness": "perf, n_active, perf_ideal, n_active_ideal, *, reduce='sum', relative=False",
    "availability": "n, n_min, ratio_out",
    "availability_curves": "n, teams, n_min=None",
    "ratio_for_availability": "n, n_min, p_v",
    "ratio_for_team": "team",
    "fit_law": "name, sizes, performance",
    "forward_error": "name, sizes, performance",
    "mean_field": "rates, n_robots, horizon_s, *, n_points=201",
    "steady_state": "rates, n_robots",
    "foraging_limit": "gaps_m, *, n_robots, n_objects, horizon_s, speed_mps, handling_s",
    "limit_of": "world",
    "estimate_rates": "n_robots, *, pickups, deliveries, n_carrying, interference, interval_s, n_objects, "
    "lone_interference=None, avoidance_s=1.0",
    "fit_ladder": "sizes, runs, *, level=0.95, n_resamples=200, seed=None",
    "predict_performance": "sizes, runs, at, *, level=0.95, n_resamples=500, seed=None",
    "score_policy": "policy, world='warehouse_small', *, measures=None, budget='standard', seeds=None",
    "compare_policies": "policies, world='warehouse_small', *, measures=None, budget='standard', seeds=None",
    "predict_policy": "policy, world='warehouse_small', *, fit=None, hold=(), seeds=4",
    "choose_policy": "policies, world='warehouse_small', *, deliver, keep=1.0, failures=None, deaths=None, "
    "noise=None, seeds=4",
    "normalize": "theta, *, distance=False",
    "find_breakdowns": "perf, reference, *, window=5, share=0.5, interval_s=1.0",
    "breakdown_probability": "breakdowns, *, method='wilson', level=0.95",
    "time_to_breakdown": "breakdowns, *, level=0.95",
    "interquartile_mean": "values, *, level=0.95, seed=None, n_resamples=2000",
    "probability_of_improvement": "first, second, *, higher_is_better=True, level=0.95, seed=None",
    "paired_tests": "first, second",
    "Panel": "*, levels, scores",
    "check_claim": "claim, panels",
    "aggregate": "values, *, method='t', level=0.95, seed=None",
}


@pytest.mark.parametrize(("name", "expected"), SIGNATURES.items(), ids=SIGNATURES)
def test_arguments_and_defaults_stay(name, expected):
    parameters = inspect.signature(getattr(metrics, name)).parameters.values()
    bare = inspect.Signature([p.replace(annotation=inspect.Parameter.empty) for p in parameters])
    assert str(bare).removesuffix(")").startswith(f"({expected}")


def test_every_measure_has_its_arguments_here():
    assert metrics.METRICS.keys() - SIGNATURES.keys() == set()


def test_every_public_name_loads():
    assert [name for name in metrics.__all__ if getattr(metrics, name) is None or name not in dir(metrics)] == []


def test_each_public_name_is_written_once():
    assert sorted(homes_of(metrics)) == sorted(metrics.__all__)


@pytest.mark.parametrize("package", [metrics, metrics.claims, metrics.scoring], ids=["metrics", "claims", "scoring"])
def test_no_public_name_is_that_of_a_module(package):
    modules = {module.name for module in pkgutil.iter_modules(package.__path__)}
    assert not modules & {*package.__all__, *(name for name in vars(package) if callable(vars(package)[name]))}


def test_unknown_names_are_refused():
    with pytest.raises(AttributeError, match="No metrics attribute scalabilty"):
        _ = metrics.scalabilty


def test_functions_and_modules_are_what_they_are_in_any_order_of_imports():
    code = (
        "import importlib, sys\n"
        "for first in ('metrics.scaling', 'metrics.catalog', 'metrics.population', 'metrics'):\n"
        "    for name in [name for name in sys.modules if name.split('.')[0] == 'metrics']:\n"
        "        del sys.modules[name]\n"
        "    importlib.import_module(first)\n"
        "    from metrics import scalability\n"
        "    import metrics.scaling, metrics.catalog\n"
        "    print(scalability([1], 1, [2], 2), type(metrics.scaling).__name__)"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (result.stdout.splitlines(), result.stderr) == (["1.0 module"] * 4, "")


def test_importing_the_package_loads_nothing_heavy():
    heavy = ("numpy", "numba", "scipy", "polars", "pymunk", "swarm_forage_env", "baselines")
    code = f"import sys, metrics; print(*[name for name in {heavy} if name in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.split() == []
