"""A benchmark that others can enter: a fixed protocol of worlds and seeds, entry files, and what they are worth."""

from .board import Board, board_of, draw_benchmark
from .croissant import describe_entries
from .entry import Entry, Training, read_entry
from .page import details_page, page_block
from .protocol import BenchmarkError, Protocol, ProtocolWorld, load_protocol
from .running import BenchmarkQuestion, benchmark_question, run_benchmark
from .standing import Standing, reference_of, scripted_entries, standing_of
from .verification import Verification, VerificationQuestion, verification_question, verify_entry

__all__ = [
    "run_benchmark",
    "benchmark_question",
    "verify_entry",
    "verification_question",
    "VerificationQuestion",
    "Verification",
    "BenchmarkQuestion",
    "load_protocol",
    "read_entry",
    "scripted_entries",
    "reference_of",
    "standing_of",
    "board_of",
    "Board",
    "page_block",
    "details_page",
    "draw_benchmark",
    "describe_entries",
    "Protocol",
    "ProtocolWorld",
    "Entry",
    "Training",
    "Standing",
    "BenchmarkError",
]
