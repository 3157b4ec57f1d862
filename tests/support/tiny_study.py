"""A study of two policies, two axes and both rules whose runs take a moment."""

from swarm_forage_env.runs.policy_spec import PolicySpec
from swarm_forage_env.studies.study import Axis, StudySpec

RANDOM = PolicySpec(label="random", policy="random")
TWIN = PolicySpec(label="twin", policy="random", caches="static")
NOBODY = PolicySpec(label="nobody", policy="nobody")
"""No installed policy has this name, so its runs fail."""


def tiny_study(**changes):
    given = {
        "name": "tiny",
        "scenario": "warehouse_small",
        "settings": {"n_objects": 20},
        "policies": (RANDOM, TWIN),
        "axes": (Axis(name="population_size", values=(2, 3)), Axis(name="noise", values=(0.0, 0.02))),
        "reference": 0.0,
        "rules": ("described",),
        "seeds": (0, 1),
        "horizon_s": 4.0,
        "interval_s": 2.0,
    }
    return StudySpec(**given | changes)
