"""What learners see and do: the compact view against a slow twin, actions and masks by hand."""

from dataclasses import replace

import numpy as np
import pytest
from gymnasium import spaces

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.codes import Event, Grip
from swarm_forage_env.contract.layout import ObservationLayout
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.interface import (
    InterfaceConfig,
    LearnerInterface,
    any_swarm,
    chosen_interface,
)
from swarm_forage_env.policies.network import Network, NetworkAbout
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.quirks import Quirks
from swarm_forage_env.wrappers.registry import parse_wrapper
from tests.reference.learner import allowed_actions, automatic_grip, compact_row, numbered_action
from tests.support.stage import NEST_CELL, OPEN_CELL, cell_centre, lay, load, put, stand, tidy_world


def bound(env: ForageEnv, **choices) -> LearnerInterface:
    return LearnerInterface(InterfaceConfig(**choices), env.swarm_spec)


@pytest.mark.parametrize(("caches", "noise", "behind_counts"), [("static", 0.0, False), ("none", 0.05, True)])
def test_the_compact_view_matches_its_twin_along_runs(caches, noise, behind_counts):
    env = ForageEnv(scenario("warehouse_small", n_robots=30, n_objects=300, width_m=16.0, nest_centre_m=(1.6, 8.0),
                             nest_size_m=(1.6, 12.8), caches=caches,
                             quirks=Quirks(obstacle_behind_counts=behind_counts)))  # fmt: skip
    stack = parse_wrapper(f"sensor_noise:sigma={noise}").wrap(env) if noise else env
    policy = load_policy({"none": "dpo", "static": "stochm"}[caches])
    policy.reset(env.swarm_spec, stream_rng(0, Stream.POLICY))
    interface = bound(env, observation="compact")
    obs = stack.reset_batch(1)
    kinds_seen = np.zeros(interface.layout.size)
    for tick in range(1400):
        obs, *_ = stack.step_batch(policy.act(obs, env.active), tasks=getattr(policy, "task", None))
        if tick == 700:
            away = np.arange(30) % 7 == 3
            env.set_population(active=~away & (np.arange(30) != 5), present=~away)
        if tick % 7 == 0:
            view = interface.observe(obs)
            expected = np.array([compact_row(row, env.layout, behind_counts=behind_counts) for row in obs])
            np.testing.assert_allclose(view, expected, atol=1e-5)
            assert view.min() >= -1.0
            assert view.max() <= 1.0
            kinds_seen += np.abs(view).sum(axis=0)
    if caches == "static" and not noise:
        assert kinds_seen.all(), "every column is put to the test in at least this run"


def test_the_view_of_a_robot_by_hand():
    env = tidy_world(n_robots=1, n_objects=3)
    x, y = cell_centre(OPEN_CELL)
    put(env, 0, x, y, np.pi / 2)
    lay(env, 0, (OPEN_CELL[0] + 1, OPEN_CELL[1]))  # 0.2 m to the east, on the right of a robot that looks north
    lay(env, 1, (OPEN_CELL[0], OPEN_CELL[1] + 2))  # 0.4 m to the north
    interface = bound(env, observation="compact")
    row = interface.observe(env.arena.observe())[0]
    seen = {part.name: row[part.start : part.stop] for part in interface.layout}
    np.testing.assert_allclose(seen["object"], [0.0, -0.2, 1.0], atol=1e-6)
    np.testing.assert_allclose(seen["light"], [0.0, 1.0], atol=0.02)  # the nest lies to the west, on the left
    np.testing.assert_allclose(seen["heading"], [0.0, 1.0], atol=1e-6)
    assert seen["proximity"].tolist() == [0.0, 0.0]
    assert seen["active"].tolist() == [1.0]
    assert not np.concatenate([seen[name] for name in ("obstacle", "on_object", "on_nest", "carrying", "cache")]).any()


def test_full_observations_are_those_of_the_environment():
    env = tidy_world()
    interface = bound(env)
    obs = env.arena.observe()
    seen = interface.observe(obs)
    np.testing.assert_array_equal(seen, obs)
    assert seen is not obs
    assert interface.layout is env.layout
    assert interface.active_column == env.layout.part("active").start


@pytest.mark.parametrize(
    ("choices", "space"),
    [
        ({}, spaces.Box(-1.0, 1.0, (3,), np.float32)),
        ({"automatic_gripper": True}, spaces.Box(-1.0, 1.0, (2,), np.float32)),
        ({"actions": "discrete"}, spaces.Discrete(11)),
        ({"actions": "discrete", "automatic_gripper": True}, spaces.Discrete(6)),
    ],
)
def test_action_spaces(choices, space):
    assert bound(tidy_world(), **choices).action_space == space


