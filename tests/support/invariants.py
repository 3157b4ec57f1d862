"""What holds after every tick of any run, whoever drives and whatever disturbs the swarm."""

import hashlib

import numpy as np
from scipy.spatial import cKDTree

from swarm_forage_env.contract.codes import Counter, ObjectStatus
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.floor import WHEEL_SCALE_MPS
from swarm_forage_env.scenarios.obstacles import distances_m
from swarm_forage_env.world.state import listed
from swarm_forage_env.wrappers.recorder import COUNTED, TOTALS, RunRecorder
from tests.support.stage import assert_conserved

IN_A_CROWD = 0.12
"""Overlap in a crowd that pushes, beyond what comes from one substep, as a share of a diameter: twice the 6 % that
`tests/science/test_physics_convergence.py` finds. Robots that pile up overlap by 90 %."""


def look_at(env: ForageEnv, obs: np.ndarray, before: bytes = b"") -> tuple[float, bytes]:
    """Check the world and what is seen of it.

    Args:
        env: The environment.
        obs: What is seen, (N, D).
        before: What the last look returned; objects that are where they were then are not looked at again.

    Returns:
        The deepest overlap as a share of a diameter, and a digest of where objects are.
    """
    swarm, arena, radius = env.swarm, env.scenario.arena, env.scenario.robots.radius_m
    assert obs.dtype == np.float32
    assert np.isfinite(obs).all(), "observations are numbers"
    assert np.abs(obs).max(initial=0.0) <= 1.0, "observations lie in [-1, 1]"
    assert not obs[~swarm.present].any(), "who is not there sees nothing"
    state = env.state()
    assert env.state_space.contains(state), "the global view lies in its space"
    assert not np.any(swarm.active & ~swarm.present)
    x_low, y_low, x_high, y_high = arena.interior_m
    position = swarm.position[swarm.present]
    assert np.isfinite(position).all(), "places are numbers"
    assert np.isfinite(swarm.heading).all(), "headings are numbers"
    inside = np.hstack((position - (x_low, y_low), (x_high, y_high) - position))
    assert inside.min(initial=np.inf) >= radius - 1e-9, f"a robot left the arena by {radius - inside.min():.3g} m"
    deep = radius - distances_m(arena.obstacles, position).min(initial=np.inf)
    assert deep <= 1e-9, f"a robot is {deep:.3g} m deep in an obstacle"
    objects = _digest_of_objects(env)
    if objects != before:
        assert_conserved(env)
    return _deepest_overlap(env, position), objects


def _digest_of_objects(env: ForageEnv) -> bytes:
    """Digest of all that `assert_conserved` looks at."""
    objects, caches, swarm = env.objects, env.caches, env.swarm
    happened = hashlib.sha256(np.sort(listed(objects.waiting)))
    lie = objects.floor, objects.status, objects.cell, objects.cache_slot, objects.carriers
    stand = caches.alive, caches.cell, caches.count, caches.serial
    for array in (*lie, *stand, swarm.carried_object, swarm.present, env.events.counters[Counter.CACHES_CREATED]):
        happened.update(np.ascontiguousarray(array))
    return happened.digest()


def _deepest_overlap(env: ForageEnv, position: np.ndarray) -> float:
    if len(position) < 2:
        return 0.0
    nearest = cKDTree(position).query(position, k=2)[0][:, 1].min()
    overlap = max(0.0, 1.0 - float(nearest) / (2 * env.scenario.robots.radius_m))
    assert overlap <= tolerated_overlap(env), f"one robot is on top of another: {overlap:.0%} of a diameter"
    return overlap


def tolerated_overlap(env: ForageEnv) -> float:
    """How deep two robots may be in each other when a tick ends, as a share of a diameter.

    A contact is met one substep late, in which two robots come nearer by twice their speed, and a crowd undoes it
    another one later.
    """
    config = env.scenario
    speed = min(config.robots.max_speed_mps, WHEEL_SCALE_MPS)
    closing_m = 2 * speed * config.dt_s / len(config.physics_substeps)
    return IN_A_CROWD + 2 * closing_m / (2 * config.robots.radius_m)


def look_at_record(recorder: RunRecorder, first_counters: np.ndarray) -> None:
    """Check that the columns of a finished run add up, and agree with the world at its end.

    Args:
        recorder: The stack.
        first_counters: Counters after the reset; static caches count as created there.
    """
    env, columns = recorder.unwrapped, recorder.columns() | recorder.contributed()
    counters, status = env.events.counters - first_counters, env.objects.status
    for name, values in columns.items():
        assert np.isfinite(values).all(), f"{name} is a number"
    for name, counter in TOTALS.items():
        assert columns[name].sum() == counters[counter], f"{name} is the total of its intervals"
        assert columns[name].min() >= 0, f"{name} never falls"
    for name in COUNTED.keys() - TOTALS.keys():
        counter = COUNTED[name]
        ticks = columns[name].sum() * env.scenario.interval_ticks
        assert abs(ticks - counters[counter]) < 1e-6 * max(1, counters[counter]), f"{name} is the mean of its ticks"
    totals = {name: int(columns[name].sum()) for name in TOTALS}
    carried = int(np.count_nonzero(status == ObjectStatus.CARRIED))
    taken = totals["free_pickups"] + totals["cache_pickups"]
    put = totals["collected"] + totals["cache_drops"] + totals["floor_drops"]
    assert taken == put + carried, "what is taken is put somewhere or still carried"
    changed = totals["caches_created"] - totals["caches_depleted"] + int(first_counters[Counter.CACHES_CREATED])
    assert changed == np.count_nonzero(env.caches.alive), "caches that were created stand until they are depleted"
    assert totals["first_picked"] <= taken, "static caches hold objects that nobody has carried"
    assert totals["displaced_drops"] <= totals["floor_drops"]
    assert np.all(columns["n_carrying"] <= columns["n_active"])
    assert np.all(columns["n_active"] <= columns["n_present"])
    assert np.all((columns["interference_fraction"] >= 0.0) & (columns["interference_fraction"] <= 1.0 + 1e-12))
    assert counters[Counter.INTERFERING] <= counters[Counter.ACTIVE]
    assert columns["avoidances"].sum() <= columns["interference_ticks"].sum()
    assert np.all(columns["interference_ticks_near_caches"] <= columns["interference_ticks"])
    busy = ("n_searching", "n_homing", "n_handling", "n_at_caches")
    avoiding = columns["interference_ticks"] / env.scenario.interval_ticks
    at_work = avoiding + sum(columns[name] for name in busy)
    assert np.allclose(at_work, columns["n_active"]), "a robot at work does exactly one of five things"
