"""Rows of arenas are present, terminate and start anew as in the episode of `lives`."""

from dataclasses import asdict

import gymnasium
import numpy as np
import pytest
from pettingzoo.test import parallel_api_test

from swarm_forage_env import parallel_env
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.policy import ActionError
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.views.arenas import ArenaBatch, ArenaStep
from swarm_forage_env.views.gymnasium import JointForageEnv
from swarm_forage_env.views.learner_arena import LearnerArena
from swarm_forage_env.views.pettingzoo import ParallelLearnerEnv
from swarm_forage_env.views.plans import ArenaPlan, plan_arena
from swarm_forage_env.wrappers.base import SwarmWrapper
from tests.support import lives
from tests.support.sampled import sampler


def plan(interface: InterfaceConfig | None = None, **overrides) -> ArenaPlan:
    options = {**lives.WORLD, **overrides}
    return plan_arena(**options, interface=interface)


def told_story(batch: ArenaBatch, arena: int) -> list[ArenaStep]:
    batch.reset([7 + a for a in range(batch.n_arenas)], [None] * batch.n_arenas)
    actions = np.zeros((batch.n_rows, 3), np.float32)
    return lives.live(
        lambda **change: batch.envs[arena].unwrapped.set_population(**change), lambda: batch.step(actions)
    )


@pytest.mark.parametrize("arena", [0, 1])
def test_the_story_by_hand(arena):
    batch = ArenaBatch(plan(), 2)
    rows = slice(arena * lives.N_ROBOTS, (arena + 1) * lives.N_ROBOTS)
    steps = told_story(batch, arena)
    np.testing.assert_array_equal([step.rewards[rows] for step in steps], lives.REWARDS)
    np.testing.assert_array_equal([step.terminated[rows] for step in steps], lives.TERMINATED)
    np.testing.assert_array_equal([step.truncated[rows] for step in steps], lives.TRUNCATED)
    np.testing.assert_array_equal([step.active[rows] for step in steps[:-1]], lives.ACTIVE_BEFORE[1:])
    seen = [step.obs[rows, batch.interface.active_column] == 1.0 for step in steps[:-1]]
    np.testing.assert_array_equal(seen, lives.ACTIVE_BEFORE[1:])
    episodes = {
        (tick, row - rows.start): (step.returns[k], step.lengths[k])
        for tick, step in enumerate(steps)
        for k, row in enumerate(step.ended.tolist())
        if step.is_episode[k] and rows.start <= row < rows.stop
    }
    assert episodes == lives.EPISODES


def test_final_observations_are_the_last_of_the_old_run_and_the_returned_ones_the_first_of_the_new():
    batch = ArenaBatch(plan(), 1)
    steps = told_story(batch, 0)
    death, end = steps[2], steps[4]
    assert death.ended.tolist() == [1]
    np.testing.assert_array_equal(death.final_obs, np.zeros((1, batch.interface.layout.size)))
    assert end.ended.tolist() == [0, 1, 2]
    position = batch.interface.layout["position"]
    # Nobody moved: robots 0 and 2 are last seen where they stood, and start somewhere else; robot 1 comes back.
    np.testing.assert_array_equal(end.final_obs[[0, 2], position], steps[0].obs[[0, 2], position])
    assert not end.final_obs[1].any()
    assert np.all(end.obs[:, position] != end.final_obs[:, position])
    assert end.obs.any(axis=1).all()
    assert end.outcomes[0]["seconds"] == 1.0


def test_an_action_is_kept_for_the_ticks_of_a_decision_and_rewards_add_up():
    batch = ArenaBatch(plan(InterfaceConfig(decision_ticks=3)), 1)
    batch.reset([0], [None])
    actions = np.zeros((3, 3), np.float32)
    step = batch.step(actions)
    assert step.rewards.tolist() == [3.0, 3.0, 3.0]
    assert batch.arenas[0].forage_env.tick == 3
    last = batch.step(actions)
    assert last.rewards.tolist() == [2.0, 2.0, 2.0], "the horizon of 5 ticks cuts the second decision short"
    assert last.truncated.all()
    assert last.lengths.tolist() == [2, 2, 2]


