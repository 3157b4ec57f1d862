"""The claims of the paper, each with a verdict by its rule and by ours: arrays in, answers out."""

from .checking import Claim, PanelName, Statement, Verdict, check_claim
from .panel import Panel
from .paper import CLAIMS, EXPERIMENTS

__all__ = ["CLAIMS", "EXPERIMENTS", "Claim", "Panel", "PanelName", "Statement", "Verdict", "check_claim"]
