"""Studies as their files: any study from a few words, and one whose runs take a moment."""

import json

from swarm_forage_env.studies.ladders import CRITERIA
from swarm_forage_env.studies.study import study_of
from swarm_forage_env.studies.study_file import Axis

RANDOM = "random"
TWIN = {"policy": "random", "label": "twin", "caches": "static"}
BROKEN = {"policy": "random", "label": "broken", "parameters": {"speed": 3}}
"""It takes no arguments, so its runs fail."""


def word(value):
    """A value as TOML has it in a line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(name)} = {word(one)}" for name, one in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(word, value)) + "]"
    return json.dumps(value) if isinstance(value, str | bool) else repr(value)


def made_up_study(*axes, reference=None, **given):
    """A study from its tables by name, `axes` as `Axis`; the budget is `small`, its keys are among the others."""
    told = {"name": "mine", "scenario": "warehouse_small", "policies": ("crw",), "rules": ("described",)} | given
    small = {name: told.pop(name) for name in ("seeds", "horizon_s", "interval_s") if name in told}
    tables = [
        {"criterion" if axis.name in (*CRITERIA, "quirk") else "field": axis.name, "values": axis.values}
        for axis in axes
    ]
    if reference is not None:
        tables[-1]["reference"] = reference
    lines = [f"{name} = {word(value)}" for name, value in (told | {"axis": tables}).items()]
    return study_of("\n".join([*lines, f"budget.small = {word(small)}"]), "small")


def tiny_study(*axes, **changes):
    """A study of two policies and two axes."""
    usual = (Axis(name="population_size", values=(2, 3)), Axis(name="noise", values=(0.0, 0.02)))
    given = {"name": "tiny", "set": {"n_objects": 20}, "policies": (RANDOM, TWIN), "seeds": (0, 1), "horizon_s": 4.0,
             "interval_s": 2.0}  # fmt: skip
    return made_up_study(*(axes or usual), **given | changes)
