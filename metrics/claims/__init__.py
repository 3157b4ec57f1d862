"""The claims of the paper and its intuitions, each with a verdict by its rule and by ours: arrays in, answers out."""

from .claim import Claim, PanelName, Statement, Verdict, check_claim
from .panel import Panel
from .paper import CLAIMS, INTUITIONS
from .words import EXPERIMENTS

__all__ = ["CLAIMS", "EXPERIMENTS", "INTUITIONS", "Claim", "Panel", "PanelName", "Statement", "Verdict", "check_claim"]
