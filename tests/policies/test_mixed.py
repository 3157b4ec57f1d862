"""Mixed swarms: their names, who drives which robot, and what the record tells of each part."""

from pathlib import Path

import numpy as np
import pytest

from swarm_forage_env import ConfigError, check_policy, load_policy, plan_run, run_one, scenario
from swarm_forage_env.cli.scenario_options import split_names
from swarm_forage_env.contract.codes import Task
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.inspect.replay.capture import record_replay
from swarm_forage_env.policies.mixed import MixedPolicy
from swarm_forage_env.policies.mixture import mixture_of, mixture_parts, part_sizes
from swarm_forage_env.policies.network import Network
from swarm_forage_env.policies.pretrained import network_file
from swarm_forage_env.policies.registry import local_policy, policy_label
from swarm_forage_env.runs.run import LiveRun, build_stack
from swarm_forage_env.scenarios.columns import PART_COLUMNS
from swarm_forage_env.scenarios.performance import performance_curve, performance_of

TINY = scenario("warehouse_small", n_robots=6, n_objects=400, horizon_s=100.0, interval_s=50.0, physics="compiled")


class Witness:
    """Stands, and keeps what it was shown."""

    reads = ("proximity", "position")

    def reset(self, spec, rng):
        self.spec, self.rng, self.seen = spec, rng, []

    def act(self, obs, active):
        self.seen.append((obs.copy(), active.copy()))
        return np.full((self.spec.n_robots, 3), self.spec.n_robots / 10.0, np.float32)


# Names


def test_small_shares_are_stored_as_they_are_read():
    parts = mixture_parts("mixed:crw=0.0015%,dpo=rest")
    assert parts[0].amount == "0.000015"
    assert mixture_parts(mixture_of(parts)) == parts


@pytest.mark.parametrize(
    ("amounts", "n_robots", "sizes"),
    [
        ("crw=2,dpo=4", 6, (2, 4)),
        ("crw=2,dpo=rest", 6, (2, 4)),
        ("crw=0.25,dpo=0.25,random=rest", 10, (3, 2, 5)),
        ("crw=0.25,dpo=0.75", 6, (2, 4)),
        ("crw=29%,dpo=rest", 50, (15, 35)),
        ("crw=0.2,dpo=rest", 1, (0, 1)),
        ("crw=0.0,dpo=1.0", 7, (0, 7)),
        ("crw=rest", 3, (3,)),
        ("crw=0.001%,dpo=rest", 100_000, (1, 99_999)),
    ],
)
def test_amounts_become_numbers_of_robots(amounts, n_robots, sizes):
    assert part_sizes(f"mixed:{amounts}", n_robots) == sizes


@pytest.mark.parametrize("n_robots", range(1, 40))
def test_shares_are_never_a_whole_robot_away(n_robots):
    sizes = part_sizes("mixed:crw=0.1,dpo=0.35,random=0.3,stochm=0.25", n_robots)
    assert sum(sizes) == n_robots
    assert (np.abs(np.array(sizes) - n_robots * np.array([0.1, 0.35, 0.3, 0.25])) < 1.0).all()


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("mixed:crw=2,dpo=5", "add up to a swarm of 6 robots, got 2 \\+ 5 = 7"),
        ("mixed:crw=2,dpo=3", "got 2 \\+ 3 = 5; write one of them as rest"),
        ("mixed:crw=7,dpo=rest", "fit into a swarm of 6 robots, got 7 = 7"),
        ("mixed:crw=0.5,dpo=0.2", "shares of .* that add up to 1, got 0.7"),
        ("mixed:crw=rest,dpo=rest", "'rest' once"),
        ("mixed:crw=2,dpo", "got 'dpo' in"),
        ("mixed:", "Expected a mixed swarm as"),
        ("mixed:mixed:crw=2=2", "got the mixed swarm"),
        ("mixed:crw=share,dpo=rest", "the parameter share"),
        ("mixed:crw=2,crv=4", "Unknown policy 'crv'. Did you mean 'crw'?"),
        ("mixed:stochm=2,crw=rest", "stochm for static, crw for none"),
    ],
)
def test_what_is_no_mixed_swarm_is_refused(name, told):
    with pytest.raises(ValueError, match=told):
        plan_run(TINY, name)


