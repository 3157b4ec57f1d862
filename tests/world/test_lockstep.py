"""Arenas that are stepped together are what they are alone, whatever happens to one of them."""

import copy
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from swarm_forage_env import scenario
from swarm_forage_env.contract.policy import ActionError
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.views.arenas import ArenaBatch, ArenaStep
from swarm_forage_env.views.learner_arena import LearnerArena
from swarm_forage_env.views.plans import ArenaPlan, plan_arena
from swarm_forage_env.world.arena import ForagingArena
from swarm_forage_env.world.lockstep import Lockstep, can_go_in_lockstep
from tests.support.branches import pickled

N_ROBOTS = 12
ADVERSITY = (
    "sensor_noise:sigma=0.03",
    "population:malfunction_per_tick=0.02,repair_per_tick=0.03,death_per_tick=0.003",
    "throttle:waveform=sine,amplitude=0.2,offset=0.2,period_s=20",
)
DRIVEN = InterfaceConfig(observation="compact", automatic_gripper=True, decision_ticks=7)
COLUMNS = ("obs", "rewards", "terminated", "truncated", "active", "ended", "final_obs", "returns", "lengths")


def plan(*wrappers: str, interface: InterfaceConfig | None = None, **fields) -> ArenaPlan:
    """A small world, 60 ticks long, so that arenas end and begin anew."""
    world = scenario("warehouse_small", **{"n_robots": N_ROBOTS, "n_objects": 60, "physics": "compiled"} | fields)
    return plan_arena(world, wrappers=wrappers, interface=interface, max_cycles=60)


class TickByTick(LearnerArena):
    decides_at_once = False


