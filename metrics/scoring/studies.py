"""The curves of a study as arrays (runs, intervals), with what each experiment varied and which runs it has."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..checks import CurveError
from ..curves import FloatArray
from ..queues import PopulationRates
from .columns import SIZE, UNDISTURBED


@dataclass(frozen=True, kw_only=True, eq=False)
class RunCurves:
    """The runs of one experiment: one criterion at one value with one swarm size."""

    criterion: str
    """One of `CRITERIA`."""
    value: float
    n_robots: int
    seeds: tuple[int, ...]
    """Number of each run, rising, (R,)."""
    curves: dict[str, FloatArray]
    """Column -> values, (R, T); only columns that the table has."""
    rates: PopulationRates | None = None
    """Rates of change of the population, per second."""
    n_planned: int | None = None
    """How many runs were planned; None = as many as there are."""

    @property
    def performance(self) -> FloatArray:
        """P(N, t), (R, T)."""
        return self.curves["performance"]

    @property
    def interference(self) -> FloatArray:
        """t_lost(N, t), (R, T)."""
        return self.curves["interference_fraction"]

    @property
    def n_lost(self) -> int:
        """Runs that were planned and are not there."""
        return 0 if self.n_planned is None else self.n_planned - len(self.seeds)

    def describe(self) -> str:
        """Return the experiment in a few words."""
        size = f"N = {self.n_robots}"
        return size if self.criterion == SIZE else f"{self.criterion} {self.value:g}, {size}"

    def averaged(self, performance: FloatArray) -> "RunCurves":
        """Return the experiment with another performance, (..., T), and the mean over runs of all other curves."""
        means: dict[str, FloatArray] = {name: curve.mean(axis=0) for name, curve in self.curves.items()}
        return replace(self, curves=means | {"performance": performance})

    def at_seeds(self, seeds: Sequence[int]) -> "RunCurves":
        """Return the same experiment with some of its runs only."""
        places = [self.seeds.index(seed) for seed in seeds]
        return replace(self, seeds=tuple(seeds), curves={name: curve[places] for name, curve in self.curves.items()})


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyCurves:
    """All experiments of one policy, on one clock."""

    controller: str
    experiments: tuple[RunCurves, ...]
    t_end_s: FloatArray | None
    """Ends of the intervals, (T,); None if the table has no such column."""
    amount: str = "objects"
    """What there is so and so much of in a performance."""
    is_total: bool = True
    """Whether performance is a total over its interval, like deliveries; else it is a mean, a ratio, a share."""
    adds_up: bool = True
    """Whether a swarm has what its robots have together, so that twice the swarm could have twice of it."""
    reference_value: float = 0.0
    """Value of a criterion at its reference runs; the authors compare population dynamics with the lowest level."""
    where: str = "the table"
    """Name of the table in error messages."""

    @property
    def horizon_s(self) -> float | None:
        """Length of a run in seconds, where known."""
        return None if self.t_end_s is None else float(self.t_end_s[-1])

    def sizes(self) -> tuple[RunCurves, ...]:
        """Return the experiments that vary the swarm size, smallest first."""
        return tuple(sorted((e for e in self.experiments if e.criterion == SIZE), key=lambda e: e.n_robots))

    def levels(self, criterion: str) -> tuple[tuple[RunCurves, RunCurves], ...]:
        """Return (reference, disturbed) for each level of a criterion, by swarm size and value.

        Raises:
            CurveError: levels without a reference run of the same swarm size.
        """
        mine = [e for e in self.experiments if e.criterion == criterion and e.value != self.reference_value]
        return tuple(
            (self._reference(level), level) for level in sorted(mine, key=lambda level: (level.n_robots, level.value))
        )

    def _reference(self, level: RunCurves) -> RunCurves:
        same_size = [e for e in self.experiments if e.n_robots == level.n_robots]
        own = [e for e in same_size if e.criterion == level.criterion and e.value == self.reference_value]
        shared = [e for e in same_size if e.criterion == UNDISTURBED]
        for reference in (*own, *shared):
            return reference
        raise CurveError(
            f"Expected a reference run for {level.describe()} of {self.controller} in {self.where}: the same swarm "
            f"size with criterion {level.criterion} and value {self.reference_value:g}, or with criterion "
            f"{UNDISTURBED}; got neither."
        )


def common_runs(*experiments: RunCurves) -> tuple[RunCurves, ...]:
    """Return the experiments with only those runs whose number all of them have, paired by it."""
    shared = shared_seeds(experiments)
    return tuple(experiment.at_seeds(shared) for experiment in experiments)


def shared_seeds(experiments: Sequence[RunCurves]) -> list[int]:
    """Return the numbers of the runs that all experiments have."""
    first, *others = (experiment.seeds for experiment in experiments)
    return [seed for seed in first if all(seed in seeds for seeds in others)]
