"""What a training run reports: where it stands, and how the policy did in evaluations."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True, slots=True)
class Evaluation:
    """How the policy did at some point of the training, beside the baseline; means over runs."""

    steps: int
    """Decisions of single robots so far."""
    wall_time_s: float
    """Time spent on the training, s; a resumed one counts on from its latest evaluation."""
    performance: float
    """What the scenario counts, per 1,000 simulated s."""
    baseline: float
    """The same of the baseline."""
    interference_fraction: float
    """Mean fraction of active robots in interference."""


@dataclass(frozen=True, kw_only=True, slots=True)
class TrainingStatus:
    """Where a training run stands."""

    steps: int
    """Decisions of single robots so far."""
    wall_time_s: float
    """Time spent on the training, s; a resumed one counts on from its latest evaluation."""
    episode_return: float
    """Mean return of the latest episodes, nan before the first."""
