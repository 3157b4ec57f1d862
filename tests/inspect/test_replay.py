"""Replays: they show the run that its record describes, come back from their files, and change nothing."""

import dataclasses
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from swarm_forage_env.contract.codes import Counter, ObjectStatus
from swarm_forage_env.inspect.replay.capture import record_replay
from swarm_forage_env.inspect.replay.coding import pack
from swarm_forage_env.inspect.replay.files import write_replays
from swarm_forage_env.inspect.replay.frames import HEADING_STEPS, Replay, Status
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import LiveRun, build_env, run_one
from swarm_forage_env.runs.spec import RunSpec, plan_run
from swarm_forage_env.wrappers.recorder import TOTALS
from swarm_forage_env.wrappers.registry import parse_wrapper
from tests.reference.replay_arrays import runs_of, unpacked
from tests.support.drivers import states_of
from tests.support.foraging import CROWDED

DISTURBED = (
    parse_wrapper("population:malfunction_per_tick=0.01,repair_per_tick=0.02,death_per_tick=0.0005"),
    parse_wrapper("throttle:waveform=sine,amplitude=0.2,offset=0.2,period_s=40"),
    parse_wrapper("sensor_noise:sigma=0.02"),
)


def spec_of(policy: str = "stochm", wrappers=DISTURBED, **fields):
    return plan_run(dataclasses.replace(CROWDED, **fields), policy, wrappers=wrappers, seed=5)


@pytest.fixture(scope="module")
def replay() -> Replay:
    return record_replay(spec_of())


# What is kept


def test_a_replay_is_the_run_of_the_record():
    spec = spec_of()
    kept, record = record_replay(spec, frame_s=0.6), run_one(spec)
    assert kept.ticks.tolist() == [*range(0, 400, 3), 400]
    for name, counter in TOTALS.items():
        assert kept.counters[-1, counter] == record[name].sum(), name


def test_frames_show_the_run_within_half_a_step(monkeypatch):
    states, _ = states_of(spec_of(), monkeypatch)
    kept = record_replay(spec_of(), frame_s=1.0)
    table = np.full((60, 3), -9)
    for frame, tick in enumerate(kept.ticks.tolist()):
        changed = kept.object_events[kept.object_events[:, 0] == frame]
        table[changed[:, 1]] = changed[:, 2:]
        if tick == 0:
            continue
        swarm, objects, _ = states[tick]
        present, carried, status = swarm.present, swarm.carried_object, objects.status
        assert np.abs(kept.position_m[frame] - swarm.position)[present].max() <= kept.position_step_m / 2 + 1e-9
        turned = np.angle(np.exp(1j * (kept.heading[frame] * (2.0 * np.pi / HEADING_STEPS) - swarm.heading)))[present]
        assert np.abs(turned).max() <= np.pi / HEADING_STEPS + 1e-9
        assert np.array_equal(kept.has(Status.ABSENT)[frame], ~present)
        assert np.array_equal(kept.has(Status.REPAIR)[frame], present & ~swarm.active)
        assert np.array_equal(kept.has(Status.CARRYING)[frame], carried >= 0)
        assert np.array_equal(table[:, 0], status)
        lies = status != ObjectStatus.CARRIED
        assert np.array_equal(table[lies, 1:], objects.cell[lies])
        assert np.array_equal(carried[table[~lies, 1]], np.flatnonzero(~lies))


def test_a_dead_robot_stays_where_it_was_last():
    deadly = (parse_wrapper("population:death_per_tick=0.1"),)
    kept = record_replay(spec_of("crw", deadly), frame_s=0.2)
    absent = kept.has(Status.ABSENT)
    assert not absent[0].any()
    assert absent[-1].all()
    assert not kept.has(Status.REPAIR).any(), "the dead are not in repair"
    assert kept.end_tick < 400, "the run ends with the last robot"
    for robot in range(12):
        gone = kept.position[absent[:, robot], robot]
        last = kept.position[~absent[:, robot], robot][-1]
        assert (gone == last).all()


def test_pick_ups_and_drops_are_those_that_were_counted():
    kept = record_replay(spec_of("dpo", (), horizon_s=400.0, physics="compiled"), frame_s=0.2)
    frames, signs, places = kept.handovers
    assert (np.diff(frames) >= 0).all()
    picked = kept.counters[-1, [Counter.FREE_PICKUPS, Counter.CACHE_PICKUPS]].sum()
    assert np.count_nonzero(signs == 1) == picked > 0
    assert np.count_nonzero(signs == -1) == kept.counters[-1, Counter.COLLECTED] > 0
    assert (places[signs == -1, 0] < 1.8 + 0.2).all(), "in the nest"
    assert (places[signs == 1, 0] > 1.8).all(), "outside of it"


def places_at(replay: Replay, frame: int, robot: int) -> set[tuple[int, float, float]]:
    """Put together what a robot remembers at a frame: kind, x, y in m."""
    places = set()
    for when, row, kind, *steps in replay.memory_events.tolist():
        if row == robot and when <= frame:
            place = (abs(kind), *(round(step * replay.position_step_m, 3) for step in steps))
            (places.add if kind > 0 else places.remove)(place)
    return places


@pytest.mark.parametrize("name", ["stochm", "generalist"])
def test_places_are_those_that_robots_remember(name):
    spec = spec_of(name, ())
    kept = record_replay(spec, frame_s=10.0)
    policy = load_policy(spec.policy, spec.parameters)
    run = LiveRun(build_env(spec.scenario, reads=policy.reads), policy, spec.seed)
    n_places = 0
    for frame, tick in enumerate(kept.ticks.tolist()):
        run.advance(to_tick=tick)
        memories = policy.describe_memories()
        for robot in range(spec.scenario.robots.n_robots):
            expected = {
                (kind, *(round(kept.position_step_m * step, 3) for step in steps))
                for kind, places_m in enumerate(memories.of_robot(robot), 1)
                for steps in np.rint(places_m / kept.position_step_m).tolist()
            }
            assert places_at(kept, frame, robot) == expected
            n_places += len(expected)
    assert n_places > 0
    assert (kept.memory_events[:, 2] < 0).any(), "something has been forgotten"


# Files


def test_a_page_holds_every_array_of_its_runs(replay, tmp_path):
    other = record_replay(spec_of("crw", ()))
    path = write_replays(tmp_path / "new" / "two.html", [replay, other], title="two & two")
    assert "<title>two &amp; two</title>" in path.read_text()
    runs = runs_of(path)
    assert [about["label"] for about, _ in runs] == ["stochm", "crw"]
    for (about, found), kept in zip(runs, (replay, other), strict=True):
        values = {item.name: getattr(kept, item.name) for item in dataclasses.fields(kept)}
        there = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
        there |= {f"signal_{name}": values for name, values in kept.signals.items()}
        assert found.keys() == there.keys()
        for name, array in there.items():
            assert found[name].dtype == array.dtype
            np.testing.assert_array_equal(found[name], array)
        assert RunSpec.from_mapping(about["spec"]) == kept.spec
        assert [about[name] for name in ("frame_ticks", "end_tick")] == [kept.frame_ticks, kept.end_tick]
        assert (tuple(about["activities"]), about["versions"]) == (kept.activities, kept.versions)


@settings(max_examples=30)
@given(
    st.sampled_from(["u1", "u2", "i4", "f4"]).flatmap(
        lambda dtype: arrays.arrays(dtype, arrays.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=5))
    )
)
def test_arrays_come_back(array):
    again = unpacked(zlib.decompress(pack(array)), array.dtype, array.shape)
    assert np.array_equal(again, array, equal_nan=array.dtype.kind == "f")
