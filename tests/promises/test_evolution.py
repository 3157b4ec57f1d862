"""Numbers of controllers and weights of networks evolve: short, to see that the scripts still fit the packages."""

import importlib
import json
import re
from pathlib import Path

import numpy as np
import pytest

from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.network import Network, NetworkAbout
from swarm_forage_env.training.evaluations import read_evaluations

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def evolve_controller(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "scripts")
    return importlib.import_module("evolve_controller")


@pytest.fixture
def evolve_network(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "scripts")
    return importlib.import_module("evolve_network")


@pytest.mark.compiled
def test_no_generation_has_the_seeds_that_judge(evolve_controller):
    used = {evolve_controller.seed_of(generation, seed) for generation in range(100) for seed in range(4)}
    assert len(used) == 400
    assert used.isdisjoint(range(evolve_controller.JUDGING_SEED, evolve_controller.JUDGING_SEED + 100))


def test_numbers_of_a_controller_evolve(run):
    pytest.importorskip("cma", reason="needs the evolve extra: cma")
    ranges = ("wander_speed_mps=0.01:0.1:log@0.02", "wander_max_change_deg=1:20")
    size = ("--generations", "2", "--population", "4", "--horizon", "200", "--judging", "2")
    code, out, err = run("evolve_controller", "crw", *ranges, *size)
    assert code == 0, err
    assert re.findall(r"generation (\S+): best \d\.\d{3}", err) == ["1/2", "2/2"]
    title, header, yardstick, before, evolved, _, found = out.splitlines()
    assert title == "Performance of crw in 200 s"
    assert header.split()[1:] == ["warehouse_small", "warehouse_medium", "search_and_rescue"]
    assert [line.split()[0] for line in (yardstick, before, evolved)] == ["dpo,", "before", "evolved"]
    speed, angle = (float(number) for number in json.loads(found.partition(", ")[2][:-1]).values())
    assert 0.01 <= speed <= 0.1
    assert 1.0 <= angle <= 20.0
    assert run("evolve_controller", "crw", *ranges, *size)[1] == out, "equal seeds, equal numbers"


def test_a_set_is_on_the_front_unless_another_one_is_as_good_in_both_and_better_in_one(evolve_controller):
    performance, interference = [1.0, 0.9, 0.8, 0.7, 0.9], [1.0, 0.5, 0.6, 0.5, 0.5]
    assert evolve_controller.on_front(np.array([performance, interference])) == [True, True, False, False, True]


def test_numbers_of_a_controller_trade_performance_against_interference(run):
    pytest.importorskip("optuna", reason="needs the evolve extra: optuna")
    pytest.importorskip("matplotlib", reason="needs the plots extra: matplotlib")
    ranges = ("wander_speed_mps=0.01:0.1:log", "recovery_s=0:10")
    size = ("--generations", "2", "--population", "4", "--horizon", "400", "--judging", "2", "--front", "front.png")
    code, out, err = run("evolve_controller", "dpo", *ranges, *size)
    assert code == 0, err
    assert re.findall(r"generation (\S+): best (1\.\d{3})", err)[0][0] == "1/2", "its own numbers are the first set"
    title, header, before, *front, _ = out.splitlines()
    assert title == "Performance and interference of dpo in 400 s, as shares of dpo's"
    assert header.split()[-2:] == ["wander_speed_mps", "recovery_s"]
    assert before.split()[:7] == ["before", "1.00", "±", "0.00", "1.00", "±", "0.00"], "it is the yardstick itself"
    assert before.split()[-2:] == ["0.09", "2"]
    assert [row.split()[0] for row in front] == [str(k + 1) for k in range(len(front))]
    assert all(0.01 <= float(row.split()[-2]) <= 0.1 and 0.0 <= float(row.split()[-1]) <= 10.0 for row in front)
    assert Path("front.png").read_bytes().startswith(b"\x89PNG")
    assert run("evolve_controller", "dpo", *ranges, *size)[1] == out, "equal seeds, equal front"


EVOLVING = """
n_arenas = 3
samples = true
interface = { observation = "compact", actions = "discrete", automatic_gripper = true, decision_ticks = 5 }
sampler.scenario = { horizon_s = 100.0, interval_s = 100.0, nest_progress = 0.05 }
sampler.worlds = [
    { scenario = { preset = "warehouse_small", n_robots = 3 }, weight = 2 },
    { scenario = { preset = "search_and_rescue", n_robots = 6 } },
]
stages = [{ steps = 500 }, { steps = 700 }]
[evaluation]
every_steps = 500
horizon_s = 200.0
worlds = [{ scenario = { preset = "warehouse_small", n_robots = 4 }, baseline = "dpo" }]
"""


def test_networks_evolve_by_a_plan_and_end_within_its_decisions(run):
    pytest.importorskip("cma", reason="needs the evolve extra: cma")
    pytest.importorskip("matplotlib", reason="needs the plots extra: matplotlib")
    Path("plan.toml").write_text(EVOLVING, encoding="utf-8")
    size = ("--seed", "3", "--n-steps", "11", "--population", "4", "--hidden", "2")
    for out in ("first", "second"):
        code, _, err = run("evolve_network", "--plan", "plan.toml", "--out", out, *size)
        assert code == 0, err
    evaluations = read_evaluations(Path("first/seed_3/evaluations.csv"))
    assert [one.steps for one in evaluations] == [528, 1056, 1188], "generations of 11 decisions of 6 + 6 robots"
    first, second = (Network.load(f"{out}/seed_3/policy.npz") for out in ("first", "second"))
    assert [weight.shape[1] for weight in first.weights] == [2, 6]
    assert first.about.samples
    assert first.about.card["plan"]["seed"] == 3
    assert all(np.array_equal(one, two) for one, two in zip(first.weights, second.weights, strict=True)), "equal seeds"
    assert Path("first/curves.png").read_bytes().startswith(b"\x89PNG")


def test_each_robot_is_driven_by_its_own_network(evolve_network):
    sizes, rng = (5, 3, 2), np.random.default_rng(0)
    points = rng.normal(size=(4, evolve_network.n_numbers(sizes))).astype(np.float32)
    rows = rng.normal(size=(4, 5)).astype(np.float32)
    found = evolve_network.outputs(rows, evolve_network.layers_of(points, sizes))
    for k, point in enumerate(points):
        layers = evolve_network.layers_of(point[None], sizes)
        about = NetworkAbout(interface=InterfaceConfig())
        network = Network(tuple(weight[0] for weight, _ in layers), tuple(bias[0] for _, bias in layers), about)
        np.testing.assert_allclose(found[k], network.outputs(rows[k : k + 1])[0], rtol=1e-5)


def test_a_network_is_worth_as_much_in_a_world_that_pays_little(evolve_network):
    rich, poor = np.array([0.0, 10.0, 20.0]), np.array([0.2, 0.1, 0.0])
    np.testing.assert_allclose(evolve_network.worth(np.array([rich, poor])), 0.0, atol=1e-12)
    assert evolve_network.worth(np.array([rich, [np.nan, 1.0, 1.0]])).argmax() == 2