def test_a_file_in_a_part_may_be_told_its_interface():
    parts = mixture_parts("mixed:a.zip:observation=compact,decision_ticks=5=10,runs/x=1/b.npz=20%,crw=rest")
    assert [(part.policy, part.amount) for part in parts] == [
        ("a.zip:observation=compact,decision_ticks=5", "10"),
        ("runs/x=1/b.npz", "0.2"),
        ("crw", "rest"),
    ]


def test_lists_of_policies_may_hold_mixed_swarms():
    assert split_names("crw, mixed:a.zip:decision_ticks=5=10, dpo=rest,stochm,mixed:crw=1,dpo=2") == (
        "crw",
        "mixed:a.zip:decision_ticks=5=10,dpo=rest",
        "stochm",
        "mixed:crw=1,dpo=2",
    )


def test_caches_that_are_asked_for_settle_what_parts_disagree_on():
    assert plan_run(TINY, "mixed:stochm=2,crw=rest", caches="static").scenario.caches == "static"
    assert plan_run(TINY, "mixed:stochm=2,random=rest").scenario.caches == "static"


# Who drives whom


def test_each_part_sees_its_rows_and_drives_them():
    made: list[Witness] = []

    def witness() -> Witness:
        made.append(Witness())
        return made[-1]

    with local_policy("witness", witness):
        mixed = MixedPolicy("mixed:witness=2,random=1,witness=rest")
    env = build_stack(TINY)
    mixed.reset(env.unwrapped.swarm_spec, np.random.default_rng(5))
    obs, active = env.reset_batch(1), np.array([True, False, True, True, False, True])
    actions = mixed.act(obs, active).copy()
    first, second = made
    np.testing.assert_array_equal(first.seen[0][0], obs[:2])
    np.testing.assert_array_equal(second.seen[0][0], obs[3:])
    np.testing.assert_array_equal(np.concatenate([first.seen[0][1], second.seen[0][1]]), np.delete(active, 2))
    np.testing.assert_array_equal(actions[:2], np.full((2, 3), np.float32(0.2)))
    np.testing.assert_array_equal(actions[3:], np.full((3, 3), np.float32(0.3)))
    assert mixed.reads == ("proximity", "position")
    children = np.random.default_rng(5).spawn(3)
    alone = load_policy("random")
    alone.reset(SwarmSpec.of(scenario("warehouse_small", n_robots=1)), children[1])
    np.testing.assert_array_equal(actions[2:3], alone.act(obs[2:3], active[2:3]))
    np.testing.assert_array_equal(second.rng.random(4), children[2].random(4))


def test_the_rules_of_policies_hold_for_a_mixed_swarm():
    check_policy("mixed:random=0.3,ppo_warehouse_small=rest", TINY)


def test_tasks_are_those_of_the_parts():
    mixed = MixedPolicy("mixed:random=2,stochm=rest")
    run = LiveRun(build_stack(plan_run(TINY, "stochm").scenario), mixed, 1)
    run.advance(to_tick=3)
    assert (mixed.task[:2] == Task.NONE).all()
    assert (mixed.task[2:] != Task.NONE).all()
    assert not hasattr(MixedPolicy("mixed:random=rest"), "task")


def test_robots_tell_which_part_they_belong_to():
    replay, _ = record_replay(plan_run(TINY, "mixed:random=2,crw=3,random=rest"), seconds=20.0)
    words = [replay.activities[code] for code in replay.activity[-1]]
    assert words[:2] == ["random (part 1)"] * 2
    assert all(word.startswith("crw: ") for word in words[2:5])
    assert words[5] == "random (part 3)"


