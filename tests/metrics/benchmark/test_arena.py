"""What a program of a search is worth, and how its faults are told."""

import pytest

from metrics.benchmark import evaluate, load_protocol
from metrics.benchmark.standing import best_of
from metrics.scoring.limits import limit_of
from swarm_forage_env import plan_run, run_one, scenario

STANDS = "class Stands:\n def reset(self, spec, rng): pass\n def act(self, obs, active): return obs[:, :3] * 0 + 1\n"
CANNOT = (
    "from swarm_forage_env import RobotPolicy\nclass A(RobotPolicy):\n @staticmethod\n def step(a, b, c, d):\n  nil\n"
)


def test_feedback_holds_the_numbers_of_short_runs():
    feedback = evaluate("crw", horizon_s=120.0, seeds=(3,))
    small, medium, rescue = feedback.worlds
    deliver = scenario("warehouse_medium", horizon_s=120.0)
    run = run_one(plan_run(scenario("search_and_rescue", horizon_s=120.0, interval_s=60.0), "crw", seed=3))
    assert rescue.performance == pytest.approx(run["performance"].sum() / 0.12)
    assert rescue.performance > 0.0
    assert rescue.later == pytest.approx(run["performance"][1] / run["performance"][0])
    assert rescue.time["avoid"] == pytest.approx(run["interference_fraction"].mean())
    assert rescue.time["search"] == pytest.approx(run["n_searching"].sum() / run["n_active"].sum())
    assert sum(medium.time.values()) == pytest.approx(1.0)
    assert rescue.of_limit is None
    assert medium.of_limit == pytest.approx(medium.performance * 0.12 / limit_of(deliver).deliveries)
    assert min(medium.of_limit, abs(rescue.later - 1.0)) > 0.0
    protocol = load_protocol()
    best = best_of(["dpo"], protocol.training, protocol)[2]
    assert rescue.ratio == pytest.approx(rescue.performance / best)
    assert feedback.score == pytest.approx((small.ratio + medium.ratio + rescue.ratio) / 3.0)
    assert len(str(feedback).splitlines()) == 7


@pytest.mark.parametrize(
    ("program", "told"),
    [
        ("x = 1\n", "a class"),
        ("class A: pass\n" + STANDS.replace("reset", "begin"), "got Stands without reset"),
        ("class A:\n  def\n", "program.py, line 2"),
        ("nobody", "Unknown policy 'nobody'"),
        ("1 / 0\nclass A: pass\n", "ZeroDivisionError: division by zero (program.py, line 1)"),
        (STANDS.replace("return", "nil; return"), "warehouse_medium: NameError: name 'nil'"),
        (CANNOT, "NameError: name 'nil' is not defined (program.py:5)"),
        (5, "Expected a policy"),
    ],
)
def test_faults_are_feedback(program, told):
    feedback = evaluate(program, horizon_s=2.0)
    assert told in feedback.error
    assert (feedback.score, feedback.worlds) == (0.0, ())


def test_a_program_that_never_ends_is_stopped():
    assert evaluate("while True: pass\nclass A: pass\n", limit_s=0.2).error == "not ready after 0.2 s"
    assert "ended before" in evaluate("import os\nos._exit(1)\nclass A: pass\n", limit_s=20.0).error
    assert evaluate(STANDS, horizon_s=2.0, limit_s=60.0).worlds[0].performance == 0.0