def test_a_reset_changes_the_scenario_for_all_later_runs_until_told_otherwise():
    batch = ArenaBatch(plan(InterfaceConfig(observation="compact")), 2)
    batch.reset([0, 1], [{"scenario": {"n_objects": 9, "width_m": 24.0}}, None])
    assert [arena.forage_env.scenario.objects.n_objects for arena in batch.arenas] == [9, 4]
    for _ in range(lives.HORIZON_TICKS):
        batch.step(np.zeros((6, 3), np.float32))
    assert [arena.forage_env.scenario.arena.width_m for arena in batch.arenas] == [24.0, 32.0]
    batch.reset([0, 1], [{"scenario": {}}, None])
    assert [arena.forage_env.scenario.objects.n_objects for arena in batch.arenas] == [4, 4]


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"scenario": {"n_robots": 4}}, "n_robots to stay 3"),
        ({"scenario": {"n_objekts": 4}}, "n_objects"),
        ({"scenario": 4}, "reset option 'scenario' to be a table of values by name, got 4"),
        ({"scenario": {}, "width_m": 12.0}, "Expected the reset option 'scenario' only, .* got 'width_m'"),
    ],
)
def test_a_refused_scenario_leaves_the_arena_as_it_was(options, reason):
    batch = ArenaBatch(plan(), 1)
    batch.reset([0], [None])
    with pytest.raises(ConfigError, match=reason):
        batch.reset([0], [options])
    with pytest.raises(RuntimeError, match="Call reset before step"):
        batch.step(np.zeros((3, 3), np.float32))
    batch.reset([0], [None])
    assert batch.step(np.zeros((3, 3), np.float32)).rewards.tolist() == [1.0, 1.0, 1.0]


def test_refuses_too_few_rows_and_steps_before_a_reset_or_after_the_end():
    batch = ArenaBatch(plan(), 2)
    with pytest.raises(RuntimeError, match="reset"):
        batch.step(np.zeros((6, 3), np.float32))
    with pytest.raises(RuntimeError, match="Call reset before action_masks"):
        batch.action_masks()
    batch.reset([0, 1], [None, None])
    with pytest.raises(ValueError, match=r"6 rows .* got shape \(\)"):
        batch.step(np.float32(0.0))
    with pytest.raises(ValueError, match="6 rows"):
        batch.step(np.zeros((3, 3), np.float32))
    with pytest.raises(ValueError, match="n_arenas to be a whole number >= 1"):
        ArenaBatch(plan(), 0)


class TickByTick(LearnerArena):
    """Python steps every tick: what the compiled decisions of others have to equal."""

    def reset(self, *given):
        super().reset(*given)
        self._tells_ahead = False


@pytest.mark.parametrize("interface", [{}, {"observation": "compact", "automatic_gripper": True, "decision_ticks": 7}])
@pytest.mark.parametrize(
    "wrappers",
    [
        (),
        (
            "sensor_noise:sigma=0.03",
            "population:malfunction_per_tick=0.02,repair_per_tick=0.03,death_per_tick=0.01",
            "throttle:waveform=sine,amplitude=0.2,offset=0.2,period_s=20",
        ),
    ],
)
def test_a_decision_is_its_ticks_one_by_one(wrappers, interface):
    world = scenario("warehouse_small", n_robots=12, n_objects=60, nest_progress=0.1)
    chosen = plan_arena(world, wrappers=wrappers, interface=interface, max_cycles=60)
    ours, theirs = ArenaBatch(chosen, 2), ArenaBatch(chosen, 2)
    for arena in theirs.arenas:
        arena.__class__ = TickByTick
    np.testing.assert_equal(*(batch.reset([4, 5], [None] * 2) for batch in (ours, theirs)))
    rng, n_ended = np.random.default_rng(0), 0
    for _ in range(80):
        actions = rng.uniform(-1, 1, (24, *ours.interface.action_space.shape)).astype(np.float32)
        one, other = (batch.step(actions) for batch in (ours, theirs))
        np.testing.assert_equal(asdict(one), asdict(other))
        n_ended += len(one.outcomes)
    assert n_ended >= 2


class Interrupted(SwarmWrapper):
    stack_position = 0

    def after_step(self, tasks, terminated, truncated):
        if self.unwrapped.tick == 2:
            raise KeyboardInterrupt


@pytest.mark.parametrize("number", [0, 1])
def test_no_step_goes_on_from_one_that_broke_off(number):
    batch = ArenaBatch(plan(InterfaceConfig(decision_ticks=3)), 2)
    batch.arenas[number].env = Interrupted(batch.arenas[number].env)
    batch.reset([0, 1], [None, None])
    with pytest.raises(KeyboardInterrupt):
        batch.step(np.zeros((6, 3), np.float32))
    with pytest.raises(RuntimeError, match="Call reset before step"):
        batch.step(np.zeros((6, 3), np.float32))


WORLDS = sampler()
COMPACT = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5)
PLAN = plan_arena(sampler=WORLDS, interface=COMPACT, max_cycles=20)
SEEDS = (3, 5, 8)


def numbers(n_rows, rng):
    return rng.integers(0, 6, n_rows)


def drawn(seeds=SEEDS):
    """The worlds that the arenas of a batch draw with these seeds."""
    return [WORLDS.world_of(seed, share) for seed, share in zip(seeds, WORLDS.shares(len(seeds)), strict=True)]


def sizes(seeds=SEEDS):
    return [world.n_robots for world in drawn(seeds)]