def test_each_robot_remembers_the_places_of_its_part():
    mixed = MixedPolicy("mixed:random=2,dpo=rest")
    anywhere = scenario("warehouse_medium", n_robots=6, physics="compiled")  # objects are never far
    run = LiveRun(build_stack(anywhere), mixed, 1)
    run.advance(to_tick=400)
    (dpo,) = (policy for policy in mixed._policies if hasattr(policy, "describe_memories"))
    places = [mixed.describe_memories().of_robot(row) for row in range(6)]
    assert [len(place.objects_m) for place in places[:2]] == [0, 0]
    for row in range(4):
        np.testing.assert_array_equal(places[2 + row].objects_m, dpo.describe_memories().of_robot(row).objects_m)
    assert sum(len(place.objects_m) for place in places) == dpo.n_known.sum() > 0


# What the record tells


@pytest.fixture(scope="module")
def record():
    return run_one(plan_run(TINY, "mixed:crw=2,crw=rest", seed=4))


def test_parts_add_up_to_the_swarm(record):
    assert record.collected.sum() + record.first_picked.sum() > 0
    for column in ("collected", "first_picked", "n_active", "n_present"):
        total = record.contributed[f"part_1_{column}"] + record.contributed[f"part_2_{column}"]
        np.testing.assert_array_equal(total, record.columns()[column])
    share = sum(record.contributed[f"part_{k}_interference_fraction"] * n for k, n in ((1, 2), (2, 4))) / 6
    np.testing.assert_allclose(share, record.interference_fraction)


def test_a_mixed_run_is_the_same_twice_and_after_a_file(record, tmp_path):
    again = run_one(plan_run(TINY, "mixed:crw=2,crw=rest", seed=4))
    assert again.same_results(record)
    record.write(tmp_path / "run.parquet")
    assert type(record).read(tmp_path / "run.parquet").same_results(record)


def test_a_part_can_be_the_performance(record):
    per_robot = record.read_as("part_1_first_picked_per_robot").performance
    np.testing.assert_array_equal(per_robot, record.contributed["part_1_first_picked"] / 2.0)
    assert performance_of("part_1_first_picked_per_robot").unit == "objects per robot"
    with pytest.raises(ConfigError, match="Expected performance to be a recorded column"):
        performance_of("part_0_collected")


def test_a_swarm_that_is_not_mixed_is_its_only_part():
    columns = run_one(plan_run(TINY, "crw", seed=4)).columns()
    assert not any(name.startswith("part_") for name in columns)
    for name in PART_COLUMNS:
        np.testing.assert_array_equal(performance_curve(f"part_1_{name}", columns), columns[name])
        assert not performance_curve(f"part_2_{name}", columns).any()


# Files


@pytest.fixture
def network(tmp_path) -> Path:
    shipped = network_file("ppo_warehouse_small")
    assert shipped is not None
    path = tmp_path / "mine.npz"
    path.write_bytes(shipped.read_bytes())
    return path


def test_files_are_pinned_by_their_content(network, monkeypatch):
    monkeypatch.chdir(network.parent)
    spec = plan_run(TINY, "mixed:mine.npz=2,crw=rest")
    assert spec.policy == f"mixed:{network}=2,crw=rest"
    assert policy_label(spec.policy) == "mixed:mine=2,crw=rest"
    assert spec.parameters["parts"][str(network)].keys() == {"digest"}
    assert plan_run(TINY, spec.policy, parameters=spec.parameters) == spec
    assert run_one(spec).same_columns(run_one(plan_run(TINY, "mixed:ppo_warehouse_small=2,crw=rest")))
    Network.load(network)  # whole, until another network takes its place
    network.write_bytes(b"something else")
    with pytest.raises(ValueError, match=r"mine\.npz"):
        run_one(spec)