class OneByOne(ArenaBatch):
    """Arenas that are stepped one by one and tick by tick: what they do is what the others have to do."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        for arena in self.arenas:
            arena.__class__ = TickByTick

    def _chosen_ways(self) -> tuple[None, None]:
        return None, None


def ways(batch: ArenaBatch) -> tuple[bool, bool, bool, bool]:
    """Whether arenas are stepped together, booked together, paid and observed without Python."""
    lockstep, books = batch._chosen_ways()
    if books is None:
        return lockstep is not None, False, False, False
    return lockstep is not None, True, books.pays, books.copies


def drawn(ticks: int, n_arenas: int) -> np.ndarray:
    """Actions (ticks, A N, 3) with which robots drive on, meet and grasp."""
    actions = np.random.default_rng(0).uniform(-1, 1, (ticks, n_arenas * N_ROBOTS, 3)).astype(np.float32)
    actions[..., :2] = np.abs(actions[..., :2])
    return actions


def joined(steps: list[ArenaStep]) -> dict[str, np.ndarray]:
    """Columns of arenas that were stepped alone, as those of one batch."""
    columns = {name: np.concatenate([getattr(step, name) for step in steps]) for name in COLUMNS}
    columns["ended"] = np.concatenate([step.ended + number * N_ROBOTS for number, step in enumerate(steps)])
    return columns


@pytest.mark.parametrize(
    ("wrappers", "fields", "chosen_ways"),
    [
        ((), {}, (True, True, True, True)),
        (ADVERSITY, {}, (True, True, False, False)),
        ((), {"caches": "dynamic"}, (True, True, True, True)),
        ((), {"walk_probability": 0.02, "caches": "static"}, (True, True, True, True)),
        ((), {"nest_progress": 0.1, "interference": -0.1, "tick": -0.01}, (True, True, True, True)),
        ((), {"nest_progress": 0.1, "team": True}, (True, True, False, True)),
        ((), {"interface": DRIVEN, "first_pickup": 1.0}, (False, True, True, False)),
        ((), {"interface": replace(DRIVEN, frame_decisions=3)}, (False, True, True, False)),
        (("throttle:waveform=constant",), {"interface": DRIVEN}, (False, True, False, False)),
        ((*ADVERSITY, "actuator_noise:sigma=0.1"), {"interface": DRIVEN}, (False, True, False, False)),
        (("handling_cost:waveform=constant",), {"interface": DRIVEN}, (True, True, False, False)),
        ((), {"physics": "chipmunk"}, (False, True, True, True)),
    ],
    ids=[
        "bare",
        "wrapped",
        "dynamic caches",
        "walking objects",
        "rewards",
        "a team",
        "an interface",
        "an interface with frames",
        "a throttled interface",
        "an interface under all kinds of adversity",
        "an interface with a wrapper that acts in every tick",
        "Chipmunk",
    ],
)
def test_arenas_together_are_those_alone(wrappers, fields, chosen_ways):
    chosen = plan(*wrappers, **fields)
    together, alone = ArenaBatch(chosen, 3), [OneByOne(chosen, 1) for _ in range(3)]
    obs, _ = together.reset([4, 5, 6], [None] * 3)
    np.testing.assert_array_equal(obs, np.concatenate([one.reset([4 + k], [None])[0] for k, one in enumerate(alone)]))
    n_ended = 0
    shape = together.interface.action_space.shape
    assert shape is not None
    for actions in drawn(150, 3)[..., : shape[0]]:
        step = together.step(actions)
        expected = joined([one.step(rows) for one, rows in zip(alone, np.split(actions, 3), strict=True)])
        for name in COLUMNS:
            np.testing.assert_array_equal(getattr(step, name), expected[name], err_msg=name)
        n_ended += len(step.outcomes)
    assert ways(together) == chosen_ways
    assert n_ended >= 6


def test_a_swarm_that_dies_between_two_decisions_ends_with_the_next_tick():
    chosen = plan("population:death_per_tick=1e-6", interface=DRIVEN, tick=-1.0)
    ends = []
    for arena in (LearnerArena(chosen), TickByTick(chosen)):
        arena.reset(2)
        for row in range(N_ROBOTS):
            assert arena.env.kill(row)
        rewards = np.zeros(N_ROBOTS, np.float32)
        dead, all_dead, _ = arena.step(np.zeros((N_ROBOTS, 2), np.float32), rewards)
        ends.append((dead.tolist(), all_dead, arena.forage_env.tick, rewards.tolist()))
    assert ends[0] == ends[1]
    assert ends[0][1:3] == (True, 1)


def arenas(n: int) -> list[ForagingArena]:
    """Arenas that have begun, each with a seed of its own."""
    config = plan().world.scenario
    made = [ForagingArena(config) for _ in range(n)]
    for seed, arena in enumerate(made):
        arena.reset(seed)
    return made


def assert_same(one: ForagingArena, other: ForagingArena) -> None:
    """Two arenas are in the same state."""
    assert one.tick == other.tick
    np.testing.assert_array_equal(one.obs, other.obs)
    np.testing.assert_array_equal(one.bodies.poses(), other.bodies.poses())
    np.testing.assert_array_equal(one.objects.floor, other.objects.floor)


def test_a_seat_may_stay_be_stepped_alone_begin_anew_and_go_back():
    ours, theirs = arenas(3), arenas(3)
    lockstep, unit = Lockstep(ours), np.ones((N_ROBOTS, 2))
    actions = drawn(40, 3).reshape(40, 3, N_ROBOTS, 3)
    kept = None
    for tick, now in enumerate(actions):
        seats = [seat for seat in range(3) if (tick + seat) % 3 or tick < 20]
        assert not lockstep.step(dict.fromkeys(seats, 0.5 * unit if tick == 7 else None), now)
        for seat in seats:
            theirs[seat].step(now[seat], wheel_gain=0.5 * unit if tick == 7 else None)
        if tick == 10:
            for arena in (ours[1], theirs[1]):
                arena.reset(99)
        if tick == 15:
            kept = [pickle.dumps(arena.__getstate__()) for arena in (ours[0], theirs[0])]
        if tick == 25:
            assert kept is not None
            for arena, state in zip((ours[0], theirs[0]), kept, strict=True):
                arena.__setstate__(pickle.loads(state))  # noqa: S301 - written above
        if tick == 30:
            for arena in (ours[2], theirs[2]):
                arena.step(now[2])
        for one, other in zip(ours, theirs, strict=True):
            assert_same(one, other)


def test_a_refused_action_stops_its_own_arena_only():
    ours, theirs = arenas(3), arenas(3)
    now = drawn(1, 3).reshape(3, N_ROBOTS, 3)
    now[1, 5, 0] = np.nan
    refused = Lockstep(ours).step(dict.fromkeys(range(3)), now)
    assert list(refused) == [1]
    assert "robot_5" in str(refused[1])
    assert [arena.tick for arena in ours] == [1, 0, 1]
    with pytest.raises(ActionError, match="robot_5"):
        theirs[1].step(now[1])
    for seat in (0, 2):
        theirs[seat].step(now[seat])
    for one, other in zip(ours, theirs, strict=True):
        assert_same(one, other)
    batch = ArenaBatch(plan(), 3)
    batch.reset([0, 1, 2], [None] * 3)
    with pytest.raises(ActionError, match="robot_5") as raised:
        batch.step(now.reshape(-1, 3))
    assert "arena 1, which was not stepped" in "".join(raised.value.__notes__)


def test_who_may_go_in_lockstep():
    config = plan().world.scenario
    assert can_go_in_lockstep([ForagingArena(config), ForagingArena(config)])
    unlike = (
        ForagingArena(config, reads=("proximity",)),
        ForagingArena(scenario("warehouse_small", n_robots=N_ROBOTS + 1)),
    )
    for other in unlike:
        assert not can_go_in_lockstep([ForagingArena(config), other])
        with pytest.raises(ValueError, match="Expected arenas of one scenario"):
            Lockstep([ForagingArena(config), other])
    assert not can_go_in_lockstep([ForagingArena(scenario("warehouse_small", physics="chipmunk"))] * 2)


@pytest.mark.parametrize(
    ("wrappers", "fields"),
    [
        (ADVERSITY, {"walk_probability": 0.05, "caches": "dynamic", "pickup_ticks": 3, "n_objects": 300}),
        (
            ("handling_cost:waveform=square,amplitude=5,offset=6,period_s=8",),
            {"message_size": 2, "neighbours_seen": 3, "neighbour_range_m": 3.0},
        ),
        ((), {"n_objects": 300}),
    ],
    ids=["adversity", "messages", "plain"],
)
def test_arrays_are_found_after_copies_snapshots_and_starts_in_any_order(wrappers, fields):
    chosen, chance = plan(*wrappers, **fields), np.random.default_rng(0)
    batch, other = ArenaBatch(chosen, 3), OneByOne(chosen, 3)
    for each in (batch, other):
        each.reset([1, 2, 3], [None] * 3)
    for tick in range(100):
        actions = chance.uniform(-1, 1, (3 * N_ROBOTS, 3 + fields.get("message_size", 0))).astype(np.float32)
        actions[:, 2] = 1.0 if tick % 3 == 0 else actions[:, 2]
        step, expected = batch.step(actions), other.step(actions)
        for name in COLUMNS:
            np.testing.assert_array_equal(getattr(step, name), getattr(expected, name), err_msg=f"{name}, tick {tick}")
        event, n = chance.integers(16), int(chance.integers(3))
        if event == 0:
            batch = pickled(batch)
        elif event == 1:
            batch = copy.deepcopy(batch)
        elif event in (2, 3):
            batch.arenas[n].restore(batch.arenas[n].snapshot())
        elif event == 4:
            for each in (batch, other):
                each._start(n, np.empty((N_ROBOTS, each._n_columns), np.float32), seed=tick)
