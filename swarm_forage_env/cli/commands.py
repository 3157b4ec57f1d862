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
        Command("watch", "Watch a run in a window.", "look:watch"),
        Command("record", "Film a run, or draw it at one time.", "look:record"),
        Command("replay", "Write runs as one page, with play and pause.", "replay:replay"),
        Command("maps", "Draw where on the floor things happened.", "maps:maps"),
        Command("saliency", "Show what a trained network looks at.", "look:saliency"),
    ),
    "Score and decide": (
        Command("score", "Score policies in all measures' experiments.", "questions:score"),
        Command("compare", "The same, for several policies.", "questions:score"),
        Command("predict", "Fit performance to swarm size, and predict.", "questions:predict"),
        Command("predict availability", "Show how likely enough robots are at work.", "questions:availability"),
        Command("choose", "Rank policies by constraints that they meet.", "questions:choose"),
    ),
    "Train": (
        Command("train", "Train one policy that every robot shares.", "train:train"),
        Command("train curves", "Draw how trainings went.", "train:curves"),
        Command("dataset", "Record what robots see and do, for learners.", "train:dataset"),
    ),
    "Studies and benchmark": (
        Command("study", "Whole studies: the paper's sets, or your own."),
        Command("study list", "List the experiment sets of the paper.", "study:list_studies"),
        Command("study show", "Show what a study varies, and its budgets.", "study:show"),
        Command("study run", "Run what is missing of a study, and pack it.", "study:run"),
        Command("study status", "Show which runs of a study are done.", "study:status"),
        Command("study pack", "Put all runs of a study into one file.", "study:pack"),
        Command("study unpack", "Go on from packed studies: their runs as folders.", "study:unpack"),
        Command("study verdict", "Hold the claims of the paper against runs.", "study:verdict"),
        Command("study plot", "Draw the figures of a study.", "study:plot"),
        Command("study report", "Write one page about studies.", "study:report"),
        Command("study diff", "Say which conditions of two studies differ.", "study:diff"),
        Command("ablate", "Switch one quirk of the rules at a time.", "questions:ablate"),
        Command("benchmark", "Run policies in a fixed protocol of worlds.", "benchmark:run"),
        Command("benchmark worlds", "List the worlds of the benchmark.", "benchmark:worlds"),
        Command("benchmark show", "Show what entries are worth.", "benchmark:show"),
        Command("benchmark page", "Write the page that compares entries.", "benchmark:page"),
    ),
    "What there is": (
        Command("list", "List scenarios, policies, wrappers or columns.", "look:list_everything"),
        Command("info", "Show what a scenario or a policy is.", "look:info"),
    ),
    "Checks": (
        Command("check", "Check rules of policies, find stuck robots.", "check:check"),
        Command("rerun", "Run a stored run again, here, and compare.", "check:rerun"),
    ),
}
"""Heading in `--help` -> its commands."""