def test_each_arena_is_bit_for_bit_that_of_its_world_alone():
    batch = ArenaBatch(PLAN, len(SEEDS))
    obs, _ = batch.reset(SEEDS, [None] * len(SEEDS))
    rng = np.random.default_rng(0)
    alone = [
        ArenaBatch(plan_arena(world.scenario, wrappers=world.wrappers, interface=COMPACT, max_cycles=20), 1)
        for world in drawn()
    ]
    first = [one.reset([seed], [None])[0] for one, seed in zip(alone, SEEDS, strict=True)]
    for arena, own in enumerate(first):
        np.testing.assert_array_equal(obs.reshape(3, 6, -1)[arena, : len(own)], own)
    for _ in range(3):
        actions = numbers(batch.n_rows, rng).reshape(3, 6)
        step = batch.step(actions.ravel())
        for arena, one in enumerate(alone):
            n_robots = one.n_robots
            own = one.step(actions[arena, :n_robots])
            np.testing.assert_array_equal(step.obs.reshape(3, 6, -1)[arena, :n_robots], own.obs)
            np.testing.assert_array_equal(step.rewards.reshape(3, 6)[arena, :n_robots], own.rewards)
            np.testing.assert_array_equal(step.active.reshape(3, 6)[arena, :n_robots], own.active)


def test_rows_to_spare_are_absent_from_the_first_step_to_the_last():
    batch = ArenaBatch(PLAN, len(SEEDS))
    obs, active = batch.reset(SEEDS, [None] * len(SEEDS))
    spare = np.arange(6) >= np.array(sizes())[:, None]
    masks = batch.action_masks().reshape(3, 6, -1)
    assert masks[spare].sum(axis=1).tolist() == [1] * spare.sum()
    assert masks[spare][:, 0].all()  # stand
    for tick in range(4):
        assert not obs.reshape(3, 6, -1)[spare].any()
        assert not active.reshape(3, 6)[spare].any()
        assert obs.reshape(3, 6, -1)[~spare].any(axis=1).all()
        step = batch.step(np.zeros(batch.n_rows, np.int64))
        obs, active = step.obs, step.active
        assert not step.rewards.reshape(3, 6)[spare].any()
        if tick < 3:
            assert not step.terminated.any()
            assert len(step.ended) == 0
    # The horizon: all rows are done, because the next run may have robots there, but nobody's episode ends in them.
    assert step.ended.tolist() == list(range(18))
    np.testing.assert_array_equal(step.is_episode, ~spare.ravel())
    np.testing.assert_array_equal(step.terminated, spare.ravel())
    np.testing.assert_array_equal(step.truncated, ~spare.ravel())
    assert not step.final_obs[spare.ravel()].any()
    assert [outcome["n_robots"] for outcome in step.outcomes.values()] == sizes()
    # Other worlds follow, of other sizes.
    present = obs.reshape(3, 6, -1).any(axis=2).sum(axis=1).tolist()
    assert present == [arena.n_robots for arena in batch.arenas]
    assert present != sizes()


# PettingZoo's test wonders about possible agents that a run does not have; that is what a drawn size means.
@pytest.mark.filterwarnings("ignore:No agents present but not all possible_agents:UserWarning")
def test_a_parallel_environment_has_the_agents_of_the_run():
    env = parallel_env(sampler=WORLDS, max_cycles=30)
    assert isinstance(env, ParallelLearnerEnv)
    assert len(env.possible_agents) == 6
    for seed in SEEDS:
        observations, _ = env.reset(seed=seed)
        assert list(observations) == env.agents == env.possible_agents[: sizes([seed])[0]]
        assert env.state_space.contains(env.state())
    parallel_api_test(env, num_cycles=60)


def test_the_global_state_has_robots_and_objects_in_their_places():
    env = ParallelLearnerEnv(sampler=WORLDS)
    env.reset(seed=3)
    n_robots, n_objects = sizes([3])[0], env.forage_env.scenario.objects.n_objects
    state, own = env.state(), env.forage_env.state()
    np.testing.assert_array_equal(state[: 6 * n_robots], own[: 6 * n_robots])
    np.testing.assert_array_equal(state[36 : 36 + 3 * n_objects], own[6 * n_robots :])
    assert not state[6 * n_robots : 36].any()
    assert not state[36 + 3 * n_objects :].any()


def test_the_central_view_is_padded():
    env = gymnasium.make("swarm_forage/sampled-v0", sampler=WORLDS, interface=COMPACT).unwrapped
    assert isinstance(env, JointForageEnv)
    obs, info = env.reset(seed=3)
    n_robots = sizes([3])[0]
    assert env.observation_space.contains(obs)
    assert obs.any(axis=1).tolist() == info["active"].tolist() == [row < n_robots for row in range(6)]
    obs, _, _, _, info = env.step(env.action_space.sample(mask=tuple(info["action_mask"])))
    assert not obs[n_robots:].any()
    with pytest.raises(ActionError, match="6 rows"):
        env.step(np.zeros(n_robots, np.int64))
