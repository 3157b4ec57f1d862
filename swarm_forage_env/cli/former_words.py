"""Words that commands had once, or that people try: what to type instead.

The parser refuses them like any other wrong word; they are only looked up to say what is right.
"""

from collections.abc import Collection

OPTIONS = {
    "--agent": ("--policy",),
    "--algorithm": ("--algo",),
    "--beside": ("--policy",),
    "--cell": ("--condition",),
    "--config": ("--scenario",),
    "--controller": ("--policy",),
    "--duration": ("--horizon",),
    "--env": ("--scenario",),
    "--file": ("--picture", "--out"),
    "--format": ("--json",),
    "--gamma": ("--arg gamma=NUMBER",),
    "--into": ("--file",),
    "--learning-rate": ("--arg learning_rate=NUMBER",),
    "--model": ("--policy",),
    "--n-jobs": ("--jobs",),
    "--n-robots": ("--robots",),
    "--out": ("--file", "--picture"),
    "--output": ("--file", "--out", "--picture"),
    "--picture": ("--file", "--out"),
    "--plot": ("--picture",),
    "--policies": ("--policy",),
    "--population": ("--robots",),
    "--processes": ("--jobs",),
    "--reading": ("--rules",),
    "--records": ("--out",),
    "--robots": ("--fit",),
    "--seconds": ("--horizon",),
    "--seed": ("--seeds", "--first-seed"),
    "--seeds": ("--seed",),
    "--size": ("--robots",),
    "--temperature": ("--plan FILE, with temperature = NUMBER in it",),
    "--workers": ("--jobs",),
    "--world": ("--scenario",),
    "--wrappers": ("--wrapper",),
    "-j": ("--jobs",),
    "-n": ("--robots",),
    "-o": ("--file", "--picture", "--out"),
}
"""Option -> options that may be meant, some with what follows them; the first of them that a command has is."""

COMMANDS = {
    "availability": "predict availability",
    "bench": "benchmark",
    "columns": "list columns",
    "config": "info",
    "curves": "train curves",
    "describe": "info",
    "eval": "score",
    "evaluate": "score",
    "film": "record",
    "policies": "list policies",
    "reproduce": "rerun",
    "report": "study report",
    "scenarios": "list scenarios",
    "schema": "list columns",
    "show": "info",
    "simulate": "run",
    "stuck": "check",
    "study compare": "study diff",
    "study maps": "maps",
    "verdict": "study verdict",
    "video": "record",
    "view": "watch",
    "wrappers": "list wrappers",
}
"""Command, after its first word where that is one -> what it is called."""


def right_option(word: str, known: Collection[str]) -> str:
    """Return the option of a command that a wrong one stands for; empty if none is known."""
    return next((right for right in OPTIONS.get(word, ()) if right.split()[0] in known), "")