def test_motions_drive_and_ask_for_nothing():
    env = tidy_world(n_robots=6, n_objects=8)
    load(env, 0, 0)
    interface = bound(env, actions="discrete")
    commands = interface.command(np.arange(6), env.arena.observe())
    expected = [(0, 0), (0.5, 0.5), (0.4, 0.6), (0.6, 0.4), (-0.25, 0.25), (0.25, -0.25)]
    np.testing.assert_allclose(commands[:, :2], expected)
    np.testing.assert_allclose(commands[:, 2], [Grip.GRASP] + [Grip.RELEASE] * 5)
    start = env.swarm.position.copy(), env.swarm.heading.copy()
    env.step_batch(commands)
    assert not env.events.code.any()
    travelled = np.hypot(*(env.swarm.position - start[0]).T)
    np.testing.assert_allclose(travelled[[0, 1, 4, 5]], [0.0, 0.02, 0.0, 0.0], atol=1e-6)
    turned = env.swarm.heading - start[1]
    assert turned[2] > 0 > turned[3]
    np.testing.assert_allclose(np.rad2deg(turned[4:]), [8.185, -8.185], atol=0.01)


@pytest.mark.parametrize(("max_speed_mps", "arc"), [(0.05, (0.2, 0.3)), (0.2, (0.8, 1.0))])
def test_motions_are_shares_of_the_robots_own_speed(max_speed_mps, arc):
    env = tidy_world(n_robots=3, max_speed_mps=max_speed_mps)
    commands = bound(env, actions="discrete").command(np.arange(3), env.arena.observe())
    np.testing.assert_allclose(commands[1:, :2], [(max_speed_mps / 0.2,) * 2, arc])


def test_the_automatic_gripper_carries_an_object_from_the_floor_to_the_nest():
    env = tidy_world(n_robots=2, n_objects=4)
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    interface = bound(env, automatic_gripper=True)
    idle, told = np.zeros((2, 2), np.float32), []
    obs = env.arena.observe()
    for tick in range(6):
        if tick == 3:
            stand(env, 0, NEST_CELL)
            obs = env.arena.observe()
        obs, *_ = env.step_batch(interface.command(idle, obs))
        told.append(Event(env.events.code[0]))
    assert told == [Event.NONE, Event.PICKED_UP, Event.NONE, Event.NONE, Event.DELIVERED, Event.NONE]
    assert env.events.counters[0] == 1


@pytest.mark.parametrize(
    ("choices", "actions", "reason"),
    [
        ({}, np.zeros((4, 2), np.float32), r"shape \(4, 3\)"),
        ({"actions": "discrete"}, np.zeros((4, 1), np.int64), r"shape \(4,\)"),
        ({"actions": "discrete"}, np.full(4, 11), "from 0 to 10"),
        ({"actions": "discrete"}, np.zeros(4), "whole numbers"),
    ],
)
def test_wrong_actions_are_refused(choices, actions, reason):
    env = tidy_world(n_robots=4)
    with pytest.raises(ValueError, match=reason):
        bound(env, **choices).command(actions, env.arena.observe())


@pytest.mark.parametrize(
    ("choices", "reason"),
    [
        ({"observation": "compakt"}, "Did you mean 'compact'"),
        ({"automatic_gripper": 1}, "True or False"),
        ({"decision_ticks": 0}, ">= 1"),
        ({"frame_decisions": -1}, r"interface\.frame_decisions"),
        ({"action": "discrete"}, "Did you mean 'interface.actions"),
        ({"without": ("gps",)}, "Unknown slice 'gps'. Known: proximity"),
        ({"without": ("position",), "site_memory": True}, "Expected position and heading for site_memory"),
        ("discrete", "its fields by name"),
    ],
)
def test_wrong_choices_are_refused(choices, reason):
    with pytest.raises(ConfigError, match=reason):
        any_swarm(chosen_interface(choices))


def test_an_interface_is_given_as_it_is_by_fields_or_not_at_all():
    numbered, driven = InterfaceConfig(actions="discrete"), InterfaceConfig(automatic_gripper=True, decision_ticks=5)
    assert chosen_interface(numbered, driven) is numbered
    assert chosen_interface(None, driven) is driven
    assert chosen_interface({"decision_ticks": 2}, driven) == InterfaceConfig(automatic_gripper=True, decision_ticks=2)
    assert chosen_interface(None) == chosen_interface({}) == InterfaceConfig()


def test_arrays_that_compiled_code_would_read_or_write_beyond_are_refused():
    env = ForageEnv(scenario("warehouse_small", n_robots=4))
    interface = bound(env, observation="compact", actions="discrete")
    obs, out = np.zeros((4, env.layout.size), np.float32), np.zeros((4, interface.layout.size), np.float32)
    for call in (
        lambda: interface.observe(obs[:, :-1].copy()),
        lambda: interface.observe(obs, out[:, :, None]),
        lambda: interface.observe(obs, out[:3]),
        lambda: interface.mask(obs.astype(np.float64)),
        lambda: interface.command(np.zeros(4, np.int64), np.asfortranarray(obs)),
        lambda: interface.command(np.zeros(4, np.int64), obs[:3]),
    ):
        with pytest.raises(ValueError, match=r"Expected (observations|out) as contiguous float32 of shape"):
            call()


