"""What each rule of `beeline` is worth: the training worlds without it, one rule at a time."""

from metrics.benchmark import evaluate
from swarm_forage_env.runs.spec import policy_spec

WITHOUT = {
    "every rule": {},
    "go back to the last find": {"first_m": 1e9},
    "search wider and wider": {"wider": 1.0},
    "drive to the nearest object in view": {"sight_cells": 0},
    "home to the nearest point of the nest": {"inside": 0.0},
    "pass on the right": {"right": 0.0},
    "lose patience": {"patience": 10**9},
}

for rule, parameters in WITHOUT.items():
    feedback = evaluate(policy_spec("beeline", parameters=parameters), horizon_s=10_000.0, seeds=(1, 2))
    ratios = "  ".join(f"{each.ratio:.2f}" for each in feedback.worlds)
    print(f"{rule:<38}{ratios}  {feedback.score:.2f}{feedback.error}", flush=True)
