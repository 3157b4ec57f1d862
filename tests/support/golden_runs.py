"""Fingerprints of short runs of every kind. A change that must not affect results must not change them.

`python -m tests.support.golden_runs` writes them anew. Do that only for a change that is meant to change results, and
say in the changelog which ones and why.
"""

import hashlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scripts.update_docs import made_with
from swarm_forage_env import AUTHORS_PROGRAM, Quirks, scenario
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import RunSpec, plan_run
from swarm_forage_env.views.arenas import ArenaBatch
from swarm_forage_env.views.plans import plan_arena
from swarm_forage_env.wrappers.registry import parse_wrapper
from tests.support.foraging import NEAR, mild_wrappers, quick_world

FILE = Path(__file__).with_suffix(".json")
_HERE, _THEN = made_with(), json.loads(FILE.read_text(encoding="utf-8"))["made_with"]
AS_THEN = (
    pytest.mark.skipif(
        _HERE["machine"] != _THEN["machine"],
        reason=f"fingerprints of {_THEN['machine']} say nothing on {_HERE['machine']}",
    ),
    # .ci/run installs the versions of the file for this test; see tests/conftest.py.
    pytest.mark.skipif(_HERE != _THEN, reason=f"fingerprints are for {_THEN}, the last bits differ with others"),
)
"""Marks of tests whose numbers hold for the machine and the versions of the golden runs only."""
CHIPMUNK_POLICIES = ("crw", "stochx")
"""Those that also run with Chipmunk's bodies. The other policies do nothing with bodies that these two do not do."""
POLICIES = ("crw", "dpo", "cpfa", "stochm", "stochx", "ppo_warehouse_small", "generalist")
RULES = {"described": Quirks(), "program": AUTHORS_PROGRAM}
WRAPPERS = {"calm": (), "adverse": mild_wrappers()}
FAR: dict[str, dict[str, Any]] = {
    "warehouse_small": {"nest_centre_m": (3.2, 8.0), "nest_size_m": (3.2, 12.8)},
    "warehouse_dual": {"nest_size_m": (3.2, 12.8)},
}
"""The nest where the preset has it: a static cache needs the room in between."""
NEAR_A_WALL: dict[str, Any] = {
    "obstacles": ((15.0, 3.0, 15.4, 7.0), (12.0, 10.0, 16.0, 10.6)),
    "further_nests": ((1.6, 6.0, 4.0, 10.0),),
}
"""Two obstacles and a second nest in the small warehouse."""
MESSAGES: dict[str, Any] = {
    "n_robots": 25,
    "neighbours_seen": 3,
    "neighbour_range_m": 1.3,
    "message_size": 2,
    "message_range_m": 1.7,
}
INTERFACES: dict[str, dict[str, Any]] = {
    "full": {},
    "compact": {"observation": "compact", "actions": "discrete", "automatic_gripper": True, "decision_ticks": 5},
}


def golden_specs() -> dict[str, RunSpec]:
    """One run for each preset, controller, rules and set of wrappers, by a name that tells them.

    A part of those by the description has Chipmunk's bodies as well.
    """
    specs = {}
    for preset in NEAR:
        for policy in POLICIES:
            for rules, quirks in RULES.items():
                for adversity, wrappers in WRAPPERS.items():
                    world = quick_world(preset, quirks=quirks, interval_s=60.0, **FAR.get(preset, {}))
                    name = f"{preset}/{policy}/{rules}/{adversity}"
                    specs[name] = plan_run(world, policy, wrappers=wrappers, seed=7)
                    if policy in CHIPMUNK_POLICIES and rules == "described":
                        chipmunk = replace(world, physics="chipmunk")
                        specs[f"{name}/chipmunk"] = plan_run(chipmunk, policy, wrappers=wrappers, seed=7)
    return specs | _others()


def _others() -> dict[str, RunSpec]:
    """Runs of what no preset of `NEAR` has: a classroom, costs of handling, obstacles and a second nest."""
    classroom = scenario("classroom", horizon_s=180.0, interval_s=60.0)
    specs = {f"classroom/{policy}": plan_run(classroom, policy, seed=7) for policy in POLICIES}
    for policy in ("dpo", "generalist"):
        world = quick_world("warehouse_small", interval_s=60.0)
        cost = parse_wrapper("handling_cost:waveform=square,amplitude=20,offset=20,period_s=60")
        specs[f"handling/{policy}"] = plan_run(world, policy, wrappers=(cost,), seed=7)
        walls = quick_world("warehouse_small", interval_s=60.0, **NEAR_A_WALL)
        specs[f"obstacles/{policy}"] = plan_run(walls, policy, seed=7)
    return specs


def run_fingerprint(spec: RunSpec) -> str:
    """Fingerprint of every column of a run's record."""
    seen = hashlib.sha256()
    for name, values in run_one(spec).columns.items():
        seen.update(name.encode() + values.tobytes())
    return seen.hexdigest()[:16]


def golden_batches() -> dict[str, tuple[dict[str, Any], dict[str, Any]]]:
    """Return scenario fields and the interface of each batch, by a name that tells them.

    Those with Chipmunk's bodies have another number of robots, since both engines give the same bits so soon.
    """
    batches = {}
    for name, interface in INTERFACES.items():
        batches[f"batch/{name}"] = {"n_robots": 20}, interface
        batches[f"batch/{name}/crowd"] = {"n_robots": 100}, interface
        batches[f"batch/{name}/chipmunk"] = {"n_robots": 30, "physics": "chipmunk"}, interface
    batches["batch/messages"] = MESSAGES, {}
    return batches


def batch_fingerprint(fields: dict[str, Any], interface: dict[str, Any]) -> str:
    """Fingerprint of all that a learner meets in two arenas, deaths and new starts included."""
    plan = plan_arena(
        quick_world("warehouse_small", **fields, horizon_s=40.0, interval_s=40.0),
        interface=interface,
        wrappers=mild_wrappers(),
    )
    batch = ArenaBatch(plan, 2)
    chance = np.random.default_rng(3)
    obs, active = batch.reset([5, 6], [None, None])
    seen = hashlib.sha256(obs.tobytes() + active.tobytes())
    for _ in range(250):
        space = batch.interface.action_space
        actions = np.stack([_action(space, chance) for _ in range(batch.n_rows)])
        step = batch.step(actions)
        for part in (step.obs, step.rewards, step.terminated, step.truncated, step.active, step.final_obs):
            seen.update(part.tobytes())
    return seen.hexdigest()[:16]


def _action(space: Any, chance: np.random.Generator) -> Any:
    if hasattr(space, "n"):
        return np.int64(chance.integers(space.n))
    return chance.uniform(-1.0, 1.0, space.shape).astype(np.float32)


def write_all() -> None:
    """Run everything and write the file of fingerprints."""
    runs = {name: run_fingerprint(spec) for name, spec in golden_specs().items()}
    runs |= {name: batch_fingerprint(*batch) for name, batch in golden_batches().items()}
    FILE.write_text(json.dumps({"made_with": made_with(), "fingerprints": runs}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    write_all()
