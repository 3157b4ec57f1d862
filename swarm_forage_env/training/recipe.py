"""The recipe by which `swarm-forage train` makes its plans: defaults that were seen to learn, for Python, too.

Deliveries are too rare to learn from them alone. Where they count, the recipe also rewards first pick-ups and the way
home, makes it cost a little to be in the way of others, and begins in a smaller arena. The last third of a training
learns more slowly. `recipes.toml` holds what was measured to suit single scenarios better.
"""

import dataclasses
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from swarm_forage_env._internal.fields import ConfigError, known_keys, table, whole
from swarm_forage_env.policies.interface import GivenInterface, InterfaceConfig, chosen_interface
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELLS_PER_M
from swarm_forage_env.scenarios.obstacles import stretched
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.scenarios.presets import chosen_scenario
from swarm_forage_env.training.defaults import (
    DECISION_TICKS,
    DEFAULT_ACTIVATION,
    DEFAULT_ARENAS,
    DEFAULT_HIDDEN,
    DEFAULT_REWARDS,
    DEFAULT_ROBOTS,
    DEFAULT_STEPS,
    EPISODE_S,
    EVALUATE_EVERY,
    EVALUATION_SHARE,
    FRAME_DECISIONS,
    JAMMING_S,
)
from swarm_forage_env.training.evaluation_plan import EvaluationPlan, EvaluationWorld
from swarm_forage_env.training.plan import LEARNING, SAMPLING, Stage, TrainingPlan
from swarm_forage_env.views.plans import DEFAULT_SCENARIO
from swarm_forage_env.views.sampler import ScenarioSampler
from swarm_forage_env.wrappers.base import WrapperConfig
from swarm_forage_env.wrappers.registry import wrapper_configs
from swarm_forage_env.wrappers.world import World

DEFAULT_OPTIONS: dict[str, dict[str, Any]] = {
    "ppo": {
        "n_steps": 128,
        "batch_size": 3200,
        "n_epochs": 3,
        "gamma": 0.99,
        "gae_lambda": 0.98,
        "learning_rate": 0.001,
        "ent_coef": 0.003,
    },
    "a2c": {"n_steps": 32, "gamma": 0.99},
    "dqn": {"buffer_size": 1_000_000, "learning_starts": 50_000, "batch_size": 1024, "train_freq": 4},
    "sac": {"buffer_size": 1_000_000, "learning_starts": 50_000, "batch_size": 1024},
}
"""Arguments that suit hundreds of robots at once; our choice, the rest is the library's."""
LATE_OPTIONS: dict[str, dict[str, Any]] = {"ppo": {"learning_rate": 0.0003, "gamma": 0.995}}
"""Arguments of an algorithm in the last third of a training: smaller steps, further ahead; our choice."""
SMALL_START = 0.4
"""Share of its size that an arena has in a small start; our choice."""


