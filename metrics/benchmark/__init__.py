"""A benchmark that others can enter: a fixed protocol of worlds and seeds, entry files, and what they are worth."""

from .arena import Feedback, evaluate
from .board import Board, board_of
from .entry import Entry, Training, read_entry, run_benchmark
from .protocol import Protocol, load_protocol
from .standing import Standing
from .verification import SAME, verify_entry

__all__ = [
    "run_benchmark",
    "evaluate",
    "Feedback",
    "verify_entry",
    "load_protocol",
    "read_entry",
    "board_of",
    "Board",
    "Protocol",
    "Entry",
    "Training",
    "Standing",
    "SAME",
]
