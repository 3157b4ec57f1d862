"""Plan: which runs there are. A list of conditions, each a policy in a world, once per seed.

    plan = Plan.product(policy_specs(["crw", "dpo"]), [World(scenario("warehouse_small"))], seeds=(0, 1, 2))
    table = run_plan(plan)                                   # `runs.runner`
    seeds, curves = table.curves(plan.conditions[0])

It is a list and not only a product: policies may have worlds of their own. Studies, scores, predictions, choices, the
benchmark and the evaluations of a training each write a plan; `runs.runner` makes its runs, and nobody else does.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

from swarm_forage_env._internal.fields import ConfigError, several, whole
from swarm_forage_env.runs.policy_spec import PolicySpec
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.wrappers.world import World


class Condition(NamedTuple):
    """A policy in a world: what is run once per seed."""

    policy: PolicySpec
    world: World

    def describe(self) -> str:
        """Return the condition in a few words."""
        return f"{self.policy.label} in {self.world.name}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """Runs that belong together.

    Raises:
        ConfigError: no conditions or seeds, equal seeds, or conditions that describe no run.
    """

    conditions: tuple[Condition, ...]
    seeds: tuple[int, ...]
    """All conditions share them, so their runs are paired."""

    def __post_init__(self) -> None:
        several("conditions of a plan", self.conditions, "conditions")
        several("seeds", self.seeds, "seeds")
        for seed in self.seeds:
            whole("a seed", seed, at_least=0)
        if len(set(self.seeds)) < len(self.seeds):
            raise ConfigError(f"Expected different seeds, got {', '.join(map(str, self.seeds))}.")
        _ = self._firsts  # refuses what runs refuse

    def __getstate__(self) -> dict[str, Any]:
        """Return what copies and pickles have; the runs by `id` are no others' than this plan's."""
        return {"conditions": self.conditions, "seeds": self.seeds}

    @classmethod
    def product(cls, policies: Iterable[PolicySpec], worlds: Sequence[World], seeds: Sequence[int]) -> "Plan":
        """Return the plan in which every policy runs in every world, policy by policy."""
        return cls(
            conditions=tuple(Condition(policy, world) for policy in policies for world in worlds), seeds=tuple(seeds)
        )

    @property
    def policies(self) -> tuple[PolicySpec, ...]:
        """Each policy once, in the order of the conditions."""
        return tuple({condition.policy.label: condition.policy for condition in self.conditions}.values())

    def of_policy(self, label: str) -> tuple[Condition, ...]:
        """Return the conditions of a policy."""
        return tuple(condition for condition in self.conditions if condition.policy.label == label)

    def specs_of(self, condition: Condition) -> tuple[RunSpec, ...]:
        """Return the runs of a condition, one per seed."""
        first = self._firsts.get(id(condition)) or self._first_of(condition, condition.world)
        return tuple(replace(first, seed=seed) for seed in self.seeds)

    def _first_of(self, condition: Condition, world: World) -> RunSpec:
        """The run of a condition with the first seed, in its world with the caches of its policy."""
        policy = condition.policy
        return RunSpec(
            world=world.with_caches(policy.caches),
            policy=policy.policy,
            parameters=policy.parameters,
            seed=self.seeds[0],
        )

    @cached_property
    def _firsts(self) -> dict[int, RunSpec]:
        """The run of each condition with the first seed, by `id`: configurations of users may have no hash."""
        worlds: dict[tuple[int, str | None], World] = {}  # policies share them, and each costs many checks
        found: dict[int, RunSpec] = {}
        for condition in self.conditions:
            policy, world = condition
            asked = (id(world), policy.caches)
            if asked not in worlds:
                worlds[asked] = world.with_caches(policy.caches)
            found[id(condition)] = self._first_of(condition, worlds[asked])
        return found

    @property
    def specs(self) -> tuple[RunSpec, ...]:
        """All runs, condition by condition and seed by seed."""
        return tuple(spec for condition in self.conditions for spec in self.specs_of(condition))

    @property
    def robot_ticks(self) -> int:
        """Robots times ticks of all runs."""
        return sum(self._firsts[id(condition)].robot_ticks for condition in self.conditions) * len(self.seeds)