@pytest.mark.parametrize("observation", ["full", "compact"])
def test_slices_that_are_left_out_are_zeros_in_rows_and_weigh_nothing_in_networks(observation):
    config = InterfaceConfig(observation=observation, actions="discrete", without=("position", "heading"))
    interface = any_swarm(config)
    spec = SwarmSpec.of(scenario("warehouse_small"))
    obs = np.random.default_rng(1).uniform(0.1, 0.9, (spec.n_robots, spec.layout.size)).astype(np.float32)
    seen, whole = interface.observe(obs), any_swarm(replace(config, without=())).observe(obs)
    names = [part.name for part in interface.layout for _ in range(part.size)]
    is_hidden = np.isin(names, config.without)
    assert is_hidden.sum() == 4
    assert not seen[:, is_hidden].any()
    assert whole[:, is_hidden].any()
    np.testing.assert_array_equal(seen[:, ~is_hidden], whole[:, ~is_hidden])
    width, n_actions = interface.widths
    layer = np.ones((width, n_actions), np.float32)
    about = NetworkAbout(interface=config, activation="tanh", samples=False)
    network = Network((layer,), (np.zeros(n_actions, np.float32),), about)
    np.testing.assert_array_equal(network.outputs(whole), network.outputs(seen))


# Twins, for random readings


N_ROBOTS = 600
GREYS = [0.7, 0.4, 0.0, 1.0]


def random_readings(layout: ObservationLayout) -> np.ndarray:
    """Observations (N, D) in which everything that decides about a gripper occurs in every combination."""
    rng = np.random.default_rng(0)
    obs = rng.uniform(-1.0, 1.0, (N_ROBOTS, layout.size)).astype(np.float32)
    for name in ("carrying", "interacting", "active"):
        obs[:, layout[name]] = rng.random((N_ROBOTS, 1)) < 0.7
    ground = rng.choice(GREYS, (N_ROBOTS, 1)).repeat(4, axis=1)
    other = rng.random((N_ROBOTS, 4)) < 0.15
    ground[other] = rng.choice(GREYS, np.count_nonzero(other))
    obs[:, layout["ground"]] = ground
    window = layout["los_object"]
    obs[:, window] = np.where(rng.random((N_ROBOTS, 25)) < 0.4, np.abs(obs[:, window]), 0.0)
    return obs


def learner(caches: str = "dynamic", **choices) -> tuple[LearnerInterface, ObservationLayout]:
    spec = ForageEnv(scenario("warehouse_small", n_robots=2, caches=caches)).swarm_spec
    return LearnerInterface(InterfaceConfig(**choices), replace(spec, n_robots=N_ROBOTS)), spec.layout


def test_the_automatic_gripper_acts_like_its_twin():
    interface, layout = learner(automatic_gripper=True)
    obs = random_readings(layout)
    wheels = np.random.default_rng(0).uniform(-1.0, 1.0, (N_ROBOTS, 2)).astype(np.float32)
    commands = interface.command(wheels, obs)
    expected = [automatic_grip(row, layout) for row in obs]
    assert len(set(expected)) == 3, "every answer is put to the test"
    np.testing.assert_array_equal(commands[:, :2], wheels)
    np.testing.assert_array_equal(commands[:, 2], np.array(expected, np.float32))


def test_actions_by_number_act_like_their_twin():
    interface, layout = learner(actions="discrete")
    obs = random_readings(layout)
    chosen = np.random.default_rng(0).integers(0, 11, N_ROBOTS)
    assert set(chosen.tolist()) == set(range(11))
    expected = [numbered_action(int(k), row, layout) for k, row in zip(chosen, obs, strict=True)]
    np.testing.assert_array_equal(interface.command(chosen, obs), np.array(expected, np.float32))


@pytest.mark.parametrize(("automatic_gripper", "caches"), [(False, "none"), (False, "dynamic"), (True, "dynamic")])
def test_masks_are_like_their_twin(automatic_gripper, caches):
    interface, layout = learner(caches, actions="discrete", automatic_gripper=automatic_gripper)
    obs = random_readings(layout)
    found = [set(np.flatnonzero(allowed).tolist()) for allowed in interface.mask(obs)]
    expected = [
        allowed_actions(row, layout, with_grips=not automatic_gripper, dynamic_caches=caches == "dynamic")
        for row in obs
    ]
    assert found == expected
    assert len({frozenset(numbers) for numbers in expected}) >= (2 if automatic_gripper else 8)
