"""Worlds that a training is judged in, where one is not enough: each with a baseline of its own.

Deliveries of eight robots and of five hundred cannot be added up. So in each world the policy is compared with the
baseline: the ratio of both performances. What counts is the mean of the ratios, or the worst of them.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import (
    ConfigError,
    as_tuples,
    check_file_name,
    instance,
    known_keys,
    one_of,
    table,
)
from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.policies.registry import load_policy, policy_class
from swarm_forage_env.runs.run import run_policy
from swarm_forage_env.runs.spec import RunSpec, plan_run
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.config import from_mapping as config_from_mapping
from swarm_forage_env.scenarios.presets import scenario as preset
from swarm_forage_env.training.status import WorldEvaluation
from swarm_forage_env.wrappers.base import WrapperConfig
from swarm_forage_env.wrappers.registry import wrappers_from_mapping

COUNTED = ("collected", "first_picked")
"""Performances by which a training can be followed: arenas for learners count these."""
BEST = "best"
"""As a baseline: the best of the scripted controllers in that world, each with the caches that it is made for."""
ALL_WORLDS = "all"
"""What stands for all worlds together where others have their names."""
CHOSEN_BY: dict[str, Callable[[Sequence[float]], Any]] = {"mean": np.mean, "worst": np.min}
"""Ways to make one number of the ratios of all worlds; the network with the highest is kept."""


@dataclass(frozen=True, kw_only=True, slots=True)
class EvaluationWorld:
    """A fixed world to judge a policy in.

    Raises:
        ConfigError: a name that cannot be, a baseline that is no policy, or a performance that arenas do not count.
    """

    scenario: ScenarioConfig
    wrappers: tuple[WrapperConfig, ...] = ()
    """What disturbs the swarm."""
    name: str = ""
    """Short name for tables; default the scenario's with the number of robots, "warehouse_small_50"."""
    baseline: str = BEST
    """Policy to compare with, or "best"."""

    def __post_init__(self) -> None:
        instance("evaluation.worlds.scenario", self.scenario, ScenarioConfig)
        if not self.name:
            object.__setattr__(self, "name", f"{self.scenario.name}_{self.scenario.robots.n_robots}")
        check_file_name("evaluation.worlds.name", self.name)
        if self.name == ALL_WORLDS:
            raise ConfigError(f"Expected a name for an evaluation world, got {ALL_WORLDS!r}, which means all of them.")
        one_of("performance of a world to evaluate in", self.scenario.performance, COUNTED)
        if self.baseline != BEST:
            try:
                policy_class(self.baseline)
            except ValueError as error:
                raise ConfigError(f"Expected the baseline of {self.name} to be a controller: {error}") from error

    def to_mapping(self) -> dict[str, Any]:
        """Return the world as plain values; `from_mapping` reads them back."""
        return {
            "name": self.name,
            "scenario": dataclasses.asdict(self.scenario),
            "wrappers": {config.name: config.to_mapping() for config in self.wrappers},
            "baseline": self.baseline,
        }

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> "EvaluationWorld":
        """Build a world from nested plain values.

        Raises:
            ConfigError: unknown keys, or values that are refused.
        """
        values = dict(table("a world of evaluation.worlds", mapping))
        known_keys(values, [item.name for item in dataclasses.fields(cls)], prefix="evaluation.worlds.")
        values["scenario"] = scenario_of(values.get("scenario"))
        if "wrappers" in values:
            values["wrappers"] = wrappers_from_mapping(table("evaluation.worlds.wrappers", values["wrappers"]))
        return cls(**values)


def scenario_of(given: Any) -> ScenarioConfig:
    """Return the scenario of a table: complete, or the `preset` it starts from and fields by name.

    Raises:
        ConfigError: no table, or one that describes no scenario.
    """
    fields = dict(table("scenario", given))
    if "preset" in fields:
        return preset(fields.pop("preset"), **tuples(fields))
    return config_from_mapping(ScenarioConfig, fields, where="scenario.")


def tuples(mapping: Mapping[str, Any]) -> dict[str, Any]:
    """Turn lists, the only sequences of TOML and JSON, into the tuples of configurations."""
    return {key: as_tuples(value) for key, value in mapping.items()}


def judged(make_policy: Callable[[], Policy], specs: Sequence[RunSpec]) -> tuple[float, float]:
    """Return performance per 1,000 s and interference of a policy, means over runs."""
    records = [run_policy(make_policy(), spec) for spec in specs]
    performance = np.mean([record.rate_per_1000_s("performance") for record in records])
    return float(performance), float(np.mean([record.interference_fraction.mean() for record in records]))


def judged_baseline(world: EvaluationWorld, specs: Sequence[RunSpec]) -> tuple[str, float]:
    """Return which policy is the baseline of a world, and its performance per 1,000 s.

    Args:
        world: The world.
        specs: The runs in it; a scripted controller has its own caches in them.
    """
    from metrics import PAPER_POLICIES  # late: a user's own metrics.py must not keep a training from running

    found: dict[str, float] = {}
    for name in PAPER_POLICIES if world.baseline == BEST else (world.baseline,):
        planned = [plan_run(spec.scenario, name, wrappers=spec.wrappers, seed=spec.seed) for spec in specs]
        found[name], _ = judged(lambda spec=planned[0]: load_policy(spec.policy, spec.parameters), planned)
    best = max(found, key=lambda name: found[name])
    return best, found[best]


def judged_in_world(
    world: EvaluationWorld, make_policy: Callable[[], Policy], specs: Sequence[RunSpec], baseline: tuple[str, float]
) -> WorldEvaluation:
    """Return how a policy did in a world.

    Args:
        world: The world.
        make_policy: Makes the policy, anew for each run.
        specs: The runs.
        baseline: Name and performance of the baseline, as `judged_baseline` returns them.
    """
    performance, interference = judged(make_policy, specs)
    name, reached = baseline
    return WorldEvaluation(
        world=world.name,
        performance=performance,
        baseline=reached,
        ratio=ratio_to(reached, performance, specs),
        interference_fraction=interference,
        baseline_policy=name,
    )


def ratio_to(baseline: float, performance: float, specs: Sequence[RunSpec]) -> float:
    """Return the ratio of a performance to that of the baseline, both per 1,000 s.

    A baseline that brings nothing home counts as if it had brought one object in all runs together (our choice: there
    is a ratio then, and finding what it does not find is still worth a lot).

    Args:
        baseline: Of the baseline.
        performance: Of the policy.
        specs: The runs of both.
    """
    return performance / max(baseline, 1000.0 / sum(spec.scenario.horizon_s for spec in specs))
