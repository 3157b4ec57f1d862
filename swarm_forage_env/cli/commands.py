"""Which commands there are. None of them is imported before it is asked for.

A command is a function, in a file of this folder; what its parameters say, `typer` makes options of. A line here adds
one. A command of two words is listed by the help of the first, `swarm-forage study --help`.
"""

from typing import NamedTuple


class Command(NamedTuple):
    """A command, as `--help` lists it."""

    words: str
    about: str
    """At most 50 characters, so that a terminal of 80 columns cuts none."""
    place: str = ""
    """Module in this folder and function in it, `study:run`; empty where only a second word makes a command."""


COMMANDS: dict[str, tuple[Command, ...]] = {
    "Run and look": (
        Command("run", "Run policies in a scenario and compare them.", "questions:run"),
        Command("plot", "Draw stored runs anew.", "questions:plot"),
        Command("play", "Steer and disturb a run in the browser.", "play:play"),
        Command("record", "Film a run, or draw it at one time.", "look:record"),
        Command("replay", "Write runs as one HTML page that plays them.", "replay:replay"),
        Command("maps", "Draw maps of where things happened.", "maps:maps"),
    ),
    "Score and decide": (Command("score", "Score policies by all measures.", "questions:score"),),
    "Train": (
        Command("train", "Train one policy that every robot shares.", "train:train"),
        Command("train curves", "Draw the progress of trainings.", "train:curves"),
        Command("export", "Write a network as a C header, or as ONNX.", "train:export"),
        Command("dataset", "Record what robots see and do, for learners.", "train:dataset"),
    ),
    "Studies and benchmark": (
        Command("study", "Run the paper's experiments, or your own."),
        Command("study list", "List the experiment sets of the paper.", "study:list_studies"),
        Command("study run", "Make the missing runs of a study, and pack it.", "study:run"),
        Command("study status", "Show which runs of a study are done.", "study:status"),
        Command("study verdict", "Test the claims of the paper with runs.", "study:verdict"),
        Command("study plot", "Draw the figures of a study.", "study:plot"),
        Command("benchmark", "Score policies in a fixed set of worlds.", "benchmark:run"),
        Command("benchmark show", "Show the scores of entries.", "benchmark:show"),
        Command("benchmark verify", "Make runs of an entry again and compare.", "benchmark:verify"),
    ),
    "Look up": (
        Command("list", "List scenarios, policies, wrappers or columns.", "look:list_everything"),
        Command("info", "Describe a scenario or a policy.", "look:info"),
    ),
    "Checks": (
        Command("check", "Check that policies keep the rules.", "check:check"),
        Command("rerun", "Repeat a stored run, and compare.", "check:rerun"),
    ),
}
"""Heading in `--help` -> its commands."""
