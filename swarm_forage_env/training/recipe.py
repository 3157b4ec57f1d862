"""The recipe by which `swarm-forage train` makes its plans: defaults that were seen to learn, for Python, too.

Deliveries are too rare to learn from them alone. Where they count, the recipe also rewards first pick-ups and the way
home, and begins in a smaller arena.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.interface import GivenInterface, InterfaceConfig, chosen_interface
from swarm_forage_env.scenarios.config import ScenarioConfig, with_overrides
from swarm_forage_env.scenarios.presets import chosen_scenario
from swarm_forage_env.scenarios.units import CELLS_PER_M
from swarm_forage_env.training.defaults import (
    DECISION_TICKS,
    DEFAULT_ARENAS,
    DEFAULT_HIDDEN,
    DEFAULT_REWARDS,
    DEFAULT_STEPS,
    EPISODE_S,
)
from swarm_forage_env.training.plan import EvaluationPlan, Stage, TrainingPlan
from swarm_forage_env.wrappers.base import WrapperConfig
from swarm_forage_env.wrappers.registry import wrapper_configs

DEFAULT_OPTIONS: dict[str, dict[str, Any]] = {
    "ppo": {
        "n_steps": 128,
        "batch_size": 3200,
        "n_epochs": 4,
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
SMALL_START = 0.4
"""Share of its size that an arena has in a small start; our choice."""


def recipe(
    scenario: str | ScenarioConfig = "warehouse_small",
    *,
    algorithm: str = "ppo",
    steps: int = DEFAULT_STEPS,
    n_arenas: int = DEFAULT_ARENAS,
    interface: GivenInterface = None,
    wrappers: Iterable[WrapperConfig | str] = (),
    hidden: tuple[int, ...] = DEFAULT_HIDDEN,
    options: Mapping[str, Any] | None = None,
    small_start: bool | None = None,
    evaluation: EvaluationPlan | None = None,
    seed: int = 0,
    **overrides: Any,
) -> TrainingPlan:
    """Return the plan of a training in a scenario.

    Args:
        scenario: Name of a preset, which gets the recipe's length of episodes (`EPISODE_S`) and, where deliveries
            count, its rewards (`DEFAULT_REWARDS`); or a complete configuration, which is taken as it is.
        algorithm: One of `plan.ALGORITHMS`.
        steps: Decisions of single robots in all stages.
        n_arenas: Arenas side by side.
        interface: What a learner sees and does: an `InterfaceConfig`, or fields by name that differ from the
            recipe's (compact observations, discrete actions or for sac continuous ones, an automatic gripper,
            `DECISION_TICKS`).
        wrappers: What disturbs the swarm, in training and in evaluations: configurations, or words as on the command
            line ("population:death_per_tick=0.01").
        hidden: Sizes of the hidden layers.
        options: Arguments of the algorithm that differ from `DEFAULT_OPTIONS`.
        small_start: Spend the first third of the steps in a smaller arena; default where deliveries count.
        evaluation: How the policy is judged meanwhile; default `EvaluationPlan()`.
        seed: Seed of everything.
        overrides: Scenario fields by name; they go before the recipe's (`nest_progress=0.1`, `horizon_s=500.0`).

    Raises:
        ConfigError: an unknown name or field, values that are refused by what they are for (see `TrainingPlan`), or
            a smaller arena that cannot be.
    """
    config = _training_scenario(scenario, overrides)
    counts_deliveries = config.performance == "collected"
    return TrainingPlan(
        scenario=config,
        wrappers=wrapper_configs(wrappers),
        algorithm=algorithm,
        interface=chosen_interface(interface, _default_interface(algorithm)).for_scenario(config),
        n_arenas=n_arenas,
        hidden=hidden,
        options=_algorithm_options(algorithm, n_arenas * config.robots.n_robots, options or {}),
        stages=_stages(config, steps, small_start=counts_deliveries if small_start is None else small_start),
        evaluation=evaluation or EvaluationPlan(),
        seed=seed,
    )


def _training_scenario(given: str | ScenarioConfig, overrides: Mapping[str, Any]) -> ScenarioConfig:
    if isinstance(given, ScenarioConfig):
        return with_overrides(given, **overrides)
    fields = {"horizon_s": EPISODE_S, **overrides}
    config = chosen_scenario(given, fields)
    if config.performance != "collected" or "reward" in overrides:
        return config
    return chosen_scenario(given, {**DEFAULT_REWARDS, **fields})


def _default_interface(algorithm: str) -> InterfaceConfig:
    return InterfaceConfig(
        observation="compact",
        actions="continuous" if algorithm == "sac" else "discrete",
        automatic_gripper=True,
        decision_ticks=DECISION_TICKS,
    )


def _algorithm_options(algorithm: str, n_rows: int, given: Mapping[str, Any]) -> dict[str, Any]:
    chosen = {**DEFAULT_OPTIONS.get(algorithm, {}), **given}
    n_steps = chosen.get("n_steps")
    if algorithm == "ppo" and "batch_size" not in given and isinstance(n_steps, int):
        chosen["batch_size"] = _fitting_batch(n_steps * n_rows, DEFAULT_OPTIONS["ppo"]["batch_size"])
    return chosen


def _fitting_batch(n_samples: int, most: int) -> int:
    """Return the largest size from `most` down to half of it that divides `n_samples`, else `most`; or all of few."""
    if 1 < n_samples <= most:
        return n_samples
    return next((size for size in range(most, most // 2, -1) if n_samples % size == 0), most)


def _stages(scenario: ScenarioConfig, steps: int, *, small_start: bool) -> tuple[Stage, ...]:
    if not small_start:
        return (Stage(steps=steps),)
    small = small_arena(scenario)
    try:
        with_overrides(scenario, **small)
    except ConfigError as error:
        raise ConfigError(
            f"Cannot begin in a smaller arena (small_start) of {small['width_m']} x {small['height_m']} m: {error} "
            "Or train in the whole arena from the beginning: small_start=False (--no-small-start)."
        ) from error
    return Stage(steps=max(1, steps // 3), scenario=small), Stage(steps=steps - steps // 3)


def small_arena(scenario: ScenarioConfig) -> dict[str, Any]:
    """Return fields that shrink the arena to SMALL_START of its size with the nest in proportion.

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
    }
