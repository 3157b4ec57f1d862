"""What a training run reports: where it stands, and how the policy did in evaluations."""

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True, kw_only=True, slots=True)
class WorldEvaluation:
    """How the policy did in one of several worlds; means over runs."""

    world: str
    """Name of the world."""
    performance: float
    """What the scenario counts, per 1,000 simulated s."""
    baseline: float
    """The same of the baseline."""
    ratio: float
    """Performance over that of the baseline; see `evaluation_worlds`."""
    interference_fraction: float
    """Mean fraction of active robots in interference."""
    baseline_policy: str
    """Which policy the baseline is."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Evaluation:
    """How the policy did at some point of the training, beside the baseline; means over runs.

    With several worlds, `performance` is the mean or the worst of their ratios to the baselines, and `baseline` is 1.
    """

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
    worlds: tuple[WorldEvaluation, ...] = ()
    """How it did in each of several worlds; none where there is only that of the plan."""

    def to_mapping(self) -> dict[str, Any]:
        """Return the evaluation as plain values, with `worlds` only where there are some."""
        plain = asdict(self)
        if not self.worlds:
            del plain["worlds"]
        return plain


@dataclass(frozen=True, kw_only=True, slots=True)
class TrainingStatus:
    """Where a training run stands."""

    steps: int
    """Decisions of single robots so far."""
    wall_time_s: float
    """Time spent on the training, s; a resumed one counts on from its latest evaluation."""
    episode_return: float
    """Mean return of the latest episodes, nan before the first."""
