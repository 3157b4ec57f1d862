"""The columns of the record of a run: what each holds, its unit, and what people call it.

Records, their schema, what performance can be, and tables of curves from other sources all read this one list.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

from swarm_forage_env.scenarios.floor import NEAR_CACHE_M

Kind: TypeAlias = Literal["text", "whole", "number", "amount", "fraction"]
"""Kind of a column: text, whole numbers >= 0, numbers, numbers >= 0, numbers in [0, 1]."""


@dataclass(frozen=True, slots=True)
class Column:
    """What a column holds: per interval, or once per run for keys."""

    kind: Kind
    unit: str
    meaning: str
    is_total: bool = False
    """Whether a number is a total over its interval; else it is a mean, a share, a state."""
    words: str = ""
    """Name for people where it is read as performance; empty = the name itself."""


def _total(unit: str, meaning: str, words: str = "") -> Column:
    return Column("amount", unit, meaning, is_total=True, words=words)


def _mean(unit: str, meaning: str, words: str = "") -> Column:
    return Column("amount", unit, meaning, words=words)


def _share(meaning: str) -> Column:
    return Column("fraction", "1", meaning)


_TASKS = ("generalist", "harvester", "collector", "starter", "finisher", "transferer", "cache_collector")

KEY_COLUMNS: Mapping[str, Column] = {
    "run_id": Column("text", "", "hash of the run's specification"),
    "scenario": Column("text", "", "name of the scenario"),
    "controller": Column("text", "", "name of the policy"),
    "n_robots": Column("whole", "robots", "swarm size N, all rows that can appear"),
    "criterion": Column("text", "", "what a study varied, 'none' for a single run"),
    "criterion_value": Column("number", "", "value of the criterion"),
    "seed": Column("whole", "", "seed of the run"),
}
"""One value per run."""

INTERVAL_COLUMNS: Mapping[str, Column] = {
    "interval": Column("whole", "", "index of the interval, from 0"),
    "t_end_s": _mean("s", "end of the interval"),
    "performance": Column("amount", "", "what `performance` of the scenario names, in its unit"),
    "collected": _total("objects", "delivered to the nest", "deliveries"),
    "first_picked": _total("objects", "picked up that no robot had carried since they were placed", "first pick-ups"),
    "free_pickups": _total("objects", "picked up from the floor", "pick-ups from the floor"),
    "cache_pickups": _total("objects", "picked up from a cache", "pick-ups from caches"),
    "cache_drops": _total("objects", "dropped into a cache", "drops into caches"),
    "floor_drops": _total("objects", "laid on the floor by a robot, displaced ones included", "drops on the floor"),
    "displaced_drops": _total("objects", "dropped without a free cell and re-placed elsewhere"),
    "objects_moved": _total("cells", "steps taken by randomly walking objects"),
    "caches_created": _total("caches", "created"),
    "caches_depleted": _total("caches", "dissolved because one object was left"),
    "interference_ticks": _total("robot-ticks", "active robots in interference, summed over ticks"),
    "interference_fraction": _share("share of active robots in interference, mean over ticks"),
    "n_active": _mean("robots", "mean over ticks of the tasked swarm: present and not in repair", "robots at work"),
    "n_present": _mean("robots", "mean over ticks of robots that are born and alive", "robots present"),
    "n_carrying": _mean("robots", "mean over ticks of active robots that carry an object", "robots carrying"),
    "n_caches": _mean("caches", "mean over ticks", "caches"),
    "n_objects_cached": _mean("objects", "mean over ticks of objects inside caches", "objects in caches"),
    "adversity": Column(
        "number", "1 or ticks", "mean over ticks of a throttle, else of the ticks that handling takes, else 0"
    ),
}
"""One value per interval, in every record."""

CONTRIBUTED_COLUMNS: Mapping[str, Column] = {
    "avoidances": _total(
        "avoidances", "begun by active robots; the mean duration is interference_ticks / avoidances, in ticks"
    ),
    "interference_ticks_near_caches": _total(
        "robot-ticks", f"those of interference_ticks within {NEAR_CACHE_M:g} m of the centre of a cache"
    ),
    "n_searching": _mean(
        "robots",
        "mean over ticks of active robots that neither avoid, nor handle an object, nor carry one",
        "robots searching",
    ),
    "n_homing": _mean(
        "robots",
        "the same of robots that carry an object, to the nest or elsewhere, and neither avoid nor handle it",
        "robots homing",
    ),
    "n_handling": _mean(
        "robots", "the same of robots in a pick-up or a drop away from caches, and not avoiding", "robots handling"
    ),
    "n_at_caches": _mean(
        "robots",
        "the same of robots in a pick-up from a cache or a drop into one, their wait for their turn included",
        "robots waiting at caches",
    ),
    "task_share_none": _share("mean over ticks of the share of active robots without a task"),
    **{f"task_share_{task}": _share(f"the same for the task {task.replace('_', ' ')}") for task in _TASKS},
    "throttle": Column("number", "1", "waveform V(t) of the throttle at the last tick of the interval"),
    "throttle_mean": Column("number", "1", "waveform V(t) of the throttle, mean over the ticks of the interval"),
    "believed_interference_fraction": _share(
        "share of active robots that see an obstacle under sensor noise, false ones included, mean over ticks"
    ),
    "handling_cost": Column(
        "number", "ticks", "mean ticks of a pick-up and a drop that start in the last tick of the interval"
    ),
    "handling_cost_mean": Column("number", "ticks", "the same, mean over the ticks of the interval"),
    "deaths": _total("robots", "that died in the interval"),
    "births": _total("robots", "that were born"),
    "malfunctions": _total("robots", "that went into repair"),
    "repairs": _total("robots", "that came back from repair"),
    "n_in_repair": _mean("robots", "length of the repair queue, mean over ticks", "robots in repair"),
    "time_at_work_s": _mean(
        "s", "mean length of the stays in the tasked swarm that ended in the interval; 0 = none ended"
    ),
    "time_in_repair_s": _mean(
        "s", "mean length of the absences that ended with a repair in the interval; 0 = none ended"
    ),
}
"""One value per interval, in records of runs to which they apply."""

ALL_COLUMNS: Mapping[str, Column] = {**KEY_COLUMNS, **INTERVAL_COLUMNS, **CONTRIBUTED_COLUMNS}
"""All columns of records, in the order of the schema."""