def recipe(
    scenario: str | ScenarioConfig | None = None,
    *,
    sampler: ScenarioSampler | None = None,
    algorithm: str = "ppo",
    steps: int = DEFAULT_STEPS,
    n_arenas: int | None = None,
    interface: GivenInterface = None,
    wrappers: Iterable[WrapperConfig | str] = (),
    hidden: tuple[int, ...] = DEFAULT_HIDDEN,
    activation: str = DEFAULT_ACTIVATION,
    options: Mapping[str, Any] | None = None,
    small_start: bool | None = None,
    evaluation: EvaluationPlan | Mapping[str, Any] | None = None,
    seed: int = 0,
    samples: bool | None = None,
    **overrides: Any,
) -> TrainingPlan:
    """Return the plan of a training in a scenario, or in many.

    Args:
        scenario: Name of a preset (default warehouse_small), which gets the recipe's length of episodes (`EPISODE_S`,
            or that of its runs or of a third of the training if these are shorter), where deliveries count its rewards
            (`DEFAULT_REWARDS`), and what `recipes.toml` says; or a complete configuration, which is taken as it is.
        sampler: Draws the world of each episode, instead of `scenario`, `wrappers`, `small_start` and `overrides`; its
            worlds are taken as they are, with their rewards and horizons. Evaluations take place in the largest world
            of each name that it draws, unless `evaluation` has worlds.
        algorithm: One of `plan.ALGORITHMS`.
        steps: Decisions of single robots in all stages, 1 or more. There is a single stage where a third of them is
            less than a rollout (of ppo and a2c), unless `small_start` is asked for.
        n_arenas: Arenas side by side; default `DEFAULT_ARENAS`, fewer of swarms that make more than `DEFAULT_ROBOTS`
            in all.
        interface: What a learner sees and does: an `InterfaceConfig`, or fields by name that differ from the
            recipe's (compact observations, discrete actions or for sac continuous ones, an automatic gripper,
            `DECISION_TICKS`, site memory, `FRAME_DECISIONS` unless robots send messages).
        wrappers: What disturbs the swarm, in training and in evaluations: configurations, or words as on the command
            line ("population:death_per_tick=0.01").
        hidden: Sizes of the hidden layers.
        activation: What hidden layers do to their sums, see `TrainingPlan.activation`.
        options: Arguments of the algorithm that differ from `DEFAULT_OPTIONS` and, to the end, from `LATE_OPTIONS`.
        small_start: Spend the first third of the steps in a smaller arena; default where deliveries count, unless
            `recipes.toml` says otherwise or there are few `steps`.
        evaluation: How the policy is judged meanwhile: an `EvaluationPlan`, or fields by name that differ from the
            recipe's (whole runs, as often as `EVALUATE_EVERY` and `EVALUATION_SHARE` allow).
        seed: Seed of everything.
        samples: Whether the trained policy draws its actions, see `TrainingPlan.samples`; default where it
            has probabilities: discrete actions of ppo and a2c.
        overrides: Scenario fields by name; they go before the recipe's (`nest_progress=0.1`). `horizon_s` is the length
            of the episodes; evaluations last as long as the scenario.

    Raises:
        ConfigError: an unknown name or field, values that are refused by what they are for (see `TrainingPlan`), or
            a smaller arena that cannot be.
    """
    whole("steps", steps, at_least=1)
    if sampler is not None:
        refused = {"scenario": scenario, "wrappers": tuple(wrappers), "small_start": small_start, **overrides}
        given = [name for name, value in refused.items() if value not in (None, ())]
        if given:
            raise ConfigError(f"Expected either a sampler or {', '.join(given)}, which it decides; got both.")
        scenario = sampler.largest
    scenario = scenario or DEFAULT_SCENARIO
    measured = Measured() if isinstance(scenario, ScenarioConfig) else measured_recipe(scenario)
    fields = {name: value for name, value in overrides.items() if name != "horizon_s"}
    config = _training_scenario(scenario, fields, measured)
    chosen = chosen_interface(interface, _default_interface(algorithm, config))
    n_arenas = _default_arenas(config, sampler) if n_arenas is None else n_arenas
    n_rows = n_arenas * config.robots.n_robots
    episodes: dict[str, Any] = {}
    if not isinstance(scenario, ScenarioConfig):
        episodes = {"horizon_s": _episode_s(config, steps // 3 / n_rows * chosen.decision_ticks * config.dt_s)}
    episodes |= {name: value for name, value in overrides.items() if name not in fields}
    with_overrides(config, **episodes)  # refuses an impossible length
    chosen_options = _algorithm_options(algorithm, n_rows, {**measured.options.get(algorithm, {}), **(options or {})})
    shortest = 1 if small_start else n_rows * _rollout_steps(algorithm, chosen_options)
    if small_start is None:
        small_start = config.performance == "collected" and sampler is None and measured.small_start
    late = _late_options(algorithm, options or {})
    return TrainingPlan(
        world=World(config, wrapper_configs(wrappers)),
        algorithm=algorithm,
        interface=chosen,
        n_arenas=n_arenas,
        hidden=hidden,
        activation=activation,
        options=chosen_options,
        stages=_stages(config, steps, episodes, late=late, small_start=small_start, shortest=shortest),
        evaluation=_evaluation(evaluation, config, chosen.decision_ticks, sampler),
        seed=seed,
        samples=_can_draw(algorithm, chosen) if samples is None else samples,
        sampler=sampler,
    )


def _default_arenas(scenario: ScenarioConfig, sampler: ScenarioSampler | None) -> int:
    """Return how many arenas are side by side; a sampler needs many, so that every batch holds all kinds of worlds."""
    if sampler is not None:
        return DEFAULT_ARENAS
    return min(DEFAULT_ARENAS, max(1, DEFAULT_ROBOTS // scenario.robots.n_robots))


def _late_options(algorithm: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return `LATE_OPTIONS` but for those that are given, which hold to the end."""
    return {name: value for name, value in LATE_OPTIONS.get(algorithm, {}).items() if name not in given}


def _can_draw(algorithm: str, interface: InterfaceConfig) -> bool:
    """Return whether a policy has probabilities to draw its actions by, so that it needs no temperature."""
    return algorithm in SAMPLING and interface.actions == "discrete"


@dataclass(frozen=True, kw_only=True, slots=True)
class Measured:
    """What was measured to suit a scenario better than the general recipe; see `recipes.toml`."""

    rewards: Mapping[str, float] = field(default_factory=dict, hash=False)
    """Fields of `RewardConfig` by name."""
    options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict, hash=False)
    """Arguments by algorithm."""
    small_start: bool = True
    """Whether a training begins in a smaller arena where deliveries count."""


@cache
def _measured_recipes() -> dict[str, Measured]:
    tables = tomllib.loads((Path(__file__).parent / "recipes.toml").read_text(encoding="utf-8"))
    return {name: Measured(**values) for name, values in tables.items()}


def measured_recipe(name: str) -> Measured:
    """Return what `recipes.toml` says about a preset; for others, what the general recipe says."""
    return _measured_recipes().get(name, Measured())


def _training_scenario(given: str | ScenarioConfig, overrides: Mapping[str, Any], measured: Measured) -> ScenarioConfig:
    config = chosen_scenario(given, overrides)
    if isinstance(given, ScenarioConfig) or "reward" in overrides:
        return config
    general = DEFAULT_REWARDS if config.performance == "collected" else {}
    return chosen_scenario(given, {**general, **measured.rewards, **overrides})


def _evaluation(
    given: EvaluationPlan | Mapping[str, Any] | None,
    scenario: ScenarioConfig,
    decision_ticks: int,
    sampler: ScenarioSampler | None,
) -> EvaluationPlan:
    if isinstance(given, EvaluationPlan):
        return given
    fields = dict(table("evaluation", given or {}))
    known_keys(fields, [item.name for item in dataclasses.fields(EvaluationPlan)], prefix="evaluation.")
    if sampler is not None:
        fields.setdefault("worlds", _largest_worlds(sampler))
    plan = EvaluationPlan(**fields)
    if "every_steps" in fields:
        return plan
    robot_ticks = plan.runs(plan.worlds or (World(scenario),), LEARNING).robot_ticks
    return dataclasses.replace(
        plan, every_steps=max(EVALUATE_EVERY, round(robot_ticks / decision_ticks / EVALUATION_SHARE))
    )


def _largest_worlds(sampler: ScenarioSampler) -> tuple[EvaluationWorld, ...]:
    """Return the world with the most robots of each name that a sampler draws, undisturbed."""
    largest: dict[str, ScenarioConfig] = {}
    for config in sorted(sampler.ends, key=lambda config: config.robots.n_robots):
        largest[config.name] = config
    return tuple(EvaluationWorld(scenario=config) for config in largest.values())


def _default_interface(algorithm: str, scenario: ScenarioConfig) -> InterfaceConfig:
    """Return the recipe's interface, without frames where these would not turn all that tells of directions."""
    robots = scenario.robots
    return InterfaceConfig(
        observation="compact",
        actions="continuous" if algorithm == "sac" else "discrete",
        automatic_gripper=True,
        decision_ticks=DECISION_TICKS,
        site_memory=True,
        frame_decisions=0 if robots.message_size else FRAME_DECISIONS,
    )


def _algorithm_options(algorithm: str, n_rows: int, given: Mapping[str, Any]) -> dict[str, Any]:
    chosen = {**DEFAULT_OPTIONS.get(algorithm, {}), **given}
    n_steps = chosen.get("n_steps")
    if algorithm == "ppo" and "batch_size" not in given and isinstance(n_steps, int):
        chosen["batch_size"] = _fitting_batch(n_steps * n_rows, DEFAULT_OPTIONS["ppo"]["batch_size"])
    return chosen


def _episode_s(scenario: ScenarioConfig, third_s: float) -> float:
    """Return how long episodes last, so that one ends in each third of a training; not where thirds show no jam."""
    ending_s = third_s // scenario.interval_s * scenario.interval_s
    return min(EPISODE_S, scenario.horizon_s, ending_s if ending_s >= JAMMING_S else EPISODE_S)


def _rollout_steps(algorithm: str, options: Mapping[str, Any]) -> int:
    """Return how many decisions of each robot come before one update; of algorithms without rollouts one."""
    n_steps = options.get("n_steps", 1)
    return n_steps if algorithm in SAMPLING and isinstance(n_steps, int) else 1


def _fitting_batch(n_samples: int, most: int) -> int:
    """Return the largest size from `most` down to half of it that divides `n_samples`, else `most`; or all of few."""
    if 1 < n_samples <= most:
        return n_samples
    return next((size for size in range(most, most // 2, -1) if n_samples % size == 0), most)


def _stages(
    scenario: ScenarioConfig,
    steps: int,
    episodes: Mapping[str, Any],
    *,
    late: Mapping[str, Any],
    small_start: bool,
    shortest: int,
) -> tuple[Stage, ...]:
    """Return a third of the steps in a smaller arena if asked for, and a third with the `late` options if any.

    Where a third is below the `shortest` stage, all steps are in the middle.
    """
    third = steps // 3
    if third < shortest:
        return (Stage(steps=steps, scenario=episodes),)
    small = {**_fitting_small_arena(scenario), **episodes} if small_start else {}
    middle = Stage(steps=steps - third * (small_start + bool(late)), scenario=episodes)
    first = (Stage(steps=third, scenario=small),) if small_start else ()
    last = (Stage(steps=third, scenario=episodes, options=late),) if late else ()
    return (*first, middle, *last)


def _fitting_small_arena(scenario: ScenarioConfig) -> dict[str, Any]:
    """Return `small_arena`; raises ConfigError where there cannot be one."""
    if scenario.objects.object_positions_m:
        raise ConfigError(
            "Expected no object_positions_m where a training begins in a smaller arena (small_start), which may not "
            "hold these places; train in the whole arena from the start: small_start=False (--set small_start=false)."
        )
    small = small_arena(scenario)
    try:
        with_overrides(scenario, **small)
    except ConfigError as error:
        raise ConfigError(
            f"Cannot begin in a smaller arena (small_start) of {small['width_m']} x {small['height_m']} m: {error} "
            "Or train in the whole arena from the beginning: small_start=False (--set small_start=false)."
        ) from error
    return small


def small_arena(scenario: ScenarioConfig) -> dict[str, Any]:
    """Return fields that shrink the arena to SMALL_START of its size with nest and obstacles in proportion.

    Only along x for a single and a dual source, which lie beside the nest: the other axis is no way home.
    """
    arena = scenario.arena
    is_beside = scenario.objects.placement in ("single_source", "dual_source")
    shares = (SMALL_START, 1.0 if is_beside else SMALL_START)
    width_m, height_m = (
        round(extent * share * CELLS_PER_M) / CELLS_PER_M
        for extent, share in zip((arena.width_m, arena.height_m), shares, strict=True)
    )
    (centre_x, centre_y), (size_x, size_y) = arena.nest_centre_m, arena.nest_size_m
    return {
        "width_m": width_m,
        "height_m": height_m,
        "nest_centre_m": (centre_x * shares[0], centre_y * shares[1]),
        "nest_size_m": (size_x * shares[0], size_y * shares[1]),
        **{
            name: stretched(boxes, shares, (width_m, height_m))
            for name in ("further_nests", "obstacles")
            if (boxes := getattr(arena, name))
        },
    }
