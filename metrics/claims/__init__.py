"""The claims of the paper and its intuitions, each a few contrasts of runs: arrays in, answers out."""

from .panel import MARGINS, Panel, PanelName
from .paper import CLAIMS, EXPERIMENTS, INTUITIONS
from .statements import Statement
from .verdict import Claim, Verdict, check_claims

__all__ = [
    "CLAIMS",
    "EXPERIMENTS",
    "INTUITIONS",
    "MARGINS",
    "Claim",
    "Panel",
    "PanelName",
    "Statement",
    "Verdict",
    "check_claims",
]
